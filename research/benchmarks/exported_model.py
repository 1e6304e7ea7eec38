"""The exported Radiance model against the run that wrote it: `make` there, and the map.

    python -m research.benchmarks.exported_model RUN [RUN ...]

Of each run: by how much the model's irradiance, all bands together, differs from the map's in the mean over the points
that are not buried, the standard error of that mean by the scatter of the points, and the scatter itself, all over the
map's mean. The model is copied before it is made.
"""

import argparse
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.scene.exported_model import ANSWER_FILE
from lidarspectra.workflow.run_folder.workspace import stage_folder

PLACE_COLUMNS = 6  # x y z nx ny nz, before the bands


def made(model: Path) -> FloatArray:
    """(point, band) irradiance that a copy of an exported model gives with `make` [W/m²/nm]."""
    programs = str(find_engine().programs)
    environment = {**os.environ, "PATH": os.pathsep.join([programs, os.environ.get("PATH", os.defpath)])}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(shutil.copytree(model, Path(scratch) / "model"))
        subprocess.run(
            ["make", f"-j{os.cpu_count() or 1}"], cwd=folder, env=environment, check=True, capture_output=True
        )
        return np.loadtxt(folder / ANSWER_FILE, ndmin=2)[:, PLACE_COLUMNS:]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    for run in parser.parse_args(arguments).runs:
        light = load_map(stage_folder(run, "map") / MAP_FILE)
        kept = ~light["buried"].to_numpy()
        mapped = light["irradiance"].transpose("point", "band").to_numpy()[kept].sum(axis=1)
        apart = made(stage_folder(run, "trace") / "model")[kept].sum(axis=1) / mapped.mean() - mapped / mapped.mean()
        scatter = float(apart.std(ddof=1))
        print(
            f"{run.name}: model less map {apart.mean():+.2%} ± {scatter / kept.sum() ** 0.5:.2%} of its mean, "
            f"scatter {scatter:.2%}, {kept.sum()} points",
            flush=True,
        )


if __name__ == "__main__":
    main()
