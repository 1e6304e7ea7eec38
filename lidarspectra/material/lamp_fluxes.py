"""Relative fluxes of lamps that were found in a scan: what the light pattern on the walls tells of each, and what not.

The fit that takes the light out of the picture (`albedo`, Eq. 1) has one factor a lamp on its direct light D. For lamps
that nobody described these factors are nearly free, and the picture decides: a wall beside a lamp twice as strong is
twice as bright. Two lamps side by side throw the same pattern; their factors come out with a wide deviation, and such
a lamp keeps the flux that its area suggests. Only ratios are told: the scale of all fluxes is the camera's exposure.
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import DatabaseError, MaterialError
from lidarspectra.io.files import write_whole
from lidarspectra.material.albedo import LightFit
from lidarspectra.spectra.spectrum_files import read_text

FLUXES_FILE = "lamp-fluxes.csv"
COLUMNS = ("lamp", "factor", "log_deviation", "told")
UNKNOWN_FLUX_DEVIATION = 0.8  # [1] of the log: one lamp of a room in six is dimmed to less than half, or stronger
MODEL_DEVIATION = 0.08  # [1] of the log, by what the fit does not know: the mesh's faults, where just the lamps hang
TOLD_DEVIATION = 0.15  # [1] of the log, up to which the walls tell a lamp's flux
MAX_NAMED = 6  # lamps named in one note


@dataclass(frozen=True, kw_only=True)
class LampFlux:
    """What a picture says of one lamp's flux.

    Parameters
    ----------
    lamp : str
        Its name.
    factor : float
        Its flux over that which its area suggests, relative to the mean of all lamps. [1]
    log_deviation : float
        Standard deviation of the factor's logarithm. [1]
    told : bool
        Whether the picture tells it; else the factor is not to be used.
    """

    lamp: str
    factor: float
    log_deviation: float
    told: bool


def told_lamps(fit: LightFit) -> BoolArray:
    """(lamp,) whether a fit with free fluxes tells that of each; of a single lamp none, for a ratio takes two."""
    count = len(fit.flux_factors)
    return np.asarray((_log_deviations(fit) <= TOLD_DEVIATION) & (count > 1), dtype=np.bool_)


def told_fluxes(names: Sequence[str], fit: LightFit, told: BoolArray) -> tuple[LampFlux, ...]:
    """What a fit says of each lamp's flux.

    Parameters
    ----------
    names : sequence of str
        Of the lamps.
    fit : LightFit
    told : (lamp,) bool
        See `told_lamps`.
    """
    return tuple(
        LampFlux(lamp=name, factor=float(factor), log_deviation=float(deviation), told=bool(sure))
        for name, factor, deviation, sure in zip(names, fit.flux_factors, _log_deviations(fit), told, strict=True)
    )


def _log_deviations(fit: LightFit) -> FloatArray:
    return np.asarray(np.hypot(fit.flux_deviations, MODEL_DEVIATION), dtype=np.float64)


def flux_notes(fluxes: Sequence[LampFlux]) -> tuple[str, ...]:
    """Say of which lamps the walls tell the flux, and of which not."""
    told = [f"{flux.lamp} {flux.factor:.2f} ± {100 * flux.log_deviation:.0f} %" for flux in fluxes if flux.told]
    silent = [flux.lamp for flux in fluxes if not flux.told]
    notes = []
    if told:
        notes.append(f"relative fluxes by the light on the walls: {_listed(told)}")
    if silent and len(fluxes) > 1:
        notes.append(
            f"the light on the walls does not tell the flux of {_listed(silent)}: taken by area; a [[lamps]] entry of "
            "your own knows better"
        )
    return tuple(notes)


def _listed(words: Sequence[str]) -> str:
    more = len(words) - MAX_NAMED
    return ", ".join(words[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


def flux_factors(names: Sequence[str], fluxes: Sequence[LampFlux], powers: FloatArray) -> FloatArray:
    """Factors on the lamps' fluxes that leave their sum as it is.

    Parameters
    ----------
    names : sequence of str
        Of the lamps.
    fluxes : sequence of LampFlux
        Lamps that are not among them, or of which nothing is told, count as 1 before the sum is restored.
    powers : (lamp,) float
        Fluxes before. [W]

    Returns
    -------
    factors : (lamp,) float
        [1]
    """
    known = {flux.lamp: flux.factor for flux in fluxes if flux.told}
    factors = np.array([known.get(name, 1.0) for name in names])
    return np.asarray(factors * powers.sum() / (factors * powers).sum(), dtype=np.float64)


def save_lamp_fluxes(fluxes: Sequence[LampFlux], folder: Path) -> None:
    """Write `lamp-fluxes.csv` into a folder that exists; without fluxes, remove it."""
    path = folder / FLUXES_FILE
    path.unlink(missing_ok=True)
    if not fluxes:
        return
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for flux in fluxes:
        writer.writerow([flux.lamp, f"{flux.factor:.6g}", f"{flux.log_deviation:.6g}", "yes" if flux.told else "no"])
    write_whole(path, text.getvalue())


def load_lamp_fluxes(folder: Path) -> tuple[LampFlux, ...]:
    """Read what `save_lamp_fluxes` wrote; empty where there is no such file.

    Raises
    ------
    MaterialError
        If the file is malformed.
    """
    path = folder / FLUXES_FILE
    if not path.is_file():
        return ()
    try:
        rows = list(csv.DictReader(io.StringIO(read_text(path), newline="")))
        fluxes = tuple(
            LampFlux(
                lamp=row["lamp"],
                factor=float(row["factor"]),
                log_deviation=float(row["log_deviation"]),
                told={"yes": True, "no": False}[row["told"]],
            )
            for row in rows
        )
        if not all(0 < flux.factor < np.inf and 0 <= flux.log_deviation < np.inf for flux in fluxes):
            raise ValueError("a factor that is not above zero, or a deviation below it")
    except (DatabaseError, csv.Error, ValueError, TypeError, KeyError) as cause:
        raise MaterialError(
            expected=f"columns {', '.join(COLUMNS)}, a line a lamp",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Run the materials stage again.",
        ) from cause
    return fluxes
