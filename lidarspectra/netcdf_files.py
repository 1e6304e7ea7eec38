"""Open a NetCDF-4 file that may be anything: whatever its libraries trip over comes out as one kind of error."""

from pathlib import Path

import h5py
import numpy as np
import xarray as xr

LARGEST_VALUE = 1e30  # [1] of any physical number here; beyond it squares overflow
_FAULTS = (
    OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RuntimeError, NotImplementedError,
    OverflowError, MemoryError,
)  # fmt: skip  # what xarray, h5netcdf and h5py raise on damaged files


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
        with h5py.File(path, "r"):  # h5netcdf leaves half an object, and its complaint, where this fails
            pass
        with xr.open_dataset(path, engine="h5netcdf", phony_dims="sort", decode_times=False) as opened:
            return opened.load()
    except _FAULTS as cause:
        raise ValueError(" ".join(f"{type(cause).__name__}: {cause}".split())) from cause


def check_numbers(dataset: xr.Dataset, name: str, dims: tuple[str, ...]) -> None:
    """Hold a variable to its dims, and its numbers to finite ones of a physical size.

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
