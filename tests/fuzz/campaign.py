"""Damaged files for every reader, many thousands of them, in a process of its own with bounds.

    python tests/fuzz/campaign.py                         10,000 cases of each reader, as `make fuzz` does
    python tests/fuzz/campaign.py --cases 50 --together   a first look, all readers in one process
    python tests/fuzz/campaign.py --only glb --case 123   one case again, with its traceback; its file is kept

A case is right when the reader gives a result or raises an error of ours, of one paragraph; takes less than `case_s` of
processor time; starts no program but Radiance's for whole rooms, opens no connection, writes nothing outside the case's
folder and opens nothing that lies beside it. The process may use `MEMORY_BYTES`, and may not warn. The same seed
gives the same cases.
"""

import argparse
import contextlib
import faulthandler
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mutations import DECOY, one_of
from readers import READERS, Files, Reader

CASES = 10_000  # [1] of each reader
SEED = 20240513
HANG_S = 300.0  # [s] of the clock, after which the process ends itself and says where it was
MEMORY_BYTES = 6 * 2**30  # [byte] of addresses that the process may use; libraries alone take 2
LONGEST_MESSAGE = 5_000  # [1] characters; one paragraph
MAX_FAULTS = 20  # [1] of a reader that are told in full
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
FORBIDDEN_EVENTS = ("subprocess.Popen", "os.system", "os.posix_spawn", "os.exec", "os.fork", "socket.connect")
PROGRAM_EVENTS = ("subprocess.Popen", "os.posix_spawn", "os.fork")
CHANGING_EVENTS = ("os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.symlink", "os.link", "os.truncate", "os.chmod")


@dataclass
class Guard:
    """Listens to what Python does on behalf of a reader.

    Parameters
    ----------
    allowed : Path
        Where files may be written.
    decoy : Path
        What no case may open.
    programs : bool
        Whether programs may be started.
    """

    allowed: Path
    decoy: Path
    listens: bool = False
    programs: bool = False
    seen: list[str] = field(default_factory=list)

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        """Take one audit event (PEP 578)."""
        if not self.listens:
            return
        if event in FORBIDDEN_EVENTS:
            if self.programs and event in PROGRAM_EVENTS:
                return
            self.seen.append(f"{event} {arguments[:2]!r}")
        elif event == "open" and isinstance(arguments[0], str | bytes):
            path = Path(os.path.realpath(os.fsdecode(arguments[0])))
            if path == self.decoy:
                self.seen.append(f"opened {path}")
            elif isinstance(arguments[2], int) and arguments[2] & WRITING:
                self._check(event, path)
        elif event in CHANGING_EVENTS and isinstance(arguments[0], str | bytes):
            self._check(event, Path(os.path.realpath(_folder_of(event, arguments) / os.fsdecode(arguments[0]))))

    def _check(self, event: str, path: Path) -> None:
        if not path.is_relative_to(self.allowed) and path != Path(os.devnull):
            self.seen.append(f"{event} of {path}")


def _folder_of(event: str, arguments: tuple[object, ...]) -> Path:
    """Where a relative name starts: in the folder whose descriptor is given, as `shutil.rmtree` does it."""
    descriptor = arguments[1] if event in ("os.remove", "os.rmdir") and len(arguments) > 1 else -1
    if isinstance(descriptor, int) and descriptor >= 0:
        return Path(f"/proc/self/fd/{descriptor}").readlink() if Path("/proc/self/fd").exists() else Path("/dev")
    return Path()


@dataclass
class Outcome:
    """What a reader made of its cases."""

    name: str
    cases: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    seconds: float = 0.0
    peak_mib: float = 0.0
    faults: list[str] = field(default_factory=list)

    def add(self, part: "Outcome") -> None:
        """Take in what became of further cases."""
        self.cases += part.cases
        self.refused += part.refused
        self.seconds += part.seconds
        self.slowest_s = max(self.slowest_s, part.slowest_s)
        self.peak_mib = max(self.peak_mib, part.peak_mib)
        self.faults += part.faults

    def row(self) -> str:
        """Its line of the table."""
        return (
            f"| {self.name} | {self.cases:,} | {self.refused:,} | {self.slowest_s:.2f} s | {self.peak_mib:,.0f} MiB | "
            f"{self.seconds:,.0f} s | {len(self.faults)} |"
        )


