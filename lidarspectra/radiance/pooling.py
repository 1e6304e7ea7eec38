"""Light reflected more than once, pooled: what one sensor's paths find on a patch of wall serves all that look at it.

Such light has lost its shadows: on a patch of half a metre it hardly changes, yet a single path knows it no better
than to a factor of two. So every sensor sends many rays that only look where they arrive (cheap), the arrivals of all
sensors are sorted into small cells of one material and one side of the room, and few paths a cell, drawn by lot from
its arrivals, measure the light for all of them:

    M(x) = ∫R dω / n Σ_rays m(cell of the ray),   m(cell) = mean over its drawn rays of (whole path - first reflection)

A cell's drawn rays are a fair sample of its arrivals. So the sum over all sensors is unbiased whatever the cells are,
and one sensor alone is sampled exactly as by independent paths. Light is only moved between sensors that look at the
same cell, by its change across the cell; and cells shrink as more rays are asked for. Measured in docs/performance.md.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import SceneError
from lidarspectra.hardware.room.rays import RayCaster
from lidarspectra.radiance.mesh_text import read_mesh_text
from lidarspectra.radiance.receptors import FIBONACCI
from lidarspectra.radiance.scene import RadianceScene
from lidarspectra.radiance.sensor_rays import Sensors

PATHS_A_CELL = 8  # [1] few, and a ray's own noise remains; many, and cells are coarse
CELL_SHARE = 1.0 / 8.0  # [1] of the room's diagonal: longest side of a cell, 0.6 m in a room of 3 m x 3 m
LEAST_LOOKS = 8  # [1] rays a sensor sends in a batch, at least
MOST_POOLED_GLOSS = 0.1  # [1] specularity above which what leaves a surface depends on who looks
_SIDES = 6  # [1] a face's side is told by the axis that its normal is nearest to


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """The surfaces of a pass, to look where rays arrive.

    Parameters
    ----------
    caster : RayCaster
    face_material : (face,) int
    is_matt : (material,) bool
        Whether it sends what it reflects in all directions alike.
    cell_m : float
        Longest side of a cell. [m]
    """

    caster: RayCaster
    face_material: IntArray
    is_matt: BoolArray
    cell_m: float

    def arrivals(self, rays: FloatArray, sensor: IntArray) -> tuple[FloatArray, IntArray]:
        """Where rays (ray, 6) of sensors (ray,) arrive: place (ray, 3) [m] and a number for what may share a cell."""
        origins, directions = rays[:, :3], rays[:, 3:]
        hits = self.caster.nearest(origins, directions)
        places = origins + np.where(hits.met, hits.distance, 0.0)[:, None] * directions
        normals = self.caster.normals[hits.face]
        away = np.einsum("ij,ij->i", normals, directions) > 0
        normals = np.where(away[:, None], -normals, normals)  # towards the ray: the two sides of a face differ
        axis = np.abs(normals).argmax(axis=1)
        side = 2 * axis + (normals[np.arange(len(axis)), axis] > 0)
        material = self.face_material[hits.face]
        kind = np.where(hits.met, 1 + _SIDES * material + side, 0)
        alone = hits.met & ~self.is_matt[material]
        kinds = 1 + _SIDES * self.is_matt.size
        return places, np.where(alone, kinds * (1 + sensor) + kind, kind)


def load_surfaces(scene: RadianceScene) -> dict[str, Surfaces]:
    """The surfaces of every pass, by its name.

    Parameters
    ----------
    scene : RadianceScene

    Returns
    -------
    surfaces : dict of str to Surfaces
        Passes of the same mesh and materials share theirs.

    Raises
    ------
    SceneError
        If a file of the scene cannot be read.
    """
    known: dict[tuple[str, str], Surfaces] = {}
    for scene_pass in scene.passes:
        key = (scene_pass.mesh, scene_pass.materials_file)
        if key not in known:
            scan, face_material, names = read_mesh_text(scene.folder / scene_pass.mesh)
            known[key] = Surfaces(
                caster=RayCaster(scan),
                face_material=face_material,
                is_matt=_are_matt(names, scene.folder / scene_pass.materials_file),
                cell_m=CELL_SHARE * float(np.linalg.norm(np.ptp(scan.bounds, axis=0))),
            )
    return {scene_pass.name: known[(scene_pass.mesh, scene_pass.materials_file)] for scene_pass in scene.passes}


def _are_matt(names: Sequence[str], path: Path) -> BoolArray:
    """Whether each named material of a scene file is matt: plastic of little gloss."""
    matt = {}
    try:
        words = iter(re.sub("#.*", "", path.read_text(encoding="utf-8")).split())
        for _modifier in words:  # modifier, type, name, then three lists, each headed by its length
            kind, name = next(words), next(words)
            _, _, numbers = [[next(words) for _ in range(int(next(words)))] for _ in range(3)]
            matt[name] = kind == "plastic" and float(numbers[3]) <= MOST_POOLED_GLOSS
        return np.array([matt[name] for name in names], dtype=np.bool_)
    except (OSError, ValueError, LookupError, StopIteration) as cause:
        raise SceneError(
            expected="the materials that write_scene made, each with its three lists",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Make the scene stage again.",
        ) from cause


@dataclass(kw_only=True, eq=False)
class PooledPaths:
    """The paths drawn for one round, and whom they count for.

    Parameters
    ----------
    rays : (path, 6) float
        First rays of the drawn paths.
    cell : (path,) int
        Cell of each, numbered through all batches.
    shares : tuple of sparse (sensor, cell)
        Per batch, the share of a sensor's rays that arrive in each cell.
    found : (path, value) float
        Whole paths less their first reflections, as answers come in.
    missing : int
        Rays still to be answered.
    """

    rays: FloatArray
    cell: IntArray
    shares: tuple[csr_array, ...]
    found: FloatArray = field(repr=False)
    missing: int

    def take(self, part: slice, values: FloatArray, *, whole: bool) -> None:
        """Take in the answer for some paths: of whole paths, or of their first reflections alone."""
        self.found[part] += values if whole else -values
        self.missing -= len(values)

    def estimates(self) -> FloatArray:
        """(batch, sensor, value) mean over each sensor's rays of what was found in their cells."""
        order = np.argsort(self.cell, kind="stable")
        count = np.bincount(self.cell)
        firsts = np.cumsum(count) - count
        means = np.add.reduceat(self.found[order], firsts, axis=0) / count[:, None]
        return np.stack([share @ means for share in self.shares])


