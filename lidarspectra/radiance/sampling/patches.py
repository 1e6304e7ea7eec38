"""Patches: where on the room's surfaces sensors may share paths, because the light there is the same for all of them.

Paths are shared by sensors whose rays arrive near one another (`pooling`). Nearness is not sufficient: the two sides of
a wall are near, and so are the bright and the dark side of a door's edge. So before any path is drawn, the surfaces
that the sensors see are divided into boxes; each box gets one place per mutually invisible part of its surfaces; and
the light at these places is estimated roughly, lamp by lamp, by a radiosity solution on the places themselves:

    B = ρ (E_direct + E),   E = W B,   W_pq = share of cosine-distributed rays from place p that arrive at patch q

Rays from all places go in the same directions of a lattice, so that what differs between neighbours is what they see.
Two neighbouring places are alike if the linear function of each (`rough_light`) has every lamp's reflected light E at
the other, to a share that is the larger the more noise is wanted (`MISFITS`). What falls evenly with the distance, as
each lamp's light in a hall, is known by these functions; what jumps, as beside a door, is not. An arrival shares paths
with those on places that are alike, that lie in the same cell of 2 x 2 x 2 boxes, and that see one another; where the
light is uneven, or an arrival does not see its place, each sensor has paths of its own, and is sampled as if alone:
such an estimate is unbiased for any distribution of light.

The rough light determines which sensors share paths, and the light beyond the last reflection traced, which is
reported beside the estimate. Into the estimate it enters as a control variate only (`rough_light`), whose own error
cancels.

References
----------
Goral C M, Torrance K E, Greenberg D P, Battaile B (1984), Modeling the interaction of light between diffuse surfaces,
SIGGRAPH '84, 213-222. Ward G J, Heckbert P S (1992), Irradiance gradients, Eurographics Workshop on Rendering, 85-98
(light that is interpolated over a distance that its own change allows).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, linked
from lidarspectra.radiance.sampling.arrivals import Arrivals, Surfaces
from lidarspectra.radiance.sampling.receptors import cosine_directions, lattice
from lidarspectra.radiance.sampling.rough_light import LinearFit, RoughLight, linear_fit
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors

MISFIT_OVER_TARGET = 17.0  # [1] of the light of the sensors that look there, over the wanted standard error
MISFITS = (0.2, 0.5)  # [1] least and most of it: at 'standard' and 'fine', and at 'draft'
FAINT = 1e-4  # [1] of a lamp's mean light at the sensors: lower limit of the light that misfits are relative to
LIFT_M = 0.02  # [m] off the surface where sight is tested: above the roughness of a scanned wall
LOOKS = 16_000  # sensors' rays that find the places, about: in a hall some thousand places are in sight
LOOKS_PER_SENSOR = (32, 144)  # fewest and most
RAYS_PER_PLACE = 144
DISCOVERY = 8  # every eighth of them is used to find places of the next generation
LAYERS = 3  # parts of a box that do not see one another and get a place each; what is seen by none shares nothing
GENERATIONS = 2  # places seen from the sensors, and from those places
REFLECTIONS = 12  # of the rough light
MAX_RATIO = 0.999  # [1] upper limit of the ratio of successive reflections
UNKNOWN_REFLECTANCE = 0.5  # [1] of glossy surfaces
NORMAL_M = 0.3  # [m] a place whose normal is turned by a radian is as far as one so far away


class RoughReflections(NamedTuple):
    """Light at the places (place, lamp, slot) that was reflected before.

    Attributes
    ----------
    whole : array
        Once or more, up to once less than is traced, and no more than `REFLECTIONS` times.
    before, last : array
        As often as is traced less one, and as often as is traced.
    """

    whole: FloatArray
    before: FloatArray
    last: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Patches:
    """Places on the surfaces that the sensors of a block look at.

    Parameters
    ----------
    surfaces : Surfaces
    key : (place,) int
        Box and kind of surface; ascending.
    positions, normals : (place, 3) float
        [m, 1]
    material : (place,) int
    transfer : (place, place) sparse
        W: share of the rays from a place that arrive at another.
    watchers : (some,) int
        Sensors whose looks found the places.
    looks : (watcher, place) sparse
        Share of their looks that arrive at each place.
    neighbours : (pair, 2) int
        Places of one kind in the same or adjoining boxes that see one another.
    """

    surfaces: Surfaces
    key: IntArray
    positions: FloatArray
    normals: FloatArray
    material: IntArray
    transfer: csr_array
    watchers: IntArray
    looks: csr_array
    neighbours: IntArray

    def __len__(self) -> int:
        return len(self.key)

    @cached_property
    def fit(self) -> LinearFit:
        """Linear functions around each place, of light that is known at the places."""
        return linear_fit(self.positions, self.neighbours, length_m=self.surfaces.cell_m)

    def groups(self, direct: FloatArray, watched: FloatArray, *, target: float) -> IntArray:
        """Find the groups of places on which sensors may share paths.

        Parameters
        ----------
        direct : (lamp, place) float
            Direct light of each lamp at the places, mean over its slots. [any unit]
        watched : (lamp, watcher) float
            The same at the sensors. [same]
        target : float
            Of the standard error: the more noise is wanted, the more may be shared. [1]

        Returns
        -------
        group : (place,) int
            Number of the group that shares paths; -1 where the light is uneven and nobody shares.
        """
        rho = self.reflectance.mean(axis=1)
        light = np.zeros_like(direct)
        for _ in range(REFLECTIONS):
            light = (self.transfer @ (rho * (direct + light)).T).T
        level = self._level(watched + (self.looks @ (rho * (direct + light)).T).T)
        first, second = self.neighbours.T
        there = (
            self.fit.at(light.T, first, self.positions[second]),
            self.fit.at(light.T, second, self.positions[first]),
        )
        missed = np.maximum(np.abs(there[0].T - light[:, second]), np.abs(there[1].T - light[:, first]))
        difference = missed * np.maximum(rho[first], rho[second])
        uneven, most = np.zeros(len(self), dtype=np.bool_), np.clip(MISFIT_OVER_TARGET * target, *MISFITS)
        for end in (first, second):
            uneven[end[(difference > most * level[:, end]).any(axis=0)]] = True
        cells = self.surfaces.box(self.positions) // 2
        together = (cells[first] == cells[second]).all(axis=1) & ~uneven[first] & ~uneven[second]
        return np.where(uneven, -1, linked(self.neighbours[together], len(self)))

    @property
    def reflectance(self) -> FloatArray:
        """(place, slot) in the engine's order of slots, or one for all."""
        scattering = self.surfaces.scattering
        known = np.where(scattering.is_diffuse[:, None], scattering.reflectance, UNKNOWN_REFLECTANCE)
        known[-1] = 0.0  # lamps
        return known[self.material]

    def reflected(self, direct: FloatArray, bounces: int) -> "RoughReflections":
        """Direct light at the places, reflected from place to place: E_k = W ρ E_(k-1).

        Parameters
        ----------
        direct : (place, lamp, slot) float
            In the engine's order of slots. [any unit of irradiance]
        bounces : int
            Largest number of reflections, 1 or more, that on the place itself counted.
        """
        lamps, slots = direct.shape[1:]
        single = np.float32  # precise enough for what is rough, in half the time
        light, transfer = direct.reshape(len(self), lamps * slots).astype(single), self.transfer.astype(single)
        paint = np.tile(np.broadcast_to(self.reflectance, (len(self), slots)), lamps).astype(single)
        whole, before = np.zeros_like(light), light
        for number in range(1, bounces + 1):
            before, light = light, transfer @ (paint * light)
            if number <= min(bounces - 1, REFLECTIONS):
                whole += light
        return RoughReflections(*(part.reshape(direct.shape).astype(np.float64) for part in (whole, before, light)))

    def sent_on(self, reflected: FloatArray) -> RoughLight:
        """Rough radiance of the places, of light that was reflected once or more before it arrived there.

        Parameters
        ----------
        reflected : (place, lamp, slot) float
            Such light, in the engine's order of slots. [any unit of irradiance]

        Returns
        -------
        rough : RoughLight
            Of (lamp x slot) values. [the same over sr]
        """
        _, lamps, slots = reflected.shape
        part = self.surfaces.scattering.diffuse_part[self.material]
        diffuse = np.tile(np.broadcast_to(part, (len(self), slots)), lamps)
        return self.fit.of(diffuse * reflected.reshape(len(self), lamps * slots) / np.pi)

    def truncated(self, reflected: "RoughReflections") -> FloatArray:
        """Each lamp's light at the watchers beyond the last reflection traced.

        Light reflected k times at the sensor is light reflected k - 1 times at the places. Beyond the last one
        traced they are taken for a geometric series of the ratio of the last two, all lamps together.

        Parameters
        ----------
        reflected : RoughReflections

        Returns
        -------
        truncated : (watcher, lamp, slot) float
            [same unit]
        """
        _, lamps, slots = reflected.last.shape
        whole, last = (each.sum(axis=(0, 1)) for each in (reflected.before, reflected.last))
        ratio = np.minimum(last / np.maximum(whole, np.finfo(np.float64).tiny), MAX_RATIO)
        paint = np.broadcast_to(self.reflectance, (len(self), slots))[:, None]
        sent = (paint * reflected.last).reshape(len(self), lamps * slots)
        tail: FloatArray = (self.looks @ sent).reshape(-1, lamps, slots) / (1.0 - ratio)
        return tail

    def nearest_watcher(self, sensors: Sensors) -> IntArray:
        """(point,) row of the watcher that is nearest to each sensor, in place and direction."""
        place = np.concatenate([sensors.positions, NORMAL_M * sensors.normals], axis=1)
        nearest: IntArray = cKDTree(place[self.watchers]).query(place)[1]
        return nearest

    def _level(self, light: FloatArray) -> FloatArray:
        """(lamp, place) light of the sensors (lamp, watcher) that look at each place: their harmonic mean, by looks.

        Where none looks, 0: whatever difference is there counts.
        """
        least = FAINT * light.mean(axis=1, keepdims=True) + 1e-30
        share = np.asarray(self.looks.sum(axis=0)).ravel()
        inverse = (self.looks.T @ (1.0 / np.maximum(light, least)).T).T
        level: FloatArray = share / np.maximum(inverse, 1e-30)
        return level

    def place_of(self, arrivals: Arrivals) -> IntArray:
        """(ray,) the place that stands for where a ray arrived: of its box and kind, and in sight; -1 if none is."""
        return _place_of(self.surfaces, arrivals, self.key, self.positions, self.normals)


