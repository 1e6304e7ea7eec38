"""Light reflected more than once, by pooled paths: all sensors that see a patch of wall share the paths sampled there.

Such light varies slowly: over a patch of half a metre it hardly changes, yet the estimate of a single path is off by a
factor of two. So every sensor sends many rays of which only the first hit is computed (cheap), the hits ("arrivals") of
all sensors are sorted into small cells of one material and one side of the room, and a few paths per cell, drawn at
random from its arrivals, estimate the light for all of them:

    M(x) = ∫R dω / n Σ_rays m(cell of the ray),   m(cell) = mean of m(y) over its drawn arrivals y

The radiance of a Lambertian surface of reflectance ρ follows from its irradiance, so the path continues from y along a
ray sampled in proportion to the cosine; over a cell, and over the whole room, these rays form a low-discrepancy
sequence (Roberts). For a glossy surface the engine traces the sensor's own ray:

    m(y) = ρ(y) L(y, ω), L being the light reflected once or more;   or   whole path - first reflection

A cell's drawn arrivals are an unbiased sample of all of them. So the sum over all sensors is unbiased whatever the
cells are, and a single sensor is sampled as by independent paths. What one sensor among many is given of the others'
light is bounded by how far the rough light (`rough_light`), which paths only correct, is wrong across a cell, and cells
shrink as more rays are requested. Bright cells get more paths than dark ones. Measured in docs/performance.md.

References
----------
Roberts M (2018), The unreasonable effectiveness of quasirandom sequences, extremelearning.com.au (the R2 sequence).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.radiance.engine.options import PATH_WEIGHT, Glass, PassOptions
from lidarspectra.radiance.sampling.arrivals import Arrivals, Scattering, Surfaces
from lidarspectra.radiance.sampling.patches import Patches
from lidarspectra.radiance.sampling.receptors import FIBONACCI, cosine_directions
from lidarspectra.radiance.sampling.rough_light import RoughLight
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors

PATHS_PER_CELL = 16  # bias against variance: more paths per cell make cells larger, fewer leave the noise of each
MIN_LOOKS = 8  # least rays per sensor and batch, in all passes of a band together
PATHS_PER_LOOK = 24  # drawn paths for each ray of a sensor: cost against variance
REST_WEIGHT = (
    0.2  # [1] as `PATH_WEIGHT`, for continued paths, whose first reflection (about one half) is already counted
)
_LOOKS = (
    1,
    2,
    3,
    *FIBONACCI,
)  # numbers of rays; below 5 they are no Fibonacci lattice, but suffice where many passes add up
VALUES_AT_ONCE = 256  # of each path that are averaged together: with all of thousands it would take gigabytes
_CURVE_BITS = 6  # 2^6 steps along each side of a box, of about 1 cm
_R2 = np.array([0.7548776662466927, 0.5698402909980532])  # [1] 1/g and 1/g², g³ = g + 1 (Roberts 2018)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sharing:
    """Which sensors may share paths on which patches.

    Parameters
    ----------
    patches : Patches
    group : (place,) int
        Patches of the same number share; -1 where each sensor has its own paths.
    rough : RoughLight
        What paths find is known roughly beforehand, of each of the engine's values.
    """

    patches: Patches
    group: IntArray
    rough: RoughLight


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """Rays to be traced by the engine for some of the drawn paths.

    Parameters
    ----------
    reach : str
        'rest': continued from a diffuse surface; 'whole': from the sensor; 'first': up to the
        first reflection only.
    rays : (ray, 6) float
    path : (ray,) int
        Path of each ray; each path occurs once.
    weight : (ray, slot) or (ray, 1) float
        Factor on the engine's result. [1]
    glass : str
        How panes of glass reflect lamps on it, see `_legs`.
    """

    reach: Literal["rest", "whole", "first"]
    rays: FloatArray
    path: IntArray
    weight: FloatArray
    glass: Glass = "plain"

    def arguments(self, options: PassOptions, bounces: int) -> tuple[str, ...]:
        """Arguments of rcontrib for light at the sensor after at most `bounces` reflections."""
        return options.gather_arguments(
            1,
            bounces={"rest": bounces - 1, "whole": bounces, "first": 1}[self.reach],
            lamps_visible=False,
            path_weight=REST_WEIGHT if self.reach == "rest" else PATH_WEIGHT,
            glass=self.glass,
        )


@dataclass(kw_only=True, eq=False)
class PooledPaths:
    """The paths drawn for one round, and the weights by which sensors share them.

    Parameters
    ----------
    legs : tuple of Leg
        Rays for the engine.
    cell : (path,) int
        Cell of each path, numbered through all batches.
    shares : tuple of sparse (sensor, cell)
        Per batch, the share of a sensor's rays that arrive in each cell.
    found : (path, value) float
        Estimate of each path, summed over its legs, less the rough light where it arrived; in single precision: with
        the sky's patches for lamps it is large.
    missing : int
        Rays without a result so far.
    rough : RoughLight or None
        0 everywhere if None.
    rough_shares : tuple of sparse (sensor, 4 place)
        Per batch, mean of the rough light over a sensor's rays, to be multiplied by its functions.
    """

    legs: tuple[Leg, ...]
    cell: IntArray
    shares: tuple[csr_array, ...]
    found: NDArray[np.float32] = field(repr=False)
    missing: int
    rough: RoughLight | None = None
    rough_shares: tuple[csr_array, ...] = ()

    def take(self, leg: Leg, part: slice, values: FloatArray) -> None:
        """Add the engine's (ray, lamp x slot) results for some rays of a leg."""
        weight = leg.weight[part]
        counted = values.reshape(len(values), -1, weight.shape[1]) * weight[:, None]
        self.found[leg.path[part]] += counted.reshape(values.shape)
        self.missing -= len(values)

    def estimates(self) -> FloatArray:
        """(batch, sensor, value) mean over each sensor's rays of the estimates of their cells."""
        order = np.argsort(self.cell, kind="stable")
        count = np.bincount(self.cell)
        firsts = np.cumsum(count) - count
        values = self.found.shape[1]
        found = np.empty((len(self.shares), self.shares[0].shape[0], values))
        for first in range(0, values, VALUES_AT_ONCE):
            part = slice(first, first + VALUES_AT_ONCE)
            means = np.add.reduceat(self.found[order, part], firsts, axis=0, dtype=np.float64) / count[:, None]
            for batch, share in enumerate(self.shares):
                found[batch, :, part] = share @ means
            if self.rough is not None:
                for batch, share in enumerate(self.rough_shares):
                    found[batch, :, part] += share @ self.rough.functions[:, part]
        return found


