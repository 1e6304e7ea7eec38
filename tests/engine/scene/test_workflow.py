"""The exported model gives the run's answer with make and Radiance alone."""

import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import SceneError
from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb, Panel
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.exported_model import write_workflow
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands

ASKED: dict[str, Any] = {"accuracy": "medium", "noise": "standard"}


@pytest.fixture(scope="module")
def engine() -> Engine:
    return find_engine()


@pytest.fixture(scope="module")
def points() -> SensorPoints:
    spots = np.array([[0.6, 0.6, 0.3], [1.5, 1.0, 0.3], [0.9, 1.6, 1.0], [1.0, 1.0, 1.5]])
    normals = np.array([[0, 0, 1.0], [0, 0, 1.0], [1.0, 0, 0], [0, 0.3, 1.0]])
    return SensorPoints(positions=spots, normals=normals, buried=np.zeros(4, dtype=bool))


def two_lamp_scene(
    folder: Path,
    mode: str,
    engine: Engine,
    *,
    alike: bool = False,
    glass: bool = False,
    third: bool = False,
    **options: Any,
) -> RadianceScene:
    """A coloured cube with two lamps of different spectra: several passes in either mode; a side may be of glass."""
    box = trimesh.creation.box(extents=(2.0, 2.0, 2.0))
    box.invert()
    scan = Scan(
        vertices=box.vertices + 1.0,
        faces=box.faces,
        appearance=Appearance(
            images=(), face_image=np.full(12, -1), corner_uv=np.zeros((12, 3, 2)), corner_color=np.ones((12, 3, 3))
        ),
        record=ScanRecord(
            file="cube", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=12, faces_kept=12
        ),
    )
    ramp = Spectrum(wavelengths_nm=[380.0, 780.0], values=[0.2, 0.7])
    wall = Material(
        name="wall", category="unknown", reflectance=ramp, source="default", provenance="default",
        confidence=1.0, measured_range_nm=(380, 780), color=(0.5, 0.5, 0.5),
    )  # fmt: skip
    pane = replace(wall, name="pane", kind="glass", transmittance=0.8)
    of_glass = glass & (box.face_normals[:, 0] > 0.9)
    materials = MaterialMap(
        materials=(wall, pane), face_material=of_glass.astype(int), face_color=np.ones((12, 3)), face_seen=np.ones(12)
    )
    down = np.array([0.0, 0.0, -1.0])
    warm = Spectrum(wavelengths_nm=[380.0, 780.0], values=[0.01, 0.05])
    line = Spectrum(wavelengths_nm=[380.0, 540.0, 545.0, 550.0, 780.0], values=[0.01, 0.01, 0.3, 0.01, 0.01])
    second = warm if alike else line
    lamps = [
        Lamp(name="warm", shape=Panel(0.4, 0.4), center=np.array([1.0, 1.0, 1.9]), normal=down, flux=warm),
        Lamp(name="line", shape=Bulb(0.05), center=np.array([0.4, 1.5, 1.2]), normal=down, flux=second),
    ]
    if third:
        lamps.append(replace(lamps[1], name="third", center=np.array([1.5, 0.4, 1.2])))
    return write_scene(scan, materials, lamps, sensor_bands("as7265x-14"), folder, mode=mode, engine=engine, **options)


def stock(engine: Engine) -> dict[str, str]:
    """An environment with Radiance's programs and make on the search path, and nothing else: no RAYPATH."""
    make = Path(str(shutil.which("make"))).parent
    return {"PATH": os.pathsep.join([str(engine.programs), str(make), os.defpath])}


