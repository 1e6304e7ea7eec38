"""The run file that `init` writes: what it says is what was found, and `run` reads it unchanged."""

import sys
import tomllib
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from lidarspectra.config import parse_run_file, read_run_file
from lidarspectra.errors import ArgumentError, DatabaseError, RunFileError, ScanError, SensorError, WorkspaceError
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.progress import Progress
from lidarspectra.workflow.init import init_file
from lidarspectra.workflow.init.choices import InitChoices
from lidarspectra.workflow.init.init_file import write_init
from lidarspectra.workflow.init.summary import InitSummary

pytestmark = pytest.mark.usefixtures("few_viewpoints")

LOOKED: dict[tuple[bytes, str], init_file._Looked] = {}  # by a scan's bytes and what was asked (`looked_once`)


@pytest.fixture(scope="module")
def lit_room(builder, ceiling, tmp_path_factory):
    """A scan with a panel, a strip and a downlight, all lit."""
    picture = ceiling((0.0, 0.0), (4.0, 3.0))
    picture.rectangle((1.0, 1.0), (0.6, 0.6))
    picture.rectangle((2.5, 2.2), (1.2, 0.15), turn_deg=90.0)
    picture.disc((3.2, 0.7), 0.15)
    return _written(
        builder, cv2.GaussianBlur(picture.picture, (0, 0), 1.5), tmp_path_factory.mktemp("lit") / "room.glb"
    )


@pytest.fixture(scope="module")
def dark_room(builder, ceiling, tmp_path_factory):
    """The same with all lamps off."""
    return _written(builder, ceiling((0.0, 0.0), (4.0, 3.0)).picture, tmp_path_factory.mktemp("dark") / "room.glb")


@pytest.fixture(scope="module")
def lit_init(lit_room, tmp_path_factory) -> tuple[Path, InitSummary]:
    """The run file of the lit room, written once, and what was told of it."""
    path = tmp_path_factory.mktemp("lit-init") / "my.room.toml"
    return path, write_init(lit_room, path)


@pytest.fixture(scope="module")
def dark_init(dark_room, tmp_path_factory) -> tuple[Path, InitSummary, list[float]]:
    """The run file of the dark room, written once, what was told of it, and the progress meanwhile."""
    path = tmp_path_factory.mktemp("dark-init") / "room.toml"
    heard: list[float] = []
    return path, write_init(dark_room, path, progress=lambda fraction, message: heard.append(fraction)), heard


@pytest.fixture(scope="module")
def small_room(builder, tmp_path_factory):
    """A bare room of few triangles."""
    room = builder(step_m=0.5)
    room.box([0, 0, 0], [2, 2, 2.5], inward=True)
    room.write_glb(path := tmp_path_factory.mktemp("small") / "room.glb")
    return path


@pytest.fixture
def looked_once(monkeypatch) -> None:
    """What is found in the bytes of a scan is found once, whatever its name is and whatever is known of its lamps."""
    look = init_file._look

    def once(scan_path: Path, out_path: Path, choices: InitChoices, progress: Progress) -> init_file._Looked:
        record = read_scan(scan_path, unit=choices.unit, up=choices.up, level=choices.level).record
        alike = replace(choices, spectrum=None, luminous_flux_lm=None)
        key = (scan_path.read_bytes(), repr(alike))
        if key not in LOOKED:
            LOOKED[key] = look(scan_path, out_path, alike, progress)
        found = LOOKED[key]
        told = {"given": choices.given, "spectrum": choices.spectrum, "luminous_flux_lm": choices.luminous_flux_lm}
        summary = replace(found.summary, run_file=out_path, scan=record, **told)
        return replace(found, summary=summary, scan=replace(found.scan, record=record))

    monkeypatch.setattr(init_file, "_look", once)


@pytest.fixture(scope="module")
def odd_room(tmp_path_factory):
    """A cube in a format that says nothing of its axes: which of them is up, can only be guessed."""
    import lidarspectra as ls

    return ls.copy_scene("box", tmp_path_factory.mktemp("odd")).parent / "scan.ply"


def _written(builder, picture, path):
    room = builder(step_m=0.1, noise_m=0.004)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, pictures={"top": picture})
    room.box([0.5, 1.5, 0.70], [1.7, 2.2, 0.74])
    room.write_glb(path)
    return path


