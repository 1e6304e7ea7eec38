"""One radiometry for all frames of a scan: a gain for each frame and channel, one tone curve, one vignetting.

A camera exposes every frame anew. Frame f shows point p in channel c as T(g_fc v(r) L_pc), with T the tone curve, g
the gain (exposure, sensitivity and white balance), v the vignetting at distance r from the middle of the picture, and L
the radiance, which a matt surface sends alike to all frames. In logarithms

    log T^-1(x_pfc) = log L_pc + log g_fc + a r^2 + b r^4                                                          (1)

is linear but for T's parameters: a least-squares problem over the graph whose nodes are frames and whose edges are the
points that two of them show. Points are eliminated exactly (Schur complement), what is left has three unknowns a frame.
Gains are free of drift where the graph has loops; where it is a chain, their deviation grows along it and is stated.

T is told by overlaps at different gains, as with Debevec and Malik's bracketed exposures: a wrong shoulder makes ratios
of two frames depend on brightness. A power of T is not told by any ratio (powers of L and g undo it), only by exposures
that are known (Grossberg and Nayar's exponential ambiguity): without them it keeps its prior deviation.

References
----------
Debevec, Malik (1997) Recovering high dynamic range radiance maps from photographs, SIGGRAPH, 369.
Grossberg, Nayar (2003) Determining the camera response from images, IEEE Trans. PAMI 25, 1455.
Goldman (2010) Vignette and exposure calibration and compensation, IEEE Trans. PAMI 32, 2276.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.material.delighting.tone_curve import USUAL_TONE, ToneCurve
from lidarspectra.threads import one_thread

ROBUST_SCALE = 2.0  # [1] of Cauchy's loss, in standard deviations
ROUNDS = 8  # re-weightings
TONE_ROUNDS = 4  # the same while curves are compared
NOISE = 0.02  # [1] of what a picture shows: noise, small highlights, grain seen from other sides
DARK_NOISE = 0.004  # [1] of white, of shadows
UNEVEN_SHARE = 0.5  # [1] of the unevenness around that a pose's error makes an error of brightness
GAIN_DEVIATION = 1.5  # [1] of a gain's logarithm before anything is known: phones' exposures span a factor of 1000
EXPOSURE_DEVIATION = 0.05  # [1] of the same about exposure time times ISO, where they are told
BALANCE_DEVIATION = 0.3  # [1] of the logs of red and blue over green about their means
VIGNETTING_DEVIATION = 0.3  # [1] of a and b: phones correct most of it
MAX_SHOULDER = 2.3  # [1] of log(1 + s)
TONE_POINTS = 3_000  # that curves are compared by
TONE_EVALUATIONS = 25
CURVATURE_STEP = 0.1  # [1] of log(1 + s) and of log g, by which their deviation is told
CELL_M = 1.0  # [m] of clusters within a frame, in which errors are alike
GAUGE = 1e-6  # [1] weight that fixes what nothing tells


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """What frames show of points; one row is one point in one frame.

    Parameters
    ----------
    point, frame : (row,) int
    shown : (row, 3) float
        Linear sRGB, not clipped. [0-1]
    uneven : (row,) float
        Relative deviation around. [1]
    radius2 : (row,) float
        Squared distance from the picture's middle over that of a corner. [0-1]
    cell : (row,) int
        Cube of `CELL_M` of its point.
    frames, points : int
        How many there are.
    exposure : (frame,) float
        Log of exposure time times ISO over the mean; NaN where it is not told. [1]
    """

    point: IntArray
    frame: IntArray
    shown: FloatArray
    uneven: FloatArray
    radius2: FloatArray
    cell: IntArray
    frames: int
    points: int
    exposure: FloatArray

    def some(self, rows: BoolArray) -> "Observations":
        """Some of the rows."""
        return Observations(
            point=self.point[rows], frame=self.frame[rows], shown=self.shown[rows], uneven=self.uneven[rows],
            radius2=self.radius2[rows], cell=self.cell[rows], frames=self.frames, points=self.points,
            exposure=self.exposure,
        )  # fmt: skip

    @cached_property
    def witnesses(self) -> int:
        """Number of clusters: one cube of space in one frame."""
        return len(np.unique(self.frame * (int(self.cell.max(initial=0)) + 1) + self.cell))


@dataclass(frozen=True, kw_only=True, eq=False)
class Radiometry:
    """The camera of a scan, frame by frame.

    Parameters
    ----------
    tone : ToneCurve
    shoulder_deviation, power_deviation : float
        Standard deviations of log(1 + s) and log g of the curve. [1]
    log_gain : (frame, 3) float
        Mean 0 in each channel. [1]
    deviation : (frame,) float
        Standard deviation of a gain's logarithm, over the mean of all. [1]
    vignetting : (2,) float
        a, b. [1]
    before, after : float
        Robust relative deviation of observations that were held out from the other frames' estimate of their point,
        in what pictures show, as they are and with this radiometry. [1]
    """

    tone: ToneCurve
    shoulder_deviation: float
    power_deviation: float
    log_gain: FloatArray
    deviation: FloatArray
    vignetting: FloatArray
    before: float
    after: float

    def fall(self, radius2: FloatArray) -> FloatArray:
        """Vignetting at squared distances from the picture's middle, over that of a corner [1]."""
        return np.asarray(np.exp(self.vignetting[0] * radius2 + self.vignetting[1] * radius2**2), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Solved:
    """Log gains (frame, 3), vignetting (2,), misfit [1], weights (row, 3), and the normal matrix of green."""

    log_gain: FloatArray
    vignetting: FloatArray
    misfit: float
    weights: FloatArray
    normal: FloatArray


def solve_radiometry(seen: Observations, generator: np.random.Generator) -> Radiometry:
    """Fit gains, tone curve and vignetting.

    Parameters
    ----------
    seen : Observations
        Of points that two or more frames show, some in every frame: others have no gain.
    generator : numpy.random.Generator
        Draws the points that curves are compared by, and the observations that are held out.

    Returns
    -------
    radiometry : Radiometry
    """
    with one_thread():
        return _radiometry(seen, generator)


def _radiometry(seen: Observations, generator: np.random.Generator) -> Radiometry:
    few = _points_of(seen, generator, TONE_POINTS)
    anchored = bool(np.isfinite(seen.exposure).sum() > 1 and np.nanstd(seen.exposure) > EXPOSURE_DEVIATION)
    tone, shoulder_deviation, power_deviation = _tone_of(few, anchored=anchored)
    held = generator.random(seen.point.size) < min(0.1, 20_000 / max(seen.point.size, 1))
    rest = seen.some(~held)
    check = _solve(rest, tone, ROUNDS)
    before = _disagreement(seen, held, ToneCurve(), np.zeros_like(check.log_gain), np.zeros(2))
    after = _disagreement(seen, held, tone, check.log_gain, check.vignetting)
    solved = _solve(seen, tone, ROUNDS)
    return Radiometry(
        tone=tone,
        shoulder_deviation=shoulder_deviation,
        power_deviation=power_deviation,
        log_gain=solved.log_gain - solved.log_gain.mean(axis=0),
        deviation=_deviations(seen, solved),
        vignetting=solved.vignetting,
        before=before,
        after=after,
    )


def _points_of(seen: Observations, generator: np.random.Generator, count: int) -> Observations:
    if seen.points <= count:
        return seen
    chosen = np.zeros(seen.points, dtype=np.bool_)
    chosen[generator.choice(seen.points, count, replace=False)] = True
    return seen.some(chosen[seen.point])


def _tone_of(seen: Observations, *, anchored: bool) -> tuple[ToneCurve, float, float]:
    """Curve of least misfit, and deviations of its logs; a power is fitted only where exposures are known."""
    from scipy.optimize import minimize, minimize_scalar  # loads slowly

    scale = seen.witnesses / max(3 * seen.point.size, 1)  # rows of one cluster are one witness

    def cost(shoulder: float, power: float) -> float:
        curve = ToneCurve(power=float(np.exp(power)), shoulder=float(np.expm1(max(shoulder, 0.0))))
        apart = (shoulder - USUAL_TONE.shoulder) / USUAL_TONE.shoulder_deviation
        prior = apart**2 + (power / USUAL_TONE.power_deviation) ** 2
        return scale * _solve(seen, curve, TONE_ROUNDS).misfit + 0.5 * prior

    options = {"maxiter": TONE_EVALUATIONS, "xatol": 0.01}
    best = float(
        minimize_scalar(
            lambda value: cost(float(value), 0.0), bounds=(0.0, MAX_SHOULDER), method="bounded", options=options
        ).x
    )
    power = 0.0
    if anchored:
        simplex = np.array([[best, 0.0], [best + 0.15, 0.0], [best, 0.1]])
        found = minimize(
            lambda each: cost(float(np.clip(each[0], 0, MAX_SHOULDER)), float(each[1])), simplex[0],
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": 2 * TONE_EVALUATIONS, "xatol": 5e-3, "fatol": 1e-3},
        )  # fmt: skip
        best, power = float(np.clip(found.x[0], 0, MAX_SHOULDER)), float(found.x[1])
    middle = max(best, CURVATURE_STEP)
    shoulder_deviation = _deviation(lambda value: cost(value, power), middle)
    power_deviation = _deviation(lambda value: cost(best, value), power) if anchored else USUAL_TONE.power_deviation
    return ToneCurve(power=float(np.exp(power)), shoulder=float(np.expm1(best))), shoulder_deviation, power_deviation


def _deviation(cost: Callable[[float], float], at: float) -> float:
    """Standard deviation of a parameter, from the curvature of half the squared misfit."""
    low, middle, high = (cost(at + step) for step in (-CURVATURE_STEP, 0.0, CURVATURE_STEP))
    curvature = max((low + high - 2.0 * middle) / CURVATURE_STEP**2, USUAL_TONE.shoulder_deviation**-2)
    return float(curvature**-0.5)


def _solve(seen: Observations, tone: ToneCurve, rounds: int) -> _Solved:
    """Robust least squares of Eq. 1 for one tone curve, by re-weighting."""
    value = np.log(tone.light(seen.shown))
    # Errors are the picture's: a curve must not be preferred for pressing them together.
    deviation = tone.slope(seen.shown) * np.hypot(
        np.hypot(NOISE, UNEVEN_SHARE * seen.uneven)[:, None], DARK_NOISE / np.maximum(seen.shown, 1e-3)
    )
    power = np.stack([seen.radius2, seen.radius2**2], axis=1)
    points = csr_array(
        (np.ones(seen.point.size), (seen.point, np.arange(seen.point.size))), shape=(seen.points, seen.point.size)
    )
    gain, vignetting = np.zeros((seen.frames, 3)), np.zeros(2)
    weights = deviation**-2
    misfit, normal = 0.0, np.zeros((0, 0))
    for _ in range(rounds):
        found = [_least_squares(seen, points, value[:, c], weights[:, c], power, c) for c in range(3)]
        gain = np.stack([each[0] for each in found], axis=1)
        vignetting = np.mean([each[1] for each in found], axis=0)
        normal = found[1][2]
        residual = value - gain[seen.frame] - (power @ vignetting)[:, None]
        residual -= _point_means(points, residual, weights)[seen.point]
        ratio2 = (residual / (ROBUST_SCALE * deviation)) ** 2
        misfit = float(0.5 * ROBUST_SCALE**2 * np.log1p(ratio2).sum())
        weights = deviation**-2 / (1.0 + ratio2)
    return _Solved(log_gain=gain, vignetting=vignetting, misfit=misfit, weights=weights, normal=normal)


def _point_means(points: csr_array, values: FloatArray, weights: FloatArray) -> FloatArray:
    """(point, 3) weighted means of (row, 3) values."""
    return np.asarray((points @ (weights * values)) / np.maximum(points @ weights, 1e-30), dtype=np.float64)


def _least_squares(
    seen: Observations, points: csr_array, value: FloatArray, weight: FloatArray, power: FloatArray, channel: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log gains (frame,) and vignetting (2,) of one channel, points eliminated, and the normal matrix."""
    count = seen.frames
    frames = coo_array((weight, (seen.point, seen.frame)), shape=(points.shape[0], count)).tocsr()
    vignette = points @ (weight[:, None] * power)
    inverse = 1.0 / np.maximum(points @ weight, 1e-30)
    sums = points @ (weight * value)
    corner = diags_array(inverse) @ frames
    normal = np.zeros((count + 2, count + 2))
    normal[:count, :count] = (
        np.diag(np.bincount(seen.frame, weights=weight, minlength=count)) - (frames.T @ corner).toarray()
    )
    cross = np.stack([np.bincount(seen.frame, weights=weight * power[:, k], minlength=count) for k in range(2)], axis=1)
    normal[:count, count:] = cross - corner.T @ vignette
    normal[count:, :count] = normal[:count, count:].T
    normal[count:, count:] = power.T @ (weight[:, None] * power) - vignette.T @ (inverse[:, None] * vignette)
    right = np.concatenate(
        [
            np.bincount(seen.frame, weights=weight * value, minlength=count) - corner.T @ sums,
            power.T @ (weight * value) - vignette.T @ (inverse * sums),
        ]
    )
    # Rows of one cluster are one witness; against priors they must not count as many.
    scale = seen.witnesses / max(seen.point.size, 1)
    normal, right = scale * normal, scale * right
    told = np.isfinite(seen.exposure)
    usual = EXPOSURE_DEVIATION if channel == 1 else np.hypot(EXPOSURE_DEVIATION, BALANCE_DEVIATION)
    prior = np.where(told, usual, GAIN_DEVIATION) ** -2.0
    normal[np.arange(count), np.arange(count)] += prior + GAUGE
    right[:count] += prior * np.nan_to_num(seen.exposure)
    normal[[count, count + 1], [count, count + 1]] += VIGNETTING_DEVIATION**-2.0
    solution: FloatArray = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
    return solution[:count], solution[count:], normal


def _deviations(seen: Observations, solved: _Solved) -> FloatArray:
    """(frame,) standard deviation of the gains over their mean."""
    covariance = np.linalg.inv(solved.normal)[: seen.frames, : seen.frames]
    over = np.eye(seen.frames) - 1.0 / seen.frames
    return np.asarray(np.sqrt(np.maximum(np.einsum("fi,ij,fj->f", over, covariance, over), 0.0)), dtype=np.float64)


def _disagreement(
    seen: Observations, held: BoolArray, tone: ToneCurve, log_gain: FloatArray, vignetting: FloatArray
) -> float:
    """Robust relative deviation, in what pictures show, of held-out rows from the median of the others."""
    power = np.stack([seen.radius2, seen.radius2**2], axis=1)
    radiance = np.log(tone.light(seen.shown)) - log_gain[seen.frame] - (power @ vignetting)[:, None]
    order = np.lexsort((radiance[:, 1], seen.point))
    order = order[~held[order]]
    point = seen.point[order]
    starts = np.searchsorted(point, np.arange(seen.points))
    counts = np.bincount(point, minlength=seen.points)
    rows = np.flatnonzero(held & (counts[seen.point] > 0))
    if not rows.size:
        return 0.0
    middle = order[starts[seen.point[rows]] + counts[seen.point[rows]] // 2]
    apart = (radiance[rows, 1] - radiance[middle, 1]) / tone.slope(seen.shown[rows, 1])
    return float(1.4826 * np.median(np.abs(apart)))
