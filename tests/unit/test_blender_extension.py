"""What the Blender extension does without Blender, held against the package that reads and writes the same files.

What needs Blender's Python is in `blender/tests` (`make test-blender`).
"""

import json
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

from blender.build import EXTENSION, build, check
from blender.extension import color_scale, frames, lamp_tables, material_table, process, room_file, sensor_points
from blender.extension.faults import ExtensionError
from blender.extension.run_file import changed_run_file, whole_text
from blender.extension.run_file_checks import checked_run_file, is_raw_data
from lidarspectra.config import RunFile
from lidarspectra.hardware.phone.orientation import METRES_PER_UNIT, upright_rotation
from lidarspectra.io.toml_sections import parse_sections
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.lamps.surfaces import Place
from lidarspectra.mapping.export.blender import BlenderRoom, Layer, save_blender_room
from lidarspectra.mapping.figures.plan_drawing import color_norm
from lidarspectra.material.assignments import read_assignments
from lidarspectra.material.material_map import Material
from lidarspectra.spectra.spectrum import Spectrum

ROOM = """# My room.
[scan]  # from the phone
file = "scan.glb"
unit = "cm"

# The one by the door.
[[lamps]]
name = "panel \\"west\\""
shape = "panel"
center = [0.85, 1.5, 2.61]
size = 0.6
cct_k = 4000
luminous_flux_lm = 3400.0
assumed = true

[[lamps]]  # far
name = "strip"
shape = "strip"
center = [2.25, 1.5, 2.61]
size = [1.2, 0.1]
spectrum = "LED-B3"
radiant_flux_W = 12.5

[trace]
noise = "draft"  # a first look

[sensors.grid]
height = 0.75
count = 20
"""


def lamps_of(text: str) -> list[dict[str, object]]:
    lamps: list[dict[str, object]] = tomllib.loads(text)["lamps"]
    return lamps


def is_run_file(text: str) -> RunFile:
    from lidarspectra.errors import RunFileError

    return parse_sections(RunFile, text, kind="run file", where="test", error=RunFileError, page="")


def test_a_run_file_that_did_not_change_is_written_as_it_was() -> None:
    content = tomllib.loads(ROOM)
    assert changed_run_file(ROOM, {"lamps": content["lamps"], "sensors": content["sensors"]}) == ROOM


def test_a_lamp_that_moved_changes_its_own_table_alone() -> None:
    lamps = lamps_of(ROOM)
    lamps[0]["center"] = [1.0, 1.5, 2.61]
    text = changed_run_file(ROOM, {"lamps": lamps})
    assert lamps_of(text) == lamps
    assert "# The one by the door." in text
    assert "# far" in text
    assert "# a first look" in text
    assert text.index("[trace]") > text.index("[[lamps]]  # far")
    assert is_run_file(text).lamps[0].center == (1.0, 1.5, 2.61)


def test_lamps_come_and_go_and_all_else_stays() -> None:
    new = {"name": "b\tulb", "shape": "bulb", "center": [1.0, 1.0, 1.0], "cct_k": 2700.0, "luminous_flux_lm": 800.0}
    text = changed_run_file(ROOM, {"lamps": [lamps_of(ROOM)[1], new], "materials": {"method": "default"}})
    assert [lamp["name"] for lamp in lamps_of(text)] == ["strip", "b\tulb"]
    assert tomllib.loads(text)["materials"] == {"method": "default"}
    assert tomllib.loads(text)["scan"] == tomllib.loads(ROOM)["scan"]
    assert "# from the phone" in text
    assert "lamps" not in tomllib.loads(changed_run_file(ROOM, {"lamps": []}))


def test_a_grid_gives_way_to_points_in_every_way_of_writing_it() -> None:
    inline = ROOM.replace(
        "[sensors.grid]\nheight = 0.75\ncount = 20", "[sensors]\ngrid = { height = 0.75, count = 20 }"
    )
    for text in (ROOM, inline):
        changed = is_run_file(changed_run_file(text, {"sensors": {"points": "my points.csv"}}))
        assert changed.sensors.points == "my points.csv"
        assert changed.sensors.grid is None


