"""Light straight from discs and spheres that a sensor is close to, integrated here instead of by the engine.

Radiance aims shadow rays at points of a round lamp through maps from the square and the cube (srcsamp.c), whose
density is uneven: the weights of `lamp_text` make a disc's right on average over the turns of its square, which is
drawn once a process. A sensor a tenth of the radius below the rim is off by up to 33 % in one process, and all its
batches alike, so that their spread does not tell; two radii away it is .05 %. A sphere's sample points lie in it as in
a cube: 2 % too little at two radii from its middle, in some directions. So for sensors that close the engine's answer
is replaced by

    disc      E = Σ f/(N (p₁ + p₂)),  f = (L/Φ) cos θ V;   half of the 2N rays drawn in proportion to the cosine at the
              sensor, p₁ = cos θ/π, half towards points even over the disc, p₂ = d²/(A cos θ') (balance heuristic)
    sphere    E = Ω/N Σ (L/Φ) cos θ V   over directions even over the cone that it fills, Ω = 2π (1 - √(1 - r²/d²))

V is the share that arrives: 0 behind the room's surfaces, T of every pane of glass passed; other lamps do not stand in
the way. Scenes with flat mirrors or panes of glass are left to the engine, which adds the lamps' images to its answer.

References
----------
Veach E, Guibas L J (1995), Optimally combining sampling techniques for Monte Carlo rendering, SIGGRAPH '95, 419-428.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.radiance.sampling.arrivals import Surfaces
from lidarspectra.radiance.sampling.receptors import cosine_directions, tangents
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors
from lidarspectra.radiance.scene.round_lamps import RoundLamp

NEAR_DISC = 3.0  # [radii] from its surface
NEAR_SPHERE = 6.0  # [radii] from its middle
RAYS_PER_SAMPLE = 64  # of each kind, for what is one shadow ray set of the engine's
GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True, kw_only=True, eq=False)
class NearLamps:
    """Pairs of a sensor and a round lamp close to it.

    Parameters
    ----------
    lamps : tuple of RoundLamp
    near : (lamp, point) bool
        Which of the lamps each point is close to.
    sensors : Sensors
    surfaces : Surfaces
        What light may meet on its way.
    flux : (lamp, slot) float
        Spectral flux of these lamps in the pass's slots. [any unit]
    generator : numpy.random.Generator
    """

    lamps: tuple[RoundLamp, ...]
    near: BoolArray
    sensors: Sensors
    surfaces: Surfaces = field(repr=False)
    flux: FloatArray
    generator: np.random.Generator = field(repr=False)

    @classmethod
    def of(
        cls,
        lamps: tuple[RoundLamp, ...],
        sensors: Sensors,
        surfaces: Surfaces,
        flux: FloatArray,
        *,
        generator: np.random.Generator,
    ) -> "NearLamps | None":
        """Find the pairs, of lamps of this flux (lamp, slot); None if there are none."""
        if not lamps:
            return None
        near = np.stack([_is_near(lamp, sensors.positions) for lamp in lamps])
        if not near.any():
            return None
        return cls(lamps=lamps, near=near, sensors=sensors, surfaces=surfaces, flux=flux, generator=generator)

    def estimates(self, points: IntArray, *, sets: int, size: int) -> Iterator[tuple[int, IntArray, FloatArray]]:
        """Light of the lamps that some points are close to.

        Parameters
        ----------
        points : (point,) int
            Of the sensors.
        sets : int
            Independent estimates of each.
        size : int
            Samples of each, in units of the engine's.

        Yields
        ------
        lamp : int
            Index of the scene's lamp.
        where : (close,) int
            Which of the points are close to it.
        light : (set, close, slot) float
            [unit of the flux, per m²]
        """
        count = RAYS_PER_SAMPLE * size
        for lamp, near, flux in zip(self.lamps, self.near, self.flux, strict=True):
            where = np.flatnonzero(near[points])
            if not where.size:
                continue
            normals = self.sensors.normals[points[where]]
            origins = self.sensors.positions[points[where]]
            lift = SENSOR_OFFSET_M * normals  # clear of the sensor's own surface
            found = np.empty((sets, where.size))
            for number in range(sets):
                shift = self.generator.random((where.size, 1, 2))
                numbers = (_lattice(count) + shift) % 1.0
                sample = _sphere if lamp.normal is None else _disc
                ways, values = sample(lamp, origins, normals, numbers)
                arriving = np.zeros_like(values)
                lit = np.nonzero(values > 0)
                arriving[lit] = self.surfaces.light_through((origins + lift)[lit[0]], ways[lit] - lift[lit[0]])
                found[number] = (values * arriving).sum(axis=1)
            yield lamp.lamp, where, found[..., None] * flux


def _is_near(lamp: RoundLamp, positions: FloatArray) -> BoolArray:
    away = positions - lamp.center
    if lamp.normal is None:
        distance = np.linalg.norm(away, axis=1) / lamp.radius_m
        around: BoolArray = (distance > 1.0) & (distance < NEAR_SPHERE)
        return around
    height = away @ lamp.normal
    beside = np.linalg.norm(away - height[:, None] * lamp.normal, axis=1)
    close: BoolArray = np.hypot(height, np.maximum(beside - lamp.radius_m, 0.0)) < NEAR_DISC * lamp.radius_m
    return close


def _lattice(count: int) -> FloatArray:
    """(count, 2) points even over the unit square."""
    number = np.arange(count)
    return np.stack([number / count, number * GOLDEN % 1.0], axis=-1)


def _sphere(
    lamp: RoundLamp, origins: FloatArray, normals: FloatArray, numbers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(point, ray, 3) ways to the lamp's surface [m], and (point, ray) what each adds if nothing stands in it [m⁻²]."""
    away = lamp.center - origins
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    away /= distance
    share = (lamp.radius_m / distance) ** 2
    cap = share / (1.0 + np.sqrt(np.maximum(1.0 - share, 0.0)))  # 1 - cos of the cone's half angle, without cancelling
    fall = numbers[..., 0] * cap
    sine, turn = np.sqrt(fall * (2.0 - fall)), 2.0 * np.pi * numbers[..., 1]
    across = tangents(away)
    directions = (
        (sine * np.cos(turn))[..., None] * across[:, None, 0]
        + (sine * np.sin(turn))[..., None] * across[:, None, 1]
        + (1.0 - fall)[..., None] * away[:, None]
    )
    inside = np.maximum(lamp.radius_m**2 - (distance * sine) ** 2, 0.0)
    ways = (distance * (1.0 - fall) - np.sqrt(inside))[..., None] * directions
    received = np.maximum(np.einsum("prk,pk->pr", directions, normals), 0.0)
    count = numbers.shape[1]
    return ways, 2.0 * np.pi * cap / count * float(lamp.radiance(np.ones(1))[0]) * received