@contextlib.contextmanager
def listening(guard: Guard) -> Iterator[None]:
    """Let the guard listen for a while."""
    guard.listens = True
    try:
        yield
    finally:
        guard.listens = False


def damaged(reader: Reader, sets: list[Files], case: int, seed: int) -> tuple[str, Files]:
    """The files of a case, and which of them is given to the reader; case 0 to len(sets) - 1 are the valid ones."""
    if case < len(sets):
        return next(iter(sets[case])), sets[case]
    rng = np.random.default_rng([seed, zlib.crc32(reader.name.encode()), case])
    files = dict(one_of(sets, rng))
    first = next(iter(files))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a number that fits no float
        files[first] = one_of(reader.damage, rng)(files[first], rng)
    return first, files


def fault_of(reader: Reader, path: Path, guard: Guard, outcome: Outcome) -> str | None:
    """Read one case; gives what is wrong, or None."""
    from lidarspectra.errors import LidarSpectraError

    guard.seen.clear()
    guard.programs = reader.starts_programs
    start = time.process_time()
    fault = None
    with listening(guard):
        try:
            reader.read(path)
        except LidarSpectraError as error:
            outcome.refused += 1
            message = str(error)
            if not message.isprintable() or len(message) > LONGEST_MESSAGE:
                fault = f"a message that is no paragraph, of {len(message)} characters: {message[:300]!r}"
        except (Exception, RecursionError, MemoryError):  # noqa: BLE001 - whatever comes is what is looked for
            fault = traceback.format_exc(limit=-6)
    took = time.process_time() - start
    outcome.slowest_s = max(outcome.slowest_s, took)
    if took > reader.case_s:
        fault = fault or f"took {took:.0f} s"
    return fault or ("; ".join(guard.seen[:3]) if guard.seen else None)


def seed_files(reader: Reader, work: Path) -> list[Files]:
    """The reader's valid files."""
    folder = work / "seeds"
    folder.mkdir()
    sets = list(reader.seeds(folder))
    shutil.rmtree(folder)
    return sets


def try_reader(reader: Reader, work: Path, guard: Guard, *, cases: range, seed: int, state: Path | None) -> Outcome:
    """Give a reader its cases."""
    outcome = Outcome(name=reader.name)
    sets = seed_files(reader, work)
    folder = work / "case"
    folder.mkdir(exist_ok=True)
    for name, data in sets[0].items():
        (folder / name).write_bytes(data)
    reader.read(folder / next(iter(sets[0])))  # loads libraries, which may start programs once to find their fonts
    start = time.perf_counter()
    for case in cases:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        first, files = damaged(reader, sets, case, seed)
        for name, data in files.items():
            (folder / name).write_bytes(data)
        if state is not None:
            state.write_text(str(case), encoding="utf-8")
        faulthandler.dump_traceback_later(HANG_S, exit=True)
        refused = outcome.refused
        fault = fault_of(reader, folder / first, guard, outcome)
        outcome.cases += 1
        if fault is None and case < len(sets) and outcome.refused > refused:
            fault = "a valid file was refused"
        if fault is not None:
            outcome.faults.append(f"{reader.name} --case {case}: {fault}")
    faulthandler.cancel_dump_traceback_later()
    outcome.seconds = time.perf_counter() - start
    outcome.peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return outcome


