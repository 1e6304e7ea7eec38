"""Readings on a map: the nearest point that looks the way of each, and how far the map is from what was read."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.measured_readings import Scale, fitted_factors
from lidarspectra.mapping.maps.metrics import Comparison, Normalisation, compare_maps
from lidarspectra.room.partitions import Partitions
from lidarspectra.words import were

MIN_POINTS = 3  # fewer do not characterise a map
MAX_TURN_DEG = 20.0  # [deg] between a reading's direction and its point's; more is other light
DIRECTION = ("nx", "ny", "nz")
NORMALISATIONS: tuple[Normalisation, ...] = ("absolute", "band", "all")
Quantity = Literal["irradiance", "illuminance"]
READ: dict[Quantity, tuple[str, str]] = {
    "irradiance": ("a channel", "a higher gain"),
    "illuminance": ("its lux", "a meter of a finer range"),
}  # what a reading may lack, and what helps where it is zero
PLACE_SD_M = 0.05  # [m] how far a reading may truly stand from its place: as deep in a wall, it is before it
NOWHERE_M = 1e9  # [m] stands for a place that is not known: far from everything


@dataclass(frozen=True, kw_only=True, eq=False)
class MatchedReadings:
    """Readings on a map.

    Parameters
    ----------
    points : (reading,) int
        The map's point for each of them.
    rows : (reading,) int
        Their rows in the table.
    notes : tuple of str
        What was left out, as full sentences.
    """

    points: IntArray
    rows: IntArray
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedReadings:
    """Readings of one quantity beside what the map has there.

    Parameters
    ----------
    comparisons : tuple of Comparison
        Absolute, and with the 0-1 normalisation by band and by map.
    scale : (band,) float
        What the readings were multiplied by before comparing. [1]
    places : (point, 3) float
        Of the points that were compared. [m]
    synthetic, real : (point, band) float
        [W/m²/nm]; of an illuminance one band. [lx]
    uncertainty : (point, band) float or None
        The map's standard uncertainty, where it states one and no factor was fitted. [as synthetic]
    """

    comparisons: tuple[Comparison, ...]
    scale: FloatArray
    places: FloatArray
    synthetic: FloatArray
    real: FloatArray
    uncertainty: FloatArray | None


def match_readings(
    light: xr.Dataset, table: pd.DataFrame, within_m: float, where: Path, partitions: Partitions | None = None
) -> MatchedReadings:
    """For each reading on the map the nearest of its points that look its way.

    Buried points do not count, and none behind a wall. Readings without nx, ny, nz are taken to look the way of the
    nearest point.

    Parameters
    ----------
    light : xarray.Dataset
        A spectral map.
    table : pandas.DataFrame
        Readings, with x, y, z [m], and nx, ny, nz where they are known.
    within_m : float
        Largest distance of a reading from its point. [m]
    where : Path
        The readings' file, for errors.
    partitions : Partitions, optional
        Of the room.

    Raises
    ------
    MapError
        If fewer than `MIN_POINTS` readings lie on the map.
    """
    usable = np.flatnonzero(~light["buried"].to_numpy())
    places = np.stack([light[axis].to_numpy() for axis in "xyz"], axis=1)[usable]
    readings = table[["x", "y", "z"]].to_numpy(dtype=np.float64)
    placed = np.isfinite(readings).all(axis=1)
    tree = cKDTree(places)
    distance, nearest = tree.query(np.where(placed[:, None], readings, NOWHERE_M))
    near = placed & (distance <= within_m)
    wanted = np.full(readings.shape, np.nan)
    if set(DIRECTION) <= set(table.columns):
        wanted = table[list(DIRECTION)].to_numpy(dtype=np.float64)
        wanted = wanted / np.maximum(np.linalg.norm(wanted, axis=1, keepdims=True), 1e-12)
    looks, agrees = _directions(light, usable), near.copy()

    def that_look_alike(row: np.integer[Any]) -> IntArray:
        about = np.array(tree.query_ball_point(readings[row], within_m), dtype=np.int64)
        if np.isfinite(wanted[row]).all():
            about = about[looks[about] @ wanted[row] >= np.cos(np.radians(MAX_TURN_DEG))]
        return np.asarray(about[np.argsort(np.linalg.norm(places[about] - readings[row], axis=1))], dtype=np.int64)

    for row in np.flatnonzero(near & np.isfinite(wanted).all(axis=1)):
        about = that_look_alike(row)
        agrees[row] = about.size > 0
        if about.size:
            nearest[row] = about[0]
    turned = int(near.sum() - agrees.sum())
    hidden = np.zeros(len(agrees), dtype=np.bool_)
    if partitions is not None:
        rows = np.flatnonzero(agrees)
        hidden[rows] = _behind_walls(partitions, places[nearest[rows]], readings[rows])
        for row in np.flatnonzero(hidden):
            about = that_look_alike(row)
            about = about[~_behind_walls(partitions, places[about], np.tile(readings[row], (about.size, 1)))]
            hidden[row] = about.size == 0
            if about.size:
                nearest[row] = about[0]
    rows = np.flatnonzero(agrees & ~hidden)
    if rows.size < MIN_POINTS:
        closest = f"{float(distance[placed].min()):.2f} m" if placed.any() else "no reading has a place"
        also = f"; {turned} more look another way than its points" if turned else ""
        also += f"; a wall stands between its points and {int(hidden.sum())} more" if hidden.any() else ""
        todo = "Measure at more of its points, looking as they do"
        if not near.any():
            todo = "Bring the readings into the scan's coordinates with 'lidarspectra sensor join --align'"
        raise MapError(
            expected=f"{MIN_POINTS} or more readings within {within_m:g} m of the map's points",
            found=f"{rows.size}; the nearest is at {closest}{also}",
            where=str(where),
            todo=f"{todo}.",
        )
    return MatchedReadings(
        points=usable[nearest[rows]].astype(np.int64),
        rows=rows.astype(np.int64),
        notes=_notes(len(table), rows.size, turned, int(hidden.sum()), within_m),
    )


def compare_readings(
    light: xr.Dataset,
    quantity: Quantity,
    readings: FloatArray,
    matched: MatchedReadings,
    names: Sequence[str],
    scale: Scale,
    where: Path,
) -> tuple[ComparedReadings, tuple[str, ...]]:
    """One quantity of a map beside the readings of it that are complete and above zero, averaged at each point.

    Parameters
    ----------
    light : xarray.Dataset
        A spectral map, of the bands that were read.
    quantity : 'irradiance' or 'illuminance'
    readings : (row, band) float
        Of the whole table; of an illuminance one band. [as the map]
    matched : MatchedReadings
    names : sequence of str
        Of the bands.
    scale : 'none', 'one', 'die' or 'channel'
        Factors that are fitted to the readings first.
    where : Path
        The readings' file, for errors.

    Returns
    -------
    compared : ComparedReadings
    notes : tuple of str
        On readings that were left out.

    Raises
    ------
    MapError
        If fewer than `MIN_POINTS` readings are complete.
    """
    lacked, remedy = READ[quantity]
    real = readings[matched.rows]
    complete = np.isfinite(real).all(axis=1)
    whole = complete & (np.nan_to_num(real) > 0).all(axis=1)  # Eq. 9 divides by what was read
    if whole.sum() < MIN_POINTS:
        raise MapError(
            expected=f"{MIN_POINTS} or more readings of the {quantity} that are complete and above zero",
            found=f"{int(whole.sum())}",
            where=str(where),
            todo=f"A reading counts where {lacked} is neither missing, saturated nor zero; where it is dark, {remedy} "
            "helps.",
        )
    points, reading = np.unique(matched.points[whole], return_inverse=True)
    count = np.bincount(reading)
    real = np.stack([np.bincount(reading, weights=band) / count for band in real[whole].T], axis=1)
    if points.size < MIN_POINTS:
        raise MapError(
            expected=f"readings at {MIN_POINTS} or more of the map's points",
            found=f"{int(whole.sum())} at {points.size}",
            where=str(where),
            todo="Measure at more of its points.",
        )

    def of_map(name: str) -> FloatArray:
        return np.asarray(light[name].to_numpy()[points].reshape(real.shape), dtype=np.float64)

    synthetic = of_map(quantity)
    factors = fitted_factors(synthetic, real, scale, names)
    real = real * factors
    compared = ComparedReadings(
        comparisons=tuple(compare_maps(synthetic, real, normalisation=each) for each in NORMALISATIONS),
        scale=factors,
        places=np.stack([light[axis].to_numpy() for axis in "xyz"], axis=1)[points],
        synthetic=synthetic,
        real=real,
        uncertainty=of_map(f"{quantity}_sd") if scale == "none" and f"{quantity}_sd" in light else None,
    )
    notes = _incomplete_notes(quantity, int((~complete).sum()), int(complete.sum() - whole.sum()))
    if points.size < whole.sum():
        notes += (
            f"The {int(whole.sum())} readings lie at {points.size} points of the map: those of one point are averaged, "
            "so that none counts more often.",
        )
    return compared, notes


def _directions(light: xr.Dataset, points: IntArray) -> FloatArray:
    """(point, 3) where some of the map's points look."""
    return np.stack([light[axis].to_numpy() for axis in DIRECTION], axis=1)[points].astype(np.float64)


