"""A faulty run file is refused before the first stage, in one sentence that names the key; a right one is not."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

import lidarspectra as ls
from lidarspectra.errors import LidarSpectraError
from lidarspectra.lamps.lamp_spectra import cct_spectrum, luminous_flux_lm
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.workflow.checks.input_checks import WHITE_LEDS_K
from lidarspectra.workflow.checks.plausible_numbers import LUMINOUS_FLUX
from lidarspectra.workflow.checks.scan_checks import extent_of_stage
from lidarspectra.workflow.run_folder.workspace import STAGES

ROOM = """
[scan]
file = "room.ply"
unit = "m"
up = "+z"

[[lamps]]
name = "panel"
shape = "panel"
center = [1.2, 1.0, 2.3]
size = [0.6, 0.6]
normal = [0, 0, -1]
spectrum = "LED-B3"
luminous_flux_lm = 2000

[[lamps]]
name = "downlight"
shape = "ies"
center = [0.6, 1.6, 2.4]
file = "lamp.ies"
spectrum = "A"

[materials]
method = "file"
file = "assigned.csv"
default = "white-plastic"
databases = ["builtin"]
model = "builtin"

[sensors]
device = "three.csv"
receptor = "cosine.csv"

[sensors.grid]
height = 0.5
spacing = 0.5
margin = 0.1
normal = [0, 0, 1]

[trace]
accuracy = "low"
noise = "draft"

