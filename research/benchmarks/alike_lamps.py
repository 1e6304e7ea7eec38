"""What it costs and gains to take fluxes of one data sheet for half alike.

`python -m research.benchmarks.alike_lamps RUN`

In a finished run with lamps of known kinds, fluxes are drawn that are off independently, half in common or mostly in
common; six readings of exact reflectances are taken at random points of the map and fitted, once with a prior under
which all lamps err alone and once under which those of one data sheet err half alike. The stated deviation of the map
and its error, before and after the readings, are means over points and rooms drawn.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import LightModel, Observations, Priors, alike_in_groups
from lidarspectra.mapping.calibration.posterior import fit
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.radiance.sampling.transport import TRANSPORT_FILE, load_transport
from lidarspectra.room.surface_parts import PARTS
from lidarspectra.workflow.calibration.light import run_room
from lidarspectra.workflow.calibration.unknowns_of_run import priors_of_room
from lidarspectra.workflow.run_folder.workspace import require_stage

READINGS = 6
EXACT = 1e-4  # [1] deviation of the levels of reflectances, which are exact here
CHANNEL = 6  # of the AS7265x, 560 nm
SEED = 20261127


@dataclass(frozen=True, kw_only=True)
class Truth:
    """How fluxes are off: standard deviation of each, and the correlation of lamps of one data sheet [1]."""

    deviation: float
    correlation: float


TRUTHS = {
    "each alone, 15 %": Truth(deviation=0.15, correlation=0.0),
    "each alone, 20 %": Truth(deviation=0.2, correlation=0.0),
    "half alike, 15 %": Truth(deviation=0.15, correlation=0.5),
    "mostly alike, 15 %": Truth(deviation=0.15, correlation=0.8),
}


def outcome(light: FloatArray, priors: Priors, sheet: IntArray, truth: Truth, rooms: int) -> tuple[float, ...]:
    """Stated deviation, error and coverage before the readings, then after them [1]."""
    generator = np.random.default_rng(SEED)
    slope = np.zeros((*light.shape, len(PARTS)))
    model = LightModel(light=light, slope=slope)
    alike = alike_in_groups(sheet, truth.correlation)
    root = truth.deviation * np.linalg.cholesky(alike + 1e-9 * np.eye(sheet.size))
    rows = []
    prior_share = light / light.sum(axis=1, keepdims=True)
    prior_sd = _deviation(prior_share, priors.covariance()[: sheet.size, : sheet.size])
    for _ in range(rooms):
        true = model.at(root @ generator.standard_normal(sheet.size), np.zeros(len(PARTS))).sum(axis=1)
        chosen = generator.choice(light.shape[0], READINGS, replace=False)
        off = np.hypot(priors.reading_sd, priors.local_sd) * generator.standard_normal(READINGS)
        readings = Observations(
            value=true[chosen] * np.exp(off), row=np.arange(READINGS), meter=np.zeros(READINGS, dtype=np.int64)
        )
        found = fit(model.some(chosen), readings, priors)
        after = model.at(found.flux, np.zeros(len(PARTS)))
        share = after / after.sum(axis=1, keepdims=True)
        sd = _deviation(share, found.covariance[: sheet.size, : sheet.size])
        before_off, after_off = (np.log(each.sum(axis=1) / true) for each in (light, after))
        rows.append(
            [
                prior_sd.mean(), np.sqrt((before_off**2).mean()), (np.abs(before_off) < prior_sd).mean(),
                sd.mean(), np.sqrt((after_off**2).mean()), (np.abs(after_off) < sd).mean(),
            ]
        )  # fmt: skip
    return tuple(float(value) for value in np.mean(rows, axis=0))


def _deviation(share: FloatArray, covariance: FloatArray) -> FloatArray:
    """(point,) standard deviation of the light's logarithm [1]."""
    return np.asarray(np.sqrt(np.einsum("pi,ij,pj->p", share, covariance, share)), dtype=np.float64)


def compared(run: Path, rooms: int) -> Table:
    """Both priors under every truth."""
    room = run_room(run)
    transport = load_transport(require_stage(run, "trace") / TRANSPORT_FILE)
    light = (transport["coefficient"] * transport["flux"]).to_numpy()[:, :, CHANNEL].T.astype(np.float64)
    names = [str(name) for name in transport["lamp"].to_numpy()]
    usual = priors_of_room(room.run_file, names, room.materials, room.part, room.scan.areas)
    assert usual.sheet is not None
    exact = EXACT**2 * np.eye(usual.parts)
    meter = np.array([EXACT])
    rows = []
    for words, truth in TRUTHS.items():
        for prior, sheet in (("each alone", None), ("half alike", usual.sheet)):
            priors = Priors(flux_sd=usual.flux_sd, levels_covariance=exact, meter_sd=meter, sheet=sheet)
            values = [100.0 * value for value in outcome(light, priors, usual.sheet, truth, rooms)]
            rows.append([words, prior, *values])
    figures = ("stated {} [%]", "error {} [%]", "within {} [%]")
    headings = tuple(words.format(when) for when in ("before", "after") for words in figures)
    frame = pd.DataFrame(rows, columns=["fluxes off", "taken for", *headings])
    caption = f"{run.name}: {len(names)} lamps of {len(set(usual.sheet.tolist()))} kinds, {rooms} rooms drawn."
    return Table(name="alike-lamps", caption=caption, frame=frame, formats=dict.fromkeys(headings, ".1f"))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table for each run folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="a finished run folder")
    parser.add_argument("--rooms", type=int, default=1000, help="drawn for each row")
    given = parser.parse_args(arguments)
    for run in given.runs:
        table = compared(run, given.rooms)
        print(table.caption)
        print()
        print(table_markdown(table))


if __name__ == "__main__":
    main()
