"""Fingerprints: readings of fixed sensors with a person at known places; one schema for traced and real readings.

A table is an xarray Dataset with the dims (fingerprint, sensor, band) and axis (x, y, z):

    irradiance        (fingerprint, sensor, band)  [W m-2 nm-1]  traced readings with the person there; or, instead,
    counts            (fingerprint, sensor, band)  [count]       readings of real sensors; NaN where one is missing
    irradiance_se     (fingerprint, sensor, band)  its standard error; for counts this, empty and empty_se are optional
    empty, empty_se   (sensor, band)               the same room with nobody in it
    position_m        (fingerprint, axis)  [m]     where the person stands, on the floor; NaN where it is not known
    label             (fingerprint,)               name of the position; several fingerprints may share it
    time_s            (fingerprint,)       [s]     optional: when a real reading was taken, from any origin
    height_m yaw_deg draw posture build upper lower hair skin   (fingerprint,)   optional: the person who was drawn
    sensor            (sensor,)                    name
    sensor_position_m, sensor_direction (sensor, axis)  optional [m, 1]
    band, band_width  (band,)              [nm]    centre and full width at half maximum
    band_label        (band,)                      short name

Readings with the person and without come from the same traced paths, so that their errors are correlated and their
difference is far more accurate than either: `effect_se` (fingerprint, sensor, band) is the standard error of irradiance
- empty, where it is known. `check_fingerprints` validates this schema wherever a table is made or read.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.errors import MapError
from lidarspectra.io.netcdf import read_netcdf, write_netcdf
from lidarspectra.spectra.spectrum import BandSet

SCHEMA = "lidarspectra fingerprints 1"
FINGERPRINTS_FILE = "fingerprints.nc"
Quantity = Literal["irradiance", "counts"]
UNITS: dict[Quantity, str] = {"irradiance": "W m-2 nm-1", "counts": "count"}
AXES = ("x", "y", "z")
READING = ("fingerprint", "sensor", "band")
EMPTY = ("sensor", "band")

_COORDINATES: dict[str, tuple[tuple[str, ...], str | None, str]] = {  # name: (dims, unit, long name)
    "position_m": (("fingerprint", "axis"), "m", "place of the person, on the floor"),
    "label": (("fingerprint",), None, "name of the position"),
    "sensor": (("sensor",), None, "name of the sensor"),
    "axis": (("axis",), None, "axis"),
    "band": (("band",), "nm", "centre wavelength"),
    "band_width": (("band",), "nm", "full width at half maximum"),
    "band_label": (("band",), None, "short name of the channel"),
}
_OPTIONAL: dict[str, tuple[tuple[str, ...], str | None, str]] = {
    "time_s": (("fingerprint",), "s", "time of the reading"),
    "draw": (("fingerprint",), "1", "number of the person who was drawn at the position"),
    "height_m": (("fingerprint",), "m", "height of the person"),
    "yaw_deg": (("fingerprint",), "degree", "direction that the person faces in plan, from x towards y"),
    "build": (("fingerprint",), "1", "girth of the person against the average of that height"),
    "posture": (("fingerprint",), None, "standing, sitting, ..."),
    "upper": (("fingerprint",), None, "reflectance of the upper clothes"),
    "lower": (("fingerprint",), None, "reflectance of the lower clothes"),
    "hair": (("fingerprint",), None, "reflectance of the hair"),
    "skin": (("fingerprint",), None, "reflectance of the skin"),
    "sensor_position_m": (("sensor", "axis"), "m", "place of the sensor"),
    "sensor_direction": (("sensor", "axis"), "1", "direction that the sensor faces"),
}


def make_fingerprints(
    readings: ArrayLike,
    *,
    quantity: Quantity,
    labels: Sequence[str],
    positions_m: ArrayLike,
    sensors: Sequence[str],
    bands: BandSet,
    readings_se: ArrayLike | None = None,
    effect_se: ArrayLike | None = None,
    empty: ArrayLike | None = None,
    empty_se: ArrayLike | None = None,
    extra: Mapping[str, ArrayLike] | None = None,
    attributes: Mapping[str, str | int | float] | None = None,
) -> xr.Dataset:
    """Put readings into a table (see the module's text).

    Parameters
    ----------
    readings : (fingerprint, sensor, band) float
        [W/m²/nm] or counts.
    quantity : 'irradiance' or 'counts'
        What they are.
    labels : sequence of str
        Name of the position of each fingerprint.
    positions_m : (fingerprint, 3) float
        NaN where it is not known. [m]
    sensors : sequence of str
        Names.
    bands : BandSet
    readings_se, effect_se : (fingerprint, sensor, band) float, optional
        Standard errors of the readings, and of their difference from `empty`.
    empty, empty_se : (sensor, band) float, optional
        Readings with nobody in the room, and their standard error.
    extra : mapping of str to array, optional
        Optional coordinates of the schema, by name.
    attributes : mapping, optional
        How the table was made.

    Returns
    -------
    table : xarray.Dataset

    Raises
    ------
    MapError
        If something does not fit the schema.
    """
    data: dict[str, ArrayLike | None] = {
        quantity: readings,
        f"{quantity}_se": readings_se,
        "effect_se": effect_se,
        "empty": empty,
        "empty_se": empty_se,
    }
    coordinates: dict[str, ArrayLike] = {
        "position_m": positions_m,
        "label": list(labels),
        "sensor": list(sensors),
        "axis": list(AXES),
        "band": bands.centers_nm,
        "band_width": bands.widths_nm,
        "band_label": list(bands.labels),
        **(extra or {}),
    }
    known = _COORDINATES | _OPTIONAL
    for name in coordinates:
        if name not in known:
            raise MapError(expected=f"one of {', '.join(_OPTIONAL)}", found=f"'{name}'", where="fingerprints")
    variables = _variables(quantity)
    try:
        table = xr.Dataset(
            {name: _variable(*variables[name], values) for name, values in data.items() if values is not None},
            {name: _variable(*known[name], values) for name, values in coordinates.items()},
            {**(attributes or {}), "Conventions": "CF-1.11", "schema": SCHEMA},
        )
    except ValueError as cause:  # xarray names the dim whose lengths differ
        raise MapError(expected="arrays that fit together", found=str(cause), where="fingerprints") from cause
    return check_fingerprints(table, where="fingerprints")


def quantity_of(table: xr.Dataset) -> Quantity:
    """Whether a table holds irradiances or counts.

    Raises
    ------
    MapError
        If it holds neither, or both.
    """
    found: list[Quantity] = [name for name in UNITS if name in table]
    if len(found) != 1:
        raise MapError(expected="readings, as 'irradiance' or as 'counts'", found=f"{found}", where="fingerprints")
    return found[0]


def check_fingerprints(table: xr.Dataset, *, where: str) -> xr.Dataset:
    """Validate a Dataset against the schema.

    Parameters
    ----------
    table : xarray.Dataset
        What should be a table of fingerprints.
    where : str
        File or step, for the error.

    Returns
    -------
    table : xarray.Dataset
        The same, its variables in (fingerprint, sensor, band) order.

    Raises
    ------
    MapError
        If a variable is missing, has other dims or units, or holds invalid values: an irradiance or an empty room's
        reading that is not finite, an infinite count, a negative error, a position that is only partly known, names of
        sensors that are not unique, bands that do not ascend.
    """
    quantity = quantity_of(table)
    variables = _variables(quantity)
    needed = {quantity, *_COORDINATES}
    if quantity == "irradiance":
        needed |= {"irradiance_se", "empty", "empty_se"}
    for name, (dims, unit, _) in (_COORDINATES | _OPTIONAL | variables).items():
        if name not in table.variables:
            if name in needed:
                raise MapError(expected=f"'{name}'", found="none", where=where)
            continue
        if set(table[name].dims) != set(dims):
            raise MapError(expected=f"'{name}' over {dims}", found=f"{table[name].dims}", where=where)
        if unit is not None and table[name].attrs.get("units") != unit:
            found = f"unit {table[name].attrs.get('units')!r}"
            raise MapError(expected=f"'{name}' in {unit}", found=found, where=where)
    ordered = table.transpose(*READING, "axis", missing_dims="ignore")
    _check_numbers(ordered, quantity, where)
    return ordered


def save_fingerprints(table: xr.Dataset, path: Path) -> Path:
    """Write a table as NetCDF-4, whole or not at all.

    Raises
    ------
    MapError
        If it does not fit the schema.
    WorkspaceError
        If the file cannot be written.
    """
    table = check_fingerprints(table, where=str(path))
    encoding = {name: {"zlib": True, "complevel": 1} for name in table.data_vars}
    write_netcdf(table, path, encoding=encoding)
    return path


def load_fingerprints(path: Path) -> xr.Dataset:
    """Read a table that `save_fingerprints` wrote.

    Raises
    ------
    MapError
        If the file is missing, damaged, or no table of fingerprints.
    """
    try:
        table = read_netcdf(path)
    except ValueError as cause:
        raise MapError(expected="fingerprints in NetCDF-4", found=str(cause), where=str(path)) from cause
    if table.attrs.get("schema") != SCHEMA:
        raise MapError(
            expected=f"a file of schema '{SCHEMA}'", found=f"schema {table.attrs.get('schema')!r}", where=str(path)
        )
    return check_fingerprints(table, where=str(path))


def _variables(quantity: Quantity) -> dict[str, tuple[tuple[str, ...], str | None, str]]:
    unit = UNITS[quantity]
    return {
        quantity: (READING, unit, "readings with the person there"),
        f"{quantity}_se": (READING, unit, "standard error of the readings"),
        "effect_se": (READING, unit, "standard error of the difference from the empty room"),
        "empty": (EMPTY, unit, "readings with nobody in the room"),
        "empty_se": (EMPTY, unit, "standard error of the readings with nobody in the room"),
    }


def _variable(dims: tuple[str, ...], unit: str | None, text: str, values: ArrayLike) -> Any:
    array = np.asarray(values)
    if array.ndim != len(dims):
        raise MapError(expected=f"'{text}' over {dims}", found=f"shape {array.shape}", where="fingerprints")
    attributes = {"long_name": text} | ({} if unit is None else {"units": unit})
    return (dims, array, attributes)


def _check_numbers(table: xr.Dataset, quantity: Quantity, where: str) -> None:
    finite = ["irradiance", "irradiance_se", "empty", "empty_se", "effect_se", "band", "band_width"]
    for name in finite:
        if name in table.variables and not np.isfinite(table[name].to_numpy()).all():
            raise MapError(expected="finite numbers", found=f"NaN or infinity in '{name}'", where=where)
    if np.isinf(table[quantity].to_numpy()).any():
        raise MapError(expected="finite readings, or NaN for missing ones", found="infinite ones", where=where)
    for name in (f"{quantity}_se", "effect_se", "empty_se"):
        if name in table.variables and (table[name].to_numpy() < 0).any():
            raise MapError(expected="standard errors of 0 or more", found=f"negative ones in '{name}'", where=where)
    places = table["position_m"].to_numpy()
    known = np.isfinite(places)
    if places.shape[1:] != (3,) or (known.any(axis=1) != known.all(axis=1)).any():
        raise MapError(expected="positions of three numbers, all known or all NaN", found="others", where=where)
    names = table["sensor"].to_numpy()
    if len(set(names.tolist())) != names.size:
        raise MapError(expected="a name of its own for each sensor", found="one that is used twice", where=where)
    if not (np.diff(table["band"].to_numpy()) > 0).all():
        raise MapError(expected="bands in ascending order", found="others", where=where)
    if 0 in table[quantity].shape:
        raise MapError(expected="one reading or more", found=f"shape {table[quantity].shape}", where=where)
