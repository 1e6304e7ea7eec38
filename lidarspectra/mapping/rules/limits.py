"""Limits of the rules, and what is held against them.

References
----------
EN 12464-1:2021, Light and lighting of work places: corridors, offices and schools; walls, ceiling, cylindrical
illuminance. WELL v2, L03 Circadian lighting design: 1 point and 3 points. UL DG 24480:2019: a circadian stimulus of .3,
which its draft put at about 350 lx of warm and 200 lx of cool white light at the eye. Brown and others, PLoS Biology
20, 2022: 250 lx of melanopic EDI (CIE S 026) by day. EN 17037:2018, minimum. IES LM-83-12.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray

Sense = Literal["at least", "at most"]
LOW_PERCENT, HIGH_PERCENT = 5.0, 95.0  # of the range that a table gives


@dataclass(frozen=True, kw_only=True)
class WorkPlace:
    """A row of EN 12464-1.

    Parameters
    ----------
    illuminance_lx, cylindrical_lx, walls_lx, ceiling_lx : float
        Maintained means of the task area, of people's faces, of walls and ceiling. [lx]
    uniformity : float
        U0 of the task area. [1]
    ugr : float
        Highest.
    """

    illuminance_lx: float
    uniformity: float
    ugr: float
    cylindrical_lx: float
    walls_lx: float
    ceiling_lx: float


def _row(*values: float) -> WorkPlace:
    names = ("illuminance_lx", "uniformity", "ugr", "cylindrical_lx", "walls_lx", "ceiling_lx")
    return WorkPlace(**dict(zip(names, values, strict=True)))


WORK_PLACES: Mapping[str, WorkPlace] = {  # EN 12464-1:2021: Em, U0, UGR, Ez, walls, ceiling
    "corridor": _row(100, 0.40, 28, 50, 50, 30),  # table 10, circulation areas and corridors
    "filing": _row(300, 0.40, 19, 100, 100, 75),  # table 34
    "writing": _row(500, 0.60, 19, 150, 150, 100),
    "drawing": _row(750, 0.70, 16, 150, 150, 100),
    "meeting": _row(500, 0.60, 19, 150, 150, 100),
    "reception": _row(300, 0.60, 22, 100, 100, 75),
    "archive": _row(200, 0.40, 25, 75, 75, 50),
    "classroom": _row(500, 0.60, 19, 150, 150, 100),  # table 44
}
SURFACE_UNIFORMITY = 0.10  # [1] U0 of walls, ceiling and cylindrical illuminance, EN 12464-1
WELL_EDI_LX = {"1 point": 136.0, "3 points": 250.0}  # [lx] melanopic EDI, WELL v2 L03, electric light alone
WELL_DAYLIT_EDI_LX = {"1 point": 109.0, "3 points": 163.0}  # [lx] the same where daylight earns points by L05 or L06
UL_EDI_LX = 175.0  # [lx] melanopic EDI of 350 lx of warm white (ratio .5), and of 200 lx of cool white (ratio .88)
DAY_EDI_LX = 250.0  # [lx] Brown and others 2022, by day


@dataclass(frozen=True, kw_only=True, eq=False)
class Criterion:
    """One requirement, and the quantity as the run's uncertainty draws it.

    Parameters
    ----------
    rule : str
        'EN 12464-1', ...
    what : str
        The quantity, in words.
    where : str
        Area, surface or observer.
    unit : str
    limit : float
        [unit]
    sense : 'at least' or 'at most'
    traced : float
        As traced. [unit]
    draws : (draw,) float
        Of the quantity. [unit]
    """

    rule: str
    what: str
    where: str
    unit: str
    limit: float
    sense: Sense
    traced: float
    draws: FloatArray

    @property
    def estimate(self) -> float:
        """Best estimate: the median of the draws [unit]."""
        return float(np.median(self.draws))

    @property
    def passes(self) -> FloatArray:
        """(draw,) whether the limit is kept, as 0 or 1."""
        kept = self.draws >= self.limit if self.sense == "at least" else self.draws <= self.limit
        return kept.astype(np.float64)

    @property
    def probability(self) -> float:
        """Of keeping the limit [1]; see `chance`."""
        return chance(self.passes)

    @property
    def range(self) -> tuple[float, float]:
        """5th and 95th percentile [unit]."""
        low, high = np.percentile(self.draws, (LOW_PERCENT, HIGH_PERCENT))
        return float(low), float(high)


def chance(passes: FloatArray) -> float:
    """Probability by draws that passed or not, (k + 1/2)/(n + 1): a count of draws proves no certainty."""
    return float((passes.sum() + 0.5) / (passes.size + 1.0))
