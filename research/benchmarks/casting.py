"""Light had by ray casting against the engine doing all of it, in the rooms that the trace is timed in.

    python -m research.benchmarks.casting [--room coarse|office|two] [--runs 2]

Both ways trace the same scene some times at `fine`, `ultra`. Printed: by how much the mean over the sensors differs, in
the channel where it differs most; the share of point-channels that agree within two standard errors of both; and
the root mean square difference over the mean.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import RadianceScene
from research.benchmarks.cross_check import Room
from research.benchmarks.trace import irradiance
from research.benchmarks.trace_rooms import ROOMS, write_room

SENSORS = 176


def mean_map(scene: RadianceScene, room: Room, runs: int) -> tuple[FloatArray, FloatArray]:
    """(point, band) mean of some runs, and its standard error [W/m²/nm]."""
    found = [trace(scene, room.points, accuracy="ultra", noise="fine", seed=seed) for seed in range(runs)]
    squares = np.mean([run["irradiance_se"].to_numpy() ** 2 for run in found], axis=0)
    return np.mean([irradiance(run) for run in found], axis=0), np.sqrt(squares / runs)


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--room", choices=tuple(ROOMS))
    parser.add_argument("--runs", type=int, default=2)
    options = parser.parse_args()
    for name in ROOMS if options.room is None else (options.room,):
        room = ROOMS[name](SENSORS)
        with tempfile.TemporaryDirectory(prefix="lidarspectra-") as folder:
            scene = write_room(room, Path(folder))
            cast, cast_se = mean_map(scene, room, options.runs)
            engine, engine_se = mean_map(replace(scene, shining=()), room, options.runs)
        off = cast.mean(axis=0) / engine.mean(axis=0) - 1.0
        within = np.abs(cast - engine) <= 2.0 * np.hypot(cast_se, engine_se)
        apart = np.sqrt(np.mean((cast - engine) ** 2, axis=0)).mean() / engine.mean()
        print(
            f"{name}: mean off by {off[np.abs(off).argmax()]:+.2%}, {within.mean():.0%} within two, {apart:.2%} apart"
        )


if __name__ == "__main__":
    main()