def find_patches(surfaces: Surfaces, sensors: Sensors, *, generator: np.random.Generator) -> Patches:
    """Cut what sensors look at into patches, and find how these light one another.

    Parameters
    ----------
    surfaces : Surfaces
    sensors : Sensors
    generator : numpy.random.Generator

    Returns
    -------
    patches : Patches
    """
    count = len(sensors.positions)
    looks = int(np.clip(LOOKS // count, *LOOKS_PER_SENSOR))
    watchers = np.unique(np.linspace(0, count - 1, LOOKS // looks).astype(np.int64))
    rays = sensors.draw_rays(watchers, sets=1, count=looks, generator=generator).reshape(-1, 6)
    looked = surfaces.arrivals(rays)
    places = _Places.of(surfaces, looked)
    for _ in range(GENERATIONS - 1):
        seen = surfaces.arrivals(places.rays()[::DISCOVERY])
        places = _Places.of(surfaces, seen, known=places.arrivals)
    seen = surfaces.arrivals(places.rays())
    return Patches(
        surfaces=surfaces,
        key=places.key,
        positions=places.arrivals.places,
        normals=places.arrivals.normals,
        material=places.arrivals.material,
        transfer=places.transfer(seen, len(places.key)),
        watchers=watchers,
        looks=places.transfer(looked, len(watchers)),
        neighbours=places.neighbours(),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Places:
    """Arrivals that stand for others, in the order of their keys."""

    surfaces: Surfaces
    arrivals: Arrivals
    key: IntArray

    @classmethod
    def of(cls, surfaces: Surfaces, seen: Arrivals, known: Arrivals | None = None) -> "_Places":
        """Known ones, and for every box what no place of it sees."""
        nothing = np.zeros(0, dtype=np.int64)
        places = cls._sorted(surfaces, seen.take(nothing) if known is None else known)
        matt = seen.take(np.flatnonzero(surfaces.can_share(seen)))
        for layer in range(LAYERS):
            matt = matt.take(np.flatnonzero(places.place_of(matt) < 0))
            key, first = np.unique(surfaces.key(matt), return_index=True)
            held = np.searchsorted(places.key, key, side="right") - np.searchsorted(places.key, key, side="left")
            first = first[held <= layer]
            if first.size:
                places = cls._sorted(surfaces, places.arrivals.joined(matt.take(first)))
        return places

    @classmethod
    def _sorted(cls, surfaces: Surfaces, arrivals: Arrivals) -> "_Places":
        key = surfaces.key(arrivals)
        order = np.argsort(key, kind="stable")
        return cls(surfaces=surfaces, arrivals=arrivals.take(order), key=key[order])

    def place_of(self, seen: Arrivals) -> IntArray:
        """(ray,) as `Patches.place_of`."""
        return _place_of(self.surfaces, seen, self.key, self.arrivals.places, self.arrivals.normals)

    def rays(self) -> FloatArray:
        """(place x ray, 6) of every place, in proportion to the cosine, in the same directions of one lattice."""
        numbers = np.broadcast_to(lattice(RAYS_PER_PLACE), (len(self.key), RAYS_PER_PLACE, 2))
        normals = self.arrivals.normals[:, None]
        rays = np.empty((len(self.key), RAYS_PER_PLACE, 6))
        rays[..., :3] = self.arrivals.places[:, None] + SENSOR_OFFSET_M * normals
        rays[..., 3:] = cosine_directions(normals, numbers)
        return rays.reshape(-1, 6)

    def transfer(self, seen: Arrivals, senders: int) -> csr_array:
        """(sender, place) share of the rays of senders, as many of each, that arrive at each place.

        Those that arrive at none's count as more of those that do: the nearest place may be behind a wall.
        """
        to = self.place_of(seen)
        each = len(to) // max(senders, 1)
        sender = np.repeat(np.arange(senders), each)
        found = to >= 0
        counts = np.bincount(sender[found], minlength=senders)
        matt = np.bincount(sender[found | self.surfaces.can_share(seen)], minlength=senders)
        share = matt / (np.maximum(counts, 1) * max(each, 1))
        return csr_array((share[sender[found]], (sender[found], to[found])), shape=(senders, len(self.key)))

    def neighbours(self) -> IntArray:
        """(pair, 2) places of one kind, in the same or adjoining boxes, that see one another."""
        if not len(self.key):
            return np.empty((0, 2), dtype=np.int64)
        box = self.surfaces.box(self.arrivals.places).astype(np.float64)
        pairs = cKDTree(np.column_stack([box, 10.0 * self.arrivals.kind])).query_pairs(
            1.5, p=np.inf, output_type="ndarray"
        )
        first, second = self.arrivals.take(pairs[:, 0]), self.arrivals.take(pairs[:, 1])
        seeing: IntArray = pairs[_see_one_another(self.surfaces, first, second.places, second.normals)]
        return seeing


def _place_of(
    surfaces: Surfaces, seen: Arrivals, key: IntArray, positions: FloatArray, normals: FloatArray
) -> IntArray:
    """(ray,) the first place of the same key that each arrival sees; -1 if none is."""
    wanted = surfaces.key(seen)
    first = np.searchsorted(key, wanted, side="left")
    count = np.searchsorted(key, wanted, side="right") - first
    place = np.full(len(wanted), -1, dtype=np.int64)
    for layer in range(LAYERS):
        open_ = np.flatnonzero((place < 0) & (count > layer))
        at = first[open_] + layer
        sees = _see_one_another(surfaces, seen.take(open_), positions[at], normals[at])
        place[open_[sees]] = at[sees]
    return place


def _see_one_another(surfaces: Surfaces, seen: Arrivals, positions: FloatArray, normals: FloatArray) -> BoolArray:
    """(ray,) whether nothing stands between arrivals and positions, both lifted off their surfaces."""
    starts = seen.places + SENSOR_OFFSET_M * seen.normals
    lift = (LIFT_M - SENSOR_OFFSET_M) * seen.normals
    lifted = starts + lift
    ways = positions + LIFT_M * normals - lifted
    ways[~ways.any(axis=1), 2] = 1e-9  # a place sees itself
    caster = surfaces.caster
    return ~(caster.blocked(starts, lift, max_distance=1.0) | caster.blocked(lifted, ways, max_distance=1.0))
