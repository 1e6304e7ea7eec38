"""Processor and clock time of a run's stages, of importing libraries, relighting and `init`; before and after in turn.

    python -m research.benchmarks.stages office             a scene of `scenes/`, as `lidarspectra demo` runs it
    python -m research.benchmarks.stages ROOM.toml          any run file
    python -m research.benchmarks.stages SCAN.glb           `init` alone, of any scan that it reads
    python -m research.benchmarks.stages office --against DIR --times 3   and as the package in DIR does it, in turn
    python -m research.benchmarks.stages office --profile materials       the stage's functions, by cProfile

Each run is a process of its own in an empty folder. Processor time is that of all processes together (user and system),
which a busy machine changes less than the clock; printed is the least of the runs, of either. Memory is the most that
any stage's record has. What a run does after its report (files of figures) is in the row "after". DIR may be a checkout
of any revision since 8119213; a scene is run as its checkout has it. A profiled run has one worker, so that all it does
shows, and its times are those of its thread.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import psutil

import lidarspectra

HERE = Path(lidarspectra.__file__).parent.parent
WORKER = """
import cProfile, json, os, pstats, sys, time
def spent():
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system
run_file, folder, profiled = sys.argv[1:]
try:
    from lidarspectra.garbage import collect_rarely  # as the command line does
    collect_rarely()
except ModuleNotFoundError:  # of revisions before 25 November 2026
    pass
from pathlib import Path
try:
    from lidarspectra.workflow.pipeline import run
except ModuleNotFoundError:  # as revision 8119213 has it
    from lidarspectra.pipeline import run
marks, clock = {"import": spent()}, {"import": time.time() - float(os.environ["BEGUN"])}
profile = cProfile.Profile(time.thread_time)
class Listener:
    def start(self, stage):
        self.at, self.moment = spent(), time.perf_counter()
        if stage == profiled:
            profile.enable()
        return lambda done, words: None
    def finish(self, result):
        name = result.record.stage
        if name == profiled:
            profile.disable()
        marks[name], clock[name] = spent() - self.at, time.perf_counter() - self.moment
    def note(self, words):
        pass
begun = time.perf_counter()
summary = run(Path(run_file), Path(folder), listener=Listener(), workers=1 if profiled else None)
marks["between"] = spent() - sum(marks.values())
clock["between"] = time.perf_counter() - begun - sum(clock.values()) + clock["import"]
memory = max(record.peak_memory_mib for record in summary.records)
if profiled:
    for order in ("cumulative", "tottime"):
        pstats.Stats(profile, stream=sys.stderr).sort_stats(order).print_stats(45)
print(json.dumps({"processor": marks, "clock": clock, "memory": memory}))
"""
COMMAND = """
try:
    from lidarspectra.cli.app import main
except ModuleNotFoundError:  # as revision 8119213 has it
    from lidarspectra.cli import main
main()
"""
RELIGHT = ("relight", "{run}", "--lamp", "{lamp}", "--dim", "0.5")


def processor_of_children() -> float:
    """User and system time of all ended children [s]."""
    spent = os.times()
    return spent.children_user + spent.children_system


def measured(root: Path, room: Path, scratch: Path, profiled: str) -> dict[str, tuple[float, float]]:
    """Processor and clock time of one run by the package in a folder, part by part [s]; the memory in MiB, twice."""
    run = scratch / "run"
    done, spent, took = _timed(root, scratch, "-c", WORKER, str(room), str(run), profiled)
    found = json.loads(done.splitlines()[-1])
    print(f"{root}: {spent:.1f} s of processor time, {took:.1f} s by the clock", file=sys.stderr, flush=True)
    parts = {name: (value, found["clock"][name]) for name, value in found["processor"].items()}
    parts["after"] = (spent - sum(p for p, _ in parts.values()), took - sum(c for _, c in parts.values()))
    parts["whole run"] = (spent, took)
    parts["memory [MiB]"] = (found["memory"], found["memory"])
    lamps = json.loads((run / "4-scene" / "lamps.json").read_text(encoding="utf-8"))
    words = [word.format(run=run, lamp=lamps[0]["name"]) for word in RELIGHT]
    parts["relight, to its answer"] = _to_first_line(root, scratch, "-c", COMMAND, *words)
    scan = room.parent / tomllib.loads(room.read_text(encoding="utf-8"))["scan"]["file"]
    others = {"relight": ("-c", COMMAND, *words), "--help": ("-c", COMMAND, "--help")}
    others["import lidarspectra"] = ("-c", "import lidarspectra")
    for name, arguments in others.items():
        _, *parts_of = _timed(root, scratch, *arguments)
        parts[name] = (parts_of[0], parts_of[1])
    return parts | measured_init(root, scan, scratch)


def measured_init(root: Path, scan: Path, scratch: Path) -> dict[str, tuple[float, float]]:
    """Processor and clock time [s] of `init` for a scan, by the package in a folder."""
    _, spent, took = _timed(root, scratch, "-c", COMMAND, "init", str(scan), "--out", str(scratch / "init.toml"))
    return {"init": (spent, took)}


def _timed(root: Path, scratch: Path, *arguments: str) -> tuple[str, float, float]:
    """What Python prints with the package in a folder; its processor and clock time [s]."""
    environment = {**os.environ, "PYTHONPATH": str(root), "BEGUN": str(time.time())}
    begun, clock = processor_of_children(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, cwd=scratch, stdout=subprocess.PIPE, check=True, text=True
    )
    return done.stdout, processor_of_children() - begun, time.perf_counter() - clock


def _to_first_line(root: Path, scratch: Path, *arguments: str) -> tuple[float, float]:
    """Processor and clock time [s] until Python prints its first line, with the package in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONUNBUFFERED": "1"}
    clock = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, *arguments], env=environment, cwd=scratch, stdout=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        running.stdout.readline()
        took, spent = time.perf_counter() - clock, psutil.Process(running.pid).cpu_times()
        running.communicate()
    return spent.user + spent.system, took


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", help="a scene of scenes/ by name, a run file, or a scan")
    parser.add_argument("--against", type=Path, help="root of another checkout, whose package runs in turn")
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--profile", default="", help="stage whose functions are printed, on stderr")
    given = parser.parse_args()
    roots = {"now": HERE, **({"before": given.against.resolve()} if given.against else {})}
    least: dict[str, dict[str, tuple[float, float]]] = {name: {} for name in roots}
    for _ in range(given.times):
        for name, root in roots.items():
            own = root / "scenes" / given.scene / "room.toml"
            room = (own if own.is_file() else Path(given.scene)).resolve()
            with tempfile.TemporaryDirectory() as scratch:
                found = (
                    measured(root, room, Path(scratch), given.profile)
                    if room.suffix == ".toml"
                    else measured_init(root, room, Path(scratch))
                )
                for part, took in found.items():
                    known = least[name].get(part, took)
                    least[name][part] = (min(took[0], known[0]), min(took[1], known[1]))
    columns = [f"{name}: {kind}" for name in roots for kind in ("processor", "clock")]
    print(f"| part | {' | '.join(columns)} |{' ratio of processor | of clock |' if given.against else ''}")
    print(f"|---|{'---|' * (len(columns) + 2 * bool(given.against))}")
    for part in least["now"]:
        values = [value for name in roots for value in least[name].get(part, (float("nan"), float("nan")))]
        ratios = [f" {values[2 + kind] / values[kind]:.2f} |" for kind in (0, 1) if given.against and values[kind] > 0]
        print(f"| {part} | {' | '.join(f'{value:.2f}' for value in values)} |{''.join(ratios)}")


if __name__ == "__main__":
    main()
