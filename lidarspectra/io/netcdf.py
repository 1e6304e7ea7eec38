"""NetCDF-4 files: reading of untrusted files, and atomic writing.

All errors of the libraries become one kind of error. Writing goes through memory, because HDF5 ends the process
when the disk is full.
"""

import io
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from lidarspectra.io.files import write_whole, writing
from lidarspectra.io.hdf5_heaps import check_heaps

LARGEST_VALUE = 1e30  # larger than any physical value here; beyond it squares overflow
_FAULTS = (
    OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RuntimeError, NotImplementedError,
    OverflowError, MemoryError, AssertionError, xr.SerializationWarning,
)  # fmt: skip  # what xarray, h5netcdf and h5py raise on damaged files


class _OpenedOnce(h5py.File):  # type: ignore[misc]  # h5py has no types
    """A file whose objects are opened once each: h5netcdf asks for every variable forty times, by its name."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "r")
        self._opened: dict[Any, Any] = {}

    def __getitem__(self, name: Any) -> Any:
        if name not in self._opened:
            self._opened[name] = super().__getitem__(name)
        return self._opened[name]


def read_netcdf(path: Path) -> xr.Dataset:
    """Read a NetCDF-4 file whole.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dataset : xarray.Dataset
        In memory; its text attributes are text, arrays of one element as attributes are numbers.

    Raises
    ------
    ValueError
        If it is missing, damaged or no NetCDF-4; the message says what was found.
    """
    try:
        check_heaps(path)
        with warnings.catch_warnings(), _OpenedOnce(path) as file:
            warnings.simplefilter("error", xr.SerializationWarning)  # of attributes that contradict one another
            with (
                h5netcdf.File(file, "r", phony_dims="sort", decode_vlen_strings=True) as netcdf,
                xr.open_dataset(xr.backends.H5NetCDFStore(netcdf), decode_times=False) as opened,
            ):
                dataset = opened.load()
    except _FAULTS as cause:
        raise ValueError(" ".join(f"{type(cause).__name__}: {cause}".split())) from cause
    for name, variable in dataset.variables.items():
        if len(variable.dims) != len(variable.shape):  # a damaged rank; xarray trips over it later
            raise ValueError(f"'{name}' with {len(variable.shape)} axes and {len(variable.dims)} dims")
    return dataset


def write_netcdf(dataset: xr.Dataset, path: Path, *, encoding: Mapping[Any, Any]) -> None:
    """Write a NetCDF-4 file atomically.

    Parameters
    ----------
    dataset : xarray.Dataset
    path : Path
    encoding : mapping
        As for `xarray.Dataset.to_netcdf`.

    Raises
    ------
    WorkspaceError
        If the file cannot be written.
    """
    packed = io.BytesIO()
    dataset.to_netcdf(packed, engine="h5netcdf", encoding=encoding)
    with writing(path):
        write_whole(path, packed.getbuffer())


def check_numbers(dataset: xr.Dataset, name: str, dims: tuple[str, ...]) -> None:
    """Check a variable's dims, and that its values are finite and of physical size.

    Raises
    ------
    ValueError
        If the variable is missing, of other dims, no numbers, or a number is NaN, infinite or above `LARGEST_VALUE`.
    """
    if name not in dataset.variables:
        raise ValueError(f"no '{name}'")
    variable = dataset[name]
    if set(variable.dims) != set(dims) or variable.dtype.kind not in "fiu":
        raise ValueError(f"'{name}' of {variable.dtype} with the dims ({', '.join(map(str, variable.dims))})")
    values = variable.to_numpy()
    if values.size and not (np.abs(values) <= LARGEST_VALUE).all():  # NaN compares false
        raise ValueError(f"'{name}' with numbers that are not finite, or above {LARGEST_VALUE:g}")