def test_a_text_that_cannot_be_cut_is_written_anew() -> None:
    tricky = ROOM.replace('noise = "draft"  # a first look', 'noise = """\n[[lamps]]\ndraft"""')
    lamps = lamps_of(tricky)
    lamps[0]["dim"] = 0.5
    changed = changed_run_file(tricky, {"lamps": lamps})
    assert lamps_of(changed) == lamps
    assert tomllib.loads(changed)["trace"] == tomllib.loads(tricky)["trace"]
    assert tomllib.loads(whole_text(tomllib.loads(ROOM))) == tomllib.loads(ROOM)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('shape = "strip"', 'shape = "pannel"', r"lamp 2 \('strip'\), shape: expected one of panel.*'pannel'"),
        ('name = "strip"', "", "lamp 2: expected a name, found none"),
        ("center = [2.25, 1.5, 2.61]", "", "center: expected 3 numbers, found none"),
        ("center = [2.25, 1.5, 2.61]", 'center = [2.25, "1.5", 2.61]', "center: expected 3 numbers"),
        ("size = 0.6", "size = [1, 2, 3]", "size: expected a number"),
        ("size = 0.6", "normal = [0, 0, 0]", "normal: expected a direction"),
        ("cct_k = 4000", 'cct_k = "warm"', "cct_k: expected a number"),
        ("cct_k = 4000", "cct_k = [4000]", "cct_k: expected a number"),
        ("[scan]", "[[scan]]", r"one table \[scan\], found several"),
        ('unit = "cm"', 'unit = "mile"', r"unit under \[scan\]"),
        ('file = "scan.glb"', "file = 3", "file: expected a text"),
        ("height = 0.75", 'height = "low"', r"height under \[sensors.grid\]"),
        ('[[lamps]]\nname = "panel', '[other]\nname = "panel', None),
    ],
)
def test_a_run_file_that_cannot_be_shown_is_refused_before_the_scene_changes(
    old: str, new: str, words: str | None
) -> None:
    assert checked_run_file(tomllib.loads(ROOM), "room.toml") == tomllib.loads(ROOM)
    assert old in ROOM
    content = tomllib.loads(ROOM.replace(old, new))
    if words is None:
        assert checked_run_file(content, "room.toml") == content  # tables that Blender does not know
        return
    with pytest.raises(ExtensionError, match=words):
        checked_run_file(content, "room.toml")


def test_raw_data_of_an_app_is_known_from_a_mesh_and_from_nothing(tmp_path: Path) -> None:
    for name in ("frames.zip", "scan.glb"):
        (tmp_path / name).write_bytes(b"")
    assert is_raw_data(tmp_path)
    assert is_raw_data(tmp_path / "frames.zip")
    assert not is_raw_data(tmp_path / "scan.glb")
    assert not is_raw_data(tmp_path / "none.zip")


def test_a_lamp_is_turned_as_the_package_turns_it_and_back() -> None:
    generator = np.random.default_rng(4)
    normals = [*generator.normal(size=(20, 3)), np.array([0, 0, -1.0]), np.array([1.0, 0, 0]), np.array([-1.0, 0, 0])]
    for normal in normals:
        unit, angle = normal / np.linalg.norm(normal), float(generator.uniform(-170, 170))
        place = Place.facing(np.zeros(3), unit, angle)
        length, width, same = lamp_tables.axes_of(normal, angle)
        assert length == pytest.approx(place.length, abs=1e-12)
        assert width == pytest.approx(place.width, abs=1e-12)
        assert same == pytest.approx(unit)
        assert lamp_tables.rotation_of(unit, length) == pytest.approx(angle, abs=1e-9)


def test_units_and_axes_are_those_of_the_package() -> None:
    assert frames.METRES == METRES_PER_UNIT
    for up, rows in frames.UPRIGHT.items():
        assert np.array_equal(upright_rotation(up), rows)  # type: ignore[arg-type]


def test_single_precision_changes_nothing_and_a_changed_flux_is_assumed_no_longer() -> None:
    original = lamps_of(ROOM)[0]
    single = {key: np.float32(value).item() for key, value in (("cct_k", 4000.0), ("luminous_flux_lm", 3400.0))}
    now = {"center": np.float32([0.85, 1.5, 2.61]).tolist(), "size": np.float32([0.6, 0.6]).tolist(), **single}
    assert lamp_tables.merged(original, {**now, "rotation_deg": 180.0, "dim": 1.0}) == original
    brighter = lamp_tables.merged(original, {**now, "luminous_flux_lm": np.float32(3512.7).item()})
    assert brighter["luminous_flux_lm"] == 3512.7
    assert brighter["assumed"] == ["spectrum"]
    known = lamp_tables.merged(brighter, {"cct_k": None, "spectrum": "LED-B1"})
    assert "assumed" not in known
    assert "cct_k" not in known
    assert lamp_tables.merged(original, {"center": [0.8501, 1.5, -0.0]})["center"] == [0.8501, 1.5, 0.0]


