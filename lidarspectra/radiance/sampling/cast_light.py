"""Light straight from lamps, and reflected once by matt surfaces, by ray casting instead of by the engine.

Neither needs more than a look at who sees whom, and for that Embree takes a fifteenth of the engine's time. Lamps
whose radiance L/Φ has a formula or a table are cast (`scene.shining`); scenes with flat mirrors or panes of glass are
left to the engine, which adds the lamps' images to its answer.

    direct        E(x) = Σ_rays (L/Φ) cos θ cos θ' V / (d² p)
    flat lamp     rays towards points even over its area A, p = 1/A. Close by, half of the 2N rays are drawn in
                  proportion to the cosine at the place instead, and all are weighed by both densities (balance
                  heuristic): f/(N (p₁ + p₂)), p₁ = cos θ/π, p₂ = d²/(A cos θ'), f = (L/Φ) cos θ V
    sphere        directions even over the cone that it fills, of solid angle 2π (1 - √(1 - r²/d²))
    once          S(x) = 1/N Σ ρ(y) E(y) over the first hits y of rays in proportion to the cosine at x
    receptors     of another response R(θ) than cos θ: direct light with the factor R(θ)/cos θ

V is the share that arrives: 0 behind the room's surfaces and other lamps, T of every pane of glass passed.

Radiance itself aims shadow rays at points of a round lamp through maps from the square and the cube (srcsamp.c), whose
density is uneven. A sensor a tenth of a disc's radius below its rim is off by up to 33 % in one process, all its
batches alike; a sphere two radii away sends up to 2 % too little.

References
----------
Veach E, Guibas L J (1995), Optimally combining sampling techniques for Monte Carlo rendering, SIGGRAPH '95, 419-428.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.surfaces import Circle, Rectangle, Sphere
from lidarspectra.radiance.sampling.arrivals import Surfaces
from lidarspectra.radiance.sampling.receptors import Receptor, cosine_directions, tangents
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors
from lidarspectra.radiance.scene.scene_record import RadianceScene, ScenePass
from lidarspectra.radiance.scene.shining import ShiningSurface

NEAR = 3.0  # [1] of half a flat lamp's length, within which a sensor's rays are drawn in both ways
NEAR_REFLECTED = 1.0  # the same for where its rays arrive
NEAR_RAYS = 64  # of each kind, for a sensor's one sample
MOST_RAYS, SHARED_RAYS = 16, 64  # of one sample to a lamp farther off: the most, and of all lamps together
ROUGH_RAYS = 4  # to a lamp, where its light is wanted roughly
LEAST_DIFFUSE = 0.5  # [1] of the surfaces' area, below which the engine takes all light reflected once
ONE_IN = 4  # rays on surfaces that gleam are followed by the engine
RAYS_AT_ONCE = 100_000  # bounds memory
GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True, kw_only=True, eq=False)
class CastLight:
    """Lamps of a pass, and what their light may meet.

    Parameters
    ----------
    shining : tuple of ShiningSurface
        Of those of the pass's lamps that are cast.
    lamps : tuple of int
        The pass's lamps, in the order of its results.
    surfaces : Surfaces
    reflectance : (material, slot) float
        Diffuse part of the surfaces', in the order of the pass's slots. [0-1]
    flux : (lamp, slot) float
        Spectral flux of the pass's lamps. [any unit]
    lamp_count : int
        Lamps of the scene, in all of its passes: the more, the less each need be known.
    """

    shining: tuple[ShiningSurface, ...]
    lamps: tuple[int, ...]
    surfaces: Surfaces = field(repr=False)
    reflectance: FloatArray = field(repr=False)
    flux: FloatArray = field(repr=False)
    lamp_count: int

    @classmethod
    def of(cls, scene: RadianceScene, scene_pass: ScenePass, surfaces: Mapping[str, Surfaces]) -> "CastLight | None":
        """Of a pass, with the surfaces of every pass by its name; None if none of its lamps can be cast."""
        shining = tuple(each for each in scene.shining if each.lamp in scene_pass.lamps)
        if not shining:
            return None
        of_pass = surfaces[scene_pass.name]
        reflectance = of_pass.scattering.diffuse_part
        if reflectance.shape[1] == scene_pass.slot_count:  # else nothing is matt
            reflectance = scene_pass.group.from_engine(reflectance)
        return cls(
            shining=shining,
            lamps=scene_pass.lamps,
            surfaces=of_pass,
            reflectance=reflectance,
            flux=scene.written_flux[np.ix_(scene_pass.lamps, scene_pass.slots)],
            lamp_count=len(scene.lamp_names),
        )

    @property
    def rows(self) -> IntArray:
        """(cast,) which of the pass's lamps are cast."""
        cast = {each.lamp for each in self.shining}
        return np.array([row for row, lamp in enumerate(self.lamps) if lamp in cast], dtype=np.int64)

    @property
    def has_all_lamps(self) -> bool:
        """Whether every lamp of the pass is cast, so that the engine need not be asked for their direct light."""
        return len(self.rows) == len(self.lamps)

    @property
    def reflects(self) -> bool:
        """Whether most surfaces are matt and opaque, so that light reflected once follows from direct light there."""
        return self.surfaces.diffuse_share >= LEAST_DIFFUSE

    def direct(
        self, sensors: Sensors, points: IntArray, *, sets: int, size: int, generator: np.random.Generator
    ) -> FloatArray:
        """(set, cast, point) estimates of the light straight from the cast lamps, per unit of their flux [m⁻²].

        Parameters
        ----------
        sensors : Sensors
        points : (point,) int
            Which of them.
        sets : int
            Independent estimates of each.
        size : int
            Samples of each.
        generator : numpy.random.Generator
        """
        rays = size * max(1, min(MOST_RAYS, SHARED_RAYS // self.lamp_count))
        chunk = max(1, RAYS_AT_ONCE // (sets * rays))
        found = np.zeros((sets, len(self.lamps), len(points)))
        for first in range(0, len(points), chunk):
            part = points[first : first + chunk]
            places, normals = np.tile(sensors.positions[part], (sets, 1)), np.tile(sensors.normals[part], (sets, 1))
            for each in self.shining:
                light = self._direct(
                    each, places, normals, rays=rays, near_rays=NEAR_RAYS * size, generator=generator,
                    receptor=sensors.receptor,
                )  # fmt: skip
                found[:, self.lamps.index(each.lamp), first : first + chunk] += light.reshape(sets, -1)
        return found[:, self.rows]

    def roughly(self, places: FloatArray, *, generator: np.random.Generator) -> FloatArray:
        """(lamp, place, slot) direct light at places with their normals (place, 6), by few rays, of lamps all cast."""
        found = np.zeros((len(self.lamps), len(places)))
        for each in self.shining:
            found[self.lamps.index(each.lamp)] += self._direct(
                each, places[:, :3], places[:, 3:], rays=ROUGH_RAYS, near_rays=ROUGH_RAYS, generator=generator
            )
        return np.asarray(found[:, :, None] * self.flux[:, None], dtype=np.float64)

    def once(
        self, sensors: Sensors, points: IntArray, *, sets: int, size: int, generator: np.random.Generator
    ) -> "ReflectedOnce":
        """Estimate the light reflected once; as `direct`, for all lamps of the pass, which have to be cast.

        Of a sample, one ray is sent in a direction that the sensor draws for itself, and one from there to each lamp.
        Rays that arrive on what is not matt are left to the engine; of those on a surface that gleams a few, whose
        difference from the surface's diffuse part counts for all.
        """
        found = np.empty((sets, len(self.lamps), len(points), self.flux.shape[1]))
        left, owner, weights = [], [], []
        chunk = max(1, RAYS_AT_ONCE // (sets * size))
        for first in range(0, len(points), chunk):
            part = points[first : first + chunk]
            rays = sensors.draw_rays(part, sets=sets, count=size, generator=generator).reshape(-1, 6)
            irradiance, reflectance, weight = self._arriving(rays, generator=generator)
            shape = (len(part), sets, size)
            light = np.einsum("ptnl,ptns->tlps", irradiance.reshape(*shape, -1), reflectance.reshape(*shape, -1))
            found[:, :, first : first + chunk] = light / size
            where = np.flatnonzero(weight)
            left.append(rays[where])
            weights.append(weight[where] * (sensors.receptor.measure_sr / size))
            owner.append(np.stack([where // size % sets, first + where // (size * sets)], axis=1))
        found *= sensors.receptor.measure_sr / np.pi * self.flux[None, :, None]
        rays = np.concatenate(left)
        return ReflectedOnce(
            estimates=found,
            rays=rays,
            owner=np.concatenate(owner),
            weight=np.concatenate(weights),
            missing=len(rays),
        )

    def _direct(
        self,
        shining: ShiningSurface,
        places: FloatArray,
        normals: FloatArray,
        *,
        rays: int,
        near_rays: int,
        generator: np.random.Generator,
        receptor: Receptor | None = None,
    ) -> FloatArray:
        """(place,) light straight from one surface of a lamp, as a receptor reads it, per unit of its flux [m⁻²]."""
        found = np.zeros(len(places))
        lift = SENSOR_OFFSET_M * normals  # clear of the sensor's own surface
        for where, ways, values in light_samples(
            shining, places, normals, rays=rays, near_rays=near_rays, near=NEAR, generator=generator
        ):
            if receptor is not None and not receptor.is_cosine:
                values[:] *= receptor.over_cosine(np.einsum("prk,pk->pr", _unit(ways)[0], normals[where]))
            lit = np.nonzero(values > 0)
            here = where[lit[0]]
            values[lit] *= self.surfaces.light_through(
                places[here] + lift[here], ways[lit] - lift[here], to_lamp=shining.lamp
            )
            found[where] = values.sum(axis=1)
        return found

    def _arriving(
        self, rays: FloatArray, *, generator: np.random.Generator
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Direct light where rays arrive, as far as it is reflected alike in all directions.

        Parameters
        ----------
        rays : (ray, 6) float
        generator : numpy.random.Generator

        Returns
        -------
        irradiance : (ray, lamp) float
            Over the lamp's flux. [m⁻²]
        reflectance : (ray, slot) float
            [1]
        weight : (ray,) float
            By which the engine's answer for the ray counts, 0 of those that it is not asked for. Where it counts for
            several, the irradiance is less by as many: w (L - D) + D, D being the diffuse part. [1]
        """
        at = self.surfaces.shaded_arrivals(rays)
        dark = self.surfaces.are_dark(at.arrivals)
        material = at.arrivals.material
        has_part = np.asarray((self.reflectance > 0).any(axis=1), dtype=np.bool_)
        gleams = np.asarray(~dark & ~self.surfaces.scattering.is_diffuse[material], dtype=np.bool_)
        weight = np.where(gleams, 1.0, 0.0)
        gleams = np.asarray(gleams & has_part[material], dtype=np.bool_)
        weight[gleams] = ONE_IN * (generator.random(int(gleams.sum())) * ONE_IN < 1.0)
        lit = np.flatnonzero(~dark & has_part[material])
        places, normals = at.arrivals.places[lit], at.shading_normals[lit]
        irradiance = np.zeros((len(rays), len(self.lamps)))
        for shining in self.shining:
            row = self.lamps.index(shining.lamp)
            for where, ways, values in light_samples(
                shining, places, normals, rays=1, near_rays=1, near=NEAR_REFLECTED, generator=generator
            ):
                some = np.nonzero(values > 0)
                here = where[some[0]]
                facets = at.arrivals.normals[lit[here]]
                above = np.sign(np.einsum("ij,ij->i", ways[some], facets))[:, None]  # a way may dip below its facet
                lift = SENSOR_OFFSET_M * above * facets
                values[some] *= self.surfaces.light_through(
                    places[here] + lift, ways[some] - lift, to_lamp=shining.lamp
                )
                irradiance[lit[where], row] += values.sum(axis=1)
        reflectance = np.zeros((len(rays), self.reflectance.shape[1]))
        reflectance[lit] = self.reflectance[material[lit]]
        irradiance[gleams] *= 1.0 - weight[gleams, np.newaxis]
        return irradiance, reflectance, weight


@dataclass(kw_only=True, eq=False)
class ReflectedOnce:
    """Light reflected once, and the rays that the engine has to follow for the rest of it.

    Parameters
    ----------
    estimates : (set, lamp, point, slot) float
        So far. [unit of the flux, per m²]
    rays : (ray, 6) float
        That arrive on what is not matt.
    owner : (ray, 2) int
        Set and point of each.
    weight : (ray,) float
        By which a ray's radiance counts. [sr]
    missing : int
        Rays without an answer so far.
    """

    estimates: FloatArray = field(repr=False)
    rays: FloatArray = field(repr=False)
    owner: IntArray = field(repr=False)
    weight: FloatArray = field(repr=False)
    missing: int

    def take(self, part: slice, radiance: FloatArray) -> None:
        """Add the engine's (ray, lamp, slot) radiance along some of the rays."""
        weighed = self.weight[part, np.newaxis, np.newaxis] * radiance
        for (number, point), light in zip(self.owner[part].tolist(), weighed, strict=True):
            self.estimates[number, :, point] += light
        self.missing -= len(radiance)


def light_samples(
    shining: ShiningSurface,
    places: FloatArray,
    normals: FloatArray,
    *,
    rays: int,
    near_rays: int,
    near: float,
    generator: np.random.Generator,
) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
    """Ways to a lamp's surface, and what each adds if nothing stands in it.

    Parameters
    ----------
    shining : ShiningSurface
    places, normals : (place, 3) float
        [m, 1]
    rays, near_rays : int
        From each place; of each kind from those that are near.
    near : float
        Distance of those, over half the surface's length. [1]
    generator : numpy.random.Generator

    Yields
    ------
    where : (some,) int
        Which of the places.
    ways : (some, ray, 3) float
        [m]
    values : (some, ray) float
        [m⁻²]
    """
    surface = shining.surface
    if isinstance(surface, Sphere):
        outside = np.flatnonzero(np.linalg.norm(places - surface.center, axis=1) > surface.radius)
        numbers = _numbers(len(outside), rays, generator)
        yield outside, *_to_sphere(shining, surface, places[outside], normals[outside], numbers)
        return
    half = 0.5 * (surface.diameter if isinstance(surface, Circle) else max(surface.length, surface.width))
    away = places - surface.place.center
    in_front = np.flatnonzero(away @ surface.normal > 0)
    around = (away[in_front] ** 2).sum(axis=1) < ((near + np.sqrt(2.0)) * half) ** 2  # no others can be close
    close = np.zeros(len(places), dtype=np.bool_)
    maybe = in_front[around]
    close[maybe] = surface.distance(places[maybe]) < near * half
    far, by = in_front[~close[in_front]], np.flatnonzero(close)
    yield far, *_to_area(shining, surface, places[far], normals[far], _numbers(len(far), rays, generator))
    at_once = max(1, RAYS_AT_ONCE // (2 * near_rays))
    for first in range(0, len(by), at_once):
        part = by[first : first + at_once]
        numbers = _numbers(len(part), near_rays, generator)
        yield part, *_in_both_ways(shining, surface, places[part], normals[part], numbers)


def _numbers(places: int, count: int, generator: np.random.Generator) -> FloatArray:
    """(place, count, 2) points even over the unit square, shifted by chance for each place."""
    number = np.arange(count)
    even = np.stack([number / count, number * GOLDEN % 1.0], axis=-1)
    return (even + generator.random((places, 1, 2))) % 1.0


def _to_sphere(
    shining: ShiningSurface, sphere: Sphere, origins: FloatArray, normals: FloatArray, numbers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    away = sphere.center - origins
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    away /= distance
    share = (sphere.radius / distance) ** 2
    cap = share / (1.0 + np.sqrt(np.maximum(1.0 - share, 0.0)))  # 1 - cos of the cone's half angle, without cancelling
    fall = numbers[..., 0] * cap
    sine, turn = np.sqrt(fall * (2.0 - fall)), 2.0 * np.pi * numbers[..., 1]
    across = tangents(away)
    directions = (
        (sine * np.cos(turn))[..., None] * across[:, None, 0]
        + (sine * np.sin(turn))[..., None] * across[:, None, 1]
        + (1.0 - fall)[..., None] * away[:, None]
    )
    inside = np.maximum(sphere.radius**2 - (distance * sine) ** 2, 0.0)
    ways = (distance * (1.0 - fall) - np.sqrt(inside))[..., None] * directions
    received = np.maximum(np.einsum("prk,pk->pr", directions, normals), 0.0)
    radiance = shining.radiance(-directions, np.ones(directions.shape[:-1]))
    return ways, 2.0 * np.pi * cap / numbers.shape[1] * radiance * received


def _to_area(
    shining: ShiningSurface,
    surface: Rectangle | Circle,
    origins: FloatArray,
    normals: FloatArray,
    numbers: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    ways = _points_on(surface, numbers) - origins[:, None]
    unit, distance = _unit(ways)
    sent = -unit @ surface.normal
    received = np.maximum(np.einsum("prk,pk->pr", unit, normals), 0.0)
    share = surface.area * np.maximum(sent, 0.0) / (distance**2 * numbers.shape[1])
    return ways, shining.radiance(-unit, sent) * received * share


def _in_both_ways(
    shining: ShiningSurface,
    surface: Rectangle | Circle,
    origins: FloatArray,
    normals: FloatArray,
    numbers: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """As `_to_area`, of rays by the cosine at the place followed by as many to the lamp's area."""
    count = numbers.shape[1]
    directions = cosine_directions(normals[:, None], numbers)
    facing = -directions @ surface.normal
    height = ((origins - surface.place.center) @ surface.normal)[:, None]
    reach = np.where(facing > 0, height / np.where(facing > 0, facing, 1.0), 0.0)
    by_cosine = reach[..., None] * directions
    met = (facing > 0) & (reach > 0) & surface.holds(origins[:, None] + by_cosine)
    ways = np.concatenate([by_cosine, _points_on(surface, numbers) - origins[:, None]], axis=1)
    unit, distance = _unit(ways)
    sent = -unit @ surface.normal
    received = np.einsum("prk,pk->pr", unit, normals)
    counts = (sent > 0) & (received > 0) & np.concatenate([met, np.ones_like(met)], axis=1)
    sent, received = np.where(counts, sent, 1.0), np.where(counts, received, 1.0)
    density = received / np.pi + distance**2 / (surface.area * sent)
    return ways, np.where(counts, shining.radiance(-unit, sent) * received / (count * density), 0.0)


def _points_on(surface: Rectangle | Circle, numbers: FloatArray) -> FloatArray:
    """(place, ray, 3) points of a surface [m]."""
    points, _ = surface.sample(numbers[..., 0].ravel(), numbers[..., 1].ravel())
    return points.reshape(*numbers.shape[:-1], 3)


def _unit(ways: FloatArray) -> tuple[FloatArray, FloatArray]:
    distance = np.maximum(np.linalg.norm(ways, axis=-1), 1e-12)
    return ways / distance[..., None], distance
