"""The run file that `init` writes: what it says is what was found, and `run` reads it unchanged."""

import sys
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from lidarspectra.config import parse_run_file, read_run_file
from lidarspectra.errors import RunFileError, ScanError, WorkspaceError
from lidarspectra.workflow.init_file import write_init


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


def _written(builder, picture, path):
    room = builder(step_m=0.1, noise_m=0.004)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, pictures={"top": picture})
    room.box([0.5, 1.5, 0.70], [1.7, 2.2, 0.74])
    room.write_glb(path)
    return path


def test_the_run_file_holds_what_was_found_and_is_read_unchanged(lit_room, tmp_path) -> None:
    summary = write_init(lit_room, tmp_path / "room.toml")
    run_file = read_run_file(tmp_path / "room.toml")
    assert (tmp_path / run_file.scan.file).resolve() == lit_room.resolve()
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


def test_the_assumptions_are_marked_in_the_file(lit_room, tmp_path) -> None:
    write_init(lit_room, tmp_path / "room.toml")
    text = (tmp_path / "room.toml").read_text(encoding="utf-8")
    assert text.count("# assumed") == 6
    assert "10,000 lm for each m²" in text
    assert text.count("% sure") >= 5


def test_the_lamps_of_the_run_file_hang_well(lit_room, tmp_path) -> None:
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.hardware.phone.repair import repair_scan
    from lidarspectra.radiance.scene.placement import placement_notes
    from lidarspectra.workflow.lamps_of_run import resolve_lamps

    write_init(lit_room, tmp_path / "room.toml")
    lamps = resolve_lamps(read_run_file(tmp_path / "room.toml").lamps, tmp_path)
    assert placement_notes(lamps, repair_scan(read_scan(lit_room))) == ()


def test_the_summary_tells_everything_in_lines(lit_room, tmp_path) -> None:
    lines = write_init(lit_room, tmp_path / "room.toml").lines()
    text = "\n".join(lines)
    for words in (
        "unit      m",
        "up        +y",
        "176 points",
        "1 disc, 1 panel, 1 strip",
        "room.toml",
        "Edit the lamps",
    ):
        assert words in text
    assert all("\n" not in line for line in lines)


def test_without_lit_lamps_the_file_shows_how_to_write_one(dark_room, tmp_path) -> None:
    summary = write_init(dark_room, tmp_path / "room.toml")
    text = (tmp_path / "room.toml").read_text(encoding="utf-8")
    assert summary.lamps.lamps == ()
    assert any("No lamp is lit" in line for line in summary.lines())
    with pytest.raises(RunFileError, match=r"\[\[lamps\]\]"):
        read_run_file(tmp_path / "room.toml")
    example = text.index("# [[lamps]]")
    end = text.index("\n\n", example)
    uncommented = "\n".join(line.removeprefix("# ") for line in text[example:end].splitlines())
    run_file = parse_run_file(text[:example] + uncommented + text[end:], where="the example")
    assert run_file.lamps[0].center[2] == pytest.approx(2.44, abs=0.02)


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
def test_any_file_name_survives(dark_room, tmp_path, name) -> None:
    if sys.platform == "win32" and set(name) & set('"\\\t\n'):
        pytest.skip("Windows has no such file names")
    scan = tmp_path / "scans" / name
    scan.parent.mkdir()
    scan.write_bytes(dark_room.read_bytes())
    (tmp_path / "runs").mkdir()
    write_init(scan, tmp_path / "runs" / "room.toml")
    table = tomllib.loads((tmp_path / "runs" / "room.toml").read_text(encoding="utf-8"))
    assert not Path(table["scan"]["file"]).is_absolute()
    assert (tmp_path / "runs" / table["scan"]["file"]).samefile(scan)


def test_a_run_file_that_is_there_is_kept_unless_forced(dark_room, tmp_path) -> None:
    path = tmp_path / "room.toml"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(RunFileError, match="--force"):
        write_init(dark_room, path)
    assert path.read_text(encoding="utf-8") == "mine"
    write_init(dark_room, path, force=True)
    assert "[scan]" in path.read_text(encoding="utf-8")


def test_the_scan_itself_is_never_overwritten(dark_room) -> None:
    before = dark_room.read_bytes()
    with pytest.raises(RunFileError, match="the scan itself"):
        write_init(dark_room, dark_room, force=True)
    assert dark_room.read_bytes() == before


def test_a_missing_scan_leaves_no_run_file(tmp_path) -> None:
    with pytest.raises(ScanError):
        write_init(tmp_path / "none.glb", tmp_path / "room.toml")
    assert not (tmp_path / "room.toml").exists()


def test_a_place_that_cannot_be_written_is_a_clear_error(dark_room, tmp_path) -> None:
    with pytest.raises(WorkspaceError, match="--out"):
        write_init(dark_room, tmp_path / "nowhere" / "room.toml")


def test_a_tiny_room_gets_fewer_sensors(builder, ceiling, tmp_path) -> None:
    room = builder(step_m=0.1)
    room.box([0, 0, 0], [1.1, 1.1, 2.2], inward=True)
    room.box([0.0, 0.0, 0.0], [1.1, 0.7, 0.5], leave_out=("bottom",))
    room.write_glb(tmp_path / "cell.glb")
    summary = write_init(tmp_path / "cell.glb", tmp_path / "room.toml")
    assert 1 <= summary.sensor_count <= 176
    assert f"count = {summary.sensor_count}" in (tmp_path / "room.toml").read_text(encoding="utf-8")


def test_progress_is_told_to_the_end(dark_room, tmp_path) -> None:
    told: list[float] = []
    write_init(dark_room, tmp_path / "room.toml", progress=lambda fraction, message: told.append(fraction))
    assert told[-1] == 1.0
    assert told == sorted(told)


def test_the_real_meeting_room_gets_its_run_file(shared, tmp_path) -> None:
    summary = write_init(shared / "scans" / "meeting-room" / "poly.glb", tmp_path / "room.toml")
    run_file = read_run_file(tmp_path / "room.toml")
    assert len(run_file.lamps) == 12
    assert summary.sensor_count == 176
    assert "12 strips" in "\n".join(summary.lines())
