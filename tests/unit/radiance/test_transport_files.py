"""Reading transports back: what is no transport is refused with a clear word."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import WorkspaceError
from lidarspectra.radiance.sampling.transport import SCHEMA, load_transport, save_transport


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="Run the trace stage again"):
        load_transport(tmp_path / "none.nc")


def test_a_damaged_file_is_said(tmp_path: Path) -> None:
    path = tmp_path / "transport.nc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 100)
    with pytest.raises(WorkspaceError, match="NetCDF"):
        load_transport(path)


def test_another_dataset_is_no_transport(tmp_path: Path) -> None:
    path = tmp_path / "other.nc"
    xr.Dataset({"a": ("x", np.ones(3))}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(WorkspaceError, match=SCHEMA):
        load_transport(path)


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="can be written"):
        save_transport(xr.Dataset({"a": ("x", np.ones(3))}), tmp_path / "none" / "transport.nc")