@pytest.mark.parametrize("is_told", [True, False])
def test_where_no_lamp_is_found_lit_ceiling_is_told(builder, ceiling, tmp_path: Path, is_told: bool) -> None:
    """A lamp that shines upward, or a cove, is not seen itself; that nothing is lit would be the wrong thing to say."""
    picture = ceiling((0.0, 0.0), (4.0, 3.0))
    if is_told:
        picture.glow((2.0, 1.5), 0.6)
    else:
        picture.rectangle((2.0, 1.5), (0.9, 0.7), color=(10.0, 20.0, 255.0))  # a blue sign is none either
    summary = write_init(_written(builder, picture.picture, tmp_path / "room.glb"), tmp_path / "room.toml")
    (advice,) = [line for line in summary.lines() if line.startswith("No lamp is lit in the scan")]
    assert ("Something lights the ceiling, " in advice and " m² around (2.0, 1.5) m: a lamp" in advice) == is_told


def test_the_run_file_holds_what_was_found_and_is_read_unchanged(lit_room, lit_init) -> None:
    path, summary = lit_init
    run_file = read_run_file(path)
    assert (path.parent / run_file.scan.file).resolve() == lit_room.resolve()
    assert (run_file.scan.unit, run_file.scan.up) == ("m", "+y")
    assert sorted(lamp.name for lamp in run_file.lamps) == ["disc 1", "panel 1", "strip 1"]
    by_name = {lamp.name: lamp for lamp in run_file.lamps}
    np.testing.assert_allclose(by_name["panel 1"].center[:2], [1.0, 1.0], atol=0.02)
    # 10,000 lm for each square metre of lamp; sizes are good to 2 cm.
    assert by_name["panel 1"].luminous_flux_lm == pytest.approx(3600, rel=0.06)
    assert by_name["strip 1"].luminous_flux_lm == pytest.approx(1800, rel=0.15)
    assert abs(by_name["strip 1"].rotation_deg) == pytest.approx(90.0, abs=1.5)
    assert all(lamp.spectrum == "LED-B3" for lamp in run_file.lamps)
    assert run_file.sensors.grid is not None
    assert run_file.sensors.grid.count == summary.sensor_count == 176
    assert summary.room.area_m2 == pytest.approx(12.0, rel=0.05)


def test_the_assumptions_are_marked_in_the_file(lit_init) -> None:
    path, _ = lit_init
    text = path.read_text(encoding="utf-8")
    assert text.count("# assumed") == 6
    assert text.count('assumed = ["flux", "spectrum"]') == 3
    run_file = read_run_file(path)
    assert all(lamp.guesses == {"flux", "spectrum"} for lamp in run_file.lamps)
    assert all(lamp.dim_in_scan == 1 for lamp in run_file.lamps)
    assert run_file.scan.assumed == ()  # a GLB declares unit and axis
    assert run_file.materials.delight
    assert "10,000 lm for each m²" in text
    assert "with dim = 0, and add the new one with dim_in_scan = 0" in text  # the scan's colours keep their light
    assert text.count("% sure") >= 5


def test_the_lamps_of_the_run_file_hang_well(lit_room, lit_init) -> None:
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.hardware.phone.repair import repair_scan
    from lidarspectra.radiance.scene.placement import placement_notes
    from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

    path, _ = lit_init
    lamps = resolve_lamps(read_run_file(path).lamps, path.parent)
    assert placement_notes(lamps, repair_scan(read_scan(lit_room))) == ()


def test_the_summary_tells_everything_in_lines(lit_init) -> None:
    _, summary = lit_init
    lines = summary.lines()
    text = "\n".join(lines)
    for words in (
        "unit      m",
        "up        +y",
        "176 points",
        "1 disc, 1 panel, 1 strip",
        "my.room.toml",
        "Edit the lamps",
    ):
        assert words in text
    assert all("\n" not in line for line in lines)


