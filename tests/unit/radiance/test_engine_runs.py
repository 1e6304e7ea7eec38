"""The engine's promises, held with stand-in programs: what is started, with what, and what becomes of bad answers."""

import os
import pickle
import sys
import threading
import time
from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import PROGRAMS, Engine, EngineJob, EngineRun, float_rows

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the stand-ins are scripts with a #! line")


def stand_ins(folder: Path, **scripts: str) -> Engine:
    """An engine whose programs are Python scripts; those not given do nothing."""
    programs, library = folder / "bin with space", folder / "lib"
    programs.mkdir()
    library.mkdir()
    (library / "rayinit.cal").touch()
    for name in PROGRAMS:
        path = programs / name
        path.write_text(f"#!{sys.executable}\nimport os, sys, time\n{scripts.get(name, '')}\n", encoding="utf-8")
        path.chmod(0o755)
    return Engine(programs=programs, library=library)


def test_a_missing_program_is_said_with_what_to_do(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path)
    (engine.programs / "rcontrib").unlink()
    with pytest.raises(EngineError, match=r"no rcontrib.*pip install pyradiance"):
        Engine(programs=engine.programs, library=engine.library)


def test_a_missing_library_is_said(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path)
    (engine.library / "rayinit.cal").unlink()
    with pytest.raises(EngineError, match=r"rayinit\.cal"):
        Engine(programs=engine.programs, library=engine.library)


def test_the_record_holds_what_was_asked_and_answered(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="sys.stderr.write('note'); sys.stdout.write(sys.stdin.read()[::-1])")
    run = engine.run("rtrace", ["-h-", "a b"], folder=tmp_path, stdin=b"abc")
    assert (run.argv, run.status, run.stderr, run.output) == (("rtrace", "-h-", "a b"), 0, "note", b"cba")
    assert run.seconds > 0
    assert run.command == 'rtrace -h- "a b"'


def test_arguments_reach_the_program_as_they_are(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="sys.stdout.write(repr(sys.argv[1:]))")
    nasty = ["$(touch x)", "; rm -rf .", "*", "a\tb", "'\""]
    assert eval(engine.run("rtrace", nasty, folder=tmp_path).output) == nasty


def test_the_child_works_in_the_scene_folder_and_the_caller_stays(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="sys.stdout.write(os.getcwd())")
    folder = tmp_path / "scène with space"
    folder.mkdir()
    before = Path.cwd()
    assert Path(engine.run("rtrace", [], folder=folder).output.decode()) == folder
    assert Path.cwd() == before


def test_the_child_sees_nothing_of_the_callers_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYPATH", "/elsewhere")
    monkeypatch.setenv("SECRET", "x")
    engine = stand_ins(tmp_path, rtrace="sys.stdout.write(repr(dict(os.environ)))")
    seen = eval(engine.run("rtrace", [], folder=tmp_path).output)
    assert "SECRET" not in seen
    assert seen["RAYPATH"] == os.pathsep.join((".", str(engine.library)))


def test_a_failing_program_is_an_error_with_its_complaint(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="sys.stderr.write('fatal - bad octree'); sys.exit(3)")
    with pytest.raises(EngineError, match=r"status 3: fatal - bad octree"):
        engine.run("rtrace", [], folder=tmp_path)


def test_a_killed_program_is_an_error(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="os.kill(os.getpid(), 9)")
    with pytest.raises(EngineError, match=r"signal 9.*memory"):
        engine.run("rtrace", [], folder=tmp_path)


def test_a_program_that_does_not_read_its_input_is_no_deadlock(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="sys.stdout.write('x' * 1_000_000)")
    assert len(engine.run("rtrace", [], folder=tmp_path, stdin=b"y" * 5_000_000).output) == 1_000_000


def test_a_program_that_hangs_is_ended_after_its_time(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="open('pid', 'w').write(str(os.getpid())); time.sleep(60)")
    with pytest.raises(EngineError, match="within 2 s"):
        engine.run("rtrace", [], folder=tmp_path, timeout_s=2.0)
    assert_gone(int((tmp_path / "pid").read_text()))


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="starts"):
        stand_ins(tmp_path).run("rtrace", [], folder=tmp_path / "none")


