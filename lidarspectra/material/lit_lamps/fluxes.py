"""Relative fluxes of lamps that were found in a scan, estimated from the light pattern on the walls.

The de-lighting fit (`albedo`, Eq. 1) has one factor per lamp on its direct light D. For lamps without a stated flux
the prior on these factors is wide, and the picture determines them: a wall beside a lamp twice as strong is twice as
bright. Two lamps side by side cast the same pattern; their factors are not identifiable (the posterior deviation is
wide), and such a lamp keeps the flux that its area suggests. Only ratios are identifiable: the scale of all fluxes is
the camera's exposure.
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
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.spectra.spectrum_files import read_text

FLUXES_FILE = "lamp-fluxes.csv"
COLUMNS = ("lamp", "factor", "log_deviation", "told")  # told: identifiable; the name in files of earlier runs
UNKNOWN_FLUX_DEVIATION = 0.8  # [1] of the log: one lamp of a room in six is dimmed to less than half, or stronger
MODEL_DEVIATION = 0.08  # [1] of the log, for errors outside the fit's model: of the mesh, and of the lamps' places
IDENTIFIABLE_DEVIATION = 0.15  # [1] of the log, up to which a lamp's flux counts as identifiable
MAX_NAMED = 6  # lamps named in one note


@dataclass(frozen=True, kw_only=True)
class LampFlux:
    """Estimate of one lamp's relative flux from a picture.

    Parameters
    ----------
    lamp : str
        Its name.
    factor : float
        Its flux over that which its area suggests, relative to the mean of all lamps. [1]
    log_deviation : float
        Standard deviation of the factor's logarithm. [1]
    identifiable : bool
        Whether the picture determines it; else the factor must not be used.
    """

    lamp: str
    factor: float
    log_deviation: float
    identifiable: bool


def identifiable_lamps(fit: LightFit) -> BoolArray:
    """(lamp,) whether the flux of each is identifiable in a fit with free fluxes; never of a single lamp."""
    count = len(fit.flux_factors)
    return np.asarray((_log_deviations(fit) <= IDENTIFIABLE_DEVIATION) & (count > 1), dtype=np.bool_)


def estimated_fluxes(names: Sequence[str], fit: LightFit, identifiable: BoolArray) -> tuple[LampFlux, ...]:
    """Each lamp's relative flux as a fit has it.

    Parameters
    ----------
    names : sequence of str
        Of the lamps.
    fit : LightFit
    identifiable : (lamp,) bool
        See `identifiable_lamps`.
    """
    return tuple(
        LampFlux(lamp=name, factor=float(factor), log_deviation=float(deviation), identifiable=bool(sure))
        for name, factor, deviation, sure in zip(
            names, fit.flux_factors, _log_deviations(fit), identifiable, strict=True
        )
    )


def _log_deviations(fit: LightFit) -> FloatArray:
    return np.asarray(np.hypot(fit.flux_deviations, MODEL_DEVIATION), dtype=np.float64)


def flux_notes(fluxes: Sequence[LampFlux]) -> tuple[str, ...]:
    """Notes on the lamps whose relative flux was estimated, and on those for which it was not identifiable."""
    known = [
        f"'{flux.lamp}' {flux.factor:.2f} ± {100 * flux.log_deviation:.0f} %" for flux in fluxes if flux.identifiable
    ]
    unknown = [f"'{flux.lamp}'" for flux in fluxes if not flux.identifiable]
    notes = []
    if known:
        notes.append(
            "The lamps' relative fluxes were estimated from the light pattern on the walls, as factors on what their "
            f"area suggests: {_listed(known)}. If you know the fluxes, give the lamps as [[lamps]] in the run file."
        )
    if unknown and len(fluxes) > 1:
        notes.append(
            f"The light pattern on the walls does not determine the relative flux of {_listed(unknown)}, which is "
            "taken in proportion to the lamp's area and may be wrong. Give these lamps with their fluxes as [[lamps]] "
            "in the run file."
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
        Lamps that are not among them, or whose flux is not identifiable, count as 1 before the sum is restored.
    powers : (lamp,) float
        Fluxes before. [W]

    Returns
    -------
    factors : (lamp,) float
        [1]
    """
    known = {flux.lamp: flux.factor for flux in fluxes if flux.identifiable}
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
        sure = "yes" if flux.identifiable else "no"
        writer.writerow([flux.lamp, f"{flux.factor:.6g}", f"{flux.log_deviation:.6g}", sure])
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
                identifiable={"yes": True, "no": False}[row["told"]],
            )
            for row in rows
        )
        if not all(0 < flux.factor < np.inf and 0 <= flux.log_deviation < np.inf for flux in fluxes):
            raise ValueError("a factor that is not above zero, or a deviation below it")
    except (DatabaseError, csv.Error, ValueError, TypeError, KeyError) as cause:
        raise MaterialError(
            expected=f"columns {', '.join(COLUMNS)}, one line per lamp",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Run the materials stage again.",
        ) from cause
    return fluxes
