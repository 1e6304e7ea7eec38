"""What a user sees when something is wrong: one clear paragraph, status 1, and nothing that a later run would trust.

Faults are tried through the command line's own entry point. Where a process matters (signals), and once for a fault in
a file, it is the installed program, as a child process.
"""

import contextlib
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from lidarspectra.radiance.engine.engine import find_engine
from tests.pipeline.conftest import CommandLine

BY_SIGNAL = pytest.mark.chance("a signal must hit a child process while one of its programs runs")

pytestmark = pytest.mark.slow  # runs to cut, and child processes that load their libraries anew, which takes seconds

RoomWriter = Callable[..., Path]
SCAN = "room scan.glb"
LEFT_AFTER_A_FAULT = {"1-scan", "2-views", "3-materials", "4-scene", "lidarspectra-run.json"}
KNOWN_AFTER_S = 0.03  # [s] between the start of a child and its parent's word on it
LONGEST_WAIT_S = 120.0  # [s] for a stage to begin on a loaded machine


def paragraph(answer: Any) -> str:
    """The one paragraph of a refused command."""
    assert answer.status == 1, answer
    assert "Traceback" not in answer.stdout + answer.stderr
    assert "Warning" not in answer.stderr
    assert answer.stderr.startswith("Error: ")
    assert answer.stderr.count("Error: ") == 1
    assert re.search(r"expected .+, found .+\. \S.+\.$", answer.words), answer.words  # ... and what to do
    return str(answer.words)


@pytest.fixture(scope="module")
def slow_text(room_text: str) -> str:
    """A run file whose materials do not depend on the lamps, and whose trace takes seconds, to be cut in."""
    text = room_text.replace("coverage = 0.5", "coverage = 0.5\ndelight = false")
    return text.replace("count = 9", "count = 25").replace('noise = "draft"', 'noise = "standard"')


@pytest.fixture(scope="module")
def prepared(
    command_line: Any, tmp_path_factory: pytest.TempPathFactory, write_room: RoomWriter, slow_text: str
) -> Path:
    """The run file of a run whose four first stages are done."""
    run_file = write_room(tmp_path_factory.mktemp("prepared"), slow_text)
    answer = command_line("scene", run_file)
    assert answer.status == 0, answer.stderr
    return run_file


def a_copy(prepared: Path, folder: Path) -> Path:
    shutil.copytree(prepared.parent, folder)
    return folder / prepared.name


# --- scans


def remove(scan: Path) -> None:
    scan.unlink()


def cut_off(scan: Path) -> None:
    scan.write_bytes(scan.read_bytes()[: scan.stat().st_size // 2])


def make_image_bomb(scan: Path) -> None:
    """Say in the texture's header that it has 60,000 x 60,000 pixels."""
    data = bytearray(scan.read_bytes())
    start = data.index(b"IHDR")
    header = b"IHDR" + struct.pack(">II", 60_000, 60_000) + bytes(data[start + 12 : start + 17])
    data[start : start + 21] = header + struct.pack(">I", zlib.crc32(header))
    scan.write_bytes(data)


def put_nan(scan: Path) -> None:
    """Make the first vertex's place no number."""
    data = scan.read_bytes()
    size = struct.unpack("<I", data[12:16])[0]
    positions = data.index(struct.pack("<f", 2.5), 20 + size)  # the ceiling's height is no other number's value
    scan.write_bytes(data[:positions] + struct.pack("<f", float("nan")) + data[positions + 4 :])


def take_faces_out(scan: Path) -> None:
    """An STL of no triangle, under a name that the run file will be told."""
    scan.with_name("empty.stl").write_bytes(bytes(80) + struct.pack("<I", 0))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (remove, "room scan.glb: expected a scan file, found nothing there"),
        (cut_off, "room scan.glb: expected .* cut"),
        (make_image_bomb, "60000|3,?600,?000,?000|3600 million"),
        (put_nan, "NaN|finite"),
        (take_faces_out, "empty.stl: expected .*(triangle|face|mesh)"),
    ],
)
def test_a_bad_scan_is_refused_in_words(
    command_line: Any, write_room: RoomWriter, tmp_path: Path, spoil: Callable[[Path], None], words: str
) -> None:
    run_file = write_room(tmp_path)
    spoil(tmp_path / SCAN)
    if (tmp_path / "empty.stl").exists():
        run_file.write_text(run_file.read_text("utf-8").replace(SCAN, "empty.stl"), encoding="utf-8")
    said = paragraph(command_line("run", run_file))
    assert re.search(words, said), said
    assert not (tmp_path / "room.run").exists()