def test_without_lit_lamps_a_grid_of_panels_is_proposed_as_assumed(dark_init) -> None:
    path, summary, _ = dark_init
    run_file = read_run_file(path)  # it has light, so that it runs as it is
    assert summary.lamps.lamps == ()
    assert [lamp.name for lamp in run_file.lamps] == ["panel 1", "panel 2"]  # 4 m x 3 m, one each 2.4 m
    assert all(lamp.assumed and lamp.luminous_flux_lm == 3600 for lamp in run_file.lamps)
    assert all(lamp.center[2] == pytest.approx(2.445, abs=0.02) for lamp in run_file.lamps)
    assert sorted(lamp.center[0] for lamp in run_file.lamps) == pytest.approx([1.0, 3.0], abs=0.05)
    assert not run_file.materials.delight  # these lamps did not light the scan
    assert any("No lamp is lit" in line for line in summary.lines())
    assert any("2 panels proposed (assumed)" in line for line in summary.lines())


def test_a_window_that_shines_by_day_is_told_and_lamps_that_were_off_are_marked(builder, ceiling, tmp_path) -> None:
    """Its light is then taken out of the colours, with none of the proposed lamps'."""
    room = builder(step_m=0.1, noise_m=0.004)
    dark = ceiling((0.0, 0.0), (4.0, 3.0)).picture
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, pictures={"top": dark, "south": np.full_like(dark, 120)})
    room.box([1.5, 0.0, 1.0], [2.7, 0.06, 2.0], color=(255, 255, 255))
    room.write_glb(tmp_path / "room.glb")
    summary = write_init(tmp_path / "room.glb", tmp_path / "room.toml")
    assert summary.panels is not None
    assert [round(float(pane.center[0]), 1) for pane in summary.panes] == [2.1]
    assert any("a window, screen or white wall" in line for line in summary.lines())
    run_file = read_run_file(tmp_path / "room.toml")
    assert all(lamp.dim_in_scan == 0 for lamp in run_file.lamps)
    assert run_file.materials.delight


def test_proposed_panels_hang_well(dark_room, dark_init) -> None:
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.hardware.phone.repair import repair_scan
    from lidarspectra.radiance.scene.placement import placement_notes
    from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

    path, *_ = dark_init
    lamps = resolve_lamps(read_run_file(path).lamps, path.parent)
    assert placement_notes(lamps, repair_scan(read_scan(dark_room))) == ()


def test_panels_keep_clear_of_ducts_and_follow_a_turned_room(builder) -> None:
    from lidarspectra.lamps.lamps import Lamp
    from lidarspectra.lamps.shapes import Panel
    from lidarspectra.room.free_space import FreeSpace
    from lidarspectra.room.room import find_room
    from lidarspectra.spectra.spectrum import Spectrum
    from lidarspectra.workflow.init.proposed_lamps import propose_panels

    room = builder(step_m=0.2)
    room.box([0, 0, 0], [7.2, 4.8, 2.7], inward=True)
    room.box([0.8, 1.0, 2.5], [1.6, 1.4, 2.7], leave_out=("top",))  # a duct where the first panel would hang
    scan = room.scan(turn_deg=30.0)
    turn = np.radians(30.0)
    spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    found = find_room(scan)
    panels = propose_panels(found, FreeSpace(scan, found))
    places = panels.centers @ spin  # back along the axes
    assert len(panels) == 6
    np.testing.assert_allclose(np.unique(places[:, 0].round(1)), [1.2, 3.6, 6.0], atol=0.11)
    np.testing.assert_allclose(np.sort(places[:, 2]), [2.445, *5 * [2.645]], atol=0.01)
    assert places[:, 2].argmin() == np.linalg.norm(places[:, :2], axis=1).argmin()  # the one under the duct
    lamp = Lamp(
        name="panel",
        shape=Panel(0.6, 0.6),
        center=panels.centers[0],
        normal=np.array([0.0, 0.0, -1.0]),
        rotation_deg=panels.rotation_deg,
        flux=Spectrum(wavelengths_nm=[400.0, 700.0], values=[1.0, 1.0]),
    )
    sides = np.diff(lamp.outline() @ spin, axis=0)  # each along x or along y, once the room's turn is undone
    np.testing.assert_allclose(np.abs(sides).min(axis=1), 0.0, atol=0.02)


