"""What each family of tone curves makes of a run's picture, and what its walls would be if evidence alone chose one.

    python -m research.benchmarks.tone_families poly.toml

Of each family, fitted to the same groups of surfaces (where the usual one is not clear, then to another's): power and
shoulder, the logarithm of its evidence, the scatter within surfaces that it leaves, and the probability that the run
gives it. Then the walls' materials, as `research.benchmarks.paints` prints them, as the run chooses the family, and by
the evidence alone.
"""

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import load_scan
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.material.delighting.tone_families import probabilities
from lidarspectra.material.material_map import load_materials
from lidarspectra.room.room import load_room
from lidarspectra.workflow.materials import light_rounds
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.workspace import stage_folder
from research.benchmarks.paints import wall_in_words

Choice = Callable[..., FloatArray]


def by_evidence(*groupings: Sequence[LightFit]) -> FloatArray:
    """(fit,) probability of each family by its evidence, whatever scatter it leaves [0-1]."""
    return probabilities(*([replace(fit, scatter=0.0) for fit in fits] for fits in groupings))


def printed(choose: Choice) -> Choice:
    """The same choice, which prints what it chooses from."""

    def choose_and_print(*groupings: Sequence[LightFit]) -> FloatArray:
        found = choose(*groupings)
        for fit, share in zip(groupings[-1], found, strict=True):
            print(
                f"power {fit.tone.power:.2f}, shoulder {fit.tone.shoulder:.2f}: log evidence {fit.log_evidence:.1f}, "
                f"scatter {fit.scatter:.4f}, probability {100 * share:.1f} %",
                flush=True,
            )
        return found

    return choose_and_print


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run_file", type=Path)
    run_file = parser.parse_args(arguments).run_file
    with tempfile.TemporaryDirectory() as folder:
        for words, choose in (("as the run chooses", probabilities), ("by evidence alone", by_evidence)):
            made = Path(folder) / f"{choose.__name__}.run"
            print(f"{words}:")
            with patch.object(light_rounds, "probabilities", printed(choose)):
                run(run_file, made, last="materials")
            scan, room = load_scan(stage_folder(made, "scan")), load_room(stage_folder(made, "scan"))
            found = load_materials(stage_folder(made, "materials"))
            for wall in room.walls if room is not None else ():
                print(wall_in_words(wall, scan, found))


if __name__ == "__main__":
    main()
