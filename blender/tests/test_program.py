"""The program beside Blender, for real: a scan in, a run out, its light in the scene, in folders with blanks."""

import os
import shutil
import tomllib
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender.tests.made_room import module

PROJECT = Path(__file__).resolve().parents[2]
QUICK = """[scan]
file = "scan.ply"

[[lamps]]
name = "first lamp"
shape = "panel"
center = [1.0, 1.0, 2.2]
size = [0.6, 0.6]
spectrum = "LED-B3"
luminous_flux_lm = 3000

[[lamps]]
name = "second lamp"
shape = "bulb"
center = [2.0, 2.0, 1.8]
cct_k = 2700
luminous_flux_lm = 800
dim = 0.5

[materials]
method = "default"
default = "white-plastic"

[sensors.grid]
height = 0.8
count = 9

[trace]
accuracy = "low"
noise = "draft"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inside = tmp_path / "rooms of mine"
    inside.mkdir()
    shutil.copy(PROJECT / "scenes" / "box" / "scan.ply", inside)
    return inside


def column(path: Path, name: str) -> np.ndarray:
    rows = path.read_text().splitlines()
    return np.array([float(row.split(",")[rows[0].split(",").index(name)]) for row in rows[1:]])


def shown(name: str) -> np.ndarray:
    held = bpy.data.objects["Map"].data.attributes[name].data
    values = np.empty(len(held), dtype=np.float32)
    held.foreach_get("value", values)
    return values


@pytest.mark.slow
def test_a_room_is_opened_changed_run_seen_and_dimmed(scene, program, wait, folder: Path) -> None:
    run_file = folder / "a room.toml"
    run_file.write_text(QUICK, encoding="utf-8")
    bpy.ops.lidarspectra.open_run_file(filepath=str(run_file))
    bpy.data.objects["first lamp"].location = (1.2, 1.0, 2.2)
    told: list[float] = []
    assert bpy.ops.lidarspectra.run() == {"FINISHED"}
    wait(see=lambda: told.append(scene.lidarspectra.job_fraction))
    assert scene.lidarspectra.message == ""
    assert sorted(told) == told or told.index(max(told)) > 0.5 * len(told)  # it rises, and begins anew for the export
    assert any(0.0 < each < 1.0 for each in told)
    assert tomllib.loads(run_file.read_text())["lamps"][0]["center"] == [1.2, 1.0, 2.2]
    table = folder / "a room.run" / "6-map" / "map.csv"
    for name in ("illuminance_lx", "E_410", "E_560", "E_760"):
        assert shown(name) == pytest.approx(column(table, name), rel=1e-6)
    assert scene.lidarspectra.layer_count == 4 + 14
    first, second = bpy.data.objects["first lamp"], bpy.data.objects["second lamp"]
    assert second.lidarspectra.dim == second.lidarspectra.dim_of_run == pytest.approx(0.5)
    assert second.data.color[0] > second.data.color[2]  # 2700 K is warm
    # relight by the program, and by the sliders: the same light
    before = shown("E_560").copy()
    first.lidarspectra.dim, second.lidarspectra.dim = 0.25, 1.0
    import subprocess

    order = ["relight", str(folder / "a room.run"), "--lamp", "first lamp", "--dim", "0.25", "--name", "evening"]
    subprocess.run([program, *order], check=True, capture_output=True)
    second.lidarspectra.dim = 0.5
    relit = column(folder / "a room.run" / "relit" / "evening" / "map.csv", "E_560")
    assert shown("E_560") == pytest.approx(relit, rel=1e-6)
    assert (shown("E_560") < before).all()
    # the dimmed lamps are what the next run has, and only the map is made again
    assert bpy.ops.lidarspectra.run() == {"FINISHED"}
    lines: list[str] = []
    wait(see=lambda: lines.extend(line for line in module("running").lines() if line not in lines))
    assert tomllib.loads(run_file.read_text())["lamps"][0]["dim"] == 0.25
    assert any(line.startswith("trace is up to date") for line in lines), lines
    assert first.lidarspectra.dim_of_run == pytest.approx(0.25)
    assert shown("E_560") == pytest.approx(relit, rel=1e-5)
    # another Blender loads the run without the program
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.lidarspectra.load_run(filepath=str(table))
    assert bpy.context.scene.lidarspectra.message == ""
    assert shown("E_560") == pytest.approx(relit, rel=1e-5)
    assert bpy.data.objects["first lamp"].lidarspectra.dim == pytest.approx(0.25)


@pytest.mark.slow
def test_a_run_is_stopped_and_nothing_of_it_goes_on(scene, program, wait, folder: Path) -> None:
    run_file = folder / "a room.toml"
    text = QUICK.replace('"draft"', '"fine"').replace('"low"', '"all"').replace("count = 9", "count = 2000")
    run_file.write_text(text, encoding="utf-8")
    bpy.ops.lidarspectra.open_run_file(filepath=str(run_file))
    bpy.ops.lidarspectra.run()
    running = module("running")
    group = running.job()._process.pid
    with pytest.raises(RuntimeError, match="one that runs"):
        bpy.ops.lidarspectra.run()
    wait(lambda: any("trace: " in line for line in running.lines()))
    assert running.job() is not None
    assert bpy.ops.lidarspectra.stop() == {"FINISHED"}
    wait(limit_s=60.0)
    assert "Finished stages are kept" in scene.lidarspectra.message
    assert not (folder / "a room.run" / "6-map" / "map.csv").exists()
    with pytest.raises(ProcessLookupError):
        os.killpg(group, 0)  # nobody is left in its group


@pytest.mark.slow
def test_what_the_program_refuses_is_said_in_its_words(scene, program, wait, folder: Path) -> None:
    run_file = folder / "a room.toml"
    run_file.write_text(QUICK.replace("LED-B3", "LED-none"), encoding="utf-8")
    bpy.ops.lidarspectra.open_run_file(filepath=str(run_file))
    bpy.ops.lidarspectra.run()
    wait()
    assert "LED-none" in scene.lidarspectra.message
    assert scene.lidarspectra.message.startswith("Error: ")


@pytest.mark.slow
def test_a_scan_gets_a_run_file_from_the_program_when_it_is_imported(scene, program, wait, folder: Path) -> None:
    bpy.ops.lidarspectra.import_scan(filepath=str(folder / "scan.ply"))
    wait()
    assert scene.lidarspectra.message == ""
    assert scene.lidarspectra.run_file == str(folder / "scan.toml")
    lamps = module("lamp_objects").lamps_of_scene(scene)
    assert len(lamps) == len(tomllib.loads((folder / "scan.toml").read_text())["lamps"]) > 0


def test_blenders_timer_looks_on_until_the_program_has_ended_and_loads_nothing_into_another_room(installed) -> None:
    import sys

    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)  # with a window
    scene, running, process = bpy.context.scene, module("running"), module("process")
    assert running._tick() is None
    followed: list[str] = []
    for room in ("", "another.toml"):
        scene.lidarspectra.run_file = ""
        job = process.Job([sys.executable, "-c", "pass"])
        running._RUNNING.update(
            job=job, follow=lambda scene: followed.append(scene.name), scene=scene.name, run_file=""
        )
        scene.lidarspectra.run_file = room
        while running._tick() is not None:
            pass
    assert followed == [scene.name]
    assert "another room" in scene.lidarspectra.message


def test_disabling_ends_the_program(scene, tmp_path: Path) -> None:
    import sys

    running, process = module("running"), module("process")
    job = process.Job([sys.executable, "-c", "import time; time.sleep(60)"])
    running._RUNNING.update(job=job, follow=lambda: None, scene=scene.name)
    running.end()
    assert job._process.wait(10.0) != 0
    assert running.job() is None
