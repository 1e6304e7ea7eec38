"""Run files made, changed and saved in Python, and what is given to `run` in their place."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.config import TraceSection, parse_run_file
from lidarspectra.material.views.views import ViewSet
from lidarspectra.workflow.run_folder.workspace import StageRecord

LAMP = {"name": "bulb", "shape": "bulb", "center": (1.5, 1.5, 1.5), "spectrum": "A", "luminous_flux_lm": 1000.0}


@pytest.fixture
def box(tmp_path: Path) -> ls.RunFile:
    return ls.read_run_file(str(ls.copy_scene("box", str(tmp_path / "box"))))


def test_a_change_is_checked_and_leaves_the_other_keys(box: ls.RunFile) -> None:
    drafted = box.changed(trace={"noise": "draft"})
    assert drafted.trace.noise == "draft"
    assert drafted.trace.accuracy == box.trace.accuracy
    assert (drafted.folder, drafted.name) == (box.folder, box.name)
    with pytest.raises(ls.LidarSpectraError, match=r"noise.*draft"):
        box.changed(trace={"noise": "loud"})
    with pytest.raises(ls.LidarSpectraError, match=r"unknown key \(did you mean 'trace'\?\)"):
        box.changed(trase={"noise": "draft"})
    assert box.changed(trace=None, sensors=None).trace == TraceSection()
    assert box.changed(cells=[{"cell": "silicon"}]).changed(cells=None) == box
    with pytest.raises(ls.LidarSpectraError, match="trase: unknown key"):
        box.changed(trase=None)


def test_run_files_that_say_the_same_are_equal_wherever_they_come_from(box: ls.RunFile) -> None:
    copy = ls.RunFile.model_validate(box.model_dump())
    assert copy.folder != box.folder
    assert copy == box
    assert hash(copy) == hash(box)
    assert copy != box.changed(trace={"noise": "draft"})
    calibrated = [each.changed(calibration={"lamps": {"bulb": 1.1}}) for each in (box, copy)]  # a table within a table
    assert len({box, *calibrated}) == 2
    assert box != "box"


@pytest.mark.parametrize("scene", ["box", "office", "apartment"])
def test_a_run_file_without_comments_says_the_same(scene: str) -> None:
    read = ls.read_run_file(ls.scenes_folder() / scene / "room.toml")
    assert parse_run_file(read.to_toml(), where="again").model_dump() == read.model_dump()


def test_a_run_file_that_is_saved_elsewhere_finds_its_scan(box: ls.RunFile, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    saved = ls.read_run_file(box.save(tmp_path / "other" / "room.toml"))
    assert (saved.folder / saved.scan.file).resolve() == (box.folder / box.scan.file).resolve()
    assert "#" in saved.text  # its comments are kept
    with pytest.raises(
        ls.LidarSpectraError, match=r"Rename it to keep it, or overwrite it: --force \(force=True in Python\)"
    ):
        box.save(tmp_path / "other" / "room.toml")
    changed = box.changed(trace={"noise": "draft"})
    assert ls.read_run_file(changed.save(str(tmp_path / "other" / "room.toml"), force=True)).trace.noise == "draft"


def test_a_run_file_that_is_saved_elsewhere_finds_every_file_that_it_names(box: ls.RunFile, tmp_path: Path) -> None:
    for name in ("tube.csv", "cell.csv", "a.csv", "b.csv", "points.csv"):
        (box.folder / name).write_text("any\n")
    lamps = [LAMP | {"spectrum": "tube.csv"}, LAMP | {"name": "second", "spectrum": "FL11"}]
    named = box.changed(
        lamps=lamps,
        cells=[{"cell": "cell.csv"}, {"cell": "silicon"}],
        materials={"databases": ["builtin", "a.csv", "b.csv"], "method": "file", "file": "not-there-yet.csv"},
        sensors={"points": "points.csv", "grid": None},
    )
    text = named.to_toml().replace('"tube.csv"', "'tube.csv'  # the label says \"tube.csv\"")
    (box.folder / "named.toml").write_text(text)
    (tmp_path / "other").mkdir()
    there = ls.read_run_file(box.folder / "named.toml")
    saved = ls.read_run_file(there.save(tmp_path / "other" / "room.toml"))
    assert '"../box/tube.csv"  # the label says "tube.csv"' in saved.text
    assert saved.lamps[1].spectrum == "FL11"
    assert [cell.cell for cell in saved.cells] == ["../box/cell.csv", "silicon"]
    assert saved.materials.databases == ("builtin", "../box/a.csv", "../box/b.csv")
    assert saved.materials.file == "../box/not-there-yet.csv"
    assert saved.sensors.points == "../box/points.csv"
    back = ls.read_run_file(saved.save(box.folder / "back.toml"))
    assert back.model_dump() == there.model_dump()


def test_a_name_over_several_lines_moves_too_without_the_comments(box: ls.RunFile, tmp_path: Path) -> None:
    text = box.text.replace(f'file = "{box.scan.file}"', f'file = """\n{box.scan.file}"""', 1)
    assert text != box.text
    (box.folder / "long.toml").write_text(text)
    (tmp_path / "other").mkdir()
    saved = ls.read_run_file(ls.read_run_file(box.folder / "long.toml").save(tmp_path / "other" / "room.toml"))
    assert (saved.folder / saved.scan.file).resolve() == (box.folder / box.scan.file).resolve()


def test_init_gives_the_text_that_the_command_writes_and_a_run_file_that_runs(tmp_path: Path) -> None:
    scan = ls.copy_scene("box", tmp_path).parent / "scan.ply"
    made = ls.init(str(scan), unit="m", up="+z", height=0.7)
    assert made.sensors.grid is not None
    assert made.sensors.grid.height == 0.7
    assert "written by 'lidarspectra init'" in made.text
    assert "1 lamp (1 assumed)" in repr(made)  # proposed, since none is lit
    assert made.lamps[0].assumed
    assert made.scan.assumed == ()
    with pytest.raises(ls.LidarSpectraError, match="a dark room has no map"):
        ls.run(made.changed(lamps=[]))
    summary = ls.run(made.changed(lamps=[LAMP]), last="scan")
    assert summary.folder == tmp_path.resolve() / "scan.run"
    assert summary.room.height_m == pytest.approx(3.0, abs=0.02)  # flattening moves a vertex by millimetres
    assert "scan" in repr(summary)
    with pytest.raises(ls.LidarSpectraError, match=r"as far as the stage 'map'.*last='map'"):
        _ = summary.map


def test_a_wrong_run_file_is_told_with_what_was_meant() -> None:
    with pytest.raises(TypeError, match=r"run_file: expected a run file: the name of a TOML file .*, found an int, 3"):
        ls.run(3)  # type: ignore[arg-type]
    with pytest.raises(ls.ArgumentError, match=r"last: expected one of 'scan', .*, found a str, 'maps'"):
        ls.run("room.toml", last="maps")  # type: ignore[arg-type]
    with pytest.raises(ls.ArgumentError, match="the name of a scan's file"):
        ls.init(None)  # type: ignore[arg-type]
    with pytest.raises(ls.LidarSpectraError, match=r"nowhere\.toml"):
        ls.run("nowhere.toml")


@pytest.mark.parametrize("workers", ["2", 1.5, 0])
def test_workers_are_a_whole_number(box: ls.RunFile, workers: int) -> None:
    with pytest.raises(ls.ArgumentError, match="workers: expected a whole number of 1 or more"):
        ls.run(box, workers=workers)


@pytest.mark.parametrize("place", [".", "/"])
def test_a_place_without_a_name_is_no_run_file_and_no_run(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ls.LidarSpectraError, match="Name a run file in it"):
        ls.run(place)
    (fault,) = ls.check(place).faults
    assert "Name a run file in it" in str(fault)
    with pytest.raises(ls.LidarSpectraError, match="a run with a finished stage"):
        ls.light_of_run(place)


def test_the_package_is_a_program_too() -> None:
    shown = subprocess.run(
        [sys.executable, "-m", "lidarspectra", "--help"], capture_output=True, text=True, encoding="utf-8", check=True
    )
    assert "lidarspectra" in shown.stdout


def test_records_tell_what_they_hold(box: ls.RunFile) -> None:
    assert repr(ls.sensor_bands("as7265x-14")).startswith("<BandSet 'as7265x-14': 14 bands, 410, 435")
    assert "300 to" in repr(ls.lamp_spectrum("A").spectrum)
    assert repr(ls.SensorPoints(positions=[(0, 0, 1), (2, 0, 1)])).startswith("<SensorPoints: 2 points; x 0.00 to 2.00")
    lamp = ls.make_lamp("bulb", (1, 1, 2), name="desk", spectrum="A", luminous_flux_lm=800)
    assert repr(lamp).startswith("<Lamp 'desk': bulb at (1.00, 1.00, 2.00) m")
    model = ls.RoomModel.from_box(4, 3, 2.7)
    assert "12 triangles, 4.00 x 3.00 x 2.70 m, without colour" in repr(model.scan)
    assert re.match(r"<Room: 4\.0\d m x 3\.0\d m, 12\.\d m² of plan, 2\.70 m high", repr(model.room))
    assert "12 faces, 6 materials: floor" in repr(model.materials)
    assert "accuracy" in repr(box)
    views = ViewSet(
        views=(),
        viewpoints=np.zeros((2, 3)),
        face_seen=np.ones(4),
        area_coverage=0.964,
        point_coverage=0.9,
        threshold=0.95,
        history=np.array([0.5, 0.964]),
        stopped="covered",
    )
    assert repr(views) == "<ViewSet: 0 views from 2 viewpoints cover 96.4 % of the area (wanted 95 %)>"


def test_scenes_and_records_of_stages_tell_what_they_hold_and_a_scene_takes_a_folders_name(tmp_path: Path) -> None:
    model = ls.RoomModel.from_box(4, 3, 2.7)
    lamp = ls.make_lamp("bulb", (1, 1, 2), name="desk", spectrum="A", luminous_flux_lm=800)
    scene = ls.write_scene(model.scan, model.materials, [lamp], ls.sensor_bands("as7265x-14"), str(tmp_path / "scene"))
    assert re.fullmatch(
        r"<RadianceScene in .*scene: 1 lamp, 14 channels in \d+ slots, \d+ pass(es)?, mode native>", repr(scene)
    )
    record = StageRecord(
        stage="scan",
        key="0",
        settings={},
        finished="2026-01-02T03:04:05+00:00",
        seconds=4.5,
        peak_memory_mib=400.0,
        summary="54 triangles",
        warnings=(),
        outputs={},
        versions={},
    )
    assert repr(record) == "<StageRecord 'scan', finished 2026-01-02T03:04:05+00:00 in 4.5 s: 54 triangles>"


def test_a_room_is_copied_over_no_file_of_the_user_s(tmp_path: Path) -> None:
    run_file = ls.copy_scene("box", tmp_path / "new")
    assert ls.copy_scene("box", tmp_path / "new") == run_file
    run_file.write_text("# mine\n", encoding="utf-8")
    (tmp_path / "new" / "walls.csv").unlink()
    with pytest.raises(ls.LidarSpectraError, match=r"room\.toml\), which may be yours"):
        ls.copy_scene("box", tmp_path / "new")
    assert run_file.read_text(encoding="utf-8") == "# mine\n"
    assert not (tmp_path / "new" / "walls.csv").exists()
    (tmp_path / "scan.ply").write_bytes(b"my scan")
    with pytest.raises(ls.LidarSpectraError, match=r"scan\.ply"):
        ls.copy_scene("box", tmp_path)
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["new", "scan.ply"]