def test_jobs_answer_in_their_order(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="n = int(sys.argv[1]); time.sleep(0.02 * (4 - n)); sys.stdout.write(str(n))")
    jobs = [EngineJob(program="rtrace", arguments=(str(n),), folder=tmp_path) for n in range(4)]
    assert [run.output for run in engine.run_jobs(jobs, workers=4)] == [b"0", b"1", b"2", b"3"]


def test_jobs_are_drawn_as_they_are_needed(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path)
    drawn = []

    def jobs():
        for number in range(100):
            drawn.append(number)
            yield EngineJob(program="rtrace", arguments=(), folder=tmp_path)

    runs = engine.run_jobs(jobs(), workers=2)
    next(runs)
    assert len(drawn) < 10
    assert isinstance(runs, Generator)
    runs.close()


def test_one_failed_job_ends_the_others(tmp_path: Path) -> None:
    script = (
        "open(f'pid{sys.argv[1]}', 'w').write(str(os.getpid()))\nif sys.argv[1] == '0': time.sleep(1); sys.exit(1)\n"
    )
    engine = stand_ins(tmp_path, rtrace=script + "time.sleep(60)")
    jobs = [EngineJob(program="rtrace", arguments=(str(n),), folder=tmp_path) for n in range(2)]
    with pytest.raises(EngineError, match="status 1"):
        list(engine.run_jobs(jobs, workers=2))
    assert_gone(int((tmp_path / "pid1").read_text()))


def test_an_interrupt_ends_the_children(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="open('pid', 'w').write(str(os.getpid())); time.sleep(60)")

    def jobs():
        yield EngineJob(program="rtrace", arguments=(), folder=tmp_path)
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            time.sleep(0.01)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(engine.run_jobs(jobs(), workers=1))
    assert_gone(int((tmp_path / "pid").read_text()))


def test_one_callers_end_leaves_anothers_children_alone(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path, rtrace="time.sleep(float(sys.argv[1])); sys.stdout.write('done')")
    answers = []

    def other() -> None:
        answers.append(engine.run("rtrace", ["0.5"], folder=tmp_path).output)

    thread = threading.Thread(target=other)
    thread.start()
    runs = engine.run_jobs([EngineJob(program="rtrace", arguments=("0",), folder=tmp_path)] * 8, workers=2)
    next(runs)
    assert isinstance(runs, Generator)
    runs.close()
    thread.join()
    assert answers == [b"done"]


def run_of(values: np.ndarray) -> EngineRun:
    return EngineRun(argv=("rtrace",), status=0, stderr="warning", seconds=0.1, output=values.astype("f4").tobytes())


def test_numbers_are_counted() -> None:
    with pytest.raises(EngineError, match=r"expected 3 x 2 numbers, found 5\. It said: warning"):
        float_rows(run_of(np.ones(5)), rows=3, columns=2)


def test_an_answer_cut_within_a_number_is_refused() -> None:
    cut = EngineRun(argv=("rtrace",), status=0, stderr="", seconds=0.1, output=b"\0" * 23)
    with pytest.raises(EngineError, match=r"found 5\.75"):
        float_rows(cut, rows=3, columns=2)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_are_finite(bad: float) -> None:
    with pytest.raises(EngineError, match="1 of 4 NaN or infinite"):
        float_rows(run_of(np.array([1.0, bad, 0.0, 2.0])), rows=2, columns=2)


def test_rows_come_as_they_were_written() -> None:
    assert np.array_equal(float_rows(run_of(np.arange(6.0)), rows=3, columns=2), np.arange(6.0).reshape(3, 2))


def test_engines_travel_between_processes(tmp_path: Path) -> None:
    engine = stand_ins(tmp_path)
    assert pickle.loads(pickle.dumps(engine)) == engine


def assert_gone(pid: int) -> None:
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