def _behind_walls(partitions: Partitions, points: FloatArray, readings: FloatArray) -> BoolArray:
    """(pair,) whether a wall stands between (pair, 3) points of a map and readings [m]."""
    way = points[:, :2] - readings[:, :2]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    before = readings[:, :2] + way * np.minimum(PLACE_SD_M / np.maximum(length, 1e-12), 1.0)
    return partitions.between(points[:, :2], before, points[:, 2])


def _notes(read: int, matched: int, turned: int, hidden: int, within_m: float) -> tuple[str, ...]:
    notes = []
    if hidden:
        notes.append(
            f"{were(hidden, 'reading', ('is', 'are'))} left out, since a wall stands between them and the map's points "
            "beside them. Map points on their side of it, too."
        )
    read -= turned + hidden
    if turned:
        notes.append(
            f"{were(turned, 'reading', ('is', 'are'))} left out, since the map's points beside them look another way, "
            f"by more than {MAX_TURN_DEG:g}°. Give their directions nx, ny, nz as the sensor looked, or map those "
            "directions too."
        )
    if matched < read:
        notes.append(
            f"{read - matched} of {read} readings are left out, since they are farther than {within_m:g} m from the "
            "map's points. Check that they are in the scan's coordinates, or give a larger --within."
        )
    return tuple(notes)


def _incomplete_notes(quantity: Quantity, incomplete: int, dark: int) -> tuple[str, ...]:
    lacked, remedy = READ[quantity]
    notes = []
    if incomplete:
        notes.append(f"{were(incomplete, 'reading', ('is', 'are'))} left out for lack of {lacked}.")
    if dark:
        notes.append(
            f"{were(dark, 'reading', ('is', 'are'))} left out, since {lacked} is zero or less, where a percentage is "
            f"undefined. Measure there with {remedy} if they matter."
        )
    return tuple(notes)