def _disc(
    lamp: RoundLamp, origins: FloatArray, normals: FloatArray, numbers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """As `_sphere`, of rays by the cosine and of as many to the lamp's area."""
    assert lamp.normal is not None
    count = numbers.shape[1]
    directions = cosine_directions(normals[:, None], numbers)
    facing = -directions @ lamp.normal
    height = ((origins - lamp.center) @ lamp.normal)[:, None]
    reach = np.where(facing > 0, height / np.where(facing > 0, facing, 1.0), 0.0)
    by_cosine = reach[..., None] * directions
    off = origins[:, None] + by_cosine - lamp.center
    met = (facing > 0) & (reach > 0) & (np.linalg.norm(off, axis=-1) <= lamp.radius_m)
    along, across = tangents(lamp.normal[None])[0]
    radius, turn = lamp.radius_m * np.sqrt(numbers[..., 0]), 2.0 * np.pi * numbers[..., 1]
    places = (radius * np.cos(turn))[..., None] * along + (radius * np.sin(turn))[..., None] * across
    by_area = lamp.center + places - origins[:, None]
    ways = np.concatenate([by_cosine, by_area], axis=1)
    distance = np.maximum(np.linalg.norm(ways, axis=-1), 1e-12)
    unit = ways / distance[..., None]
    sent = -unit @ lamp.normal
    received = np.einsum("prk,pk->pr", unit, normals)
    counts = (sent > 0) & (received > 0) & np.concatenate([met, np.ones_like(met)], axis=1)
    sent, received = np.where(counts, sent, 1.0), np.where(counts, received, 1.0)
    density = received / np.pi + distance**2 / (lamp.area * sent)
    return ways, np.where(counts, lamp.radiance(sent) * received / (count * density), 0.0)