def draw_pooled_paths(
    surfaces: Surfaces,
    sensors: Sensors,
    paths: int,
    *,
    batches: int,
    values: int,
    generator: np.random.Generator,
    sharers: int = 1,
    sharing: Sharing | None = None,
) -> PooledPaths:
    """Find the first hits of the sensors' rays, and draw the paths to be traced.

    Parameters
    ----------
    surfaces : Surfaces
    sensors : Sensors
    paths : int
        About how many are drawn per batch, for all sensors together.
    batches : int
        Independent sets.
    values : int
        Values in the engine's result for a ray.
    generator : numpy.random.Generator
    sharers : int
        Number of passes whose light adds up, each with its own sensor rays.
    sharing : Sharing, optional
        Which sensors may share a path; by default all whose rays arrive in one box on one kind of surface.

    Returns
    -------
    pooled : PooledPaths
    """
    count = len(sensors.positions)
    looks = _looks(paths, count, sharers)
    sensor = np.repeat(np.arange(count), looks)
    legs: list[list[Leg]] = []
    cells: list[IntArray] = []
    arrived: list[tuple[IntArray, IntArray]] = []
    rough = None if sharing is None else sharing.rough
    rough_shares: list[csr_array] = []
    known: list[csr_array] = []
    total = drawn = 0
    for _ in range(batches):  # one at a time to bound memory: a million rays take 100 MB
        rays = sensors.draw_rays(np.arange(count), sets=1, count=looks, generator=generator).reshape(-1, 6)
        arrivals = surfaces.arrivals(rays)
        lit = np.flatnonzero(~surfaces.are_dark(arrivals))
        rays, arrivals, watching = rays[lit], arrivals.take(lit), sensor[lit]
        most = max(1, PATHS_PER_CELL * len(rays) // paths)
        place = None if sharing is None else sharing.patches.place_of(arrivals)
        kind = _kinds(surfaces, arrivals, watching, sharing, place)
        cell = sort_into_cells(arrivals.places, kind, most=most, longest_m=surfaces.cell_m, origin=surfaces.bounds[0])
        chosen = _draw(cell, _worth(surfaces.scattering, arrivals.material), min(paths, len(rays)), generator)
        legs.append(_legs(surfaces, arrivals, rays, chosen, first_path=drawn, generator=generator))
        cells.append(cell[chosen] + total)
        arrived.append((watching, cell + total))
        if rough is not None and place is not None:
            row = np.arange(len(chosen))
            known.append(rough.terms(place[chosen], arrivals.places[chosen], row=row, rows=len(row), weight=-1.0))
            rough_shares.append(rough.terms(place, arrivals.places, row=watching, rows=count, weight=1.0 / looks))
        total += int(cell.max(initial=-1)) + 1
        drawn += len(chosen)
    joined = _joined(legs)
    found = np.zeros((drawn, values), dtype=np.float32) if rough is None else vstack(known, "csr") @ rough.functions
    return PooledPaths(
        legs=joined,
        cell=np.concatenate(cells),
        shares=tuple(
            csr_array((np.full(cell.size, 1.0 / looks), (watching, cell)), shape=(count, total))
            for watching, cell in arrived
        ),
        found=found,
        missing=sum(len(leg.rays) for leg in joined),
        rough=rough,
        rough_shares=tuple(rough_shares),
    )


def _kinds(
    surfaces: Surfaces, arrivals: Arrivals, sensor: IntArray, sharing: Sharing | None, place: IntArray | None
) -> IntArray:
    """(ray,) labels; rays share a cell only under one label: a group of patches, or a sensor and kind of surface."""
    kinds = 1 + int(arrivals.kind.max(initial=0))
    can_share = surfaces.can_share(arrivals)
    shared, groups = arrivals.kind, 0
    if sharing is not None and place is not None:
        group = np.append(sharing.group, -1)[place]  # of place -1, none: -1
        can_share &= group >= 0
        shared, groups = kinds + group, len(sharing.patches)
    own = kinds + groups + kinds * sensor + arrivals.kind
    return np.where(can_share, shared, own)


def _looks(paths: int, sensors: int, sharers: int) -> int:
    """Rays per sensor and batch: enough for their variance not to exceed that of the drawn paths."""
    wanted = max(MIN_LOOKS / sharers, paths / PATHS_PER_LOOK, paths / sensors)
    return next((count for count in _LOOKS if count >= wanted), _LOOKS[-1])


def _worth(scattering: Scattering, material: IntArray) -> FloatArray:
    """(ray,) relative number of paths to draw from an arrival [1].

    The square root of the surface's mean reflectance if known: its light is proportional to the reflectance, but a
    surface that is dark in the mean may be bright in one band.
    """
    worth = np.sqrt(np.where(scattering.is_diffuse, scattering.reflectance.mean(axis=1), 1.0))
    return np.where(material >= 0, worth[material], 1.0)


def _legs(
    surfaces: Surfaces,
    arrivals: Arrivals,
    rays: FloatArray,
    chosen: IntArray,
    *,
    first_path: int,
    generator: np.random.Generator,
) -> list[Leg]:
    """Engine rays for the chosen arrivals, which are in the order of their cells.

    Light that a pane of glass reflects from a lamp to where the path first arrived belongs to what is reflected once
    (images). All later such light comes from the panes' glow, but for paths that meet glass at once: what glows there
    was counted before.
    """
    scattering = surfaces.scattering
    path = first_path + np.arange(len(chosen))
    material = arrivals.material[chosen]
    goes_on = (material >= 0) & scattering.is_diffuse[material]
    there, watched = chosen[goes_on], chosen[~goes_on]
    normals = arrivals.normals[there]
    numbers = (generator.random(2) + np.arange(len(there))[:, None] * _R2) % 1.0
    starts = arrivals.places[there] + SENSOR_OFFSET_M * normals
    onward = np.concatenate([starts, cosine_directions(normals, numbers)], axis=1)
    has_glass = bool(scattering.is_glass.any())
    one = np.ones((len(watched), 1))
    rest = Leg(reach="rest", rays=onward, path=path[goes_on], weight=scattering.reflectance[material[goes_on]])
    at_once = surfaces.are_glass(surfaces.arrivals(onward)) if has_glass else np.ones(len(there), dtype=np.bool_)
    whole = Leg(reach="whole", rays=rays[watched], path=path[~goes_on], weight=one)
    first = Leg(reach="first", rays=rays[watched], path=path[~goes_on], weight=-one)
    clear = surfaces.are_glass(arrivals.take(watched)) if has_glass else np.ones(len(watched), dtype=np.bool_)
    return [
        *(_some(rest, at_once, "plain"), _some(rest, ~at_once, "glow")),
        *(_some(whole, clear, "plain"), _some(whole, ~clear, "glow")),
        *(_some(first, clear, "plain"), _some(first, ~clear, "images")),
    ]


def _some(leg: Leg, chosen: BoolArray, glass: Glass) -> Leg:
    """Some rays of a leg."""
    return Leg(reach=leg.reach, rays=leg.rays[chosen], path=leg.path[chosen], weight=leg.weight[chosen], glass=glass)


def _joined(legs: Sequence[Sequence[Leg]]) -> tuple[Leg, ...]:
    """Legs of all batches, joined by reach; empty ones are dropped."""
    joined = [
        Leg(
            reach=alike[0].reach,
            rays=np.concatenate([leg.rays for leg in alike]),
            path=np.concatenate([leg.path for leg in alike]),
            weight=np.concatenate([leg.weight for leg in alike]),
            glass=alike[0].glass,
        )
        for alike in zip(*legs, strict=True)
    ]
    return tuple(leg for leg in joined if len(leg.rays))


def sort_into_cells(
    places: FloatArray, kind: IntArray, *, most: int, longest_m: float, origin: FloatArray | None = None
) -> IntArray:
    """Sort points into cells of neighbours of one kind: grid boxes, divided along the Z-order curve if too full.

    Parameters
    ----------
    places : (point, 3) float
        [m]
    kind : (point,) int
        Points of different kinds never share a cell.
    most : int
        Largest number of points in a cell.
    longest_m : float
        Side of the boxes. [m]
    origin : (3,) float, optional
        A corner of the grid; that of the points if left out. [m]

    Returns
    -------
    cell : (point,) int
        Labels from 0, without gaps.

    References
    ----------
    Morton G M (1966), A computer oriented geodetic data base and a new technique in file sequencing, IBM.
    """
    if not len(places):
        return np.zeros(0, dtype=np.int64)
    boxes = (places - (places.min(axis=0) if origin is None else origin)) / longest_m
    corner = np.floor(boxes).astype(np.int64)
    steps = ((boxes - corner) * (1 << _CURVE_BITS)).astype(np.int64)
    corner -= corner.min(axis=0)
    across, up = corner.max(axis=0)[1:] + 1
    box = (corner[:, 0] * across + corner[:, 1]) * up + corner[:, 2]
    _, label = np.unique(kind * (box.max() + 1) + box, return_inverse=True)
    label = label.ravel()
    order = np.argsort((label << (3 * _CURVE_BITS)) | _along_curve(steps))
    sizes = np.bincount(label)
    cells = -(-sizes // most)
    rank = np.arange(order.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    label = label[order]
    cell = np.empty(order.size, dtype=np.int64)
    cell[order] = (np.cumsum(cells) - cells)[label] + rank * cells[label] // sizes[label]
    return cell


def _along_curve(steps: IntArray) -> IntArray:
    """(point,) Morton code of (point, 3) steps along the axes: their bits interleaved."""
    place = np.zeros(len(steps), dtype=np.int64)
    for bit in range(_CURVE_BITS):
        for axis in range(3):
            place |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    return place


def _draw(cell: IntArray, worth: FloatArray, paths: int, generator: np.random.Generator) -> IntArray:
    """Indices of randomly drawn points, ordered by cell: at least one per cell, in proportion to the cell's worth."""
    sizes = np.bincount(cell)
    worths = np.bincount(cell, weights=worth)
    wanted = np.rint(worths * (paths / max(worths.sum(), 1e-9)))
    wanted = np.clip(wanted, 1, sizes).astype(np.int64)
    order = np.argsort(cell + generator.random(cell.size))
    rank = np.arange(cell.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.asarray(order[rank < wanted[cell[order]]], dtype=np.int64)