def draw_pooled_paths(
    surfaces: Surfaces, sensors: Sensors, paths: int, *, batches: int, values: int, generator: np.random.Generator
) -> PooledPaths:
    """Look where sensors' rays arrive, and draw the paths to be followed.

    Parameters
    ----------
    surfaces : Surfaces
    sensors : Sensors
    paths : int
        About so many are drawn in each batch, for all sensors together.
    batches : int
        Independent sets.
    values : int
        Numbers that the engine answers a ray with.
    generator : numpy.random.Generator

    Returns
    -------
    pooled : PooledPaths
    """
    count = len(sensors.positions)
    looks = _looks(paths, count)
    sensor = np.repeat(np.arange(count), looks)
    drawn: list[FloatArray] = []
    cells: list[IntArray] = []
    arrived: list[IntArray] = []
    total = 0
    for _ in range(batches):  # one after the other: a million rays are 100 MB
        rays = sensors.draw_rays(np.arange(count), sets=1, count=looks, generator=generator).reshape(-1, 6)
        places, kind = surfaces.arrivals(rays, sensor)
        most = max(1, PATHS_A_CELL * len(rays) // paths)
        cell = sort_into_cells(places, kind, most=most, longest_m=surfaces.cell_m)
        chosen = _draw(cell, min(1.0, paths / len(rays)), generator)
        drawn.append(rays[chosen])
        cells.append(cell[chosen] + total)
        arrived.append(cell + total)
        total += int(cell.max()) + 1
    shares = [csr_array((np.full(cell.size, 1.0 / looks), (sensor, cell)), shape=(count, total)) for cell in arrived]
    rays = np.concatenate(drawn)
    return PooledPaths(
        rays=rays,
        cell=np.concatenate(cells),
        shares=tuple(shares),
        found=np.zeros((len(rays), values)),
        missing=2 * len(rays),
    )


def _looks(paths: int, sensors: int) -> int:
    """Rays a sensor sends in a batch: enough that their own noise is no more than the drawn paths'."""
    wanted = max(LEAST_LOOKS, paths / PATHS_A_CELL, paths / sensors)
    return next((count for count in FIBONACCI if count >= wanted), FIBONACCI[-1])


def sort_into_cells(places: FloatArray, kind: IntArray, *, most: int, longest_m: float) -> IntArray:
    """Sort points into cells of neighbours of one kind, by halving cells along their longest side.

    Parameters
    ----------
    places : (point, 3) float
        [m]
    kind : (point,) int
        Points of different kinds never share a cell.
    most : int
        Points in a cell.
    longest_m : float
        Side of a cell's bounding box. [m]

    Returns
    -------
    cell : (point,) int
        From 0, each used.
    """
    _, label = np.unique(kind, return_inverse=True)
    label = label.ravel()
    order = np.argsort(label)  # points still to be sorted, those of a label side by side
    label = label[order]
    cell = np.empty(order.size, dtype=np.int64)
    used = 0
    while order.size:
        sizes = np.bincount(label)
        firsts = np.cumsum(sizes) - sizes
        lowest = np.minimum.reduceat(places[order], firsts)
        sides = np.maximum.reduceat(places[order], firsts) - lowest
        axis = sides.argmax(axis=1)
        longest = sides.max(axis=1)
        split = (sizes > 1) & (((sizes > most) & (longest > 0)) | (longest > longest_m))
        number = np.where(split, np.cumsum(split) - 1, used + np.cumsum(~split) - 1)
        halved = split[label]
        cell[order[~halved]] = number[label[~halved]]
        used += int(np.count_nonzero(~split))
        order, label = order[halved], label[halved]
        along = (places[order, axis[label]] - lowest[label, axis[label]]) / longest[label]
        label, sizes = number[label], sizes[split]
        order = order[np.argsort(label + 0.999 * along)]
        rank = np.arange(order.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        label = 2 * label + (rank >= sizes[label] // 2)
    return cell


def _draw(cell: IntArray, share: float, generator: np.random.Generator) -> IntArray:
    """Numbers of points drawn by lot: about a share of each cell's, at least one."""
    sizes = np.bincount(cell)
    wanted = np.maximum(1, np.rint(share * sizes)).astype(np.int64)
    order = np.argsort(cell + generator.random(cell.size))
    rank = np.arange(cell.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.asarray(order[rank < wanted[cell[order]]], dtype=np.int64)