def test_a_grid_fills_the_face_that_was_chosen_and_no_more() -> None:
    square = np.array([[[0, 0, 1], [2, 0, 1], [2, 1, 1]], [[0, 0, 1], [2, 1, 1], [0, 1, 1]]], dtype=float)
    points = sensor_points.grid_on_triangles(square, np.array([0, 0, 1.0]), 0.25, 0.125)
    assert len(points) == 8 * 4
    assert points[:, 2] == pytest.approx(1.0)
    assert points.min(axis=0)[:2] == pytest.approx([0.125, 0.125])
    half = sensor_points.grid_on_triangles(square[:1], np.array([0, 0, 1.0]), 0.25, 0.125)
    assert 12 <= len(half) < 32
    assert (half[:, 1] <= half[:, 0] / 2 + 1e-9).all()
    assert len(sensor_points.grid_on_triangles(square[:1], np.array([0, 0, 1.0]), 50.0)) == 1
    with pytest.raises(ExtensionError, match="larger spacing"):
        sensor_points.grid_on_triangles(square, np.array([0, 0, 1.0]), 0.001)
    with pytest.raises(ExtensionError, match="Select faces"):
        sensor_points.grid_on_triangles(square[:0], np.zeros(3), 0.1)


def test_points_are_read_as_they_were_written_and_as_the_package_reads_them(tmp_path: Path) -> None:
    from lidarspectra.room.sensor_points import read_points

    points = np.array([[0.123456, 1.0, 2.0], [3.0, -0.0, 0.75]])
    normals = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    table = tmp_path / "a room-sensors.csv"
    table.write_text(sensor_points.points_table(points, normals), encoding="utf-8")
    again = sensor_points.read_points(table)
    assert again[0] == pytest.approx(points, abs=1e-5)
    assert again[1] == pytest.approx(normals)
    package = read_points(table)
    assert package[0] == pytest.approx(points, abs=1e-5)
    assert package[1] == pytest.approx(normals)
    with pytest.raises(ExtensionError, match="columns x, y, z"):
        sensor_points.read_points(tmp_path / "none.csv")
    far = points + [500_000.0, 5_000_000.0, 0.0]  # in a frame of a country
    table.write_text(sensor_points.points_table(far, normals), encoding="utf-8")
    assert sensor_points.read_points(table)[0] == pytest.approx(far, abs=1e-5)


def test_points_that_nobody_moved_stay_in_their_table_whatever_else_it_has(tmp_path: Path) -> None:
    table = tmp_path / "desks.csv"
    table.write_text("name;X;y;z;nx;ny;nz\ndesk 1;1,5;2;0,75;0;0;2\n;;;;;;\nNA;3;-4;0,75;1;0;0\n", encoding="utf-8")
    points, normals = sensor_points.read_points(table)
    assert points.tolist() == [[1.5, 2.0, 0.75], [3.0, -4.0, 0.75]]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    as_in_blender = points.astype(np.float32).astype(np.float64)
    assert sensor_points.are_those_of(table, as_in_blender, normals)
    assert not sensor_points.are_those_of(table, as_in_blender + [0.001, 0, 0], normals)
    assert not sensor_points.are_those_of(table, as_in_blender[::-1], normals)
    assert not sensor_points.are_those_of(table, as_in_blender[:1], normals[:1])
    assert not sensor_points.are_those_of(tmp_path / "none.csv", as_in_blender, normals)