def answer(folder: Path, engine: Engine, *options: str) -> np.ndarray:
    done = subprocess.run(
        ["make", *options], cwd=folder, env=stock(engine), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return np.loadtxt(folder / "irradiance.txt", ndmin=2)


needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


@pytest.mark.chance("two runs of the engine, seeded by the clock, within four of their combined errors")
@needs_make
@pytest.mark.slow
@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_make_gives_the_runs_irradiance(engine: Engine, points: SensorPoints, tmp_path: Path, mode: str) -> None:
    scene = two_lamp_scene(tmp_path / "scene", mode, engine)
    folder = tmp_path / "a model (é)"
    write_workflow(scene, points, folder, **ASKED)
    rows = answer(folder, engine, "-j2")
    np.testing.assert_allclose(rows[:, :3], points.positions, rtol=1e-6)
    transport = trace(scene, points, **ASKED, seed=1, engine=engine)
    irradiance = (transport["coefficient"] * transport["flux"]).sum("lamp").to_numpy()
    # Each side aims at 1 % standard error of the mean irradiance: four of their combined errors.
    difference = np.abs(rows[:, 6:] - irradiance) / irradiance.mean(axis=0)
    assert difference.max() < 4 * np.hypot(0.01, 0.01)
    assert np.abs((rows[:, 6:] - irradiance).mean() / irradiance.mean()) < 0.01


@needs_make
@pytest.mark.parametrize("glass", [False, True])
def test_make_does_nothing_twice_and_cleans_up(
    engine: Engine, points: SensorPoints, tmp_path: Path, glass: bool
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine, glass=glass)
    folder = write_workflow(scene, points, tmp_path / "model", accuracy="low", noise="draft").parent
    before = {path.name for path in folder.iterdir()}
    answer(folder, engine)
    again = subprocess.run(["make", "-q"], cwd=folder, env=stock(engine), capture_output=True, check=False)
    assert again.returncode == 0  # make's word for up to date
    subprocess.run(["make", "clean"], cwd=folder, env=stock(engine), capture_output=True, check=True)
    assert {path.name for path in folder.iterdir()} == before


def lying(folder: Path, engine: Engine, program: str, script: str) -> dict[str, str]:
    """The stock environment, with a script of ours in place of one of Radiance's programs."""
    folder.mkdir()
    stand_in = folder / program
    stand_in.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    stand_in.chmod(0o755)
    environment = stock(engine)
    return environment | {"PATH": os.pathsep.join([str(folder), environment["PATH"]])}


@needs_make
@pytest.mark.parametrize(
    ("program", "script"),
    [
        ("rtrace", "echo no licence >&2; exit 1"),
        ("rtrace", "exit 0"),
        ("rtrace", "cat > /dev/null; echo 1 2 3"),
        ("rcalc", "exit 1"),
        ("oconv", "exit 1"),
        ("total", "exit 3"),
        ("total", "cat > /dev/null"),
        ("rlam", "exit 1"),
        ("rlam", "head -n 1 points.txt"),
    ],
)
def test_a_program_that_fails_or_answers_too_little_ends_make_with_a_status_and_no_answer(
    engine: Engine, points: SensorPoints, tmp_path: Path, program: str, script: str
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine)
    folder = write_workflow(scene, points, tmp_path / "model", accuracy="low", noise="draft").parent
    for _ in range(2):  # a second try must not take what the first left behind for an answer
        done = subprocess.run(
            ["make"],
            cwd=folder,
            env=lying(tmp_path / f"bin{_}", engine, program, script),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode != 0
        assert not (folder / "irradiance.txt").exists()
    answer(folder, engine)  # and with the true program it goes on from there


@needs_make
def test_a_search_path_without_radiances_library_changes_nothing(
    engine: Engine, points: SensorPoints, tmp_path: Path
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine)
    folder = write_workflow(scene, points, tmp_path / "model", accuracy="low", noise="draft").parent
    environment = stock(engine) | {"RAYPATH": str(tmp_path / "nowhere")}
    subprocess.run(["make"], cwd=folder, env=environment, capture_output=True, check=True)
    assert np.loadtxt(folder / "irradiance.txt", ndmin=2).shape == (4, 20)


@needs_make
def test_without_its_function_files_make_fails_and_leaves_no_answer(
    engine: Engine, points: SensorPoints, tmp_path: Path
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine)
    folder = write_workflow(scene, points, tmp_path / "model", accuracy="low", noise="draft").parent
    (folder / "rayinit.cal").unlink()
    done = subprocess.run(["make"], cwd=folder, env=stock(engine), capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "rayinit.cal" in done.stderr
    assert not (folder / "irradiance.txt").exists()


@needs_make
def test_rad_reads_the_control_files(engine: Engine, points: SensorPoints, tmp_path: Path) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine)
    folder = write_workflow(scene, points, tmp_path / "model", **ASKED).parent
    octrees = [scene_pass.octree for scene_pass in scene.passes]
    subprocess.run(["make", *octrees], cwd=folder, env=stock(engine), capture_output=True, check=True)
    for scene_pass in scene.passes:
        commands = engine.run("rad", ["-n", f"{scene_pass.name}.rif"], folder=folder).output.decode()
        assert "oconv" not in commands  # it takes the octree that make compiled
        assert " ".join(scene_pass.group.options) in commands
        assert scene_pass.octree in commands


def test_columns_are_named_and_slots_add_up_by_their_shares(
    engine: Engine, points: SensorPoints, tmp_path: Path
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine)
    folder = write_workflow(scene, points, tmp_path / "model", **ASKED).parent
    names = (folder / "bands.txt").read_text(encoding="utf-8").splitlines()
    assert names[:7] == ["1 x_m", "2 y_m", "3 z_m", "4 nx", "5 ny", "6 nz", "7 E_410"]
    formulas = (folder / "sum.cal").read_text(encoding="utf-8").splitlines()
    columns = 1.0 + np.arange(6 + sum(scene_pass.slot_count for scene_pass in scene.passes))
    slots, column = np.zeros(len(scene.slots)), 6
    for scene_pass in scene.passes:  # the last slot of each pass comes first, since the engine starts at the long end
        found = columns[column : column + scene_pass.slot_count][::-1]
        slots[list(scene_pass.slots)] += found[: len(scene_pass.slots)]
        column += scene_pass.slot_count
    expected = scene.slots.fold(slots) / WRITTEN_PER_WATT
    for number, formula in enumerate(formulas[6:], start=7):
        text = formula.removeprefix(f"${number}=").removesuffix(";")
        value = eval(re.sub(r"\$(\d+)", lambda match: repr(float(columns[int(match[1]) - 1])), text))
        assert value == pytest.approx(expected[number - 7])


def test_a_scene_of_an_earlier_version_without_its_octrees_of_panes_is_refused(
    engine: Engine, points: SensorPoints, tmp_path: Path
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine, glass=True)  # a pass for each: of unlike spectra
    (tmp_path / "scene" / "pass0_panes.oct").unlink()
    with pytest.raises(SceneError, match="--from scene"):
        trace_plain(scene, points, accuracy="low", noise="draft", engine=engine)
    (tmp_path / "scene" / "pass0_panes.rad").unlink()
    with pytest.raises(SceneError, match="scene stage"):
        write_workflow(scene, points, tmp_path / "model", **ASKED)


@pytest.mark.parametrize("glass", [False, True])
def test_every_file_of_the_model_is_named_in_its_readme_or_made_by_make(
    engine: Engine, points: SensorPoints, tmp_path: Path, glass: bool
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine, alike=True, glass=glass)
    folder = write_workflow(scene, points, tmp_path / "model", **ASKED).parent
    text = (folder / "README.txt").read_text(encoding="ascii")
    assert "for at most 8 reflections; each sensor is traced 8 times" in " ".join(text.split())
    assert ("passN_images" in text) == glass
    named = text.replace("passN", "pass0")
    made = (folder / "Makefile").read_text(encoding="utf-8")
    others = {"README.txt", "Makefile", "rayinit.cal", "source.cal"}
    for file in {path.name for path in folder.iterdir()} - others:
        assert file in named or file in made, file


def test_in_a_room_with_glass_some_passes_may_have_more_lamps_than_others(
    engine: Engine, points: SensorPoints, tmp_path: Path
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine, alike=True, glass=True, third=True, lamps_per_pass=2)
    assert [len(each.lamps) for each in scene.passes] == [2, 1]
    write_workflow(scene, points, tmp_path / "model", **ASKED)


def test_a_scene_without_its_files_is_refused(engine: Engine, points: SensorPoints, tmp_path: Path) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine)
    (tmp_path / "scene" / "room.obj").unlink()
    with pytest.raises(SceneError, match="scene stage"):
        write_workflow(scene, points, tmp_path / "model", **ASKED)


@pytest.mark.parametrize(("mode", "glass"), [("native", False), ("rgb", False), ("native", True)])
def test_plain_rtrace_asks_the_engine_what_the_makefile_asks(
    tmp_path: Path, engine: Engine, points: SensorPoints, mode: str, glass: bool
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", mode, engine, glass=glass)
    transport = trace_plain(scene, points, accuracy="low", noise="draft", engine=engine)
    model = tmp_path / "model"
    write_workflow(scene, points, model, accuracy="low", noise="draft", engine=engine)
    rules = [line.split() for line in (model / "Makefile").read_text().splitlines() if line.startswith("\trtrace")]
    asked = [line.split() for line in transport.attrs["commands"].splitlines()]
    assert len(rules) == len(asked) == len(scene.passes) * (3 if glass else 1)
    for rule, words in zip(rules, asked, strict=True):
        program, _, shared, slots, octree, *_ = rule
        files = [(model / name.removeprefix("@")).read_text().split() for name in (shared, slots)]
        assert [program, *files[0], *files[1], octree] == [word for word in words if word not in ("-h-", "-fdf")]


@pytest.mark.chance("two runs of the engine, seeded by the clock, within five of their combined errors")
@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_plain_rtrace_and_trace_agree_lamp_by_lamp(
    tmp_path: Path, engine: Engine, points: SensorPoints, mode: str
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", mode, engine, alike=True, lamps_per_pass=1)
    assert all(len(each.lamps) == 1 for each in scene.passes)
    assert len(scene.slots) > len(scene.bands)  # else nothing is folded
    plain = trace_plain(scene, points, **ASKED, engine=engine)
    adaptive = trace(scene, points, **ASKED, seed=2, engine=engine)
    assert (plain.attrs["method"], plain.attrs["bounces"]) == ("rtrace", 8)
    difference = abs(plain["coefficient"] - adaptive["coefficient"])
    error = np.hypot(plain["coefficient_se"], adaptive["coefficient_se"])
    assert float((difference / error).max()) < 5.0
    assert float((error / adaptive["coefficient"]).median()) < 0.05  # else the above would hold of anything


@pytest.mark.chance("two runs of the engine, seeded by the clock, within five of their combined errors")
@needs_make
@pytest.mark.parametrize("glass", [False, True])
def test_plain_rtrace_and_make_give_one_irradiance(
    tmp_path: Path, engine: Engine, points: SensorPoints, glass: bool
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine, alike=True, glass=glass, lamps_per_pass=1)
    folder = write_workflow(scene, points, tmp_path / "model", **ASKED).parent
    made = answer(folder, engine)[:, 6:]
    plain = trace_plain(scene, points, **ASKED, engine=engine)
    irradiance = (plain["coefficient"] * plain["flux"]).sum("lamp").transpose("point", "band").to_numpy()
    error = np.sqrt(2.0) * plain["irradiance_se"].transpose("point", "band").to_numpy()  # both do the same work
    assert np.abs((made - irradiance) / error).max() < 5.0
    assert np.median(error / irradiance) < 0.02  # else the above would hold of anything


def test_plain_rtrace_refuses_lamps_that_it_cannot_tell_apart(
    tmp_path: Path, engine: Engine, points: SensorPoints
) -> None:
    scene = two_lamp_scene(tmp_path / "scene", "native", engine, alike=True)
    with pytest.raises(SceneError, match="'warm', 'line' in pass0"):
        trace_plain(scene, points, engine=engine)
