"""Positions of readings from the robot's poses, and their averages at the locations of a map."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import MapError, ReadingError
from lidarspectra.hardware.robot.alignment import Alignment
from lidarspectra.hardware.robot.time_offset import ExpectedLight, TimeOffset, estimate_time_offset, given_offset
from lidarspectra.hardware.robot.trajectory import LONGEST_GAP_S, Trajectory
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.measured_readings import read_readings
from lidarspectra.hardware.sensor.readings import POSITION
from lidarspectra.io.files import write_whole, writing

DEFAULT_RADIUS_M = 0.25  # [m] largest distance of a reading from its location, less where locations are closer
SAME_PLACE_M = 0.01  # [m] on the floor between locations one above the other
STOREY_M = 1.5  # [m] more than this without a location lies between storeys
MAX_STACKED = 8  # locations one above the other
UP = (0.0, 0.0, 1.0)  # the sensor of the paper's robot looks up


@dataclass(frozen=True, kw_only=True, eq=False)
class Placement:
    """Readings with places.

    Parameters
    ----------
    readings : xarray.Dataset
        x, y, z filled; NaN where the robot's place is not known.
    offset : TimeOffset
        Of the robot's clock.
    placed : int
        Readings with a place.
    words : tuple of str
        What was done, in words for logs.
    """

    readings: xr.Dataset
    offset: TimeOffset
    placed: int
    words: tuple[str, ...]


def place_readings(
    readings: xr.Dataset,
    trajectory: Trajectory,
    *,
    light: ArrayLike,
    offset_s: float | None = None,
    mount: ArrayLike = (0.0, 0.0, 0.0),
    alignment: Alignment | None = None,
    expected: ExpectedLight | None = None,
    longest_gap_s: float = LONGEST_GAP_S,
) -> Placement:
    """Give each reading the place where the sensor was.

    Parameters
    ----------
    readings : xarray.Dataset
        With times.
    trajectory : Trajectory
        Of the robot, in its own frame and by its own clock.
    light : (reading, channel) float
        Signal by which the clocks are compared: irradiance or counts.
    offset_s : float, optional
        Added to the readings' times to get the robot's; estimated if left out. [s]
    mount : (3,) float
        Place of the sensor on the robot: forward, left, up of the point that the poses are of. [m]
    alignment : Alignment, optional
        Of the robot's frame to the scan's.
    expected : callable, optional
        Light of a map at positions in the scan's frame; decides between offsets that the drive alone leaves open.
    longest_gap_s : float
        Longest time between poses over which a place is interpolated. [s]

    Returns
    -------
    placement : Placement

    Raises
    ------
    ReadingError
        If the readings have no times, none lies within the drive, or the place of the sensor on the robot asks for
        headings that the poses lack.
    """
    arm = float_array(mount, name="place of the sensor on the robot", shape=(3,))
    if arm[:2].any() and not trajectory.has_headings:
        raise ReadingError(
            expected="poses with headings, for a sensor that is not above the point that the poses are of",
            found=f"none, and a sensor {arm[0]:g} m before and {arm[1]:g} m left of it",
            where="place of the sensor on the robot",
            todo="Give the poses a column yaw [rad], yaw_deg, or qx, qy, qz and qw.",
        )
    times = readings["unix_s"].to_numpy()
    if not np.isfinite(times).any():
        raise ReadingError(
            expected="readings with times",
            found="none has one",
            where=readings.attrs.get("source", "readings"),
            todo="Record with 'lidarspectra sensor record', which dates every reading.",
        )
    if offset_s is None:
        drive = trajectory
        if alignment is not None:
            drive = trajectory.moved(alignment.rotation, alignment.translation, frame="scan")
        offset = estimate_time_offset(times, light, drive, longest_gap_s=longest_gap_s, expected=expected)
    else:
        offset = given_offset(offset_s)
    driven = (times + offset.seconds >= trajectory.unix_s[0]) & (times + offset.seconds <= trajectory.unix_s[-1])
    place, heading = trajectory.at(times + offset.seconds, longest_gap_s=longest_gap_s)
    c, s = np.cos(heading), np.sin(heading)
    turned = np.stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], np.full_like(c, arm[2])], axis=1)
    place = place + turned
    words = [offset.words]
    if alignment is not None:
        place = alignment.apply(place)
        words.append(alignment.words())
    placed = int(np.isfinite(place).all(axis=1).sum())
    between = int((driven & ~np.isfinite(place).all(axis=1)).sum())
    seldom = f"{between} of {times.size} readings lie between poses more than {longest_gap_s:g} s apart"
    if not placed and between:
        raise ReadingError(
            expected="poses that say where the robot was",
            found=seldom,
            where=readings.attrs.get("source", "readings"),
            todo="Record /odom beside /amcl_pose, which comes only as the robot moves.",
        )
    if not placed:
        shifted = "" if offset_s is None else f", shifted by {offset_s:g} s"
        raise ReadingError(
            expected="readings taken during the drive",
            found=f"readings from {np.nanmin(times):.0f} to {np.nanmax(times):.0f} s{shifted}, poses from"
            f" {trajectory.unix_s[0]:.0f} to {trajectory.unix_s[-1]:.0f} s (unix time)",
            where=readings.attrs.get("source", "readings"),
            todo="Check both clocks and their time zones; --offset shifts the readings' times by hand.",
        )
    words.append(f"{placed} of {times.size} readings lie within the drive")
    if between:
        words.append(f"{seldom}, where the place is not known: record /odom beside /amcl_pose")
    moved = readings.assign_coords({name: ("reading", place[:, i], {"units": "m"}) for i, name in enumerate(POSITION)})
    return Placement(readings=moved, offset=offset, placed=placed, words=tuple(words))


def read_locations(path: Path) -> FloatArray:
    """Read the locations of a map: a CSV with columns x, y and z, such as the points file or the map of a run.

    Returns
    -------
    locations : (location, 3) float
        [m]

    Raises
    ------
    ReadingError
        If it cannot be read or has no such columns.
    """
    return locations_of(location_table(path), path)


def location_table(path: Path) -> pd.DataFrame:
    """A table of locations with all its columns; raises ReadingError as `read_locations`."""
    try:
        return read_readings(path, needs_places=False)
    except MapError as cause:
        raise ReadingError(expected=cause.expected, found=cause.found, where=cause.where, todo="Mend it.") from cause


def locations_of(table: pd.DataFrame, path: Path) -> FloatArray:
    """(location, 3) places of a table's rows [m]; raises ReadingError at a gap."""
    numbers = table[list(POSITION)].to_numpy(np.float64)
    bare = [name for name, column in zip(POSITION, numbers.T, strict=True) if np.isnan(column).all()]
    if bare:
        raise ReadingError(
            expected="columns x, y, z [m]", found=f"no number in {', '.join(bare)}", where=str(path),
            todo="Name them so.",
        )  # fmt: skip
    gaps = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if gaps.size:
        raise ReadingError(
            expected="numbers in every row", found="a gap", where=f"{path}, row {gaps[0] + 1}", todo="Mend that row."
        )
    return np.asarray(numbers)


