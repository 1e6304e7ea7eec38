"""Readings of a room in a file, as calibration takes them: places, directions, quantities and meters."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DIE_INDEX
from lidarspectra.hardware.sensor.measured_readings import (
    Scale,
    Unit,
    channel_columns,
    irradiance_of,
    lux_column,
    numbers_of,
    read_readings,
)
from lidarspectra.mapping.calibration.model import UNKNOWN_METER_SD, Observations

LUX = "illuminance"  # a quantity; the others are channels, by number, and the current of a cell
CURRENT = "current"
CURRENT_COLUMN = "current_mA"
NAME_COLUMN = "name"
CALIBRATED_SD = 0.03  # [1] of a meter's factor where it is calibrated
CHANNEL_SD = 0.05  # [1] of a calibrated spectral channel: its calibration, and the lamp's spectrum in it
Quantity = int | str


def unit_of(quantity: Quantity) -> str:
    """Unit of an illuminance, a cell's current or a channel."""
    return {LUX: "lx", CURRENT: "A"}.get(str(quantity), "W/m²/nm")


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """Readings of a room.

    Parameters
    ----------
    names : tuple of str
        Of each row: a place and a direction.
    positions, normals : (row, 3) float
        [m], and unit vectors.
    quantities : tuple of int or str
        Of each number: a channel, 'illuminance' or 'current'.
    numbers : Observations
        Values [W/m²/nm, lx or A], rows and meter factors.
    meters : tuple of str
        Names of the meter factors.
    meter_sd : (meter,) float
        Deviation of each one's logarithm. [1]
    notes : tuple of str
        What was left out, as full sentences.
    """

    names: tuple[str, ...]
    positions: FloatArray
    normals: FloatArray
    quantities: tuple[Quantity, ...]
    numbers: Observations
    meters: tuple[str, ...]
    meter_sd: FloatArray
    notes: tuple[str, ...] = ()


def calibration_readings(
    path: Path, labels: tuple[str, ...], *, unit: Unit = "W/m2/nm", scale: Scale = "none", has_cell: bool = False
) -> Readings:
    """Read the readings that a run is calibrated by.

    Parameters
    ----------
    path : Path
        CSV with x, y, z [m] in the scan's frame, nx, ny, nz where a sensor does not look up, and one or more of: lux,
        the channels E_410 ... [W/m²/nm] or columns in another unit that name a channel, current_mA of a cell. Empty
        fields are left out. A column 'name' names the rows.
    labels : tuple of str
        The run's channels.
    unit : str
        Of the channels.
    scale : 'none', 'one', 'die' or 'channel'
        Factors of the meter that are not known: none for a calibrated one; 'one' for a phone's lux meter.
    has_cell : bool
        Whether the cell is known whose current was read.

    Returns
    -------
    readings : Readings

    Raises
    ------
    MapError
        If there is no reading, or a table or a direction cannot be read.
    """
    table = read_readings(path)
    columns: dict[Quantity, FloatArray] = {}
    own_sd: dict[Quantity, FloatArray] = {}
    lux = lux_column(table)
    if lux is not None:
        columns[LUX] = numbers_of(table, lux, path)
    channels = channel_columns(table, labels, unit)
    if channels:
        light = irradiance_of(table, list(channels.values()), unit, "one" if scale == "none" else scale, path)
        columns |= {index: light[:, place] for place, index in enumerate(channels)}
        own_sd |= {index: _own_sd(table, name, unit) for index, name in channels.items()}
    if CURRENT_COLUMN in table.columns:
        columns[CURRENT] = _cell_currents(table, path, has_cell)
    if not columns:
        raise MapError(
            expected=f"a column lux, channels such as E_{labels[0]}, or {CURRENT_COLUMN}",
            found=", ".join(map(str, table.columns[:8])),
            where=str(path),
            todo="Name the column so; --unit says the unit of channels.",
        )
    if unit == "counts" and scale == "none" and channels:
        raise MapError(
            expected="a scale that is fitted, for counts",
            found="--scale none",
            where=str(path),
            todo="Give --scale one, die or channel: the factor of single sensors is not known.",
        )
    return _gathered(table, columns, own_sd, labels, scale, path)


def _own_sd(table: pd.DataFrame, name: str, unit: Unit) -> FloatArray:
    """(reading,) relative deviation of a channel's numbers beside what all of them share: whole counts, mostly.

    Of counts their rounding; of irradiances what the column SE_ has more than at its best known reading.
    """
    values = table[name].to_numpy(dtype=np.float64)
    error_column = f"S{name}"
    with np.errstate(divide="ignore", invalid="ignore"):
        if unit == "counts":
            return np.asarray(np.where(values > 0, 1.0 / np.sqrt(12.0) / values, 0.0))
        if error_column not in table.columns:
            return np.zeros(values.size)
        relative = table[error_column].to_numpy(dtype=np.float64) / np.where(values > 0, values, np.nan)
    known = np.isfinite(relative)
    least = float(relative[known].min()) if known.any() else 0.0
    return np.asarray(np.where(known, np.sqrt(np.maximum(relative**2 - least**2, 0.0)), 0.0))


