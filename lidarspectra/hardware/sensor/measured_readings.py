"""Readings of a room in a file: places and channels, as irradiance, as µW/cm², or as plain counts."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError, ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_LABELS,
    DIE_INDEX,
    GAUSSIAN_WIDTH_NM,
    UW_CM2_TO_W_M2,
    basic_counts,
    channel_letter,
    mask_counts,
    nominal_responsivity,
    require_gains,
)
from lidarspectra.hardware.sensor.log_text import log_text
from lidarspectra.io.csv_cells import delimiter_of, read_table

Unit = Literal["W/m2/nm", "uW/cm2", "counts"]
Scale = Literal["none", "one", "die", "channel"]
SETTINGS = ("gain", "integration_ms")  # columns that make the counts of different rows comparable
NUMBERS = ("x", "y", "z", "nx", "ny", "nz", "buried", *SETTINGS)  # columns that must be numeric
LUX_COLUMNS = ("lux", "lx", "illuminance", "illuminance_lx")  # the first of them that a table has
WORDS = (*NUMBERS, "name", *LUX_COLUMNS, "current_mA")  # known in any case of letters
NAMES = ("name", "sensor", "label")  # columns whose cells are words, whatever they say
CHANNELS = ("E_", "SE_")  # how columns of channels and of their uncertainties begin


def read_readings(measured: Path, *, needs_places: bool = True) -> pd.DataFrame:
    """A table of readings with places.

    Parameters
    ----------
    measured : Path
        CSV as pandas or Excel writes it: between commas, semicolons or tabs, with decimal points or commas, in UTF-8,
        UTF-16 or Windows' coding; lines that begin with '#' are left out.
    needs_places : bool
        Whether x, y, z must be there; they are NaN otherwise.

    Returns
    -------
    table : pandas.DataFrame

    Raises
    ------
    MapError
        If it cannot be read, has no x, y, z, or holds words where numbers belong.
    """
    try:
        table = _table_of(log_text(measured))
    except (ReadingError, ValueError) as cause:  # pandas' parser errors are ValueErrors
        found = cause.found if isinstance(cause, ReadingError) else str(cause)
        raise MapError(expected="a readable CSV of readings", found=found, where=str(measured)) from cause
    if table.empty:
        raise MapError(expected="readings, one a row below the header", found="none", where=str(measured))
    table = table.rename(columns=_known_words(table.columns))
    missing = [name for name in ("x", "y", "z") if name not in table.columns]
    if missing and not needs_places:
        table = table.assign(**dict.fromkeys(missing, np.nan))
    elif missing:
        raise MapError(
            expected="columns x, y, z in metres, in the scan's frame",
            found=", ".join(map(str, table.columns[:8])),
            where=str(measured),
            todo="'lidarspectra sensor join' gives readings their places.",
        )
    _require_numbers(
        table, [name for name in map(str, table) if name in NUMBERS or name.startswith(CHANNELS)], measured
    )
    return table


def _known_words(columns: pd.Index) -> dict[str, str]:
    """Headings without blanks around them, and known words as they are known: 'X' is x, 'Lux' is lux."""
    bare = {name: str(name).strip() for name in columns}
    known = {word.lower(): word for word in WORDS}
    taken = set(bare.values())
    for name, text in bare.items():
        word = known.get(text.lower(), text)
        if word not in taken:
            bare[name] = word
            taken.add(word)
    return bare


def _table_of(text: str) -> pd.DataFrame:
    """A table between commas, semicolons or tabs; where commas part no cells they may be decimal signs."""
    lines = [line for line in text.split("\n") if line.strip() and not line.startswith("#")]
    delimiter = delimiter_of(lines[0]) if lines else ","
    has_commas = delimiter != "," and any(re.search(r"\d,\d", line) for line in lines)
    # A '#' further on is no comment: pandas would cut the row of 'desk #2' there, and lose its numbers.
    return read_table("\n".join(lines), NAMES, sep=delimiter, decimal="," if has_commas else ".")


def _require_numbers(table: pd.DataFrame, columns: Sequence[str], measured: Path) -> None:
    for name in columns:
        if not pd.api.types.is_numeric_dtype(table[name]):
            wrong = table[name].notna() & ~np.isfinite(_coerced(table[name]))
            row = int(np.argmax(wrong.to_numpy()))
            word = str(table[name].iloc[row])
            where = f"{measured}, column '{name}', reading {row + 1}"
            raise MapError(expected="numbers", found=f"'{word[:30]}'", where=where)


def _coerced(column: "pd.Series[float]") -> "pd.Series[float]":
    """A column's numbers, NaN where it has words."""
    try:
        return pd.to_numeric(column, errors="coerce")
    except OverflowError:  # pandas reads a whole number of hundreds of digits, and cannot make it a float
        return pd.to_numeric(column.astype(str), errors="coerce")