# --- run files


def test_in_the_test_s_process_a_command_answers_as_the_program_does(command_line: CommandLine, tmp_path: Path) -> None:
    for words in (("databases", "list"), ("run", tmp_path / "missing.toml")):
        assert command_line(*words) == command_line.as_program(*words)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('accuracy = "low"', 'acuracy = "low"', "trace.acuracy: unknown key"),
        ("count = 9", "count = -9\nheigth = 1", "sensors.grid.count: .*; sensors.grid.heigth: unknown key"),
        ("[trace]", "[trace", "expected valid TOML, found .*line"),
    ],
)
def test_a_slip_in_a_run_file_is_named(
    command_line: Any, write_room: RoomWriter, room_text: str, tmp_path: Path, old: str, new: str, words: str
) -> None:
    run_file = write_room(tmp_path, room_text.replace(old, new))
    said = paragraph(command_line("run", run_file))
    assert re.search(words, said), said
    assert "room.toml" in said
    assert not (tmp_path / "room.run").exists()


def test_a_dark_room_is_refused(command_line: Any, write_room: RoomWriter, room_text: str, tmp_path: Path) -> None:
    dark = re.sub(r"\[\[lamps\]\].*?(?=\[\[lamps|\[mat)", "", room_text, flags=re.DOTALL)
    assert "a dark room has no map" in paragraph(command_line("run", write_room(tmp_path, dark)))


def test_a_scan_given_for_a_run_file_is_told_apart(command_line: Any, write_room: RoomWriter, tmp_path: Path) -> None:
    write_room(tmp_path)
    assert "lidarspectra init" in paragraph(command_line.as_program("run", tmp_path / SCAN))


# --- places


def test_a_place_that_cannot_be_written_is_named(command_line: Any, write_room: RoomWriter, tmp_path: Path) -> None:
    run_file = write_room(tmp_path)
    (tmp_path / "file").write_text("", encoding="utf-8")  # not permissions: an administrator may write anywhere
    said = paragraph(command_line("run", run_file, "--out", tmp_path / "file" / "run"))
    assert "expected a run folder that can be written" in said
    assert "--out" in said


def test_a_folder_of_other_things_is_left_alone(command_line: Any, write_room: RoomWriter, tmp_path: Path) -> None:
    run_file = write_room(tmp_path)
    other = tmp_path / "thesis"
    other.mkdir()
    (other / "chapter.txt").write_text("mine", encoding="utf-8")
    assert "chapter.txt" in paragraph(command_line("run", run_file, "--out", other))
    assert [path.name for path in other.iterdir()] == ["chapter.txt"]


