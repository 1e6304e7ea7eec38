"""After a fault a run folder holds whole stages only, and the next run goes on from them to the same answer.

The table of faults and where each is tried stands in docs/faults.md. Here they strike a run in this process, stage by
stage; `test_killed_runs.py` and tests/pipeline/test_errors.py strike child processes.
"""

import errno
import json
import os
import re
import resource
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import xarray as xr

from lidarspectra.errors import EngineError, LidarSpectraError, SceneError, WorkspaceError
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.engine import seed_clock
from lidarspectra.radiance.engine.engine import PROGRAMS, Engine, find_engine
from lidarspectra.workflow import stages
from lidarspectra.workflow.pipeline import plan, run
from lidarspectra.workflow.run_folder import sensing_of_run
from lidarspectra.workflow.run_folder.workspace import (
    LOCK_FILE,
    MARKER_FILE,
    STAGES,
    StageName,
    StageResult,
    hash_files,
    stage_folder,
)

BY_TWO_TRACES = pytest.mark.chance(
    "two traces of one room, seeded by the clock, are held to errors known from eight batches"
)

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="limits and programs of POSIX")]

ROOM = """
[scan]
file = "room.glb"
[[lamps]]
name = "panel"
shape = "panel"
center = [1.2, 1.0, 2.3]
size = [0.5, 0.5]
spectrum = "LED-B3"
luminous_flux_lm = 2000
[materials]
method = "default"
coverage = 0.5
[sensors]
device = "three.csv"
[sensors.grid]
count = 4
height = 0.5
[trace]
accuracy = "low"
noise = "draft"
workers = 2
"""
STRUCK: tuple[StageName, ...] = ("scan", "views", "materials", "scene", "trace", "map")
"""Stages that faults strike here; the report is made like them, and takes longer."""
SIGMAS = 7.0  # [1] two traces of one point agree within; four points and three bands, far below one run in a million


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run file of a run of a tiny room, up to the map."""
    folder = tmp_path_factory.mktemp("faults") / "room"
    folder.mkdir()
    mesh = trimesh.creation.box(extents=(2.4, 2.0, 2.5))
    mesh.apply_translation((1.2, 1.0, 1.25))
    mesh = mesh.subdivide().subdivide()
    mesh.invert()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))  # glTF is y up
    mesh.export(folder / "room.glb")
    (folder / "three.csv").write_text("center_nm,fwhm_nm\n460,20\n560,20\n610,20\n", encoding="utf-8")
    (folder / "room.toml").write_text(ROOM, encoding="utf-8")
    run(folder / "room.toml", last="map")
    return folder / "room.toml"


@pytest.fixture
def cut_before(finished: Path, tmp_path: Path) -> Callable[[StageName], Path]:
    """Stage -> run file of a copy of that run, in which this stage and those after it are still to be made."""

    def cut(stage: StageName) -> Path:
        shutil.copytree(finished.parent, tmp_path / "room")
        run_file = tmp_path / "room" / finished.name
        for later in STAGES[STAGES.index(stage) :]:
            shutil.rmtree(stage_folder(run_file.with_suffix(".run"), later), ignore_errors=True)
        return run_file

    return cut


def assert_whole(run_file: Path, before: StageName) -> None:
    """No stage is there from `before` on, nothing is half-made, nothing is locked, and a plan says so."""
    folder = run_file.with_suffix(".run")
    done = STAGES[: STAGES.index(before)]
    expected = {MARKER_FILE, *(stage_folder(folder, stage).name for stage in done)}
    assert {path.name for path in folder.iterdir()} == expected
    assert plan(run_file) == {stage: "up to date" if stage in done else "to be made" for stage in STAGES}


def assert_continues(run_file: Path, finished: Path) -> None:
    """The next run ends well: what no chance goes into is the same to the bit, the light within its error."""
    run(run_file, last="map")
    ours, theirs = run_file.with_suffix(".run"), finished.with_suffix(".run")
    for part in ("1-scan", "2-views", "3-materials", "4-scene", "5-trace/model"):
        assert hash_files(ours / part) == hash_files(theirs / part), part
    maps = []
    for folder in (ours, theirs):
        with xr.open_dataset(folder / "6-map" / "map.nc", engine="h5netcdf") as light:
            maps.append(light.load())
    spread = np.hypot(*(light["irradiance_se"].to_numpy() for light in maps))
    difference = maps[0]["irradiance"].to_numpy() - maps[1]["irradiance"].to_numpy()
    # Four points know their spread from eight batches: the mean's own error is no smaller than 3 % of it.
    floor = 0.05 * maps[1]["irradiance"].to_numpy()
    assert np.all(np.abs(difference) < SIGMAS * spread + floor)


# --- disk, memory, interrupts, at every stage


@contextmanager
def files_limited_to(size: int) -> Iterator[None]:
    """No file of this process may grow beyond a size, as on a disk that is full [byte]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@BY_TWO_TRACES
