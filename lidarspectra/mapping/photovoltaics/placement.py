"""The best mount of a solar cell of a given size in a room: place, tilt and orientation, by tracing tilted sensors.

First every mount is traced with a large standard error at the cell's centre; then the best are traced finely over the
cell's whole face.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.response_weights import band_weights
from lidarspectra.mapping.photometry.point_light import light_of_lamps
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.options import Accuracy
from lidarspectra.radiance.sampling.trace import trace, trace_irradiance
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_points import SensorPoints, place_points

ROUGH_SE = 0.03  # [1] standard error over mean of the first trace, which only ranks
SAMPLES_ALONG = 3  # points along each side of a cell
WALL_SPACING_M = 0.25  # [m] between places along a wall
OFF_WALL_M = 0.03  # [m] clears the noise of a scanned wall, which is a few centimetres
UPRIGHT = 0.999  # [1] |z| of a normal above which a cell counts as horizontal


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounts:
    """Candidate positions and directions of a cell.

    Parameters
    ----------
    positions : (mount, 3) float
        Centre of the cell. [m]
    normals : (mount, 3) float
        Unit vectors.
    place : (mount,) int
        Mounts with the same number are directions at the same place.
    """

    positions: FloatArray
    normals: FloatArray
    place: IntArray

    def __post_init__(self) -> None:
        positions = float_array(self.positions, name="Mounts.positions", shape=(None, 3))
        normals = float_array(self.normals, name="Mounts.normals", shape=(len(positions), 3))
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "normals", normals)

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def tilt_deg(self) -> FloatArray:
        """(mount,) angle from facing up: 0 flat on a table, 90 upright, 180 under a shelf [deg]."""
        return np.asarray(np.degrees(np.arccos(np.clip(self.normals[:, 2], -1.0, 1.0))), dtype=np.float64)

    @property
    def azimuth_deg(self) -> FloatArray:
        """(mount,) direction that it faces in plan, from the x axis counter-clockwise; 0 where it faces up [deg]."""
        return np.asarray(np.degrees(np.arctan2(self.normals[:, 1], self.normals[:, 0])) % 360.0, dtype=np.float64)

    def only(self, chosen: IntArray) -> "Mounts":
        """The chosen mounts, in that order."""
        return Mounts(positions=self.positions[chosen], normals=self.normals[chosen], place=self.place[chosen])


@dataclass(frozen=True, kw_only=True, eq=False)
class RankedMounts:
    """The best mounts, best first.

    Parameters
    ----------
    mounts : Mounts
    density, standard_error : (mount,) float
        Mean current density over the cell's face. Its points share light paths, so that their errors are correlated and
        the error of the mean is taken as the mean of theirs. [A/m²]
    evenness : (mount,) float
        Minimum over mean on the face: the darkest of several cells in series limits the current. [1]
    tried : int
        Number of mounts that were compared.
    """

    mounts: Mounts
    density: FloatArray
    standard_error: FloatArray
    evenness: FloatArray
    tried: int


def tilted_mounts(positions: FloatArray, tilts_deg: Sequence[float], azimuths_deg: Sequence[float]) -> Mounts:
    """Every place in every tilt and azimuth; a tilt of 0 or 180 is one direction.

    Parameters
    ----------
    positions : (place, 3) float
        [m]
    tilts_deg, azimuths_deg : sequence of float
        See `Mounts`. [deg]
    """
    turns = []
    for tilt in tilts_deg:
        for azimuth in azimuths_deg if 0.0 < tilt < 180.0 else (0.0,):
            t, a = np.radians(tilt), np.radians(azimuth)
            turns.append((np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)))
    normals = np.round(np.array(turns), 12)
    return Mounts(
        positions=np.repeat(positions, len(normals), axis=0),
        normals=np.tile(normals, (len(positions), 1)),
        place=np.repeat(np.arange(len(positions)), len(normals)),
    )


def wall_mounts(room: Room, heights_m: Sequence[float]) -> Mounts:
    """Places on the walls of all rooms, `WALL_SPACING_M` apart and facing into them; shorter walls have none.

    Parameters
    ----------
    room : Room
    heights_m : sequence of float
        Above the floor. [m]

    Raises
    ------
    MapError
        If a height does not lie between floor and ceiling, or no wall is as long as the spacing.
    """
    outside = [height for height in heights_m if not 0.0 < height < room.height_m]
    if outside:
        raise MapError(
            expected=f"heights between floor and ceiling, {room.height_m:.2f} m",
            found=", ".join(f"{height:g} m" for height in outside),
            where="walls",
        )
    positions, normals = [], []
    for outline, floor_z in zip(room.outlines, (room.floor_z, *room.other_floor_z), strict=True):
        for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            along = end - start
            length = float(np.hypot(*along))
            inward = np.array([-along[1], along[0], 0.0]) / max(length, 1e-9)  # an outline is counter-clockwise
            count = int(length // WALL_SPACING_M)
            for share in (np.arange(count) + 0.5) / max(count, 1):
                for height in heights_m:
                    positions.append((*(start + share * along + OFF_WALL_M * inward[:2]), floor_z + height))
                    normals.append(inward)
    if not positions:
        raise MapError(expected=f"a wall of {WALL_SPACING_M:g} m or more", found="none", where="walls of the room")
    found = np.array(positions)
    return Mounts(positions=found, normals=np.array(normals), place=np.arange(len(found)))


def joined(first: Mounts, second: Mounts) -> Mounts:
    """Both, as different places."""
    return Mounts(
        positions=np.vstack([first.positions, second.positions]),
        normals=np.vstack([first.normals, second.normals]),
        place=np.concatenate([first.place, second.place + first.place.max() + 1]),
    )


def face_points(mounts: Mounts, size_m: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Points spread over the face of a cell at every mount.

    Parameters
    ----------
    mounts : Mounts
    size_m : (float, float)
        Width, along the level side, and height. [m]

    Returns
    -------
    positions, normals : (mount x 9, 3) float
        Nine points a mount, in its order. [m, 1]
    """
    offsets = (np.arange(SAMPLES_ALONG) + 0.5) / SAMPLES_ALONG - 0.5
    level = np.cross([0.0, 0.0, 1.0], mounts.normals)
    flat = np.abs(mounts.normals[:, 2]) > UPRIGHT
    level[flat] = [1.0, 0.0, 0.0]
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    upward = np.cross(mounts.normals, level)
    u, v = (grid.ravel() for grid in np.meshgrid(size_m[0] * offsets, size_m[1] * offsets))
    spread = u[None, :, None] * level[:, None, :] + v[None, :, None] * upward[:, None, :]
    positions = (mounts.positions[:, None, :] + spread).reshape(-1, 3)
    return positions, np.repeat(mounts.normals, u.size, axis=0)


