"""Processor time of a run's stages, of the libraries' import, and of relighting; before and after a change in turn.

    python -m research.benchmarks.stages office             a scene of `scenes/`, as `lidarspectra demo` runs it
    python -m research.benchmarks.stages ROOM.toml          any run file
    python -m research.benchmarks.stages office --against DIR --times 3   and as the package in DIR does it, in turn
    python -m research.benchmarks.stages office --profile materials       the stage's functions, by cProfile

Each run is a process of its own in an empty folder. Processor time is that of all processes together (user and system),
which a busy machine changes less than the clock; printed is the least of the runs. Memory is the most that any stage's
record has. What a run does after its report (files of figures) is in the row "after".
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import lidarspectra

HERE = Path(lidarspectra.__file__).parent.parent
WORKER = """
import cProfile, json, os, pstats, sys, time
def spent():
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system
run_file, folder, profiled = sys.argv[1:]
from pathlib import Path
from lidarspectra.workflow.inputs import copy_scene
from lidarspectra.workflow.pipeline import run
begun, marks = spent(), {"import": spent()}
profile = cProfile.Profile(time.thread_time)
class Listener:
    def start(self, stage):
        self.at = spent()
        if stage == profiled:
            profile.enable()
        return lambda done, words: None
    def finish(self, result):
        name = result.record.stage
        if name == profiled:
            profile.disable()
        marks[name] = spent() - self.at
    def note(self, words):
        pass
summary = run(run_file, folder, listener=Listener(), workers=1 if profiled else None)
marks["between"] = spent() - sum(marks.values())
memory = max(record.peak_memory_mib for record in summary.records)
if profiled:
    for order in ("cumulative", "tottime"):
        pstats.Stats(profile, stream=sys.stderr).sort_stats(order).print_stats(45)
print(json.dumps({"processor": marks, "memory": memory}))
"""
RELIGHT = ("relight", "{run}", "--lamp", "{lamp}", "--dim", "0.5")


def processor_of_children() -> float:
    """User and system time of all ended children [s]."""
    spent = os.times()
    return spent.children_user + spent.children_system


def measured(root: Path, room: Path, scratch: Path, profiled: str) -> dict[str, float]:
    """Processor time of one run by the package in a folder, part by part [s]; the memory in MiB."""
    run = scratch / "run"
    environment = {**os.environ, "PYTHONPATH": str(root)}
    begun, clock = processor_of_children(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", WORKER, str(room), str(run), profiled],
        env=environment,
        cwd=scratch,
        stdout=subprocess.PIPE,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    parts = dict(found["processor"])
    whole = processor_of_children() - begun
    parts["after"] = whole - sum(parts.values())
    parts["whole run"], parts["its clock"] = whole, time.perf_counter() - clock
    parts["memory [MiB]"] = found["memory"]
    lamp = json.loads((run / "6-map" / "lamps.json").read_text(encoding="utf-8"))[0]["name"]
    words = [word.format(run=run, lamp=lamp) for word in RELIGHT]
    for name, arguments in {"relight": words, "--help": ["--help"]}.items():
        begun = processor_of_children()
        subprocess.run(
            [sys.executable, "-m", "lidarspectra", *arguments],
            env=environment,
            cwd=scratch,
            stdout=subprocess.DEVNULL,
            check=True,
        )
        parts[name] = processor_of_children() - begun
    begun = processor_of_children()
    subprocess.run([sys.executable, "-c", "import lidarspectra"], env=environment, cwd=scratch, check=True)
    parts["import lidarspectra"] = processor_of_children() - begun
    return parts


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", help="a scene of scenes/ by name, or a run file")
    parser.add_argument("--against", type=Path, help="root of another checkout, whose package runs in turn")
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--profile", default="", help="stage whose functions are printed, on stderr")
    given = parser.parse_args()
    named = HERE / "scenes" / given.scene / "room.toml"
    room = (named if named.is_file() else Path(given.scene)).resolve()
    roots = {"now": HERE, **({"before": given.against.resolve()} if given.against else {})}
    least: dict[str, dict[str, float]] = {name: {} for name in roots}
    for _ in range(given.times):
        for name, root in roots.items():
            with tempfile.TemporaryDirectory() as scratch:
                for part, value in measured(root, room, Path(scratch), given.profile).items():
                    least[name][part] = min(value, least[name].get(part, value))
    order = list(least["now"])
    print(f"| part | {' | '.join(roots)} |{' ratio |' if given.against else ''}")
    print(f"|---|{'---|' * (len(roots) + bool(given.against))}")
    for part in order:
        values = [least[name].get(part, float("nan")) for name in roots]
        ratio = f" {values[1] / values[0]:.2f} |" if given.against and values[0] > 0 else ""
        print(f"| {part} | {' | '.join(f'{value:.2f}' for value in values)} |{ratio}")


if __name__ == "__main__":
    main()