def _gathered(
    table: pd.DataFrame,
    columns: dict[Quantity, FloatArray],
    own_sd: dict[Quantity, FloatArray],
    labels: tuple[str, ...],
    scale: Scale,
    path: Path,
) -> Readings:
    normals = _directions(table, path)
    meters, meter_of = _meters(tuple(columns), labels, scale)
    row, value, quantities, meter, own = [], [], [], [], []
    for quantity, values in columns.items():
        good = np.flatnonzero(np.isfinite(values) & (np.nan_to_num(values) > 0))
        row += good.tolist()
        value += values[good].tolist()
        quantities += [quantity] * good.size
        meter += [meter_of[quantity]] * good.size
        own += own_sd.get(quantity, np.zeros(values.size))[good].tolist()
    left_out = sum(int(np.isfinite(values).sum() - (np.nan_to_num(values) > 0).sum()) for values in columns.values())
    used = sorted(set(row))
    if not used:
        raise MapError(expected="readings above 0", found="none", where=str(path))
    places = table[["x", "y", "z"]].to_numpy(dtype=np.float64)
    nowhere = [index for index in used if not np.isfinite(places[index]).all()]
    if nowhere:
        raise MapError(
            expected="x, y and z of every reading",
            found="a place without a number",
            where=f"{path}, reading {nowhere[0] + 1}",
            todo="Write where it was read, in metres in the scan's frame, or leave the row out.",
        )
    names = table[NAME_COLUMN].tolist() if NAME_COLUMN in table.columns else [""] * len(table)
    return Readings(
        names=tuple(names[index] or f"row {index + 1}" for index in used),
        positions=places[used],
        normals=normals[used],
        quantities=tuple(quantities),
        numbers=Observations(
            value=np.array(value), row=np.searchsorted(used, row), meter=np.array(meter), own_sd=np.array(own)
        ),
        meters=tuple(name for name, _ in meters),
        meter_sd=np.array([sd for _, sd in meters]),
        notes=(f"{left_out} numbers of 0 or less are left out: a logarithm is fitted.",) if left_out else (),
    )


def _meters(
    quantities: tuple[Quantity, ...], labels: tuple[str, ...], scale: Scale
) -> tuple[list[tuple[str, float]], dict[Quantity, int]]:
    """Name and deviation of each meter factor, and which of them a quantity has."""
    meters: list[tuple[str, float]] = []
    meter_of: dict[Quantity, int] = {}
    for quantity in quantities:
        name, sd = _meter(quantity, labels, scale)
        if (name, sd) not in meters:
            meters.append((name, sd))
        meter_of[quantity] = meters.index((name, sd))
    return meters, meter_of


def _meter(quantity: Quantity, labels: tuple[str, ...], scale: Scale) -> tuple[str, float]:
    if isinstance(quantity, str):
        return f"{quantity} meter", UNKNOWN_METER_SD if scale != "none" else CALIBRATED_SD
    label = labels[quantity]
    if scale == "die" and label in CHANNEL_LABELS:
        return f"die {DIE_INDEX[CHANNEL_LABELS.index(label)] + 1}", UNKNOWN_METER_SD
    if scale == "one":
        return "sensor", UNKNOWN_METER_SD
    return f"channel {label}", CHANNEL_SD if scale == "none" else UNKNOWN_METER_SD


def _cell_currents(table: pd.DataFrame, path: Path, has_cell: bool) -> FloatArray:
    if not has_cell:
        raise MapError(
            expected="the cell whose current was read",
            found="none",
            where=f"{path}, column '{CURRENT_COLUMN}'",
            todo="Name it: --cell NAME, and --area in cm² where the database has none.",
        )
    return numbers_of(table, CURRENT_COLUMN, path) / 1000.0


def _directions(table: pd.DataFrame, path: Path) -> FloatArray:
    given = [name for name in ("nx", "ny", "nz") if name in table.columns]
    if not given:
        return np.tile([0.0, 0.0, 1.0], (len(table), 1))
    if len(given) < 3:
        raise MapError(
            expected="all of nx, ny and nz, or none", found=", ".join(given), where=str(path),
            todo="They are the direction that the sensor looks in: 0, 0, 1 is up.",
        )  # fmt: skip
    normals = np.stack([numbers_of(table, name, path) for name in given], axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not np.all(lengths > 0):
        row = int(np.flatnonzero(~(lengths[:, 0] > 0))[0])
        raise MapError(expected="a direction", found="0, 0, 0", where=f"{path}, row {row + 1}")
    return np.asarray(normals / lengths, dtype=np.float64)
