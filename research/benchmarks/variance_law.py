"""How the variance of traced light falls with the number of samples, from the first round of a trace to the second.

    python -m research.benchmarks.variance_law office apartment     scenes of `scenes/`
    python -m research.benchmarks.variance_law ROOM.toml --times 2  any run file

Printed are, for each part of each pass, the samples a batch after either round, by how much the variance fell (greatest
of the channels, mean over the points), and the exponent a of n^-a that this is; and the standard error after each.
`estimator.FALL` is what the trace reckons with.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lidarspectra.radiance.sampling import rounds
from lidarspectra.radiance.sampling.estimator import Component, band_variance
from lidarspectra.radiance.sampling.stated_error import relative_rms
from lidarspectra.workflow.pipeline import run

SCENES = Path("scenes")


def trace_told(run_file: Path) -> None:
    """Run as far as the trace, and print what its rounds leave."""
    seen: list[list[tuple[str, float, float]]] = []
    sample = rounds._sample

    def sampled(components: Sequence[Component], *given: Any, **named: Any) -> None:
        sample(components, *given, **named)
        seen.append(
            [
                (each.sampler.kind, float(each.samples.mean()), float(band_variance(each).mean(axis=0).max()))
                for each in components
            ]
        )

    def told(*given: Any) -> float:
        error = float(relative_rms(*given))
        print(f"{run_file}: standard error {100 * error:.2f} % of the mean")
        return error

    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(rounds, "_sample", sampled),
        patch.object(rounds, "relative_rms", told),
    ):
        run(run_file, Path(folder) / "run", last="trace")
    for (kind, first, before), (_, second, after) in zip(*seen[:2], strict=True):
        if second > first and after > 0:
            exponent = np.log(before / after) / np.log(second / first)
            print(
                f"  {kind:6} {first:.0f} to {second:.0f} samples: {before / after:.1f} times less, a = {exponent:.2f}"
            )


def main() -> None:
    """Trace the rooms."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+", help="scenes by name, or run files")
    parser.add_argument("--times", type=int, default=1)
    given = parser.parse_args()
    for room in given.rooms:
        path = Path(room) if room.endswith(".toml") else SCENES / room / "room.toml"
        for _ in range(given.times):
            trace_told(path.resolve())


if __name__ == "__main__":
    main()