def test_no_engine_is_told_with_how_to_get_it(
    command_line: Any, tmp_path: Path, prepared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyradiance").mkdir()
    (tmp_path / "pyradiance" / "__init__.py").write_text("", encoding="utf-8")  # hides the real one
    monkeypatch.delitem(sys.modules, "pyradiance", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    run_file = a_copy(prepared, tmp_path / "room")
    said = paragraph(command_line("run", run_file))
    assert "expected Radiance's programs" in said
    assert "pip install pyradiance" in said
    doctor = command_line("doctor")
    assert doctor.status == 1
    assert "pip install pyradiance" in doctor.stdout
    assert "Traceback" not in doctor.stderr


# --- lamps and sensors


def test_a_lamp_outside_the_scan_is_refused_before_anything_is_made_of_it(
    command_line: Any, prepared: Path, slow_text: str, tmp_path: Path
) -> None:
    run_file = a_copy(prepared, tmp_path / "room")
    run_file.write_text(slow_text.replace("[1.2, 1.0, 2.3]", "[9.0, 1.0, 2.3]"), encoding="utf-8")
    said = paragraph(command_line("scene", run_file))
    assert 'lamp "one" !rm\' at (9.00, 1.00, 2.30) m' in said
    assert "Correct 'center'" in said


def test_a_lamp_that_sticks_through_a_wall_is_told_and_the_run_goes_on(
    command_line: Any, prepared: Path, slow_text: str, tmp_path: Path
) -> None:
    run_file = a_copy(prepared, tmp_path / "room")
    run_file.write_text(slow_text.replace("[0.6, 1.6, 1.9]", "[0.6, 1.99, 1.9]"), encoding="utf-8")
    answer = command_line("scene", run_file)
    assert answer.status == 0, answer.stderr
    (note,) = [line for line in answer.stdout.splitlines() if "note: " in line and "'warm'" in line]
    assert re.search("surface .*all of the light reaches the room", note)


def test_sensors_that_all_lie_outside_are_refused(
    command_line: Any, prepared: Path, slow_text: str, tmp_path: Path
) -> None:
    run_file = a_copy(prepared, tmp_path / "room")
    text = slow_text.replace("[sensors.grid]\ncount = 25\nheight = 0.5", '[sensors]\npoints = "places.csv"')
    run_file.write_text(text, encoding="utf-8")
    (run_file.parent / "places.csv").write_text("x,y,z\n1,1,-4\n8,1,1\n", encoding="utf-8")
    said = paragraph(command_line("run", run_file))
    assert "sensors.points: places.csv: " in said
    assert "2 of 2" in said
    assert {path.name for path in run_file.with_suffix(".run").iterdir()} == LEFT_AFTER_A_FAULT


# --- interruption

NEEDS_SIGNALS = pytest.mark.skipif(sys.platform == "win32", reason="signals to a process group are POSIX")


def engine_children(process: int) -> list[psutil.Process]:
    """The engine's programs that a run has started, long enough ago that it knows of them, and that still run.

    Libraries start processes of their own while they are imported, before the run holds its folder.
    """
    programs = str(find_engine().programs)
    children = []
    for child in psutil.Process(process).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
            is_known = time.time() - child.create_time() > KNOWN_AFTER_S
            if is_known and child.status() != psutil.STATUS_ZOMBIE and programs in " ".join(child.cmdline()[:2]):
                children.append(child)
    return children


def assert_ended(children: list[psutil.Process]) -> None:
    """A child whose parent ended first may stay a zombie where nobody collects those, as in a container."""
    _, alive = psutil.wait_procs(children, timeout=5)
    for child in alive:
        with contextlib.suppress(psutil.NoSuchProcess):
            assert child.status() == psutil.STATUS_ZOMBIE


def cut(run: "subprocess.Popen[str]", how: signal.Signals, *, group: bool) -> tuple[str, list[psutil.Process]]:
    """Send a signal while a program of the engine runs; gives what was said, and the programs."""
    until = time.monotonic() + LONGEST_WAIT_S
    children: list[psutil.Process] = []
    while not children:
        assert run.poll() is None, run.communicate()
        assert time.monotonic() < until, "no program was started"
        time.sleep(0.005)
        children = engine_children(run.pid)
    if group:
        os.killpg(run.pid, how)
    else:
        os.kill(run.pid, how)
    _, said = run.communicate(timeout=LONGEST_WAIT_S)
    return said, children


def assert_cut_in_words(status: int, said: str) -> None:
    assert status == 1
    assert said == "Interrupted. Finished stages are kept. Give the same command again to continue after them.\n"


def ask_for_less(run_file: Path) -> None:
    """Let the trace that is made again be a quick one: it is made from its start, whatever its noise."""
    text = run_file.read_text(encoding="utf-8")
    run_file.write_text(text.replace('noise = "standard"', 'noise = "draft"'), encoding="utf-8")


def states(command_line: Any, run_file: Path) -> dict[str, str]:
    """What a run would make."""
    answer = command_line("run", run_file, "--dry-run")
    assert answer.status == 0, answer.stderr
    lines = re.findall(r"^\d (\w+) +(up to date|to be made)", answer.stdout, flags=re.MULTILINE)
    return dict(lines)


@BY_SIGNAL
@NEEDS_SIGNALS
@pytest.mark.parametrize(
    ("how", "group"), [(signal.SIGINT, True), (signal.SIGTERM, False)], ids=["Ctrl-C in a terminal", "kill"]
)
def test_a_run_cut_in_the_trace_leaves_nothing_and_resumes_there(
    command_line: Any, prepared: Path, tmp_path: Path, how: signal.Signals, group: bool
) -> None:
    run_file = a_copy(prepared, tmp_path / "room")
    run = command_line.start("map", run_file)
    said, children = cut(run, how, group=group)
    assert_cut_in_words(run.returncode, said)
    assert_ended(children)
    assert {path.name for path in run_file.with_suffix(".run").iterdir()} == LEFT_AFTER_A_FAULT
    assert list(states(command_line, run_file).values()) == ["up to date"] * 4 + ["to be made"] * 3
    if group:  # once is enough: what is left behind is the same
        ask_for_less(run_file)
        answer = command_line("map", run_file)
        assert answer.status == 0, answer.stderr
        assert re.findall(r"^(\d) \w+ +kept", answer.stdout, flags=re.MULTILINE) == ["1", "2", "3", "4"]


@BY_SIGNAL
@NEEDS_SIGNALS
def test_a_run_that_was_killed_is_taken_up_again(command_line: Any, prepared: Path, tmp_path: Path) -> None:
    run_file = a_copy(prepared, tmp_path / "room")
    run = command_line.start("map", run_file)
    cut(run, signal.SIGKILL, group=True)
    left = {path.name for path in run_file.with_suffix(".run").iterdir()}
    assert {"5-trace.partial", "run.lock"} <= left  # nothing could tidy up ...
    assert states(command_line, run_file)["trace"] == "to be made"  # ... and nothing trusts it
    ask_for_less(run_file)
    answer = command_line("map", run_file)
    assert answer.status == 0, answer.stderr
    left = {path.name for path in run_file.with_suffix(".run").iterdir()}
    assert left == LEFT_AFTER_A_FAULT | {"5-trace", "6-map"}


DAYLIGHT = """
[daylight]
latitude_deg = 48.1
longitude_deg = 11.6
time = 2024-06-21T12:00:00+02:00
[[daylight.windows]]
name = "window"
center = [0.05, 1.0, 1.5]
size = [1.0, 1.0]
normal = [1, 0, 0]
"""


@BY_SIGNAL
@NEEDS_SIGNALS
def test_a_run_cut_in_the_scene_leaves_no_half_written_sky(prepared: Path, slow_text: str, tmp_path: Path) -> None:
    command_line = CommandLine(tmp_path / "cache")  # without tables of the air
    run_file = a_copy(prepared, tmp_path / "room")
    run_file.write_text(slow_text + DAYLIGHT, encoding="utf-8")
    run = command_line.start("scene", run_file)  # the first sky of a climate takes a minute
    said, children = cut(run, signal.SIGINT, group=True)
    assert_cut_in_words(run.returncode, said)
    assert_ended(children)
    assert list(states(command_line, run_file).values()) == ["up to date"] * 3 + ["to be made"] * 4
    assert not (run_file.with_suffix(".run") / "4-scene.partial").exists()
    assert not list(command_line.cache.rglob("*.dat"))
