"""The dimming that meets all limits with the least power, or misses them least.

Solved by scipy: `milp` (HiGHS) for limits, lamps that are on or off, and choices of spectra; `lsq_linear` for aims
alone. Squares do not go into a mixed-integer program. So where there are limits or choices beside aims, the sum of the
aims' absolute deviations is minimised, and where there are none, the sum of their squares.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, lsq_linear, milp
from scipy.sparse import csr_array, hstack

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.design.problem import Aim, Problem

TIME_LIMIT_S = 60.0  # [s] of one program; after it the best that was found counts, and how far it may be from the best
MET = 1e-6  # [1] of a limit's scale: the solver's own tolerance
WIDER = (MET, 1e-5, 1e-4)  # [1] of a limit's scale, in turn: at the edge of what is possible HiGHS may end in an error
SAME = 1e-3  # [1] of what is wanted: deviation of aims that is given away for fewer watts
MAX_FACTOR = 100.0  # [1] on the lamps' flux, up to which more flux is looked for
OUT_OF_TIME = 1  # status of `milp`


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """A design.

    Parameters
    ----------
    dims : (source,) float
        Share of each source's full flux. [0-1]
    shortfall : (limit,) float
        Largest miss of each limit, in units of its scale; 0 where it is met. [1]
    gap : float
        By how much the optimum may be better, as a share of it; 0 where it is proven. [1]
    """

    dims: FloatArray
    shortfall: FloatArray
    gap: float

    @property
    def is_met(self) -> bool:
        """Whether every limit holds."""
        return bool((self.shortfall <= 10 * MET).all())


@dataclass(frozen=True, kw_only=True)
class Obstacles:
    """What stands in the way of a problem that has no solution.

    Parameters
    ----------
    flux_factor : float or None
        With so many times the flux of every lamp all limits would be met; None if no flux is enough. [1]
    lamps_needed : int or None
        So many lit lamps would do; None if the number is no obstacle, or all lamps together do not.
    without : tuple of int
        Limits each of which, left out, lets all others be met, and not by darkness.
    alone : tuple of (float or None)
        For each limit the factor on all fluxes that it would need if it were the only one: 1 if it is met as it is,
        None if no flux is enough. [1]
    """

    flux_factor: float | None
    lamps_needed: int | None
    without: tuple[int, ...]
    alone: tuple[float | None, ...]


def solve(problem: Problem, *, time_limit_s: float = TIME_LIMIT_S) -> Solution:
    """Find the best design.

    Parameters
    ----------
    problem : Problem
    time_limit_s : float
        Of each program. [s]

    Returns
    -------
    solution : Solution
        Where the limits cannot all be met, the one whose shortfalls have the least sum, and of such the best.
    """
    program = _Program(problem, time_limit_s)
    slack = np.zeros(len(problem.limits))
    found = program.best(slack)
    if found is None:
        slack = program.least_slack()
        found = next(filter(None, (program.best(slack + wider) for wider in WIDER)), None)
    if found is None:
        raise MapError(
            expected="a design that is possible at all",
            found="rules for lamps and spectra that contradict each other",
            where="design",
            todo="Allow more lamps, or a lower min_dim.",
        )
    dims, gap = found
    return Solution(dims=dims, shortfall=np.array([limit.shortfall(dims) for limit in problem.limits]), gap=gap)


def obstacles(problem: Problem, *, time_limit_s: float = TIME_LIMIT_S / 6) -> Obstacles:
    """Why the limits of a problem cannot all be met: each reason is tried by taking it away.

    Parameters
    ----------
    problem : Problem
        One without a solution.
    time_limit_s : float
        Of each program. [s]

    Returns
    -------
    obstacles : Obstacles
    """
    problem = replace(problem, aims=())
    needed = None
    if problem.freedom.max_lamps is not None:
        more = replace(problem, freedom=replace(problem.freedom, max_lamps=None, least="lamps"))
        dims = _tried(more, time_limit_s)
        needed = None if dims is None else int(np.count_nonzero(problem.sources.members @ dims > MET))
    without = []
    if len(problem.limits) > 1:
        for number in range(len(problem.limits)):
            rest = tuple(limit for index, limit in enumerate(problem.limits) if index != number)
            dark = all(limit.shortfall(np.zeros(len(problem.sources))) == 0 for limit in rest)  # which tells nothing
            if not dark and _tried(replace(problem, limits=rest), time_limit_s) is not None:
                without.append(number)
    return Obstacles(
        flux_factor=_flux_factor(problem, time_limit_s),
        lamps_needed=needed,
        without=tuple(without),
        alone=tuple(_alone(replace(problem, limits=(limit,)), time_limit_s) for limit in problem.limits),
    )


def _alone(problem: Problem, time_limit_s: float) -> float | None:
    """Factor on all fluxes by which a problem of one limit can be met, 1 or more; None if there is none [1]."""
    if _tried(problem, time_limit_s) is not None:
        return 1.0
    factor = _flux_factor(problem, time_limit_s)
    return None if factor is None else max(factor, 1.0)


def _tried(problem: Problem, time_limit_s: float) -> FloatArray | None:
    """Dims that meet every limit; None if there are none, or none are found in time."""
    try:
        found = _Program(problem, time_limit_s).best(np.zeros(len(problem.limits)))
    except MapError:
        return None
    return None if found is None else found[0]


def _flux_factor(problem: Problem, time_limit_s: float) -> float | None:
    """Least factor on all fluxes that meets every limit [1]; None if none does."""
    if not problem.freedom.dimmable:
        return None
    try:
        return _Program(problem, time_limit_s, reach=MAX_FACTOR).flux_factor()
    except MapError:
        return None


class _Program:
    """Rows and columns of the mixed-integer program of a problem.

    Columns: dims (source), lit (lamp), chosen (spectrum), one (source, where each lamp has one spectrum of several),
    slack (limit), scales of aims, deviations of aims (row), one factor on all fluxes.
    """

    def __init__(self, problem: Problem, time_limit_s: float, *, reach: float = 1.0) -> None:
        self.problem = problem
        self.time_limit_s = time_limit_s
        self.reach = reach  # largest share of its full flux that a lamp may send
        sources, freedom = problem.sources, problem.freedom
        several = bool(np.unique(sources.lamp).size < len(sources))
        self.aim, self.weight, self.root_weight = _joined(problem.aims, len(sources))
        self.has_lit = (
            freedom.max_lamps is not None or not freedom.dimmable or freedom.min_dim > 0 or freedom.least == "lamps"
        )
        spectra = int(sources.spectrum.max()) + 1
        sizes = {
            "dim": len(sources),
            "lit": sources.lamps if self.has_lit else 0,
            "chosen": spectra if several and freedom.mix == "same" else 0,
            "one": len(sources) if several and freedom.mix == "each" else 0,
            "slack": len(problem.limits),
            "scale": self.aim.free.shape[1],
            "deviation": len(self.aim.wanted),
            "factor": 1 if reach > 1 else 0,
        }
        ends = np.cumsum(list(sizes.values()))
        self.columns = {
            name: slice(int(end) - size, int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True)
        }
        self.width = int(ends[-1])
        self.is_integer = np.zeros(self.width)
        for name in ("lit", "chosen", "one"):
            self.is_integer[self.columns[name]] = 1

    def best(self, slack: FloatArray) -> tuple[FloatArray, float] | None:
        """Dims of the best design that misses each limit by no more than this, and its gap; None if there is none."""
        rows = [*self._rows(), self._at_most("slack", slack)]
        gap = 0.0
        if self.problem.aims:
            squares = None if self.problem.limits or self.is_integer.any() else self._least_squares(rows)
            if squares is not None:
                return squares, 0.0
            found = self._run(self._cost(deviation=self.weight), rows)
            if found is None:
                return None
            values, gap = found
            least = float(self.weight @ values[self.columns["deviation"]])
            rows.append(self._constraint(-np.inf, least + SAME, deviation=self.weight[None]))
        if self.problem.freedom.least == "lamps":
            found = self._run(self._cost(lit=np.ones(self.problem.sources.lamps)), rows)
            if found is None:
                return None
            gap = max(gap, found[1])
            rows.append(self._at_most_sum("lit", float(np.rint(found[0][self.columns["lit"]].sum()))))
        found = self._run(self._cost(dim=self.problem.sources.watts), rows)
        if found is None:
            return None
        return self._dims(found[0]), max(gap, found[1])

    def least_slack(self) -> FloatArray:
        """(limit,) shortfalls of the least sum: of levels first, then of ratios, which a dark room would meet [1].

        These programs have solutions. Where HiGHS ends in an error all the same, it is asked without its presolve:
        levels that nothing holds would leave the room dark.
        """
        is_ratio = np.array([limit.is_ratio for limit in self.problem.limits])
        slack, rows = np.full(is_ratio.size, np.inf), self._rows()
        for chosen in (~is_ratio, is_ratio):
            if chosen.any():
                cost = self._cost(slack=chosen.astype(np.float64))
                found = self._run(cost, rows) or self._run(cost, rows, presolve=False)
                if found is None and np.isinf(slack).all():
                    raise MapError(
                        expected="the design that misses the targets least",
                        found="no answer of the solver, though a dark room is one",
                        where="design",
                        todo="Change a target by a little, or give fewer candidates, and try again.",
                    )
                if found is None:  # at the edge of what levels allow: ratios as they come
                    return slack
                least = np.maximum(found[0][self.columns["slack"]], 0.0)
                slack = np.where(chosen, least, slack)
                rows.append(self._at_most("slack", slack + MET))
        return np.asarray(slack, dtype=np.float64)

    def flux_factor(self) -> float | None:
        """Least factor on all fluxes that meets every limit [1]; None if none does."""
        rows = [*self._rows(), self._at_most("slack", np.zeros(len(self.problem.limits)))]
        found = self._run(self._cost(factor=np.ones(1)), rows)
        return None if found is None else float(found[0][self.columns["factor"]][0])

    def _rows(self) -> list[LinearConstraint]:
        """Limits, aims and choices."""
        sources, freedom = self.problem.sources, self.problem.freedom
        members, rows = sources.members, []
        for number, limit in enumerate(self.problem.limits):
            unit = np.zeros((len(limit.fixed), len(self.problem.limits)))
            unit[:, number] = 1.0
            light, fixed = limit.light / limit.scale, limit.fixed / limit.scale
            low, high = limit.low / limit.scale - fixed, limit.high / limit.scale - fixed
            if np.isfinite(low).any():
                rows.append(self._constraint(low, np.inf, dim=light, slack=unit))
            if np.isfinite(high).any():
                rows.append(self._constraint(-np.inf, high, dim=light, slack=-unit))
        if len(self.aim.wanted):
            wanted, one = self.aim.wanted - self.aim.fixed, np.eye(len(self.aim.wanted))
            rows.append(self._constraint(wanted, np.inf, dim=self.aim.light, scale=-self.aim.free, deviation=one))
            rows.append(self._constraint(-np.inf, wanted, dim=self.aim.light, scale=-self.aim.free, deviation=-one))
        if self._size("factor"):
            rows.append(self._constraint(-np.inf, 0.0, dim=members, factor=-np.ones((sources.lamps, 1))))
        rows.append(self._constraint(-np.inf, self.reach, dim=members))
        if self.has_lit:
            on = np.eye(sources.lamps)
            rows.append(self._constraint(-np.inf, 0.0, dim=members, lit=-self.reach * on))
            least = freedom.min_dim if freedom.dimmable else 1.0
            rows.append(self._constraint(0.0, np.inf, dim=members, lit=-least * on))
        if freedom.max_lamps is not None:
            rows.append(self._at_most_sum("lit", float(freedom.max_lamps)))
        rows += self._choices(members)
        return rows

    def _choices(self, members: FloatArray) -> list[LinearConstraint]:
        """One spectrum for each lamp, or for all."""
        identity = np.eye(len(self.problem.sources))
        rows = []
        if self._size("one"):
            rows.append(self._constraint(-np.inf, 0.0, dim=identity, one=-self.reach * identity))
            rows.append(self._constraint(-np.inf, 1.0, one=members))
        if self._size("chosen"):
            own = np.eye(self._size("chosen"))[self.problem.sources.spectrum]
            rows.append(self._constraint(-np.inf, 0.0, dim=identity, chosen=-self.reach * own))
            rows.append(self._at_most_sum("chosen", 1.0))
        return rows

    def _run(
        self, cost: FloatArray, rows: list[LinearConstraint], *, presolve: bool = True
    ) -> tuple[FloatArray, float] | None:
        """Values of the columns and the gap; None where there is no solution."""
        high = np.full(self.width, np.inf)
        for name in ("lit", "chosen", "one"):
            high[self.columns[name]] = 1.0
        answer: Any = milp(
            cost,
            integrality=self.is_integer,
            bounds=Bounds(np.zeros(self.width), high),
            constraints=rows,
            options={"time_limit": self.time_limit_s, "presolve": presolve},
        )
        if answer.x is None and answer.status == OUT_OF_TIME:
            raise MapError(
                expected="a design within the solver's time",
                found=f"none after {self.time_limit_s:g} s",
                where="design",
                todo="Give fewer candidates, spectra or points.",
            )
        if answer.x is None:
            return None
        gap = answer.mip_gap if self.is_integer.any() else 0.0
        return np.asarray(answer.x, dtype=np.float64), float(gap or 0.0)

    def _least_squares(self, rows: list[LinearConstraint]) -> FloatArray | None:
        """Dims for aims alone, of those with the same light the least watts; None if a mixture needs more than 1."""
        aim, root = self.aim, self.root_weight
        matrix = np.concatenate([aim.light, -aim.free], axis=1)
        high = np.concatenate([np.ones(aim.light.shape[1]), np.full(aim.free.shape[1], np.inf)])
        bounds = (np.zeros(high.size), high)
        found = lsq_linear(root[:, None] * matrix, root * (aim.wanted - aim.fixed), bounds=bounds, tol=1e-12)
        dims, scales = np.split(found.x, [aim.light.shape[1]])
        if (self.problem.sources.members @ dims > 1.0 + MET).any():
            return None
        values = aim.light @ dims - aim.free @ scales
        alike = self._constraint(values - SAME, values + SAME, dim=aim.light, scale=-aim.free)
        least = self._run(self._cost(dim=self.problem.sources.watts), [*rows, alike])
        return np.asarray(dims) if least is None else self._dims(least[0])

    def _dims(self, values: FloatArray) -> FloatArray:
        """Shares of the full flux, with what is only the solver's round-off taken away."""
        dims = np.clip(values[self.columns["dim"]], 0.0, 1.0)
        return np.where(dims < MET, 0.0, dims)

    def _size(self, name: str) -> int:
        return int(self.columns[name].stop - self.columns[name].start)

    def _cost(self, **parts: FloatArray) -> FloatArray:
        cost = np.zeros(self.width)
        for name, values in parts.items():
            cost[self.columns[name]] = values
        return cost

    def _constraint(self, low: FloatArray | float, high: FloatArray | float, **parts: FloatArray) -> LinearConstraint:
        """Rows low <= Σ part columns <= high."""
        count = len(next(iter(parts.values())))
        blocks = [csr_array(parts.get(name, np.zeros((count, self._size(name))))) for name in self.columns]
        return LinearConstraint(hstack(blocks, format="csc"), low, high)

    def _at_most(self, name: str, values: FloatArray) -> LinearConstraint:
        return self._constraint(-np.inf, values, **{name: np.eye(self._size(name))})

    def _at_most_sum(self, name: str, value: float) -> LinearConstraint:
        return self._constraint(-np.inf, value, **{name: np.ones((1, self._size(name)))})


def _joined(aims: tuple[Aim, ...], sources: int) -> tuple[Aim, FloatArray, FloatArray]:
    """All aims as one, and the weights of its rows in a sum of absolute deviations, and on their root of squares."""
    counts, widths = [len(aim.wanted) for aim in aims], [aim.free.shape[1] for aim in aims]
    free = np.zeros((sum(counts), sum(widths)))
    row = column = 0
    for aim, count, width in zip(aims, counts, widths, strict=True):
        free[row : row + count, column : column + width] = aim.free
        row, column = row + count, column + width
    whole = Aim(
        light=np.concatenate([aim.light for aim in aims]) if aims else np.zeros((0, sources)),
        fixed=np.concatenate([aim.fixed for aim in aims]) if aims else np.zeros(0),
        wanted=np.concatenate([aim.wanted for aim in aims]) if aims else np.zeros(0),
        free=free,
        weight=1.0,
    )
    weight = np.repeat([aim.weight for aim in aims], counts)
    size = np.repeat(np.array(counts, dtype=np.float64), counts)
    return whole, weight / size, weight / np.sqrt(size)
