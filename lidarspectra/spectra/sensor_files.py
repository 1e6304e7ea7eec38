"""The channels of any sensor: presets by name, or a user's CSV file of centres and widths, or of response curves.

center_nm,fwhm_nm            wavelength_nm,blue,green,red
450,25                       400,0.02,0,0
525,30                       405,0.05,0,0
"""

from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ArrayError, DatabaseError
from lidarspectra.io.csv_cells import csv_rows
from lidarspectra.spectra.spectrum import BandSet, gaussian_bands, sensor_bands, uniform_bands
from lidarspectra.spectra.spectrum_files import LONGEST_NM, SHORTEST_NM, finite_number, read_text

PRESETS = ("as7265x-14", "as7265x-18", "full-spectrum")
FULL_SPECTRUM_NM = (380.0, 780.0)  # [nm] the range in which lamps and surfaces are commonly measured
FULL_SPECTRUM_STEP_NM = 5.0  # [nm] CIE 15:2018, 7.1.1: sufficient for colorimetry
WAVELENGTH, CENTER, WIDTH = "wavelength_nm", "center_nm", "fwhm_nm"
MAX_CHANNELS = 200  # with the two limits below, responses fit into memory
MIN_WIDTH_NM = 0.5  # [nm]
GRID_STEP_NM = 1.0  # [nm] response curves are interpolated to it


def find_bands(device: str, base: Path) -> BandSet:
    """Channels of the sensor that a run file names.

    Parameters
    ----------
    device : str
        'as7265x-14', 'as7265x-18', 'full-spectrum' (80 channels of 5 nm from 380 to 780 nm), or a CSV file: see the
        module's text.
    base : Path
        Where relative file names start.

    Returns
    -------
    bands : BandSet
        By ascending centre. Of a response curve, the centre is the response-weighted mean wavelength, and the width
        that of a rectangle of the same area and peak.

    Raises
    ------
    DatabaseError
        If the device is unknown or the file malformed.
    """
    if device == "full-spectrum":
        first, last = FULL_SPECTRUM_NM
        return uniform_bands(first, last, round((last - first) / FULL_SPECTRUM_STEP_NM))
    if device in PRESETS:
        return sensor_bands(device)
    if not device.lower().endswith(".csv"):
        raise DatabaseError(
            expected=f"a sensor ({', '.join(PRESETS)}) or a .csv file",
            found=f"'{device}'",
            where="sensors.device",
            todo="docs/run-file.md shows the two forms of such a file.",
        )
    path = base / device
    header, columns = _numbers(path)
    try:
        if header[:2] == [CENTER, WIDTH]:
            order = np.argsort(columns[:, 0])
            _check_channels(columns[:, 0], columns[:, 1], name=path.stem)
            return gaussian_bands(path.stem, columns[order, 0], columns[order, 1])
        if header[0] == WAVELENGTH and len(header) > 1:
            return _measured_bands(path.stem, columns)
    except ArrayError as cause:
        raise DatabaseError(
            expected=f"up to {MAX_CHANNELS} channels with ascending centres, positive widths and responses, within "
            f"{SHORTEST_NM:g} to {LONGEST_NM:g} nm",
            found=cause.found,
            where=str(path),
        ) from cause
    raise DatabaseError(
        expected=f"a header '{CENTER},{WIDTH}' or '{WAVELENGTH},CHANNEL,...'",
        found=",".join(header[:4]),
        where=str(path),
    )


def _measured_bands(name: str, columns: FloatArray) -> BandSet:
    wavelengths = columns[:, 0]
    if len(wavelengths) < 2 or np.any(np.diff(wavelengths) <= 0):
        raise ArrayError(expected="ascending wavelengths", found="wavelengths out of order", where=name)
    if wavelengths[0] < SHORTEST_NM or wavelengths[-1] > LONGEST_NM or columns.shape[1] - 1 > MAX_CHANNELS:
        found = f"{columns.shape[1] - 1} from {wavelengths[0]:g} to {wavelengths[-1]:g} nm"
        raise ArrayError(expected="channels of light", found=found, where=name)
    grid = np.arange(wavelengths[0], wavelengths[-1] + GRID_STEP_NM / 2, GRID_STEP_NM)
    responses = np.stack([np.interp(grid, wavelengths, column) for column in columns[:, 1:].T])
    total = responses.sum(axis=1)
    if np.any(responses < 0) or np.any(total <= 0):
        raise ArrayError(expected="positive responses", found="a channel with negative or no response", where=name)
    centers = responses @ grid / total
    order = np.argsort(centers)
    return BandSet(
        name=name,
        centers_nm=centers[order],
        widths_nm=(GRID_STEP_NM * total / responses.max(axis=1))[order],
        wavelengths_nm=grid,
        responses=responses[order],
    )


def _check_channels(centers: FloatArray, widths: FloatArray, *, name: str) -> None:
    """Refuse channels whose responses would fill the memory."""
    within = (centers >= SHORTEST_NM) & (centers <= LONGEST_NM) & (widths >= MIN_WIDTH_NM) & (widths <= centers)
    if not within.all() or centers.size > MAX_CHANNELS:
        found = f"{centers.size}, {int((~within).sum())} of them beyond, or not {MIN_WIDTH_NM:g} nm to a centre wide"
        raise ArrayError(expected="channels of light", found=found, where=name)


def _numbers(path: Path) -> tuple[list[str], FloatArray]:
    """Header and numbers of a CSV file; '#' starts a comment."""
    rows = list(csv_rows(line for line in read_text(path).splitlines() if line.strip() and not line.startswith("#")))
    if len(rows) < 2:
        raise DatabaseError(expected="a header and at least one row", found=f"{len(rows)} rows", where=str(path))
    header = [cell.strip() for cell in rows[0]]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise DatabaseError(
                expected=f"{len(header)} cells", found=f"{len(row)}", where=f"{path}, row {number} after comments"
            )
    values = [
        [finite_number(cell, where=f"{path}, row {number} after comments") for cell in row]
        for number, row in enumerate(rows[1:], start=2)
    ]
    return header, np.array(values, dtype=np.float64)