[[cells]]
cell = "silicon"
area_cm2 = 10
hours = "8-17"
"""
GRID = ROOM[ROOM.index("[sensors.grid]") : ROOM.index("[trace]")]
DEVICE = 'device = "three.csv"'
DAYLIGHT = """
[daylight]
latitude_deg = 48.1
longitude_deg = 11.6
time = 2024-06-21T12:00:00+02:00
[[daylight.windows]]
name = "south"
center = [1.2, 0.05, 1.4]
size = [1.0, 1.2]
normal = [0, 1, 0]
"""
LAMPS = ROOM[ROOM.index("[[lamps]]") : ROOM.index("[materials]")]
FROM_SCAN = '[lamps_from_scan]\nspectrum = "LED-B3"\n\n'
IES = """IESNA:LM-63-2002
TILT=NONE
1 1000 1 3 1 1 2 -0.1 -0.1 0
1 1 10
0 45 90
0
300 200 0
"""
FILES = {
    "lamp.ies": IES,
    "assigned.csv": "group,reflectance\n*,white-plastic\n",
    "three.csv": "center_nm,fwhm_nm\n460,20\n560,20\n610,20\n",
    "cosine.csv": "angle_deg,response\n0,1\n60,0.5\n90,0\n",
    "points.csv": "x,y,z\n1,1,0.5\n1.5,1,0.5\n",
}
Change = tuple[str, str]


def box(colored: bool = True) -> bytes:
    """A room of 2.4 m x 2.0 m x 2.5 m, as a PLY."""
    mesh = trimesh.creation.box(extents=(2.4, 2.0, 2.5))
    mesh.apply_translation((1.2, 1.0, 1.25))
    mesh = mesh.subdivide().subdivide()
    mesh.invert()
    if colored:
        mesh.visual.vertex_colors = np.full((len(mesh.vertices), 4), (180, 170, 160, 255), dtype=np.uint8)
    return bytes(mesh.export(file_type="ply"))


@pytest.fixture(scope="module")
def scan_files() -> dict[str, bytes]:
    return {"room.ply": box(), "grey.ply": box(colored=False)}


Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path, scan_files: dict[str, bytes]) -> Write:
    """(old, new) pairs, other files -> run file of the room with these changes."""

    def written(*changes: Change, **files: str) -> Path:
        text = ROOM
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        for name, data in scan_files.items():
            (tmp_path / name).write_bytes(data)
        for name, content in {**FILES, **{name.replace("_", "."): content for name, content in files.items()}}.items():
            (tmp_path / name).write_text(content, encoding="utf-8")
        path = tmp_path / "room.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return written


def points_file(name: str) -> tuple[Change, Change]:
    """The changes by which the sensors stand at the points of a file."""
    return (GRID, ""), (DEVICE, f'{DEVICE}\npoints = "{name}"')


FAULTS: dict[str, tuple[tuple[Change, ...], dict[str, str], str]] = {
    # what is wrong: changes of the run file, of its files, and the message: key, expected, found
    "a key with a slip": ((("accuracy =", "acuracy ="),), {}, r"trace\.acuracy: unknown key \(did you mean 'accuracy'"),
    "no TOML": ((("[trace]", "[trace"),), {}, "expected valid TOML, found .*line"),
    "a word that is no choice": ((('"draft"', '"coarse"'),), {}, r"trace\.noise: .*'draft', 'standard' or 'fine'"),
    "a lamp's two fluxes": (
        (("luminous_flux_lm = 2000", "luminous_flux_lm = 2000\nradiant_flux_W = 5"),),
        {},
        r"lamps\.1: give luminous_flux_lm or radiant_flux_W, not both",
    ),
    "two lamps of a name": ((('"downlight"', '"panel"'),), {}, "two lamps have the name 'panel'"),
    "a negative count": ((("spacing = 0.5", "count = -5"),), {}, r"sensors\.grid\.count: .*greater than or equal to 1"),
    "no light": (((LAMPS, ""),), {}, r"expected one or more \[\[lamps\]\].*a dark room"),
    # files and names
    "no scan": ((('"room.ply"', '"rom.ply"'),), {}, r"scan\.file: .*rom\.ply: expected a scan file, found nothing"),
    "a scan that is none": ((('"room.ply"', '"three.csv"'),), {}, r"scan\.file: three\.csv: expected one of \.glb"),
    "an empty scan": ((('"room.ply"', '"points.ply"'),), {"points_ply": "ply\n"}, r"scan\.file: points\.ply: expected"),
    "no spectrum of that name": ((("LED-B3", "LED-B33"),), {}, r"lamps\.1\.spectrum: .*'LED-B33'.* LED-B3"),
    "no spectrum file": ((("LED-B3", "led.csv"),), {}, r"lamps\.1\.spectrum: .*led\.csv"),
    "a spectrum file of words": (
        (("LED-B3", "led.csv"),),
        {"led_csv": "nm,W\nblue,much\n"},
        r"lamps\.1\.spectrum: .*led\.csv",
    ),
    "no luminaire file": ((('"lamp.ies"', '"lam.ies"'),), {}, r"lamps\.2\.file: .*lam\.ies"),
    "a luminaire file that is none": ((), {"lamp_ies": "hello\n"}, r"lamps\.2\.file: .*lamp\.ies"),
    "no material of that name": ((("white-plastic", "white-plastik"),), {}, r"materials\.default: .*'white-plastik'"),
    "no database of that name": ((('["builtin"]', '["spectradb"]'),), {}, r"materials\.databases: .*'spectradb'"),
    "no file of assignments": ((('"assigned.csv"', '"asigned.csv"'),), {}, r"materials\.file: .*asigned\.csv"),
    "an assigned material that is not there": (
        (),
        {"assigned_csv": "group,reflectance\n*,gold-leaf\n"},
        r"materials\.file: .*assigned\.csv, line 2: .*gold-leaf",
    ),
    "an assigned spectrum that is not there": (
        (),
        {"assigned_csv": "group,reflectance\n*,carpet.csv\n"},
        r"materials\.file: .*line 2: .*carpet\.csv",
    ),
    "no segmentation model": ((('model = "builtin"', 'model = "my.onnx"'),), {}, r"materials\.model: .*my\.toml"),
    "no sensor of that name": ((('"three.csv"', '"as7625x"'),), {}, r"sensors\.device: expected a sensor .*'as7625x'"),
    "no sensor file": ((('"three.csv"', '"four.csv"'),), {}, r"sensors\.device: .*four\.csv"),
    "a sensor file without channels": ((), {"three_csv": "a,b\n1,2\n"}, r"sensors\.device: .*header 'center_nm"),
    "no receptor file": ((('"cosine.csv"', '"cos.csv"'),), {}, r"sensors\.receptor: .*cos\.csv"),
    "no file of points": (points_file("place.csv"), {}, r"sensors\.points: .*place\.csv"),
    "points without a column": (points_file("points.csv"), {"points_csv": "x,y\n1,1\n"}, r"sensors\.points: .*x, y, z"),
    "a point of words": (
        points_file("points.csv"),
        {"points_csv": "x,y,z\n1,here,1\n"},
        r"sensors\.points: .*points\.csv, line 2",
    ),
    "a point without direction": (
        points_file("points.csv"),
        {"points_csv": "x,y,z,nx,ny,nz\n1,1,1,0,0,0\n"},
        r"sensors\.points: .*1 with a zero direction",
    ),
    "no cell of that name": ((('"silicon"', '"silicone"'),), {}, r"cells\.1: .*'?silicone"),
    "hours that are none": ((('"8-17"', '"17-8-3"'),), {}, r"cells\.1: hours: .*8-3"),
    # lamps that cannot be
    "a lamp that no channel sees": (
        (("LED-B3", "far-red.csv"),),
        {"far-red_csv": "wavelength_nm,W_nm\n840,0\n850,1\n860,0\n"},
        r"lamps\.1\.spectrum: .*which the sensor sees",
    ),
    "a lamp without a size": ((("size = [0.6, 0.6]\n", ""),), {}, r"lamps\.1: .*expected 'size' in metres for a panel"),
    "a disc of two diameters": (
        (('shape = "panel"', 'shape = "disc"'),),
        {},
        r"lamps\.1: .*1 positive size\(s\) in metres for a disc",
    ),
    "a lamp that faces nowhere": ((("[0, 0, -1]", "[0, 0, 0]"),), {}, r"lamps\.1\.normal: expected a direction"),
    "a relative spectrum without a flux": ((("luminous_flux_lm = 2000\n", ""),), {}, r"lamps\.1: .*luminous_flux_lm"),
    "all lamps off": (
        (
            ("luminous_flux_lm = 2000", "luminous_flux_lm = 2000\ndim = 0"),
            ('spectrum = "A"', 'spectrum = "A"\ndim = 0'),
        ),
        {},
        r"lamps\.1\.dim: expected a lamp that is lit",
    ),
    "3.4 million lumens": (
        (("= 2000", "= 3400000"),),
        {},
        r"lamps\.1\.luminous_flux_lm: expected .* 300,000 lm, found 3,400,000 lm",
    ),
    "a thousandth of a lumen": ((("= 2000", "= 0.002"),), {}, r"lamps\.1\.luminous_flux_lm: .*found 0\.002 lm"),
    "watts that are no watts": (
        (("luminous_flux_lm = 2000", "radiant_flux_W = 34000"),),
        {},
        r"lamps\.1\.radiant_flux_W: expected .* W, found 34,000 W",
    ),
    "a panel of 60 m": ((("[0.6, 0.6]", "[60, 0.6]"),), {}, r"lamps\.1\.size: .*40 m, found 60 m"),
    "a panel larger than the room": (
        (("[0.6, 0.6]", "[6.0, 0.6]"),),
        {},
        r"lamps\.1\.size: .*into the scan.*found 6 m",
    ),
    "a lamp outside the scan": (
        (("[1.2, 1.0, 2.3]", "[12.0, 1.0, 2.3]"),),
        {},
        r"lamps\.1\.center: expected .*x from 0\.00 to 2\.40 m.*'panel' at \(12\.00, 1\.00, 2\.30\) m",
    ),
    "lamps sought where there is no colour": (
        ((LAMPS, FROM_SCAN), ('"room.ply"', '"grey.ply"')),
        {},
        r"lamps_from_scan: expected a scan with colours",
    ),
    "an exitance of the sun": (
        ((LAMPS, FROM_SCAN.replace("B3", "B1") + "luminous_exitance_lm_m2 = 3e9\n"),),
        {},
        r"lamps_from_scan\.luminous_exitance_lm_m2: .*found 3,000,000,000",
    ),
    # daylight
    "daylight at night": (
        ((LAMPS, DAYLIGHT.replace("T12", "T01")),),
        {},
        r"daylight\.time: expected a time at which light comes .*below the horizon",
    ),
    "a window outside the scan": (
        (("[materials]", DAYLIGHT.replace("0.05, 1.4", "-3.05, 1.4") + "[materials]"),),
        {},
        r"daylight\.windows\.1\.center: .*'south' at",
    ),
    "a window that faces nowhere": (
        (("[materials]", DAYLIGHT.replace("normal = [0, 1, 0]", "normal = [0, 0, 0]") + "[materials]"),),
        {},
        r"daylight\.windows\.1\.normal: expected a direction",
    ),
    # sensors that cannot be
    "a height of 80 m": ((("height = 0.5", "height = 80"),), {}, r"sensors\.grid\.height: .*30 m, found 80 m"),
    "a height below the floor": ((("height = 0.5", "height = -0.5"),), {}, r"sensors\.grid\.height: .*found -0\.5 m"),
    "a height above the ceiling": (
        (("height = 0.5", "height = 2.6"),),
        {},
        r"sensors\.grid\.height: .*2\.50 m above it",
    ),
    "a million points by their spacing": (
        (("spacing = 0.5", "spacing = 0.001"),),
        {},
        r"sensors\.grid\.spacing: expected .*0\.005 to 100 m, found 0\.001 m",
    ),
    "more points than there is room for": (
        (("spacing = 0.5", "count = 999999"),),
        {},
        r"sensors\.grid\.count: expected at most .*found 999,999",
    ),
    "a margin wider than the room": ((("margin = 0.1", "margin = 1.1"),), {}, r"sensors\.grid\.margin: .*found 1\.1 m"),
    "a grid that looks nowhere": ((("[0, 0, 1]", "[0, 0, 0]"),), {}, r"sensors\.grid\.normal: expected a direction"),
    "points in another unit": (
        points_file("points.csv"),
        {"points_csv": "x,y,z\n1000,1000,500\n1500,1000,500\n"},
        r"sensors\.points: points\.csv: expected sensor points within .*2 of 2 outside of it: row 1 at \(1000\.00",
    ),
    # cells
    "a card in mid-air": (
        (
            ('method = "file"\nfile = "assigned.csv"', 'method = "estimate"'),
            ('model = "builtin"', 'model = "none"\n[[materials.cards]]\ncenter = [1, 1, 1.2]\nreflectance = 0.18'),
        ),
        {},
        r"materials\.cards\.1\.center: .*within 15 cm of a card's middle",
    ),
    "a card in mid-air, where only some materials are given": (
        (('model = "builtin"', 'model = "none"\n[[materials.cards]]\ncenter = [1, 1, 1.2]\nreflectance = 0.18'),),
        {"assigned_csv": "group,reflectance\n0,white-plastic\n"},
        r"materials\.cards\.1\.center: .*within 15 cm of a card's middle",
    ),
    "a cell of a square kilometre": (
        (("area_cm2 = 10", "area_cm2 = 1e10"),),
        {},
        r"cells\.1\.area_cm2: .*10,000,000,000",
    ),
    "a cell of a million volts": (
        (("area_cm2 = 10", "area_cm2 = 10\nvolt = 1e6"),),
        {},
        r"cells\.1\.volt: .*1,000,000 V",
    ),
}


def test_the_room_itself_has_no_fault(write: Write) -> None:
    found = ls.check(write())
    assert found.good, found
    assert found.faults == ()
    assert found.notes == ()
    assert set(found.states.values()) == {"to be made"}
    assert set(found.seconds) == set(STAGES)


@pytest.mark.parametrize("what", FAULTS)
def test_each_fault_is_told_at_once_with_its_key(write: Write, tmp_path: Path, what: str) -> None:
    changes, files, words = FAULTS[what]
    run_file = write(*changes, **files)
    before = sorted(tmp_path.rglob("*"))
    (fault,) = ls.check(run_file).faults
    assert fault.expected
    assert fault.found
    assert fault.todo, "what to do"
    assert "room.toml" in str(fault)
    with pytest.raises(type(fault), match=f"(?s){words}"):
        ls.run(run_file)
    assert sorted(tmp_path.rglob("*")) == before, "nothing is made"


def test_there_are_enough_faults() -> None:
    assert len(FAULTS) >= 36


def test_several_faults_are_all_listed_and_a_run_names_the_first(write: Write) -> None:
    run_file = write(("LED-B3", "LED-B33"), ('"three.csv"', '"four.csv"'), ("height = 0.5", "height = 80"))
    faults = ls.check(run_file).faults
    assert [key for fault in faults for key in ("device", "spectrum", "height") if key in fault.where][:3] == [
        "device",
        "spectrum",
        "height",
    ]
    with pytest.raises(LidarSpectraError, match=r"sensors\.device.* other faults: 'lidarspectra check room\.toml'"):
        ls.run(run_file)


def test_a_fault_that_many_lamps_have_is_one(write: Write) -> None:
    run_file = write(("LED-B3", "LED-B33"), ('spectrum = "A"', 'spectrum = "LED-B33"'))
    (fault,) = ls.check(run_file).faults
    assert fault.where == "room.toml, lamps.1.spectrum, lamps.2.spectrum"


def test_what_was_changed_in_reading_a_spectrum_is_said(write: Write) -> None:
    """The run file's lamps had photons made power, columns chosen and lines sorted without a word."""
    counts = "nm,photons/s/nm,other\n400,1,1\n560,2,1\n700,1,1\n"
    own, others = ls.check(write(('spectrum = "LED-B3"', 'spectrum = "own.csv"'), own_csv=counts)).notes
    assert "lamps.1.spectrum: The heading says that values count photons" in own
    assert "'photons/s/nm' was taken, not 'other'" in others


