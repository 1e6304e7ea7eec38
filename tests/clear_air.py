"""genssky's tables of the air on a summer's day, kept in a small file: it makes them in half a minute of two cores.

The file holds each table by the products of its axes that carry most of it (Tucker's decomposition): the sum of squares
that is left out is below `LEFT_OUT`². Light that was scattered more than `SCATTERING_ORDERS` times is not in them.
Both change how a clear sky's light is spread over it, by some per cent. How much light there is follows from SPECTRL2
alone (`compute_sky`).

    .venv/bin/python -m tests.clear_air

makes them by genssky, and the file of them anew.
"""

import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.engine.engine import Engine, EngineRun, find_engine
from lidarspectra.radiance.scene.sky import TABLES_FOLDER, Daylight, compute_sky

KEPT = Path(__file__).parent / "clear-air.npz"
NOON = Daylight(latitude_deg=48.0, longitude_deg=0.0, time=datetime(2024, 6, 21, 12, 0, tzinfo=UTC))
SCATTERING_ORDERS = 2  # genssky's least; it would go to 4, in twice the time
LEFT_OUT = {"tau": 1e-3, "irrad": 1e-3, "scat": 3e-3, "scat1m": 3e-3}  # [1] root of the share of squares, of each table


def read_table(path: Path) -> tuple[str, FloatArray]:
    """A table's heading, with the reach and the length of its axes, and its numbers in their shape."""
    axes, *rest = path.read_text(encoding="ascii").split("\n", 1)
    lines = rest[0].split("\n", int(axes))
    shape = [int(line.split()[2]) for line in lines[:-1]]
    heading = "\n".join([axes, *lines[:-1]])
    return heading, np.array(lines[-1].split(), dtype=np.float64).reshape(shape)


def write_table(path: Path, heading: str, table: FloatArray) -> None:
    """Write a table as genssky does, in fewer digits."""
    numbers = ("%.5e\n" * table.size) % tuple(table.ravel().tolist())
    path.write_text(f"{heading}\n{numbers}", encoding="ascii", newline="\n")


def _along(table: FloatArray, axis: int, matrix: FloatArray) -> FloatArray:
    """The table with a matrix applied along one of its axes."""
    return np.moveaxis(np.tensordot(matrix, np.moveaxis(table, axis, 0), axes=1), 0, axis)


def parted(table: FloatArray, left_out: float) -> tuple[FloatArray, list[FloatArray]]:
    """A core, and for each axis the matrix (length, kept) that takes it back, by the axis' singular vectors."""
    matrices = []
    for axis, length in enumerate(table.shape):
        unfolded = np.moveaxis(table, axis, 0).reshape(length, -1)
        directions, squares, _ = np.linalg.svd(unfolded @ unfolded.T)
        rest = np.sqrt(np.cumsum(squares[::-1])[::-1] / squares.sum())
        matrices.append(directions[:, : max(1, int((rest > left_out).sum()))])
    core = table
    for axis, matrix in enumerate(matrices):
        core = _along(core, axis, matrix.T)
    return core, matrices


def joined(core: FloatArray, matrices: Sequence[FloatArray]) -> FloatArray:
    """The table of such parts; none of its numbers is negative."""
    for axis, matrix in enumerate(matrices):
        core = _along(core, axis, matrix)
    return np.maximum(core, 0.0)


def write_tables(folder: Path, kept: Path = KEPT) -> None:
    """Write genssky's tables from the file."""
    with np.load(kept) as parts:
        for name in sorted(name for name in parts.files if "|" not in name):
            core = parts[name].astype(np.float64)
            matrices = [parts[f"{name}|{axis}"].astype(np.float64) for axis in range(core.ndim)]
            write_table(folder / name, str(parts[f"{name}|heading"]), joined(core, matrices))


def keep_tables(folder: Path, kept: Path = KEPT) -> None:
    """Write the file from genssky's tables."""
    parts: dict[str, Any] = {}
    for path in sorted(folder.glob("*.dat")):
        heading, table = read_table(path)
        core, matrices = parted(table, LEFT_OUT[path.name.split("_")[0]])
        parts[path.name], parts[f"{path.name}|heading"] = core.astype(np.float16), heading
        for axis, matrix in enumerate(matrices):
            parts[f"{path.name}|{axis}"] = matrix.astype(np.float16)
    np.savez_compressed(kept, **parts)


def made_by_genssky(atmosphere: Path) -> Path:
    """Folder of the tables that genssky makes for `NOON`, below one of the air's."""
    engine_run = Engine.run

    def fewer_orders(engine: Engine, program: str, arguments: Sequence[str], **others: Any) -> EngineRun:
        asked = ("-i", str(SCATTERING_ORDERS)) if program == "genssky" else ()
        return engine_run(engine, program, [*arguments, *asked], **others)

    with patch.object(Engine, "run", fewer_orders):
        compute_sky(NOON, atmosphere / "sky", find_engine(), atmosphere=atmosphere)
    return atmosphere / TABLES_FOLDER


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        keep_tables(made_by_genssky(Path(name)))
