"""What the installation takes: by pip as `make setup` did it, and as it does it, in turn, with nothing cached.

    python -m research.benchmarks.installation

Each way sets up a virtual environment of its own in a temporary folder. Processor time is that of all processes; the
clock counts the network, too, and whatever else the machine does.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
BIN = "Scripts" if os.name == "nt" else "bin"
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
            [pythons[old], *pip, "--editable", f"{HERE}[decimate]"],
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
        subprocess.run(command, check=True, env={**os.environ, **UNCACHED}, stderr=subprocess.DEVNULL)
    after = os.times()
    return (
        time.perf_counter() - clock,
        after.children_user + after.children_system - before.children_user - before.children_system,
    )


def size_mb(folder: Path) -> float:
    """Size of the files of a folder [MB]."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file() and not path.is_symlink()) / 1e6


def main() -> None:
    """Print the table."""
    print("| way | clock | processor | on the disk |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for (name, commands), environment in zip(ways(folder).items(), ("old", "plain", "new"), strict=True):
            clock_s, processor_s = measured(commands)
            print(
                f"| {name} | {clock_s:.0f} s | {processor_s:.1f} s | {size_mb(folder / environment):.0f} MB |",
                flush=True,
            )


if __name__ == "__main__":
    main()
