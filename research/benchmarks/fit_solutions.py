"""The solutions of the fit of camera and light: what comes of other starts, and of groups that a room's hues make.

    python -m research.scenes.by_day FOLDER --scene kitchen --case night
    python -m research.benchmarks.fit_solutions FOLDER/kitchen-night-1 ...

Of each scan, camera and light are fitted from each start alone, with either family of tone curves; then surfaces are
grouped and fitted again five times. First with surfaces of all hues that the room is sorted into, then, as a run does,
with those of hues that a plane tells apart (`told_hues`). Of each start: the tone curve, the median of log reflectance
over the truth, the number of groups, half the sum of squares, the logarithm of the evidence, the scatter within
surfaces, and the mean absolute error of reflectance (linear sRGB) at the points of the fit. Costs of fits to different
groups do not compare.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting import albedo, surface_hues
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb, srgb_of_cones
from lidarspectra.material.delighting.surface_light import MIN_LIGHT
from lidarspectra.material.delighting.told_hues import told_hues
from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, USUAL_TONE
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials import delighting, light_rounds
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_rounds import REFLECTANCE_RANGE, Surfaces, fit_in_rounds
from research.benchmarks.delighting import Case, read_case, true_colors

ROUND_SHARES = (0.3, *(0.05,) * 5, 0.2, 0.25)  # of the time, of a fit and five more of grouping and fitting


class Tried:
    """The (fit, evidence) that each start ends in, and the (sample,) faces of its points, of a de-lighting."""

    found: list[tuple[LightFit, LightEvidence]]
    face: IntArray

    def fitted(
        self, surfaces: Surfaces, lamps: Sequence[Lamp], evidence: LightEvidence, **more: Any
    ) -> tuple[LightFit, LightEvidence]:
        """As `fit_in_rounds`, of each start alone, kept; the last is given."""
        self.face = surfaces.samples.face
        self.found = [
            _from(start, surfaces, lamps, replace(evidence, tone_prior=prior), **{**more, "other_families": ()})
            for prior, start in product((USUAL_TONE, FILMIC_TONE), albedo.STARTS)
        ]
        return self.found[-1]


def _from(start: tuple[float, float], *given: Any, **more: Any) -> tuple[LightFit, LightEvidence]:
    """What one start ends in."""
    with (
        patch.object(albedo, "STARTS", (start,)),
        patch.object(albedo, "FIT_SHARES", albedo.FIT_SHARES[-3:]),
        patch.object(light_rounds, "ROUND_SHARES", ROUND_SHARES),
    ):
        return fit_in_rounds(*given, **more)


def as_sorted(hues: FloatArray, label: IntArray) -> IntArray:
    """Groups of hues as they are, in the place of `told_hues`."""
    return label


def row(fit: LightFit, evidence: LightEvidence, truth: FloatArray) -> str:
    """A line of the table, given the (sample, 3) true reflectance in linear sRGB."""
    told = (truth < 1.0).all(axis=1) & (evidence.group >= 0)
    found = np.clip(srgb_of_cones(fit.reflectance), *REFLECTANCE_RANGE)
    level = np.log(np.maximum(fit.reflectance, MIN_LIGHT) / np.maximum(cones_of_srgb(truth), MIN_LIGHT))
    groups = len(np.unique(evidence.group[evidence.group >= 0]))
    return (
        f"{fit.tone_family:6s} {fit.tone.power:6.2f} {fit.tone.shoulder:8.2f} {np.median(level[told]):+7.3f} "
        f"{groups:6d} {fit.cost:7.1f} {fit.log_evidence:9.1f} {fit.scatter:8.4f} "
        f"{np.abs(found - truth)[told].mean():7.4f}"
    )


def run(folder: Path) -> None:
    """Print a scan's table."""
    case: Case = read_case(folder)
    for words, told in (("all hues of the room", as_sorted), ("hues that a plane tells apart", told_hues)):
        tried = Tried()
        with (
            patch.object(surface_hues, "told_hues", told),
            patch.object(delighting, "fit_in_rounds", side_effect=tried.fitted),
        ):
            take_light_out(case.scan, find_room(case.scan), case.lamps)
        print(f"\n{folder.name}, {words}")
        print("family  power shoulder   level groups    cost  evidence  scatter   error")
        for fit, evidence in tried.found:
            print(row(fit, evidence, true_colors(case)[tried.face]), flush=True)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="scans whose truth is known")
    for folder in parser.parse_args().folders:
        run(folder)


if __name__ == "__main__":
    main()