def test_the_panel_of_a_narrow_corridor_round_a_corner_hangs_in_it(builder) -> None:
    from lidarspectra.room.free_space import FreeSpace
    from lidarspectra.room.room import find_room
    from lidarspectra.workflow.init.proposed_lamps import propose_panels

    corridor = builder(step_m=0.2)
    corner, width_m, long_m, high_m = [0.0, 0.0], 0.95, 4.0, 2.6
    plan = [corner, [long_m, 0.0], [long_m, width_m], [width_m, width_m], [width_m, long_m], [0.0, long_m]]
    for start, end in zip(plan, [*plan[1:], plan[0]], strict=True):
        side = np.subtract(end, start)
        corridor.rectangle([*start, 0.0], [0.0, 0.0, high_m], [*side, 0.0])
    for z, faces_up in ((0.0, True), (high_m, False)):
        for low, sides in (([0.0, 0.0], [long_m, width_m]), ([0.0, width_m], [width_m, long_m - width_m])):
            first, second = [sides[0], 0.0, 0.0], [0.0, sides[1], 0.0]
            corridor.rectangle([*low, z], *((first, second) if faces_up else (second, first)))
    scan = corridor.scan()
    found = find_room(scan)
    panels = propose_panels(found, FreeSpace(scan, found))
    assert found.in_plan(panels.centers).all()
    assert len(panels) == 1


def test_a_hall_gets_panels_that_its_run_file_may_have() -> None:
    from lidarspectra.geometry.scan import bare_scan
    from lidarspectra.room.free_space import FreeSpace
    from lidarspectra.room.room import Room
    from lidarspectra.workflow.checks.plausible_numbers import LUMINOUS_FLUX
    from lidarspectra.workflow.init.proposed_lamps import propose_panels

    sides = np.array([200.0, 100.0, 12.0])
    box = trimesh.creation.box(sides)
    inward = bare_scan(box.vertices + sides / 2, box.faces[:, ::-1])
    outline = np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 100.0], [0.0, 100.0]])
    hall = Room(
        floor_z=0.0, ceiling_z=12.0, floor_area_m2=2e4, ceiling_area_m2=2e4, floor_confidence=1.0,
        ceiling_confidence=1.0, wall_angle_deg=0.0, wall_confidence=1.0, walls=(), outline=outline,
    )  # fmt: skip
    panels = propose_panels(hall, FreeSpace(inward, hall))
    assert len(panels) * panels.luminous_flux_lm == pytest.approx(3600.0 / 2.4**2 * 2e4, rel=0.02)
    assert panels.luminous_flux_lm < LUMINOUS_FLUX.possible[1]


@pytest.mark.usefixtures("looked_once")
@pytest.mark.parametrize(
    "name",
    [
        "plain.glb",
        'a "quoted" room.glb',
        "a\\b.glb",
        "Büro № 5 – 部屋.glb",
        "tab\tand\nline.glb",
        "#[scan].glb",
        "'.glb",
    ],
)
def test_any_file_name_survives(small_room, tmp_path, name) -> None:
    if sys.platform == "win32" and set(name) & set('"\\\t\n'):
        pytest.skip("Windows has no such file names")
    scan = tmp_path / "scans" / name
    scan.parent.mkdir()
    scan.write_bytes(small_room.read_bytes())
    (tmp_path / "runs").mkdir()
    write_init(scan, tmp_path / "runs" / "room.toml")
    table = tomllib.loads((tmp_path / "runs" / "room.toml").read_text(encoding="utf-8"))
    assert not Path(table["scan"]["file"]).is_absolute()
    assert (tmp_path / "runs" / table["scan"]["file"]).samefile(scan)


@pytest.mark.usefixtures("looked_once")
def test_a_run_file_that_is_there_is_kept_unless_forced(small_room, tmp_path) -> None:
    path = tmp_path / "room.toml"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(RunFileError, match="--force"):
        write_init(small_room, path)
    assert path.read_text(encoding="utf-8") == "mine"
    write_init(small_room, path, force=True)
    assert "[scan]" in path.read_text(encoding="utf-8")


def test_the_scan_itself_is_never_overwritten(dark_room) -> None:
    before = dark_room.read_bytes()
    with pytest.raises(RunFileError, match="the scan itself"):
        write_init(dark_room, dark_room, force=True)
    assert dark_room.read_bytes() == before