def test_a_colour_temperature_is_asked_about_since_an_led_sends_another_spectrum(write: Write) -> None:
    (note,) = ls.check(write(('spectrum = "LED-B3"', "cct_k = 4000"))).notes
    assert "lamps.1.cct_k: 4000 K stands for a thermal lamp's spectrum" in note
    assert 'spectrum = "LED-B3" (4103 K)' in note
    (by_day,) = ls.check(write(('spectrum = "LED-B3"', "cct_k = 6500"))).notes
    assert "daylight's" in by_day
    assert '"LED-B5"' in by_day
    assert ls.check(write(('spectrum = "LED-B3"', 'spectrum = "A"'))).notes == ()


@pytest.mark.parametrize("name", WHITE_LEDS_K)
def test_a_white_led_sends_as_little_at_both_ends_as_is_said(name: str) -> None:
    wavelengths = np.array([410.0, 680.0, 730.0])
    led, thermal = lamp_spectrum(name).spectrum, cct_spectrum(WHITE_LEDS_K[name])
    per_lm = [each.at(wavelengths, outside="zero") / luminous_flux_lm(each) for each in (led, thermal)]
    ratio = per_lm[0] / per_lm[1]
    assert ratio[1] == pytest.approx(1 / 3, abs=0.05)
    assert ratio[0] < 0.1
    assert ratio[2] < 0.105


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("= 2000", "= 60000"), "lamps.1.luminous_flux_lm: is 60,000 lm meant?"),
        (("spacing = 0.5", "spacing = 0.01"), "sensors.grid.spacing: is 0.01 m meant?"),
        (("[trace]", "[trace]\nworkers = 1000"), "trace.workers: are 1000 processes meant?"),
        (("[materials]", DAYLIGHT.replace("T12", "T01") + "[materials]"), "daylight.time: at 2024-06-21 01:00"),
    ],
)
def test_what_is_unlikely_is_asked_about_and_does_not_end_a_run(write: Write, change: Change, words: str) -> None:
    found = ls.check(write(change))
    assert found.good
    assert any(words in note for note in found.notes), found.notes


