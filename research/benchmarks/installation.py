"""What the installation takes: by pip as `make setup` did it, and as it does it, in turn, with nothing cached.

    python -m research.benchmarks.installation
    python -m research.benchmarks.installation --demo     with the first and the second demo in each environment

Each way sets up a virtual environment of its own in a temporary folder. Processor time is that of all processes; the
clock counts the network, too, and whatever else the machine does. "Fetched" is the size of the wheels, by a
`pip download` that is not timed; the largest are named below the table. What is not compiled at the installation
is compiled when the first demo imports it.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
BIN = "Scripts" if os.name == "nt" else "bin"
OLD = f"{HERE}[decimate]"  # pymeshlab was among the main job's libraries
LARGEST = 4  # wheels that are named
DISCARDED = subprocess.DEVNULL
UNCACHED = {"PIP_NO_CACHE_DIR": "1", "UV_NO_CACHE": "1"}


def ways(folder: Path) -> dict[str, list[list[str]]]:
    """Commands of each way to set up an environment below a folder."""
    old, plain, new = (folder / name for name in ("old", "plain", "new"))
    pythons = {path: str(path / BIN / "python") for path in (old, plain, new)}
    venv = [sys.executable, "-m", "venv"]
    pip = ["-m", "pip", "install", "--quiet"]
    return {
        "pip, everything compiled, with pymeshlab": [
            [*venv, str(old)],
            [pythons[old], *pip, "--upgrade", "pip"],
            [pythons[old], *pip, "--editable", OLD],
        ],
        "pip, nothing compiled": [
            [*venv, str(plain)],
            [pythons[plain], *pip, "--no-compile", "--editable", str(HERE)],
        ],
        "`make setup`: uv, nothing compiled": [
            [*venv, str(new)],
            [sys.executable, str(HERE / "tools" / "install.py"), pythons[new], str(HERE)],
        ],
    }


def measured(commands: list[list[str]]) -> tuple[float, float]:
    """Clock and processor time of commands, one after the other [s]."""
    before, clock = os.times(), time.perf_counter()
    for command in commands:
        subprocess.run(command, check=True, env={**os.environ, **UNCACHED}, stdout=DISCARDED, stderr=DISCARDED)
    after = os.times()
    return (
        time.perf_counter() - clock,
        after.children_user + after.children_system - before.children_user - before.children_system,
    )


def size_mb(folder: Path) -> float:
    """Size of the files of a folder [MB]."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file() and not path.is_symlink()) / 1e6


def fetched(what: str, folder: Path) -> list[tuple[float, str]]:
    """Sizes [MB] and names of the wheels that an installation fetches, the largest first."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(folder), what]
    subprocess.run(command, check=True, env={**os.environ, **UNCACHED}, stderr=subprocess.DEVNULL)
    return sorted(((path.stat().st_size / 1e6, path.name.split("-")[0]) for path in folder.iterdir()), reverse=True)


def demo_s(environment: Path, folder: Path) -> float:
    """Processor time of a demo in an environment [s]."""
    return measured([[str(environment / BIN / "lidarspectra"), "demo", str(folder)]])[1]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--demo", action="store_true", help="run the demo twice in each environment")
    with_demo = parser.parse_args().demo
    print(f"| way | clock | processor | on the disk | fetched |{' first demo | second demo |' if with_demo else ''}")
    print(f"|---|---|---|---|---|{'---|---|' if with_demo else ''}")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        wheels = {what: fetched(what, folder / f"wheels-{number}") for number, what in enumerate((OLD, str(HERE)))}
        for (name, commands), environment, what in zip(
            ways(folder).items(), ("old", "plain", "new"), (OLD, str(HERE), str(HERE)), strict=True
        ):
            clock_s, processor_s = measured(commands)
            cells = [f"{clock_s:.0f} s", f"{processor_s:.1f} s", f"{size_mb(folder / environment):.0f} MB"]
            cells.append(f"{sum(size for size, _ in wheels[what]):.0f} MB")
            if with_demo:
                cells += [f"{demo_s(folder / environment, folder / f'{environment}-{n}'):.1f} s" for n in (1, 2)]
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
    largest = ", ".join(f"{name} {size:.0f} MB" for size, name in wheels[OLD][:LARGEST])
    print(f"\nThe largest of the wheels with pymeshlab: {largest}")


if __name__ == "__main__":
    main()
