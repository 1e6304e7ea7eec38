"""Why reflectances have the level they have: the fit of camera and light against the one that the truth asks for.

    python -m research.benchmarks.level FOLDER [--only red-room-day ...]

Of each scan that `research.scenes.by_day` made, for the last fit's evidence: half the sum of squares, of the data and
of the priors by themselves; the median of log ρ over the truth, and the level of the ceiling. First of the fit; then of
the parameters that make reflectances true; of a fit that starts there, which shows whether the fit found its optimum;
and of fits with one prior after the other left out, whose costs are of all priors again. If the truth has the smaller
data term and the larger priors, these reject it.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting import light_objective
from lidarspectra.material.delighting.albedo import LightFit, fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import COMMON, LOG_SCATTER, LightObjective
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.material.delighting.surface_light import MIN_LIGHT
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials import delighting
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_rounds import Surfaces, fit_in_rounds
from research.benchmarks.delighting import Case, read_case, true_colors

NOT_BELIEVED = 1e3  # [1] a prior's deviation that says nothing
LEFT_OUT: Mapping[str, tuple[str, object]] = {
    "without the ceiling's": ("CEILING_DEVIATION", NOT_BELIEVED),
    "without the whites' hue": ("WHITE_HUE_DEVIATION", (NOT_BELIEVED, NOT_BELIEVED)),
    "without the brightest": ("BRIGHTEST_DEVIATION", NOT_BELIEVED),
    "without the balance's": ("BALANCE_DEVIATION", NOT_BELIEVED),
    "without the windows' hue": ("SOURCE_HUE_DEVIATION", NOT_BELIEVED),
    "without the sky's lobes": ("SKY_LOBES_DEVIATION", (NOT_BELIEVED, NOT_BELIEVED)),
}
ROBUST = 1.5  # [1] deviations of log ρ from the truth, from which a point counts less
HELD = 0.3  # [1] of the weight of the priors of camera and beam, while the truth's parameters are looked for
TRUTH_STEPS = 25


class Last:
    """The last fit of a de-lighting, its evidence, the (sample,) faces of its points, and its fluxes' deviations."""

    fit: LightFit
    evidence: LightEvidence
    face: np.ndarray
    flux_deviation: FloatArray

    def fitted(
        self,
        surfaces: Surfaces,
        lamps: Sequence[Lamp],
        evidence: LightEvidence,
        *,
        flux_deviation: FloatArray,
        **more: Any,
    ) -> tuple[LightFit, LightEvidence]:
        """As `fit_in_rounds`, kept."""
        found = fit_in_rounds(surfaces, lamps, evidence, flux_deviation=flux_deviation, **more)
        (self.fit, self.evidence), self.face, self.flux_deviation = found, surfaces.samples.face, flux_deviation
        return found


def objective(last: Last) -> LightObjective:
    """Of a fit, under the priors as they are now."""
    return LightObjective(
        last.evidence, flux_deviation=last.flux_deviation, observations_per_place=last.fit.observations_per_place
    )


def fitted_to_truth(model: LightObjective, start: FloatArray, truth: FloatArray) -> FloatArray:
    """(parameter,) with which the (row, 3) log ρ come nearest to the truth; NaN where there is none."""
    from scipy.optimize import least_squares

    known = np.isfinite(truth).all(axis=1)
    weight = np.sqrt(model.witnesses / model.rows.size) / LOG_SCATTER

    def apart(parameters: FloatArray) -> FloatArray:
        values = model.log_reflectance(parameters)
        errors = (weight * model.clarity * (values - truth))[known].ravel()
        beliefs = model.residuals(parameters)[3 * model.rows.size :][:COMMON]
        return np.concatenate([np.sign(errors) * ROBUST * np.sqrt(np.log1p((errors / ROBUST) ** 2)), HELD * beliefs])

    found = np.asarray(least_squares(apart, start, x_scale=0.1, max_nfev=TRUTH_STEPS).x, dtype=np.float64)
    found[COMMON : COMMON + model.lamp_count] -= model.flux_logs(found).mean() if model.lamp_count else 0.0
    found[1] = max(found[1], 1e-3)  # a shoulder of 0 or more
    return found


def row(words: str, model: LightObjective, parameters: FloatArray, truth: FloatArray) -> str:
    """A line of the table."""
    squares = 0.5 * model.residuals(parameters) ** 2
    data, priors = squares[: 3 * model.rows.size].sum(), squares[3 * model.rows.size :].sum()
    values = model.log_reflectance(parameters)
    ceiling = np.exp(np.median(values[model.ceiling], axis=0)).mean() if model.ceiling.size else np.nan
    tone = model.parts(parameters)[0]
    return (
        f"  {words:26s} {data + priors:7.2f} {data:7.2f} {priors:7.2f} {np.nanmedian(values - truth):+7.3f} "
        f"{ceiling:8.2f} {tone.power:6.2f} {tone.shoulder:8.2f}"
    )


def run(folder: Path) -> None:
    """Print a scan's table."""
    case: Case = read_case(folder)
    last = Last()
    with patch.object(delighting, "fit_in_rounds", side_effect=last.fitted):
        take_light_out(case.scan, find_room(case.scan), case.lamps)
    model = objective(last)
    colors = true_colors(case)[last.face[model.rows]]
    truth = np.where(
        (colors < 1.0).all(axis=1, keepdims=True), np.log(np.maximum(cones_of_srgb(colors), MIN_LIGHT)), np.nan
    )
    best = last.fit.parameters
    true_parameters = fitted_to_truth(model, best, truth)
    print(f"\n{folder.name}, {model.witnesses} places of {last.fit.observations_per_place:.1f} observations")
    print(
        f"  {'':26s} {'cost':>7s} {'data':>7s} {'priors':>7s} {'level':>7s} {'ceiling':>8s} {'power':>6s} "
        f"{'shoulder':>8s}"
    )
    print(row("the fit", model, best, truth))
    print(row("the truth's", model, true_parameters, truth))
    print(row("fitted from the truth's", model, _again(last, true_parameters), truth))
    for words, (name, value) in LEFT_OUT.items():
        with patch.object(light_objective, name, value):
            other = _again(last, best)
        print(row(words, model, other, truth), flush=True)


def _again(last: Last, start: FloatArray) -> FloatArray:
    fit = fit_light(
        last.evidence, flux_deviation=last.flux_deviation, start=start,
        observations_per_place=last.fit.observations_per_place,
    )  # fmt: skip
    return fit.parameters


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    given = parser.parse_args(arguments)
    for folder in sorted(given.folder.iterdir()):
        if (folder / "scan.glb").is_file() and folder.name.startswith(tuple(given.only)):
            run(folder)


if __name__ == "__main__":
    main()