def test_faces_that_were_given_a_reflectance_are_assigned_it(tmp_path: Path) -> None:
    face, before = np.array([0, 1, 2, 3]), np.array([0, 0, 1, 1])
    names = ["", "", "builtin:white-wall"]
    path = tmp_path / "m.csv"
    path.write_text(material_table.assignments_table(face, np.array([0, 2, 1, 2]), before, names), encoding="utf-8")
    read = read_assignments(path)
    assert read.by == "face"
    assert [(row.target, row.reflectance) for row in read.rows] == [("1", names[2]), ("3", names[2])]
    assert read.face_count is None
    counted = material_table.assignments_table(face, np.array([0, 2, 1, 2]), before, names, face_count=4)
    path.write_text(counted, encoding="utf-8")
    again = read_assignments(path)
    assert (again.face_count, len(again.rows)) == (4, 2)
    assert material_table.assignments_table(face, before, before, ["", "", ""]) == ""
    all_faces = material_table.assignments_table(face, np.array([0, 2, 1, 2]), before, names, default="white-plastic")
    assert all_faces.count("white-plastic") == 2
    with pytest.raises(ExtensionError, match="has no name"):
        material_table.assignments_table(face, np.array([1, 0, 1, 1]), before, ["", "", ""])


def test_the_scale_is_that_of_the_reports_figures_with_round_ticks() -> None:
    for values in (np.array([3.0, 250.0]), np.array([200.0, 250.0]), np.array([0.0, 0.0]), np.array([5.0, 5.0])):
        norm, scale = color_norm(values), color_scale.scale_of(values)
        if values.min() < values.max() or values.max() == 0:
            assert (scale.low, scale.high) == pytest.approx((norm.vmin, norm.vmax))
        ticks = scale.ticks()
        assert 2 <= len(ticks) <= color_scale.MAX_TICKS
        assert scale.low - 1e-9 <= min(ticks) <= max(ticks) <= scale.high + 1e-9
    assert color_scale.scale_of(np.array([3.0, 250.0])).ticks() == [0, 50, 100, 150, 200, 250]
    factor, unit = color_scale.prefixed(0.0042, "W/m²/nm")
    assert (factor, unit) == (pytest.approx(1e3), "mW/m²/nm")  # type: ignore[comparison-overlap]
    assert color_scale.prefixed(250.0, "lx") == (1.0, "lx")


@pytest.fixture
def room_npz(tmp_path: Path) -> Path:
    """The file of a room of two triangles, two lamps, three points, two layers."""
    flat = Spectrum(wavelengths_nm=np.array([380.0, 780.0]), values=np.full(2, 0.5), name="grey")
    grey = Material(name="grey", category="painted", reflectance=flat, source="builtin:grey", provenance="assigned",
                    confidence=1.0, measured_range_nm=(380.0, 780.0), color=(0.5, 0.5, 0.5))  # fmt: skip
    lamps = tuple(
        make_lamp("panel", (x, 1.0, 2.5), name=name, size=0.6, cct_k=4000, luminous_flux_lm=1000)
        for name, x in (("a", 1.0), ("b", 2.0))
    )
    room = BlenderRoom(
        run="a room.run",
        version="0",
        vertices=np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0.0]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        face_material=np.array([0, 0]),
        face_color=np.full((2, 3), 0.5),
        points=np.array([[1, 1, 0.5], [2, 1, 0.5], [1, 1.5, 0.5]]),
        normals=np.tile([0.0, 0.0, 1.0], (3, 1)),
        triangles=np.array([[0, 1, 2]]),
        buried=np.array([False, False, True]),
        layers=(Layer(name="illuminance_lx", words="illuminance", unit="lx"),
                Layer(name="E_560", words="spectral irradiance, 560 nm", unit="W/m²/nm")),
        shares=np.array([[[100, 1e-3], [50, 5e-4], [10, 1e-4]], [[20, 2e-4], [80, 8e-4], [10, 1e-4]]]),
        standard_error=np.ones((3, 2)),
        lamps=lamps,
        dims=(1.0, None),
        materials=(grey,),
        lamp_spectra=("LED-B3",),
        reflectances=("builtin:grey",),
    )  # fmt: skip
    return save_blender_room(room, tmp_path / "room.npz")


def test_the_extension_reads_what_the_package_writes_and_dims_by_a_sum(room_npz: Path) -> None:
    room = room_file.read_room(room_npz)
    assert room.lamps[0]["name"] == "a"
    assert room.lamps[1]["dim"] is None
    assert room.lamps[0]["luminous_flux_lm"] == pytest.approx(1000)
    assert room.materials[0]["color"] == pytest.approx([0.5, 0.5, 0.5], abs=0.01)
    assert room.materials[0]["provenance"] == "assigned"
    assert room.light({})[:, 0] == pytest.approx([120, 130, 20])
    assert room.light({"a": 0.5, "nobody": 3.0})[:, 0] == pytest.approx([70, 105, 15])
    assert room_file.read_room(room_npz) is room  # read once


