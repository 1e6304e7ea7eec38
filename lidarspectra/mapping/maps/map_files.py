"""A spectral map as NetCDF and as a table."""

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LidarSpectraError, MapError
from lidarspectra.io.netcdf import read_netcdf, write_netcdf
from lidarspectra.mapping.maps.assumptions import ASSUMED, assumptions_of
from lidarspectra.mapping.maps.map_schema import DIRECTION, POSITION, check_map, has_illuminance, listed, map_dataset
from lidarspectra.spectra.spectrum import BandSet

MAP_FILE, MAP_TABLE_FILE = "map.nc", "map.csv"  # in the folder of a run's map stage, and of a relighting
_LUX_COLUMNS = {"illuminance": "illuminance_lx", "illuminance_se": "SE_illuminance_lx"}  # of the table
_UNCERTAIN_LUX_COLUMN = "SD_illuminance_lx"


def save_map(dataset: xr.Dataset, path: str | PathLike[str]) -> Path:
    """Write a spectral map as NetCDF-4, atomically.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    path : str or path
        map.nc, for instance.

    Returns
    -------
    path : Path

    Raises
    ------
    MapError
        If the Dataset is not a spectral map.
    WorkspaceError
        If the file cannot be written.
    """
    path = path_of(path, name="path")
    checked = check_map(dataset, where="map to save")
    encoding = {name: {"zlib": True, "complevel": 4} for name in checked.data_vars}
    write_netcdf(checked, path, encoding=encoding)
    return path


def load_map(path: str | PathLike[str]) -> xr.Dataset:
    """Read a spectral map that a run wrote (`6-map/map.nc`), or `save_map`.

    Parameters
    ----------
    path : str or path
        NetCDF-4.

    Returns
    -------
    map : xarray.Dataset
        (point, band) irradiance and irradiance_se [W m-2 nm-1] with their coordinates: see the module docstring.

    Raises
    ------
    MapError
        If the file is missing, or holds no spectral map in NetCDF-4.
    """
    path = path_of(path, name="path", meaning="the name of a map's file (map.nc), as a str or a Path")
    todo = "A run's map is RUN/6-map/map.nc; make it again if it is damaged."
    with _reported(path, expected="a spectral map in NetCDF-4", todo=todo):
        dataset = read_netcdf(path)
    return check_map(dataset, where=str(path))


def map_table(dataset: xr.Dataset) -> pd.DataFrame:
    """A spectral map as a wide table, one row per point.

    Returns
    -------
    table : pandas.DataFrame
        x, y, z [m], nx, ny, nz [1], buried (0 or 1), E_410 ... and their standard errors SE_410 ... [W/m²/nm]; where
        the bands tell it illuminance_lx and SE_illuminance_lx [lx]; where the map states its uncertainty
        SD_illuminance_lx [lx] and SD_410 ... [W/m²/nm]; where the map rests on guesses assumed, in every
        row what is assumed: 'flux and spectrum of 2 lamps; the ceiling'.
    """
    checked = check_map(dataset, where="map to tabulate")
    columns: dict[str, ArrayLike] = {name: checked[name].to_numpy() for name in (*POSITION, *DIRECTION)}
    columns["buried"] = checked["buried"].to_numpy().astype(np.int64)
    for prefix, name in (("E", "irradiance"), ("SE", "irradiance_se")):
        values = checked[name].to_numpy()
        columns |= {f"{prefix}_{label}": values[:, b] for b, label in enumerate(checked["band_label"].to_numpy())}
    if has_illuminance(checked):
        columns |= {column: checked[name].to_numpy() for name, column in _LUX_COLUMNS.items()}
    if "illuminance_sd" in checked:
        columns[_UNCERTAIN_LUX_COLUMN] = checked["illuminance_sd"].to_numpy()
    if "irradiance_sd" in checked:
        values = checked["irradiance_sd"].to_numpy()
        columns |= {f"SD_{label}": values[:, b] for b, label in enumerate(checked["band_label"].to_numpy())}
    table = pd.DataFrame(columns)
    if assumed := assumptions_of(checked).in_words("; "):  # without commas, for who splits lines at them
        table[ASSUMED] = assumed
    return table


def save_map_table(dataset: xr.Dataset, path: str | PathLike[str]) -> Path:
    """Write `map_table` as CSV with nine significant digits.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    path : str or path
        map.csv, for instance.

    Returns
    -------
    path : Path

    Raises
    ------
    MapError
        If the Dataset is not a spectral map, or the file cannot be written.
    """
    path = path_of(path, name="path")
    table = map_table(dataset)
    with _reported(path, expected="a file that can be written", todo="Choose a folder that you may write to."):
        table.to_csv(path, index=False, float_format="%.9g", encoding="utf-8", lineterminator="\n")
    return path


def read_map_table(path: Path, *, bands: BandSet) -> xr.Dataset:
    """Read a map from the CSV of `save_map_table`; channels are found by their column names, never by position.

    Parameters
    ----------
    path : Path
        The CSV.
    bands : BandSet
        Its channels; each needs its columns E_<label> and SE_<label>.

    Raises
    ------
    MapError
        If the file cannot be read, a column is missing or is not numeric.
    """
    with _reported(path, expected="a map table (CSV)", todo="Export the map again."):
        table = pd.read_csv(path, encoding="utf-8")
    columns = [*POSITION, *DIRECTION, "buried", *(f"{kind}_{label}" for kind in ("E", "SE") for label in bands.labels)]
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise MapError(expected=f"a column '{missing[0]}'", found=f"columns {listed(table.columns)}", where=str(path))
    for name in columns:
        _numbers_of(table, name, path)
    values = {
        name: table[[f"{kind}_{label}" for label in bands.labels]].to_numpy(np.float64)
        for kind, name in (("E", "irradiance"), ("SE", "irradiance_se"))
    }
    if set(_LUX_COLUMNS.values()) <= set(table.columns):
        values |= {name: _numbers_of(table, column, path) for name, column in _LUX_COLUMNS.items()}
    if _UNCERTAIN_LUX_COLUMN in table.columns:
        values["illuminance_sd"] = _numbers_of(table, _UNCERTAIN_LUX_COLUMN, path)
    if {f"SD_{label}" for label in bands.labels} <= set(table.columns):
        values["irradiance_sd"] = np.stack([_numbers_of(table, f"SD_{label}", path) for label in bands.labels], axis=1)
    source = xr.Dataset(
        coords={name: ("point", table[name].to_numpy(np.float64)) for name in (*POSITION, *DIRECTION)}
        | {
            "buried": ("point", table["buried"].to_numpy() != 0),
            "band": ("band", bands.centers_nm),
            "band_width": ("band", bands.widths_nm),
            "band_label": ("band", list(bands.labels)),
        }
    )
    return check_map(map_dataset(values, source), where=str(path))


def _numbers_of(table: pd.DataFrame, column: str, path: Path) -> FloatArray:
    if not pd.api.types.is_numeric_dtype(table[column]):
        raise MapError(expected="numbers only", found="other text", where=f"{path}, column '{column}'")
    return table[column].to_numpy(np.float64)


@contextmanager
def _reported(path: Path, *, expected: str, todo: str) -> Iterator[None]:
    """Turn what file libraries raise into one error of ours."""
    try:
        yield
    except LidarSpectraError:
        raise
    except (OSError, ValueError, KeyError, RuntimeError, TypeError) as cause:
        raise MapError(
            expected=expected, found=str(cause) or type(cause).__name__, where=str(path), todo=todo
        ) from cause