@pytest.mark.parametrize(
    ("normal", "asked"),
    [("[0, 1, 0]", False), ("[0, -1, 0]", True), ("[0, -2.0, 0.1]", True), ("[1, 0, 0]", False), ("[0, 0, 0]", False)],
)
def test_a_window_that_shines_out_of_the_scan_is_asked_about(write: Write, normal: str, asked: bool) -> None:
    found = ls.check(write(("[materials]", DAYLIGHT.replace("[0, 1, 0]", normal) + "[materials]")))
    assert any("'south' shines out of the scan" in note for note in found.notes) == asked, found.notes


@pytest.mark.parametrize(("normal", "asked"), [("[0, 1, 0]", False), ("[0, -1, 0]", True)])
def test_a_lamp_in_the_shape_of_a_window_that_shines_out_is_asked_about(write: Write, normal: str, asked: bool) -> None:
    placed = ('shape = "panel"\ncenter = [1.2, 1.0, 2.3]', 'shape = "window"\ncenter = [1.2, 0.05, 1.4]')
    found = ls.check(write(placed, ("normal = [0, 0, -1]", f"normal = {normal}")))
    assert any("'panel' shines out of the scan" in note for note in found.notes) == asked, found.notes


@pytest.mark.parametrize(("lumens", "asked"), [("-1", False), ("500", True), ("1000", False), ("9000", True)])
def test_candela_that_contradict_the_lamps_lumens_are_asked_about(write: Write, lumens: str, asked: bool) -> None:
    found = ls.check(write(lamp_ies=IES.replace("1 1000 1 ", f"1 {lumens} 1 ", 1)))
    assert found.good
    assert any("lamps.2.file: its candela are" in note for note in found.notes) == asked, found.notes