def try_readers(readers: list[Reader], arguments: argparse.Namespace) -> list[Outcome]:
    """Try readers in this process, in a folder of their own."""
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory(prefix="lidarspectra-fuzz-") as name:
        root = Path(name).resolve()
        work = root / "inner" / "work"
        work.mkdir(parents=True)
        (work / DECOY).write_text("not for readers", encoding="utf-8")
        for variable in ("LIDARSPECTRA_DATA", "XDG_CACHE_HOME", "XDG_DATA_HOME", "HOME", "TMPDIR", "MPLCONFIGDIR"):
            (work / variable).mkdir()
            os.environ[variable] = str(work / variable)
        tempfile.tempdir = None
        guard = Guard(allowed=work, decoy=work / DECOY)
        sys.dont_write_bytecode = True  # a module that is first loaded within a case would be kept, as a file
        sys.addaudithook(guard)
        first = arguments.first if arguments.case is None else arguments.case
        cases = range(first, first + (arguments.cases if arguments.case is None else 1))
        outcomes = []
        for reader in readers:
            outcome = try_reader(reader, work, guard, cases=cases, seed=arguments.seed, state=arguments.state)
            if arguments.case is not None:
                shutil.copytree(work / "case", Path("fuzz-case"), dirs_exist_ok=True)
            outcomes.append(outcome)
        return outcomes


def try_apart(reader: Reader, arguments: argparse.Namespace) -> Outcome:
    """Try one reader in processes of its own, which may be killed by what they read."""
    whole = Outcome(name=reader.name)
    cases = min(arguments.cases, reader.most_cases)
    for first in range(0, cases, reader.cases_a_process):
        whole.add(try_part(reader, first, min(reader.cases_a_process, cases - first), arguments.seed))
    return whole


def try_part(reader: Reader, first: int, cases: int, seed: int) -> Outcome:
    """Some of a reader's cases, in a process of their own."""
    with tempfile.NamedTemporaryFile(prefix="lidarspectra-fuzz-") as state:
        words = ["--only", reader.name, "--first", str(first), "--cases", str(cases), "--seed", str(seed)]
        run = subprocess.run(
            [sys.executable, __file__, *words, "--json", "--together", "--state", state.name],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if run.returncode == 0:
            return Outcome(**json.loads(run.stdout.splitlines()[-1]))
        case = Path(state.name).read_text(encoding="utf-8")
    fault = f"{reader.name} --case {case}: the process ended with {run.returncode}: {run.stderr[-2000:]}"
    return Outcome(name=reader.name, faults=[fault])


def main() -> int:
    """Run it and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", action="append", choices=[reader.name for reader in READERS])
    parser.add_argument("--without", action="append", default=[], choices=[reader.name for reader in READERS])
    parser.add_argument("--case", type=int, help="this one alone; its files are kept in ./fuzz-case")
    parser.add_argument("--together", action="store_true", help="all in one process")
    parser.add_argument("--json", action="store_true", help="a line a reader, for programs")
    parser.add_argument("--state", type=Path, help="a file that always has the number of the case")
    arguments = parser.parse_args()
    wanted = arguments.only or [reader.name for reader in READERS]
    readers = [reader for reader in READERS if reader.name in wanted and reader.name not in arguments.without]
    if arguments.together or arguments.case is not None:
        outcomes = try_readers(readers, arguments)
    else:
        outcomes = []
    if not arguments.json:
        print("| reader | cases | refused | slowest case | memory | time | faults |\n|---|---|---|---|---|---|---|")
    whole = Outcome(name="all")
    for outcome in outcomes or (try_apart(reader, arguments) for reader in readers):
        whole.add(outcome)
        if arguments.json:
            print(json.dumps(outcome.__dict__), flush=True)
            continue
        print(outcome.row(), flush=True)
        for fault in outcome.faults[:MAX_FAULTS]:
            print(f"\n{fault}", file=sys.stderr, flush=True)  # at once: the whole campaign takes long
    if arguments.json:
        return 0
    print(whole.row())
    return 1 if whole.faults else 0


if __name__ == "__main__":
    sys.exit(main())