def best_mounts(
    scene: RadianceScene,
    scan: Scan,
    lamps: Sequence[Lamp],
    mounts: Mounts,
    cell: Cell,
    size_m: tuple[float, float],
    *,
    count: int = 5,
    accuracy: Accuracy = "high",
    seed: int = 0,
    workers: int | None = None,
    free: FreeSpace | None = None,
    progress: Progress = silent,
) -> RankedMounts:
    """Rank mounts by the current of a cell.

    Parameters
    ----------
    scene : RadianceScene
        Of a run.
    scan : Scan
        From which the scene was made: mounts whose face would lie or reach inside an object are left out.
    lamps : sequence of Lamp
        The scene's, with their spectra.
    mounts : Mounts
    cell : Cell
    size_m : (float, float)
        Width and height of the cell. [m]
    count : int
        Places to return, each with its best direction.
    accuracy, seed, workers, progress
        See `radiance.trace.trace`.
    free : FreeSpace, optional
        The scan's free space, if the caller has it.

    Returns
    -------
    ranked : RankedMounts

    Raises
    ------
    MapError
        If the cell has no size, or fits nowhere.
    """
    if not (0 < size_m[0] < np.inf and 0 < size_m[1] < np.inf):
        raise MapError(
            expected="a width and a height above 0", found=f"{size_m[0]:g} m x {size_m[1]:g} m", where="size of a cell"
        )
    space = free or FreeSpace(scan)
    open_mounts = mounts.only(np.flatnonzero(_is_open(scan, mounts, size_m, space)))
    if not len(open_mounts):
        raise MapError(expected="a mount at which the cell fits into free air", found="none", where="places for a cell")
    rough, _ = trace_irradiance(
        scene,
        open_mounts.positions,
        open_mounts.normals,
        relative_se=ROUGH_SE,
        accuracy=accuracy,
        seed=seed,
        workers=workers,
        progress=part_of(progress, 0.0, 0.5),
    )
    bands_alone = _band_light(scene, rough, cell)
    best = open_mounts.only(_first_of_each(open_mounts.place, np.argsort(-bands_alone), 2 * count))
    positions, normals = face_points(best, size_m)
    transport = trace(
        scene,
        SensorPoints(positions=positions, normals=normals, buried=np.zeros(len(positions), dtype=np.bool_)),
        accuracy=accuracy,
        seed=seed + 1,
        workers=workers,
        progress=part_of(progress, 0.5, 1.0),
    )
    light = light_of_lamps(transport, {lamp.name: lamp.flux for lamp in lamps})
    values, errors = (part.reshape(len(best), -1) for part in light.weigh(cell.responsivity))
    density = values.mean(axis=1)
    order = np.argsort(-density)[:count]
    return RankedMounts(
        mounts=best.only(order),
        density=density[order],
        standard_error=errors.mean(axis=1)[order],
        evenness=(values.min(axis=1) / np.maximum(density, 1e-300))[order],
        tried=len(open_mounts),
    )


def _band_light(scene: RadianceScene, irradiance: FloatArray, cell: Cell) -> FloatArray:
    """(mount,) current density from the bands alone, accurate enough for ranking [A/m²]."""
    return np.asarray(irradiance @ band_weights(scene.bands.centers_nm, cell.responsivity), dtype=np.float64)


def _first_of_each(place: IntArray, order: IntArray, count: int) -> IntArray:
    """Mounts in order, only the first of each place."""
    _, first = np.unique(place[order], return_index=True)
    return order[np.sort(first)[:count]]


def _is_open(scan: Scan, mounts: Mounts, size_m: tuple[float, float], space: FreeSpace) -> BoolArray:
    """(mount,) whether all four corners of the cell's face lie in air."""
    outer = SAMPLES_ALONG / (SAMPLES_ALONG - 1)  # [1] scales the outermost sample points to the corners
    positions, normals = face_points(mounts, (outer * size_m[0], outer * size_m[1]))
    corners = [0, SAMPLES_ALONG - 1, SAMPLES_ALONG * (SAMPLES_ALONG - 1), SAMPLES_ALONG**2 - 1]
    keep = (np.arange(len(mounts))[:, None] * SAMPLES_ALONG**2 + np.array(corners)).ravel()
    placed = place_points(scan, positions[keep], normals[keep], 0.0, free=space)
    return np.asarray(~placed.buried.reshape(len(mounts), len(corners)).any(axis=1), dtype=np.bool_)