def test_what_the_user_gives_is_taken_and_not_assumed(odd_room, tmp_path) -> None:
    guessed = write_init(odd_room, tmp_path / "guessed.toml")
    assert guessed.assumed_of_scan == ("up",)
    assert read_run_file(tmp_path / "guessed.toml").scan.assumed == ("up",)
    assert any("a guess" in line and line.startswith("up ") for line in guessed.lines())
    assert sum("upward axis" in line or "up = +z" in line for line in guessed.lines()) == 1  # told once
    choices = InitChoices(unit="m", up="+z", height=0.8)
    summary = write_init(odd_room, tmp_path / "given.toml", choices=choices)
    run_file = read_run_file(tmp_path / "given.toml")
    assert (run_file.scan.unit, run_file.scan.up, run_file.scan.assumed) == ("m", "+z", ())
    assert run_file.sensors.grid is not None
    assert run_file.sensors.grid.height == 0.8
    text = "\n".join(summary.lines())
    assert "unit      m (given)" in text
    assert "up        +z (given)" in text
    assert "points 0.8 m above the floor" in text
    assert "may be wrong" not in text


@pytest.mark.usefixtures("looked_once")
def test_what_all_lamps_have_alike_is_given_once_and_not_assumed(lit_room, dark_room, tmp_path, monkeypatch) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "runs").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    Path("ours.csv").write_text("nm,power\n400,1\n500,2\n600,2\n700,1\n", encoding="utf-8")
    path = tmp_path / "runs" / "room.toml"
    summary = write_init(lit_room, path, choices=InitChoices(spectrum="ours.csv", luminous_flux_lm=700.0))
    run_file = read_run_file(path)
    assert len(run_file.lamps) == 3
    # the file lies where the command was given, and a run file names what lies beside itself
    assert all((lamp.spectrum, lamp.luminous_flux_lm) == ("../here/ours.csv", 700.0) for lamp in run_file.lamps)
    assert not any(lamp.guesses for lamp in run_file.lamps)
    assert "assumed" not in path.read_text(encoding="utf-8").split("[[lamps]]", 1)[1]
    assert "1 disc, 1 panel, 1 strip (flux and spectrum given)" in "\n".join(summary.lines())
    assert not any("delete 'assumed'" in line for line in summary.lines())

    summary = write_init(lit_room, path, choices=InitChoices(spectrum="fl11"), force=True)
    assert all(lamp.guesses == {"flux"} for lamp in read_run_file(path).lamps)
    assert any("(flux assumed)" in line for line in summary.lines())
    assert any("Edit the lamps' fluxes (--lumens), and delete" in line for line in summary.lines())
    write_init(dark_room, path, choices=InitChoices(luminous_flux_lm=1234567.5), force=True)  # panels, proposed
    panels = read_run_file(path).lamps
    assert all(lamp.luminous_flux_lm == 1234567.5 and lamp.guesses == {"spectrum", "place"} for lamp in panels)
    assert "ASSUMED: places, sizes and spectrum." in path.read_text(encoding="utf-8")


def test_a_spectrum_that_is_not_there_is_refused_before_the_scan_is_looked_at(tmp_path) -> None:
    with pytest.raises(DatabaseError, match="LED-B33"):
        write_init(tmp_path / "none.glb", tmp_path / "room.toml", choices=InitChoices(spectrum="LED-B33"))
    for wrong in (0.0, -5.0, float("nan"), "700"):
        with pytest.raises(ArgumentError, match="lm"):
            InitChoices(luminous_flux_lm=wrong)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="spectrum"):
        InitChoices(spectrum=" ")


def test_a_wrong_choice_is_refused_with_what_may_stand_there() -> None:
    with pytest.raises(ArgumentError, match=r"unit: expected one of 'auto', 'm', .* found a str, 'yd'"):
        InitChoices(unit="yd")
    with pytest.raises(ArgumentError, match="height above the floor"):
        InitChoices(height=float("nan"))