def grid_readings(light: xr.Dataset, locations: ArrayLike, *, radius_m: float | None = None) -> xr.Dataset:
    """Average readings at locations: each reading counts for the nearest location of its storey within the radius.

    Of locations one above the other it is the one nearest to it in height.

    Parameters
    ----------
    light : xarray.Dataset
        From `calibrated_light.spectral_irradiance`, with places.
    locations : (location, 3) float
        [m]
    radius_m : float, optional
        How far from a location, on the floor, a reading may be; half the distance between neighbouring locations by
        default, at most 0.25 m. [m]

    Returns
    -------
    gridded : xarray.Dataset
        irradiance, irradiance_se (point, channel) [W/m²/nm], NaN where nothing was read; readings (point,) how many;
        distance (point,) mean distance of those from the location [m]; x, y, z; the attribute heights_apart_m, by how
        much the readings are higher than their locations, in the median [m]. irradiance_se combines the readings'
        scatter over √n with their own uncertainty, which is not divided by √n because they share most of it.

    Raises
    ------
    ReadingError
        If no reading is near any location.
    """
    wanted = float_array(locations, name="locations", shape=(None, 3))
    places = np.stack([light[name].to_numpy() for name in POSITION], axis=1)
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    radius = radius_m if radius_m is not None else min(DEFAULT_RADIUS_M, 0.5 * median_spacing(wanted))
    nearest, distance = _nearest(places[known], wanted)
    near = distance <= radius
    if not near.any():
        raise ReadingError(
            expected=f"readings within {radius:.2f} m of a location",
            found=f"the nearest is {distance.min():.2f} m away" if distance.size else "no reading with a place",
            where="gridding",
            todo="Check that both are in the scan's frame ('lidarspectra sensor join --align'), or widen --radius.",
        )
    rows, points, distance = known[near], nearest[near], distance[near]
    values = light["irradiance"].to_numpy()[rows]
    errors = light["irradiance_se"].to_numpy()[rows]
    mean, scatter, count = _grouped(values, points, wanted.shape[0])
    own, _, _ = _grouped(errors, points, wanted.shape[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        total = np.hypot(np.where(count > 1, scatter / np.sqrt(count), 0.0), own)
    visits = np.bincount(points, minlength=wanted.shape[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.bincount(points, weights=distance, minlength=wanted.shape[0]) / visits
    return xr.Dataset(
        {
            "irradiance": (("point", "channel"), mean, {"units": "W m-2 nm-1"}),
            "irradiance_se": (("point", "channel"), total, {"units": "W m-2 nm-1"}),
            "readings": ("point", visits),
            "distance": ("point", far, {"units": "m"}),
        },
        coords={
            **{name: ("point", wanted[:, i], {"units": "m"}) for i, name in enumerate(POSITION)},
            "wavelength_nm": ("channel", light["wavelength_nm"].to_numpy()),
        },
        attrs={
            **light.attrs,
            "radius_m": radius,
            "heights_apart_m": float(np.median(places[rows, 2] - wanted[points, 2])),
        },
    )


def median_spacing(locations: FloatArray) -> float:
    """Median distance on the floor from a location to its nearest neighbour of its storey; not to one above it [m]."""
    distance = np.linalg.norm(locations[:, None, :2] - locations[None, :, :2], axis=2)
    storey = _storeys(locations)
    distance[(distance < SAME_PLACE_M) | (storey[:, None] != storey)] = np.inf
    nearest = distance.min(axis=1)
    return float(np.median(nearest[np.isfinite(nearest)])) if np.isfinite(nearest).any() else 2.0 * DEFAULT_RADIUS_M


def storeys_of(places: FloatArray, locations: FloatArray) -> tuple[IntArray, IntArray]:
    """Numbers of the storeys of locations, from below, and of the one that each place lies in or nearest to.

    Parameters
    ----------
    places, locations : (n, 3) float
        One location at least. [m]

    Returns
    -------
    of_place : (place,) int
    of_location : (location,) int
    """
    of_location = _storeys(locations)
    heights = [locations[of_location == number, 2] for number in range(of_location.max() + 1)]
    apart = [np.maximum(low.min() - places[:, 2], places[:, 2] - low.max()) for low in heights]
    return np.argmin(np.maximum(apart, 0.0), axis=0).astype(np.int64), of_location


def _storeys(locations: FloatArray) -> IntArray:
    """(location,) number of the storey, from below."""
    order = np.argsort(locations[:, 2], kind="stable")
    storey = np.empty(len(locations), dtype=np.int64)
    storey[order] = np.concatenate([[0], np.cumsum(np.diff(locations[order, 2]) > STOREY_M)])
    return storey


def _nearest(places: FloatArray, locations: FloatArray) -> tuple[IntArray, FloatArray]:
    """Index of the location of its storey that is nearest to each place on the floor, and how far it is there [m]."""
    from scipy.spatial import cKDTree

    index, distance = np.zeros(len(places), dtype=np.int64), np.zeros(len(places))
    if not len(places):
        return index, distance
    of_place, of_location = storeys_of(places, locations)
    for number in np.unique(of_place):
        rows, own = np.flatnonzero(of_place == number), np.flatnonzero(of_location == number)
        some = np.arange(1, min(MAX_STACKED, own.size) + 1)
        away, found = cKDTree(locations[own, :2]).query(places[rows, :2], k=some)
        off = np.abs(locations[own[found], 2] - places[rows, None, 2])
        best = np.argmin(np.where(away <= away[:, :1] + SAME_PLACE_M, off, np.inf), axis=1)
        index[rows], distance[rows] = own[found[np.arange(rows.size), best]], away[np.arange(rows.size), best]
    return index, distance


def _grouped(values: FloatArray, group: IntArray, groups: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean, sample standard deviation and count of values by group and channel, NaN left out."""
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    count, total, squares = (np.zeros((groups, values.shape[1])) for _ in range(3))
    np.add.at(count, group, known)
    np.add.at(total, group, filled)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = total / count
        np.add.at(squares, group, np.where(known, values - mean[group], 0.0) ** 2)
        deviation = np.sqrt(squares / (count - 1.0))
    return mean, np.where(count > 1, deviation, 0.0), count


def measured_table(gridded: xr.Dataset, *, normal: ArrayLike = UP) -> pd.DataFrame:
    """Table of a measured map, in the columns of a simulated one, for the comparison of the two.

    Parameters
    ----------
    gridded : xarray.Dataset
        From `grid_readings`.
    normal : (3,) float
        Viewing direction of the sensor.

    Returns
    -------
    table : pandas.DataFrame
        x, y, z, nx, ny, nz, buried, E_410 ..., SE_410 ... [W/m²/nm], readings; locations without any are left out,
        channels of which no location has a value likewise.
    """
    visited = gridded["readings"].to_numpy() > 0
    direction = float_array(normal, name="direction of the sensor", shape=(3,))
    columns: dict[str, ArrayLike] = {name: gridded[name].to_numpy()[visited] for name in POSITION}
    n = int(visited.sum())
    columns |= {f"n{axis}": np.full(n, direction[i]) for i, axis in enumerate(POSITION)}
    columns["buried"] = np.zeros(n, dtype=np.int64)
    known = np.isfinite(gridded["irradiance"].to_numpy()[visited]).any(axis=0)
    for prefix, name in (("E", "irradiance"), ("SE", "irradiance_se")):
        values = gridded[name].to_numpy()[visited]
        columns |= {f"{prefix}_{label}": values[:, c] for c, label in enumerate(CHANNEL_LABELS) if known[c]}
    columns["readings"] = gridded["readings"].to_numpy()[visited]
    return pd.DataFrame(columns)


def write_measured(gridded: xr.Dataset, path: Path) -> int:
    """Write `measured_table` as CSV, whole or not at all; returns the number of locations in it.

    Raises
    ------
    ReadingError
        If it cannot be written.
    """
    table = measured_table(gridded)
    with writing(path, error=ReadingError):
        write_whole(path, table.to_csv(index=False, float_format="%.9g", lineterminator="\n"))
    return len(table)