def channel_columns(table: pd.DataFrame, labels: Sequence[str], unit: Unit) -> dict[int, str]:
    """Which column holds each of a map's channels.

    Parameters
    ----------
    table : pandas.DataFrame
    labels : sequence of str
        The map's channels, '410' and so on.
    unit : str
        Irradiance stands in E_410 ...; other units in any column that names a channel (A, 410, 410nm, A_410:count).

    Returns
    -------
    columns : dict of int to str
        By the channel's index; channels that the table lacks are not in it.
    """
    found = {index: f"E_{label}" for index, label in enumerate(labels) if f"E_{label}" in table.columns}
    if found or unit == "W/m2/nm":
        return found
    letters = {channel_letter(str(name).split(":")[0]): str(name) for name in table.columns}
    wanted = [channel_letter(label) for label in labels]
    return {index: letters[letter] for index, letter in enumerate(wanted) if letter is not None and letter in letters}


def lux_column(table: pd.DataFrame) -> str | None:
    """The column of illuminances [lx], if a table of readings has one."""
    return next((name for name in LUX_COLUMNS if name in table.columns), None)


def numbers_of(table: pd.DataFrame, column: str, where: Path) -> FloatArray:
    """(reading,) A column's numbers, NaN where a field is empty; raises MapError at a word."""
    values = _coerced(table[column])
    broken = ~np.isfinite(values) & table[column].notna()
    if broken.any():
        raise MapError(
            expected="a number",
            found=f"'{table[column][broken].iloc[0]}'",
            where=f"{where}, column '{column}', row {int(np.flatnonzero(broken)[0]) + 1}",
            todo="Write the reading as a plain number, with a point, or leave the field empty.",
        )
    return np.asarray(values, dtype=np.float64)


def irradiance_of(table: pd.DataFrame, columns: Sequence[str], unit: Unit, scale: Scale, where: Path) -> FloatArray:
    """Readings as spectral irradiance.

    µW/cm² are taken over a channel's Gaussian of 20 nm; counts over gain and integration time where the table has
    them, and by the data sheet's responsivity, which single sensors miss by a factor.

    Parameters
    ----------
    table : pandas.DataFrame
    columns : sequence of str
    unit, scale : str
    where : Path
        The file, for errors.

    Returns
    -------
    irradiance : (reading, channel) float
        NaN where a channel is missing or saturated. [W/m²/nm]

    Raises
    ------
    MapError
        If counts have no settings to be compared by, and no scale is fitted.
    ReadingError
        If a gain is none of the device.
    """
    _require_numbers(table, columns, where)
    values = table[list(columns)].to_numpy(dtype=np.float64)
    if unit == "W/m2/nm":
        return values
    if unit == "uW/cm2":
        return np.asarray(values * UW_CM2_TO_W_M2 / GAUSSIAN_WIDTH_NM, dtype=np.float64)
    counts, _ = mask_counts(values)
    if all(name in table.columns for name in SETTINGS):
        require_gains(table["gain"].to_numpy(dtype=np.float64), where=f"{where}, column 'gain'")
        counts = basic_counts(counts, table["gain"].to_numpy(), table["integration_ms"].to_numpy())
    elif scale == "none":
        raise MapError(
            expected=f"columns {' and '.join(SETTINGS)} beside counts, or a scale that is fitted",
            found="counts without them, which cannot be compared",
            where=str(where),
            todo="Give --scale one, die or channel if gain and integration time were the same in all readings.",
        )
    return np.asarray(counts / nominal_responsivity()[0], dtype=np.float64)


def fitted_factors(synthetic: FloatArray, real: FloatArray, scale: Scale, labels: Sequence[str]) -> FloatArray:
    """Least-squares factors on the readings, min Σ(syn - f real)²: none, one for all, one per die, or one per channel.

    Parameters
    ----------
    synthetic, real : (point, channel) float
        [W/m²/nm]
    scale : str
    labels : sequence of str
        Of the channels.

    Returns
    -------
    factors : (channel,) float
        [1]

    Raises
    ------
    MapError
        If a die is asked for of channels that are not the AS7265x's.
    """
    if scale == "none":
        return np.ones(real.shape[1])
    if scale == "channel":
        groups = np.arange(real.shape[1])
    elif scale == "one":
        groups = np.zeros(real.shape[1], dtype=np.int64)
    else:
        strangers = [label for label in labels if label not in CHANNEL_LABELS]
        if strangers:
            raise MapError(
                expected="channels of the AS7265x, which has three dies",
                found=", ".join(strangers),
                where="scale by die",
                todo="Give --scale one or channel.",
            )
        groups = DIE_INDEX[[CHANNEL_LABELS.index(label) for label in labels]]
    factors = np.empty(real.shape[1])
    for group in np.unique(groups):
        some = groups == group
        factors[some] = (synthetic[:, some] * real[:, some]).sum() / (real[:, some] ** 2).sum()
    return factors
