"""What the campaign once found, in the smallest file that shows it."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from pyldt import Ldt, LdtHeader, LdtWriter

from lidarspectra.errors import (
    DatabaseError,
    LampError,
    LidarSpectraError,
    MapError,
    MaterialError,
    ReadingError,
    ScanError,
    SensorError,
)
from lidarspectra.hardware.phone.raw_mesh import FileFolder
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.robot.poses import read_poses
from lidarspectra.hardware.robot.reference_files import read_map
from lidarspectra.hardware.sensor.calibration_files import read_calibration
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log
from lidarspectra.hardware.sensor.reading_log import FORMAT_LINE, LogWriter
from lidarspectra.hardware.sensor.sensor_records import Moment, Reading
from lidarspectra.io.hdf5_heaps import HEAD, ITEM, SIGNATURE, check_heaps
from lidarspectra.io.netcdf import read_netcdf
from lidarspectra.lamps.ies import read_ies
from lidarspectra.lamps.ldt import ies_text_of_ldt
from lidarspectra.mapping.photometry.schedule import parse_hours
from lidarspectra.material.segmentation.segmentation import Classifier
from lidarspectra.radiance.sampling.receptors import read_receptor
from lidarspectra.spectra.database_files import read_manifest
from lidarspectra.spectra.databases import import_lspdd
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum_files import read_spectrum_file

MANY = "1" * 400


@pytest.mark.parametrize(
    ("read", "text"),
    [
        (lambda path: import_lspdd([path]), '{"a":' * 100_000),
        (read_calibration, "[" * 100_000),
        (lambda path: find_bands(path.name, path.parent), "center_nm,fwhm_nm\n460,4294967295\n"),
        (lambda path: find_bands(path.name, path.parent), "center_nm,fwhm_nm\n460,1e-9\n"),
        (read_spectrum_file, "nm,W/nm\n400,1e999\n500,1\n"),
        (read_sensor_log, f"{FORMAT_LINE}\nkind,utc\nreading,now\n"),
        (read_poses, f"header:\n  stamp:\n    sec: 1\n    nanosec: {MANY}\n---\n"),
    ],
)
def test_a_file_that_asks_too_much_is_refused(tmp_path: Path, read: Callable[[Path], object], text: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises((DatabaseError, ReadingError)):
        read(path)


def test_numbers_of_too_many_digits_are_no_hours_and_no_candela() -> None:
    with pytest.raises(MapError):
        parse_hours(f"8:{MANY}-17")
    with pytest.raises(LampError, match="the number 1e99"):
        read_ies("TILT=NONE\n1 -1 1e99 2 1 1 2 1 1 0 1 1 1 0 90 0 1e99 1e99", where="a.ies")


@pytest.mark.parametrize("name", ["CON", "nul.png", "a/COM1.mtl", "x" * 10_000, "\ud800.png", "aux .jpg"])
def test_names_that_no_system_has_a_file_of_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ScanError):
        FileFolder(root=tmp_path, where="a.obj").read(name)


def test_a_usd_file_with_infinite_positions_is_refused_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    points = "(inf, 0, 0), (-inf, 1, 0), (0, 1, nan), (0, 0, 1)"
    text = (
        '#usda 1.0\n( upAxis = "Z"\n metersPerUnit = 1 )\ndef Mesh "m" {\n'
        f"point3f[] points = [{points}]\n"
        "int[] faceVertexCounts = [3, 3]\nint[] faceVertexIndices = [0, 1, 2, 0, 2, 3]\n"
        'double3 xformOp:scale = (2, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n}\n'
    )
    path = tmp_path / "a.usda"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ScanError, match="finite positions"):
        read_scan(path)


def test_a_model_whose_names_are_no_text_is_refused(tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx", reason="onnx writes the model")
    node = onnx.helper.make_node("Identity", ["x"], ["y"])
    ends = [
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, 3, "height", "width"]) for name in "xy"
    ]
    model = onnx.helper.make_model(
        onnx.helper.make_graph([node], "g", ends[:1], ends[1:]),
        opset_imports=[onnx.helper.make_opsetid("", 13)], ir_version=8,
    )  # fmt: skip
    (tmp_path / "model.onnx").write_bytes(model.SerializeToString().replace(b"height", b"\xd3eight"))
    (tmp_path / "model.toml").write_text('classes = ["wood", "tile", "metal"]\ninput_px = 16\nstride_px = 8\n')
    with pytest.raises(MaterialError, match="no text"):
        Classifier(tmp_path / "model.onnx")


@pytest.mark.parametrize("count", ["inf", "nan", "3.5", '"3"'])
def test_a_manifest_counts_in_whole_numbers(tmp_path: Path, count: str) -> None:
    words = "".join(f'{key} = "a"\n' for key in ("path", "title", "source", "licence", "grid", "provenance", "sha256"))
    (tmp_path / "MANIFEST.toml").write_text(f"[[file]]\n{words}count = {count}\n", encoding="utf-8")
    with pytest.raises(DatabaseError, match="a manifest with path"):
        read_manifest(tmp_path, database=None)


@pytest.mark.parametrize(("rows", "words"), [("", "no response"), ("0,1,45,1,90,0\n", "two numbers a row")])
def test_a_receptor_of_no_rows_or_of_long_ones_is_refused(tmp_path: Path, rows: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(f"angle_deg,response\n{rows}", encoding="utf-8")
    with pytest.raises(SensorError, match=words):
        read_receptor(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("column", "damage"), [("flags", "0-0"), ("flags", "0" * 19), ("lost", "many"), ("lost", "9" * 400)]
)
def test_a_row_of_a_log_with_damaged_flags_or_counts_is_a_broken_one(tmp_path: Path, column: str, damage: str) -> None:
    with LogWriter(tmp_path / "log.csv") as writer:
        writer.head(["protocol = test"])
        for number in range(3):
            moment = Moment(unix_s=1.7e9 + number, monotonic_s=float(number))
            reading = Reading(
                moment=moment, counts=np.arange(18.0), module_values=np.full(18, np.nan),
                flags=np.zeros(18, dtype=np.uint8), gain=16.0, integration_ms=165.2,
                temperatures_c=(25.0, 25.0, 25.0), boot=1, sequence=number, device_ms=1000 * number,
            )  # fmt: skip
            writer.write([reading], moment)
    lines = (tmp_path / "log.csv").read_text(encoding="utf-8").splitlines()
    (header,) = (line for line in lines if line.startswith("kind,utc"))
    cells = lines[-1].split(",")
    cells[header.split(",").index(column)] = damage
    (tmp_path / "log.csv").write_text("\n".join([*lines[:-1], ",".join(cells)]) + "\n", encoding="utf-8")
    log = read_sensor_log(tmp_path / "log.csv")
    assert log.readings.sizes["reading"] == 2
    assert log.readings.attrs["broken_lines"] == "1"


def test_a_column_that_only_begins_like_a_channels_is_none(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("time,count,410\n2023-04-20T14:36:08Z,1,2\n", encoding="utf-8")
    with pytest.raises(ReadingError):
        read_sensor_log(tmp_path / "log.csv")


@pytest.mark.parametrize("row", [f"a,{MANY},1", f"1,1,{MANY}"])
def test_a_map_table_with_a_number_of_hundreds_of_digits_is_refused(tmp_path: Path, row: str) -> None:
    rows = "".join(f"{cells},0.3\n" for cells in (row, "2,2,1"))
    (tmp_path / "map.csv").write_text(f"x,y,E_410,z\n{rows}", encoding="utf-8")
    with pytest.raises(ReadingError, match=r"reading 1: expected numbers, found '(a|1{30})'"):
        read_map(tmp_path / "map.csv")


def test_a_netcdf_file_with_two_fill_values_is_refused_without_a_warning(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        numbers = file.create_dataset("ny", data=np.ones(4))
        numbers.attrs["_FillValue"] = np.array([1, 2])
    with pytest.raises(ValueError, match="multiple fill values"):
        read_netcdf(tmp_path / "a.nc")


@pytest.mark.parametrize(("axes", "chunks"), [([0], None), ([], (1, 3))])
def test_a_netcdf_file_whose_array_has_other_axes_than_dims_is_refused(
    tmp_path: Path, axes: list[int], chunks: tuple[int, int] | None
) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        for number, (name, values) in enumerate({"x": np.zeros(2), "v": np.zeros((2, 3))}.items()):
            made = file.create_dataset(name, data=values, chunks=chunks if name == "v" else None)
            made.make_scale(name)
            made.attrs["_Netcdf4Dimid"] = np.int32(number)
        file["v"].attrs["_Netcdf4Coordinates"] = np.array(axes, dtype=np.int32)
    with pytest.raises(ValueError, match=r"axes|Assertion"):
        read_netcdf(tmp_path / "a.nc")


def test_a_netcdf_file_on_which_hdf5_never_ends_is_refused(tmp_path: Path) -> None:
    xr.Dataset({"name": ("lamp", np.array(["one", "two"], dtype=object))}).to_netcdf(
        tmp_path / "a.nc", engine="h5netcdf"
    )
    check_heaps(tmp_path / "a.nc")
    data = bytearray((tmp_path / "a.nc").read_bytes())
    at = data.index(SIGNATURE) + HEAD.size
    while ITEM.unpack_from(data, at)[0] > 0:
        at += ITEM.size + -(-ITEM.unpack_from(data, at)[3] // 8) * 8
    ITEM.pack_into(data, at, 0, 0, 0, 0)  # what is free has no size now
    (tmp_path / "a.nc").write_bytes(data)
    with pytest.raises(ValueError, match="free space of no size"):
        read_netcdf(tmp_path / "a.nc")


def test_a_message_is_one_paragraph_whatever_words_it_repeats() -> None:
    error = LidarSpectraError(expected="a name", found="\x1b[2J" + "x" * 10_000 + "\n\u202eabc", where="a\nb")
    assert str(error).isprintable()
    assert len(str(error)) < 1_200


@pytest.mark.parametrize(("line", "damage"), [("271", "inf"), ("271", "nan"), ("1", "inf")])
def test_a_luminaire_of_planes_or_factors_without_bound_is_refused_without_a_warning(
    tmp_path: Path, line: str, damage: str
) -> None:
    header = LdtHeader(
        company="Ours", ityp=2, isym=0, mc=4, dc=90.0, ng=4, dg=30.0, luminaire_name="One", length=1200.0, width=300.0,
        length_lum_area=1180.0, width_lum_area=280.0, n_sets=2, num_lamps=[2, 2], lamp_types=["LED"] * 2,
        lamp_flux=[3000.0] * 2, lamp_cct=["4000"] * 2, lamp_cri=["80"] * 2, lamp_watt=[25.0] * 2,
        direct_ratios=[0.0] * 10, c_angles=[0.0, 90.0, 180.0, 271.0], g_angles=[0.0, 30.0, 60.0, 90.0],
    )  # fmt: skip
    path = tmp_path / "a.ldt"
    LdtWriter.write(Ldt(header=header, intensities=[[300.0, 200.0, 100.0, 0.0]] * 4), path)
    lines = path.read_text(encoding="latin-1").splitlines()
    (where,) = (number for number, words in enumerate(lines) if words == line)
    lines[where] = damage
    path.write_text("\n".join(lines), encoding="latin-1")
    with pytest.raises(LampError):
        ies_text_of_ldt(path)


def test_a_luminaire_of_a_billion_lamp_sets_is_refused_at_once(tmp_path: Path) -> None:
    lines = ["Ours", "1", "1", "1", "0", "4", "0", "", "", "", "", ""]  # up to the first size
    path = tmp_path / "a.ldt"
    path.write_text("\n".join([*lines, *["1"] * 13, "1000000000", "1"]), encoding="utf-8")
    with pytest.raises(LampError, match="number of lamp sets"):
        ies_text_of_ldt(path)