def test_no_room_leaves_a_run_file_with_what_to_fill_in(builder, tmp_path) -> None:
    floor = builder(step_m=0.5)
    floor.box([0, 0, 0], [4, 3, 0.1], inward=True)
    floor.write_glb(tmp_path / "floor.glb")
    with pytest.raises(ScanError, match=r"A run file with what to fill in was written: .*room\.toml"):
        write_init(tmp_path / "floor.glb", tmp_path / "room.toml", choices=InitChoices(height=0.5))
    text = (tmp_path / "room.toml").read_text(encoding="utf-8")
    assert "ft  13.1 x 9.84 x 0.328 m" not in text  # of the file's numbers in feet: 1.22 m
    assert "#   ft  1.22 x 0.914 x 0.0305 m" in text
    assert text.count("FILL IN") >= 4
    example = text.index("# [[lamps]]")
    end = text.index("\n\n", example)
    uncommented = "\n".join(line.removeprefix("# ") for line in text[example:end].splitlines())
    run_file = parse_run_file(text[:example] + uncommented + text[end:], where="filled in")
    assert run_file.lamps[0].shape == "panel"
    assert run_file.sensors.grid is not None
    assert run_file.sensors.grid.height == 0.5


def test_a_scan_that_cannot_be_read_leaves_a_run_file_too_but_never_in_place_of_one(tmp_path) -> None:
    (tmp_path / "cut.glb").write_bytes(b"glTF\x02")
    with pytest.raises(ScanError, match="was written"):
        write_init(tmp_path / "cut.glb", tmp_path / "room.toml")
    assert tomllib.loads((tmp_path / "room.toml").read_text(encoding="utf-8"))["scan"]["file"] == "cut.glb"
    (tmp_path / "room.toml").write_text("mine", encoding="utf-8")
    with pytest.raises(ScanError):
        write_init(tmp_path / "cut.glb", tmp_path / "room.toml", force=True)
    assert (tmp_path / "room.toml").read_text(encoding="utf-8") == "mine"


def test_what_is_no_mesh_leaves_no_run_file_that_would_stand_in_the_way(tmp_path) -> None:
    with zipfile.ZipFile(tmp_path / "room.zip", "w") as archive:
        for name in ("__MACOSX/._room.usdz", "export/room.txt", "export/room.usdz"):
            archive.writestr(name, "")
    with pytest.raises(ScanError, match=r"It holds a mesh: unpack it all, and give export/room\.usdz itself"):
        write_init(tmp_path / "room.zip", tmp_path / "room.toml")
    (tmp_path / "room.png").write_bytes(b"\x89PNG")
    with pytest.raises(ScanError, match=r"one of \.glb"):
        write_init(tmp_path / "room.png", tmp_path / "room.toml")
    assert not (tmp_path / "room.toml").exists()


def test_a_name_with_a_blank_stands_in_quotes_where_it_is_to_be_typed(lit_init) -> None:
    summary = replace(lit_init[1], run_file=Path("my room.toml"))
    assert summary.lines()[-1].endswith("lidarspectra run 'my room.toml'")


def test_sensors_that_fit_nowhere_leave_a_run_file_with_all_else(dark_room, tmp_path) -> None:
    scan = tmp_path / "my room.glb"
    scan.write_bytes(dark_room.read_bytes())
    with pytest.raises(SensorError, match=r"was written: .*lidarspectra init '\S*my room\.glb' --height"):
        write_init(scan, tmp_path / "room.toml", choices=InitChoices(height=3.0))
    run_file = read_run_file(tmp_path / "room.toml")
    assert len(run_file.lamps) == 2
    assert "no sensor fits at this height" in (tmp_path / "room.toml").read_text(encoding="utf-8")


def test_the_plan_is_drawn_beside_the_run_file_and_named_in_the_last_line(lit_init) -> None:
    path, summary = lit_init
    picture = path.parent / "my.room.plan.png"
    assert summary.picture == picture
    assert "my.room.plan.png" in summary.lines()[-1]
    shown = cv2.imread(str(picture))
    assert shown is not None
    assert min(shown.shape[:2]) > 500
    blue, green, red = (shown[..., channel].astype(int) for channel in range(3))
    assert ((red > 200) & (green > 150) & (blue < 120)).sum() > 1000  # the lamps' yellow
    assert ((blue > 150) & (red < 60)).sum() > 500  # the sensors' blue


