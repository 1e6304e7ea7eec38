"""Reading transports back: what is no transport is refused with a clear word."""

from collections import Counter
from pathlib import Path
from unittest.mock import patch

import h5py
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


def small_transport() -> xr.Dataset:
    """One lamp, two points, two channels, of which the second was traced in two slots."""
    variables: dict[str, tuple[tuple[str, ...], np.ndarray]] = {
        name: (("lamp", "point", "band"), np.ones((1, 2, 2))) for name in ("coefficient", "coefficient_se")
    }
    variables |= {"flux": (("lamp", "band"), np.ones((1, 2))), "irradiance_se": (("point", "band"), np.ones((2, 2)))}
    variables |= {
        "slot_coefficient": (("lamp", "point", "slot"), np.ones((1, 2, 3))),
        "slot_flux": (("lamp", "slot"), np.ones((1, 3))),
        "slot_share": (("slot",), np.array([1.0, 0.4, 0.6])),
        "slot_channel": (("slot",), np.array([0, 1, 1])),
        "slot_weights": (("slot", "wavelength"), np.full((3, 4), 0.25)),
        "slot_reflectance": (("lamp", "slot"), np.full((1, 3), 0.5)),
        "mean_reflectance": (("wavelength",), np.full(4, 0.5)),
    }
    return xr.Dataset(variables, attrs={"schema": SCHEMA})


def test_a_transport_with_its_slots_is_read_back(tmp_path: Path) -> None:
    path = save_transport(small_transport(), tmp_path / "transport.nc")
    np.testing.assert_array_equal(load_transport(path)["slot_channel"].to_numpy(), [0, 1, 1])


@pytest.mark.parametrize(
    ("name", "damage"),
    [("slot_share", None), ("slot_flux", np.nan), ("slot_coefficient", np.inf), ("slot_channel", 2)],
)
def test_damaged_slots_are_said(tmp_path: Path, name: str, damage: float | None) -> None:
    transport = small_transport()
    if damage is None:
        transport = transport.drop_vars(name)
    else:
        values = transport[name].to_numpy().copy()
        values.flat[0] = damage
        transport[name] = (transport[name].dims, values)
    path = save_transport(transport, tmp_path / "transport.nc")
    with pytest.raises(WorkspaceError, match=name):
        load_transport(path)


def test_a_file_s_variables_are_opened_once_each(tmp_path: Path) -> None:
    """Not forty times, as h5netcdf asks for them by name: that took most of the time in which a run is read."""
    path = save_transport(small_transport(), tmp_path / "transport.nc")
    with patch.object(h5py.File, "__getitem__", autospec=True, side_effect=h5py.File.__getitem__) as opened:
        load_transport(path)
    names = Counter(call.args[1] for call in opened.call_args_list)
    assert names["/slot_weights"] == 1
    assert max(names.values()) == 1
