"""Reference spectra for calibration, from a spectrometer's or lamp's file, and light from a simulated map."""

import re
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.robot.robot import location_table, locations_of, storeys_of
from lidarspectra.hardware.robot.time_offset import ExpectedLight
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.calibration import reference_bands
from lidarspectra.spectra.spectrum_files import read_spectrum_file

UNIT_SCALES = {
    "W/m2/nm": 1.0,
    "mW/m2/nm": 1e-3,
    "uW/m2/nm": 1e-6,
    "W/cm2/nm": 1e4,
    "mW/cm2/nm": 10.0,
    "uW/cm2/nm": 0.01,
}
"""Known units, in W/m²/nm."""
MAX_DISTANCE_M = 1.0  # [m] from a sensor to the map's point whose light it is said to have: a map's wide spacing
MIN_DISTANCE_M = 0.02  # [m] a place nearer than this to a point of the map gets that point's light

_UNIT = re.compile(r"(?P<prefix>[mu]?)W[/. ]?(?P<area>c?m)(?:\^?-?2)[/. ]?nm(?:\^?-1)?")


def unit_scale(words: str) -> float | None:
    """Factor to W/m²/nm of the unit that a heading names, or None."""
    plain = (
        words.replace("²", "2")
        .replace("⁻", "-")
        .replace("¹", "1")
        .replace("µ", "u")
        .replace("μ", "u")
        .replace("·", ".")
    )
    match = _UNIT.search(plain)
    return UNIT_SCALES[f"{match['prefix']}W/{match['area']}2/nm"] if match is not None else None


def reference_from_file(path: Path, *, unit: str | None = None) -> FloatArray:
    """Band values of a reference spectrum in the sensor's 18 channels.

    Parameters
    ----------
    path : Path
        Two columns, wavelength [nm] and spectral irradiance.
    unit : str, optional
        One of `UNIT_SCALES`; else that of the file's heading.

    Returns
    -------
    reference : (18,) float
        [W/m²/nm]

    Raises
    ------
    ReadingError
        If the unit is not known.
    DatabaseError
        If the file is not a spectrum.
    """
    file = read_spectrum_file(path)
    scale = UNIT_SCALES.get(unit) if unit is not None else unit_scale(file.unit)
    if scale is None:
        raise ReadingError(
            expected=f"a spectral irradiance in one of {', '.join(UNIT_SCALES)}",
            found=f"'{unit or file.unit}'",
            where=str(path),
            todo="Name the unit in the heading of the second column, or give --unit.",
        )
    return reference_bands(file.spectrum.scaled(scale))


def simulated_light_at(path: Path, place: tuple[float, float, float]) -> tuple[FloatArray, float]:
    """Spectral irradiance of a simulated map at the point nearest to a place.

    Parameters
    ----------
    path : Path
        Map table of a run, with columns x, y, z and E_410 ... [W/m²/nm].
    place : tuple of 3 float
        [m]

    Returns
    -------
    light : (18,) float
        Zero for channels that the map does not have. [W/m²/nm]
    distance : float
        From the place to that point. [m]

    Raises
    ------
    ReadingError
        If the file has no such columns, or no point near the place.
    """
    positions, values = read_map(path)
    distance = np.linalg.norm(positions - np.array(place), axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] > MAX_DISTANCE_M:
        at = ", ".join(f"{value:.2f}" for value in positions[nearest])
        raise ReadingError(
            expected=f"a place within {MAX_DISTANCE_M:g} m of a point of the map, in the scan's frame",
            found=f"the nearest point at ({at}) m, {distance[nearest]:.2f} m away",
            where=str(path),
            todo="Give the place of one of the map's points, x y z in metres.",
        )
    return np.nan_to_num(values[nearest]), float(distance[nearest])


def read_map(path: Path) -> tuple[FloatArray, FloatArray]:
    """Positions (point, 3) [m] and spectral irradiance (point, 18) [W/m²/nm] of a map table; NaN for absent channels.

    Points inside furniture (`buried`), whose values mean nothing, are left out.

    Raises
    ------
    ReadingError
        If the file has no such columns.
    """
    table = location_table(path)
    positions = locations_of(table, path)
    values = np.full((len(table), len(CHANNEL_LABELS)), np.nan)
    for c, label in enumerate(CHANNEL_LABELS):
        if f"E_{label}" in table.columns:
            values[:, c] = table[f"E_{label}"]
    if not np.isfinite(values).any():
        raise ReadingError(
            expected="columns E_410, E_435, ... [W/m²/nm]",
            found=", ".join(map(str, table.columns)),
            where=str(path),
            todo="Give the map table of a run.",
        )
    if "buried" in table.columns:
        is_free = (table["buried"] == 0).to_numpy()
        if not is_free.any():
            raise ReadingError(
                expected="a point that is not buried in furniture", found="none", where=str(path),
                todo="Give the map of a run whose points stand in the room.",
            )  # fmt: skip
        positions, values = positions[is_free], values[is_free]
    return positions, values


def map_light(path: Path) -> ExpectedLight:
    """Light of a map table at any place: of the four nearest points of its storey, by inverse square distance there.

    Raises
    ------
    ReadingError
        See `read_map`.
    """
    from scipy.spatial import cKDTree

    positions, values = read_map(path)

    def at(places: FloatArray) -> FloatArray:
        found = np.full((len(places), values.shape[1]), np.nan)
        of_place, of_point = storeys_of(places, positions)
        for storey in np.unique(of_place):
            own, rows = np.flatnonzero(of_point == storey), np.flatnonzero(of_place == storey)
            tree, count = cKDTree(positions[own, :2]), min(4, own.size)
            distance, index = tree.query(places[rows, :2], k=np.arange(1, count + 1))
            weight = 1.0 / np.maximum(distance, MIN_DISTANCE_M) ** 2
            light = (values[own[index]] * weight[..., None]).sum(axis=1)
            found[rows] = light / weight.sum(axis=1, keepdims=True)
        return found

    return at