def test_a_texture_that_is_not_there_is_named(tmp_path) -> None:
    lines = ["mtllib room.mtl", "usemtl wall"]
    corners = [(x, y, z) for x in (0, 4) for y in (0, 2.5) for z in (0, 3)]  # y up
    lines += [f"v {x} {y} {z}" for x, y, z in corners] + ["vt 0 0"]
    quads = ((0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5), (0, 2, 3, 1), (4, 5, 7, 6))
    lines += ["f " + " ".join(f"{corner + 1}/1" for corner in reversed(quad)) for quad in quads]
    (tmp_path / "room.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "room.mtl").write_text("newmtl wall\nmap_Kd lost.jpg\n")
    summary = write_init(tmp_path / "room.obj", tmp_path / "room.toml")
    assert any("lost.jpg" in line for line in summary.lines())
    assert "lost.jpg" in (tmp_path / "room.toml").read_text(encoding="utf-8")


def test_a_missing_scan_leaves_no_run_file(tmp_path) -> None:
    with pytest.raises(ScanError):
        write_init(tmp_path / "none.glb", tmp_path / "room.toml")
    assert not (tmp_path / "room.toml").exists()


@pytest.mark.usefixtures("looked_once")
def test_a_place_that_cannot_be_written_is_a_clear_error(small_room, tmp_path) -> None:
    with pytest.raises(WorkspaceError, match="--out"):
        write_init(small_room, tmp_path / "nowhere" / "room.toml")


def test_a_tiny_room_gets_fewer_sensors(builder, ceiling, tmp_path) -> None:
    room = builder(step_m=0.1)
    room.box([0, 0, 0], [1.1, 1.1, 2.2], inward=True)
    room.box([0.0, 0.0, 0.0], [1.1, 0.7, 0.5], leave_out=("bottom",))
    room.write_glb(tmp_path / "cell.glb")
    summary = write_init(tmp_path / "cell.glb", tmp_path / "room.toml")
    assert 1 <= summary.sensor_count <= 176
    assert f"count = {summary.sensor_count}" in (tmp_path / "room.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("level", [True, False])
def test_a_room_that_leans_keeps_the_coordinates_of_its_file_if_asked_to(small_room, tmp_path, level: bool) -> None:
    mesh = trimesh.load(small_room, force="mesh", process=False)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(3.0), [1.0, 0.0, 0.0]))
    mesh.export(tmp_path / "leans.glb")
    summary = write_init(tmp_path / "leans.glb", tmp_path / "leans.toml", choices=InitChoices(level=level))
    section = read_run_file(tmp_path / "leans.toml").scan
    assert section.level is level
    assert any("leans by 3" in note for note in summary.scan.notes) is level
    scan = read_scan(tmp_path / "leans.glb", up=section.up, unit=section.unit, level=section.level)
    walls = np.abs(scan.normals[:, 2]) < 0.2
    assert bool(np.abs(scan.normals[walls, 2]).max() < 0.002) is level


def test_progress_is_told_to_the_end(dark_init) -> None:
    *_, told = dark_init
    assert told[-1] == 1.0
    assert told == sorted(told)


def test_the_real_meeting_room_gets_its_run_file(shared, tmp_path) -> None:
    summary = write_init(shared / "scans" / "meeting-room" / "poly.glb", tmp_path / "room.toml")
    run_file = read_run_file(tmp_path / "room.toml")
    assert len(run_file.lamps) == 12
    assert summary.sensor_count == 176
    assert "12 strips" in "\n".join(summary.lines())


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX")
@pytest.mark.parametrize("old", [None, "# my edits\n"])
def test_a_run_file_for_which_the_disk_is_too_small_leaves_what_was_there(tmp_path: Path, old: str | None) -> None:
    import resource

    path = tmp_path / "room.toml"
    if old is not None:
        path.write_text(old, encoding="utf-8")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(WorkspaceError, match=r"room\.toml.* --out"):
            init_file._write(path, "x" * 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert {file.name: file.read_text(encoding="utf-8") for file in tmp_path.iterdir()} == (
        {} if old is None else {"room.toml": old}
    )