@pytest.mark.parametrize(("height_m", "is_lower_scan"), [(2.9, True), (9.0, False)])
def test_lamps_above_a_scan_may_hang_right_and_the_scan_be_too_low(
    write: Write, height_m: float, is_lower_scan: bool
) -> None:
    """Whoever measured a lamp's height was told to correct it, and hung it into the room's middle."""
    run_file = write()
    text = run_file.read_text(encoding="utf-8")
    center = next(line for line in text.splitlines() if line.startswith("center"))
    run_file.write_text(text.replace(center, f"center = [1.2, 1.0, {height_m}]"), encoding="utf-8")
    (fault,) = ls.check(run_file).faults
    assert "within the scan" in str(fault)
    assert (f"ceiling = {height_m + 0.1:.2f}" in str(fault)) == is_lower_scan


def test_a_point_just_outside_is_asked_about(write: Write) -> None:
    run_file = write(*points_file("points.csv"), points_csv="x,y,z\n1,1,0.5\n2.6,1,0.5\n")
    (note,) = ls.check(run_file).notes
    assert "1 of 2 points of points.csv lie just outside of the scan (row 2 at (2.60, 1.00, 0.50) m)" in note


def test_a_run_folder_of_other_things_is_a_fault(write: Write, tmp_path: Path) -> None:
    run_file = write()
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("mine", encoding="utf-8")
    (fault,) = ls.check(run_file, tmp_path / "thesis").faults
    assert "chapter.txt" in str(fault)