@pytest.mark.parametrize("fault", ["format", "shares", "triangles", "cut", "missing"])
def test_a_file_that_is_not_whole_is_refused_in_words(room_npz: Path, fault: str) -> None:
    with np.load(room_npz) as held:
        arrays = dict(held)
    about = json.loads(str(arrays["about"]))
    if fault == "format":
        arrays["about"] = np.array(json.dumps({**about, "format": 99}))
    elif fault == "shares":
        arrays["shares"] = arrays["shares"][:1]
    elif fault == "triangles":
        arrays["triangles"] = arrays["triangles"] + 7
    np.savez(room_npz, **arrays)
    if fault == "cut":
        room_npz.write_bytes(room_npz.read_bytes()[:-300])
    if fault == "missing":
        room_npz.unlink()
    with pytest.raises(ExtensionError, match=r"room\.npz: expected .*, found "):
        room_file.read_room(room_npz)


def ended(job: process.Job, within_s: float = 30.0) -> int:
    limit = time.monotonic() + within_s
    while (status := job.poll()) is None:
        assert time.monotonic() < limit, job.lines
        time.sleep(0.02)
    return status


def test_a_program_tells_how_far_it_is_and_what_went_wrong(tmp_path: Path) -> None:
    script = tmp_path / "a program.py"
    script.write_text(
        "import sys\nprint('scan took 1.0 s: done')\nprint(' 50 %  trace: rays; about 1 min left')\n"
        "print('Error: ' + sys.argv[1], file=sys.stderr)\nsys.exit(1)\n",
        encoding="utf-8",
    )
    job = process.Job([sys.executable, str(script), "no 'file' of $HOME; &"])
    assert ended(job) == 1
    assert job.message() == "Error: no 'file' of $HOME; &"  # no shell has looked at it
    begun, share = sum(process.SHARES[:4]), process.SHARES[4]
    assert job.fraction == pytest.approx(begun + 0.5 * share)
    assert job.words.startswith("trace: rays")
    assert sum(process.SHARES) == pytest.approx(1.0)


@pytest.mark.skipif(sys.platform == "win32", reason="processes and their groups as POSIX has them")
def test_a_program_is_stopped_with_all_that_it_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "PATIENCE_S", 0.3)
    script = tmp_path / "deaf.py"
    script.write_text(
        "import signal, subprocess, sys, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        "print('child', child.pid, flush=True)\ntime.sleep(60)\n",
        encoding="utf-8",
    )
    job = process.Job([sys.executable, str(script)])
    while not any(line.startswith("child") for line in job.lines):
        job.poll()
        time.sleep(0.02)
    child = int(job.lines[-1].split()[1])
    job.stop()
    assert ended(job) != 0
    assert job.was_stopped
    state = Path(f"/proc/{child}/stat")
    deadline = time.monotonic() + 10.0
    while state.is_file() and state.read_text().split()[2] != "Z":
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_program_that_is_not_there_is_named_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ExtensionError, match="preferences"):
        process.find_program(str(tmp_path / "no program"))
    program = tmp_path / "a program"
    program.write_text("", encoding="utf-8")
    assert process.find_program(str(program)) == str(program)


def test_the_source_of_the_extension_has_no_fault_and_the_zip_is_the_same_each_time(tmp_path: Path) -> None:
    assert check(EXTENSION) == []
    first, second = (build(EXTENSION, tmp_path / name).read_bytes() for name in ("a", "b b"))
    assert first == second


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("import lidarspectra", "lidarspectra"),
        ("from urllib import request", "urllib"),
        ("import xarray", "xarray"),
        ("from . import nowhere", "nowhere"),
        ("from ..build import check", "build"),
    ],
)
def test_the_check_finds_what_blender_has_not(line: str, found: str, tmp_path: Path) -> None:
    for path in EXTENSION.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "faults.py").write_text(f"{line}\n", encoding="utf-8")
    (fault,) = check(tmp_path)
    assert fault.startswith("faults.py: ")
    assert found in fault