@pytest.mark.parametrize("stage", STRUCK)
def test_a_full_disk_leaves_whole_stages_and_the_next_run_goes_on(
    cut_before: Callable[[StageName], Path], finished: Path, stage: StageName
) -> None:
    run_file = cut_before(stage)
    made = stage_folder(finished.with_suffix(".run"), stage)
    largest = max(path.stat().st_size for path in made.rglob("*") if path.is_file())
    marker = (run_file.with_suffix(".run") / MARKER_FILE).stat().st_size
    # Noise packs into more bytes or fewer: a tenth less is less in any run.
    with files_limited_to(max(9 * largest // 10, marker)), pytest.raises(LidarSpectraError) as caught:
        run(run_file, last="map")
    assert re.search(r"File too large\. .*space", str(caught.value))
    assert_whole(run_file, stage)
    if stage == "scan":  # what goes on after the others is a part of it
        assert_continues(run_file, finished)


class Striker:
    """Raises something in the middle of a stage, from where its progress is told."""

    def __init__(self, stage: StageName, fault: BaseException) -> None:
        self.stage = stage
        self.fault = fault

    def start(self, stage: StageName) -> Progress:
        return self._strike if stage == self.stage else silent

    def finish(self, result: StageResult[Any]) -> None:
        pass

    def note(self, words: str) -> None:
        pass

    def _strike(self, fraction: float, message: str) -> None:
        raise self.fault


TELL_PROGRESS: tuple[StageName, ...] = ("scan", "views", "materials", "scene", "trace")


@pytest.mark.parametrize("stage", TELL_PROGRESS)
@pytest.mark.parametrize(
    ("fault", "raised"),
    [
        (KeyboardInterrupt(), KeyboardInterrupt),
        (MemoryError("1 GB"), WorkspaceError),
        (OSError(errno.EROFS, "Read-only file system"), WorkspaceError),
    ],
    ids=["Ctrl-C", "out of memory", "read-only"],
)
def test_a_fault_within_a_stage_leaves_whole_stages(
    cut_before: Callable[[StageName], Path], stage: StageName, fault: BaseException, raised: type[BaseException]
) -> None:
    run_file = cut_before(stage)
    with pytest.raises(raised) as caught:
        run(run_file, last="map", listener=Striker(stage, fault))
    if isinstance(fault, MemoryError):
        assert f"enough memory for the stage '{stage}'" in str(caught.value)
    assert_whole(run_file, stage)


# --- engines that fail, or lie with status 0

ENGINE = """#!{python} -SE
import os, signal, subprocess, sys
run = subprocess.run(["{program}", *sys.argv[1:]], stdin=sys.stdin, capture_output=True)
{fault}
sys.stdout.buffer.write(run.stdout)
sys.stderr.buffer.write(run.stderr)
sys.exit(run.returncode)
"""
ENGINE_FAULTS = {
    "killed": ("os.kill(os.getpid(), signal.SIGKILL)", "signal|-9|killed"),
    "short": ("run.stdout = run.stdout[:-4]", "numbers"),
    "silent": ("run.stdout = b''", "numbers"),
    "NaN": ("run.stdout = b'\\xff\\xff\\xff\\xff' + run.stdout[4:]", "finite numbers"),
    "infinite": ("run.stdout = run.stdout[:-4] + b'\\0\\0\\x80\\x7f'", "finite numbers"),
}


@pytest.fixture
def lying_engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """(program, Python) -> the trace is given an engine in which that program runs, and then does this."""
    real = find_engine()

    def make(program: str, fault: str) -> None:
        folder = tmp_path / "programs"
        folder.mkdir()
        for name in PROGRAMS:
            (folder / name).symlink_to(real.programs / name)
        (folder / program).unlink()
        text = ENGINE.format(python=sys.executable, program=real.programs / program, fault=fault)
        (folder / program).write_text(text, encoding="utf-8")
        (folder / program).chmod(0o755)
        lying = Engine(programs=folder, library=real.library)
        for module in (stages, sensing_of_run):
            monkeypatch.setattr(module, "find_engine", lambda: lying)

    return make


@BY_TWO_TRACES
@pytest.mark.parametrize("kind", ENGINE_FAULTS)
def test_an_engine_that_dies_or_lies_is_noticed_and_a_sound_one_goes_on(
    cut_before: Callable[[StageName], Path], finished: Path, lying_engine: Callable[[str, str], None],
    monkeypatch: pytest.MonkeyPatch, kind: str,
) -> None:  # fmt: skip
    run_file = cut_before("trace")
    fault, words = ENGINE_FAULTS[kind]
    lying_engine("rcontrib", fault)
    with pytest.raises(EngineError, match=words):
        run(run_file, last="map")
    assert_whole(run_file, "trace")
    if kind == "NaN":
        monkeypatch.undo()
        assert_continues(run_file, finished)


@pytest.mark.parametrize(
    ("program", "fault"),
    [
        ("oconv", "run.stdout = b''"), ("oconv", "run.stdout = run.stdout[:-1]"), ("oconv", "sys.exit(3)"),
        ("obj2mesh", "run.stdout = b''"), ("obj2mesh", "run.stdout = run.stdout[:-1]"),
    ],
)  # fmt: skip
def test_a_compiler_that_fails_leaves_no_scene(
    cut_before: Callable[[StageName], Path], lying_engine: Callable[[str, str], None], program: str, fault: str
) -> None:
    run_file = cut_before("scene")
    lying_engine(program, fault)
    with pytest.raises(SceneError, match=f"{program}|mesh"):
        run(run_file, last="map")
    assert_whole(run_file, "scene")


@BY_TWO_TRACES
def test_an_octree_that_was_cut_off_is_no_dark_room(cut_before: Callable[[StageName], Path], finished: Path) -> None:
    """Of what is left, the engine would make a map without some of its lamps."""
    run_file = cut_before("trace")
    octree = run_file.with_suffix(".run") / "4-scene" / "pass0.oct"
    octree.write_bytes(octree.read_bytes()[: octree.stat().st_size // 2])
    with pytest.raises(SceneError, match="--from scene"):
        run(run_file, last="map")
    assert_whole(run_file, "trace")
    run(run_file, first="scene", last="scene")
    assert_continues(run_file, finished)


# --- clocks, places, databases


def test_a_clock_that_is_set_back_does_not_hold_a_run_up() -> None:
    slept: list[float] = []
    seed_clock.await_unused([(7_000, 7_002)], now=lambda: 3_400.0, sleep=slept.append)
    assert sum(slept) <= 1.0


def test_a_clock_that_is_set_leaves_finished_stages_up_to_date(
    cut_before: Callable[[StageName], Path], tmp_path: Path
) -> None:
    run_file = cut_before("report")
    for place in sorted(tmp_path.rglob("*")):
        os.utime(place, (0, 0) if place.name.endswith("npz") else (4e9, 4e9))
    assert list(plan(run_file).values()) == ["up to date"] * 6 + ["to be made"]


def test_a_moved_run_is_up_to_date_where_it_is(cut_before: Callable[[StageName], Path], tmp_path: Path) -> None:
    moved = cut_before("report").parent.rename(tmp_path / "an other place")
    assert list(plan(moved / "room.toml").values()) == ["up to date"] * 6 + ["to be made"]


def test_a_run_moved_away_from_its_run_file_goes_on_with_out(
    cut_before: Callable[[StageName], Path], tmp_path: Path
) -> None:
    run_file = cut_before("report")
    away = run_file.with_suffix(".run").rename(tmp_path / "away")
    assert list(plan(run_file, away).values()) == ["up to date"] * 6 + ["to be made"]


def test_a_database_that_changes_between_runs_makes_what_names_it_again_and_nothing_else(
    cut_before: Callable[[StageName], Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from lidarspectra.spectra.databases import import_lspdd

    def bring(number: int) -> None:
        lamp = {"id": number, "cct": 3000, "spectraldata": "nm,power\n400,0.1\n500,0.2\n700,0.3\n"}
        (tmp_path / f"{number}.json").write_text(json.dumps(lamp), encoding="utf-8")
        import_lspdd([tmp_path / f"{number}.json"])

    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path / "data"))
    run_file = cut_before("report")
    bring(1)
    assert list(plan(run_file).values()) == ["up to date"] * 6 + ["to be made"]  # its lamps are of no import
    text = run_file.read_text(encoding="utf-8")
    run_file.write_text(text.replace('"LED-B3"', '"LSPDD:1"'), encoding="utf-8")
    run(run_file, last="map")
    bring(2)
    # The map reads lamps again; light that they send as before is not traced again.
    assert list(plan(run_file).values()) == ["up to date"] * 5 + ["to be made"] * 2


def test_a_lock_that_nobody_holds_is_no_obstacle_whatever_it_says(cut_before: Callable[[StageName], Path]) -> None:
    run_file = cut_before("map")
    (run_file.with_suffix(".run") / LOCK_FILE).write_text(json.dumps({"pid": os.getpid()}), encoding="utf-8")
    run(run_file, last="map")
    assert not (run_file.with_suffix(".run") / LOCK_FILE).exists()