def test_that_nothing_can_decimate_is_said_before_the_run(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    run_file = write(('up = "+z"', 'up = "+z"\nmax_faces = 500'))
    assert ls.check(run_file).good
    monkeypatch.setitem(sys.modules, "pymeshlab", None)  # as where it is not installed
    (fault,) = ls.check(run_file).faults
    assert "scan.max_faces" in str(fault)
    assert "lidarspectra[decimate]" in str(fault)


def test_a_scan_that_is_up_to_date_is_not_read_again(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    run_file = write()
    ls.run(run_file, last="scan")
    folder = run_file.with_suffix(".run")
    (folder / "1-scan" / "mesh.npz").touch()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the scan was read")

    monkeypatch.setattr("lidarspectra.workflow.checks.input_checks.read_scan", refuse)
    monkeypatch.setattr("lidarspectra.workflow.stages.load_scan", refuse)
    monkeypatch.setattr("lidarspectra.geometry.scan.load_scan", refuse)
    assert ls.check(run_file).states["scan"] == "up to date"
    ls.run(run_file, last="scan")
    run_file.write_text(run_file.read_text("utf-8").replace("[1.2, 1.0, 2.3]", "[12.0, 1.0, 2.3]"), encoding="utf-8")
    with pytest.raises(LidarSpectraError, match=r"lamps\.1\.center"):
        ls.run(run_file, last="scan")


def test_the_box_of_a_run_of_an_earlier_version_is_that_of_its_mesh(write: Write) -> None:
    run_file = write()
    ls.run(run_file, last="scan")
    folder = run_file.with_suffix(".run") / "1-scan"
    now = extent_of_stage(folder)
    record = folder / "scan.json"
    text = record.read_text("utf-8")
    assert '"bounds_m"' in text
    record.write_text(text.replace('"bounds_m"', '"box"'), encoding="utf-8")
    np.testing.assert_array_equal(extent_of_stage(folder).bounds, now.bounds)
    assert extent_of_stage(folder).height_m == pytest.approx(2.5, abs=0.01)


def test_what_is_refused_is_beyond_what_is_asked_about() -> None:
    from lidarspectra.workflow.checks import plausible_numbers

    every = [each for each in vars(plausible_numbers).values() if isinstance(each, type(LUMINOUS_FLUX))]
    assert len(every) > 10
    for each in every:
        assert each.possible[0] <= each.usual[0] < each.usual[1] <= each.possible[1], each


def test_a_check_takes_what_a_run_takes() -> None:
    with pytest.raises(ls.ArgumentError):
        ls.check(7)  # type: ignore[arg-type]
