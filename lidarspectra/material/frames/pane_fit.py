"""Whether a piece of wall shows the room's image, or what lies behind it, by its colours from frame to frame.

A matt square q of a wall sends the same light M_q to all frames. A mirror or glass sends, to frame f,

    L_qf = M_q + ρ R_qf   or   M_q + τ T_qf,                                                                       (1)

with R what a perfect mirror in its place would show, T what lies behind, ρ its reflectance and τ its transmittance. The
M_q are eliminated exactly; what is left is a line through the origin. The gain over a matt
surface is that of the residuals' variance: the noise of pictures need not be known,

    G = - n/2 log(1 - r²),                                                                                         (2)

with r² the share of the variance within squares that (1) explains, and n the number of frames: rows of one frame are
one witness, since they share its gain and its pose.

References
----------
Szeliski, Avidan, Anandan (2000) Layer extraction from multiple images containing reflections and transparency, CVPR
(what is reflected moves as a layer of its own). Whelan et al. (2018) Reconstructing scenes with mirror and glass
surfaces, ACM Trans. Graphics 37, 102 (depth does not tell them).
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from lidarspectra.arrays import BoolArray, FloatArray, IntArray

WINDOW = 5  # [squares] on a side, over which a square's own gain is taken
ROUNDS = 5  # re-weightings
ROBUST_SCALE = 2.5  # [1] of Cauchy's loss, in standard deviations: poses, edges, people
MIN_VIEWS = 3  # of a square
NOISE = 0.03  # [1] of the light, below which residuals say nothing more
LEAST = 1e-12  # in place of a sum that is 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """Rows of squares held against what is predicted of them.

    Parameters
    ----------
    square, frame : (row,) int
    shown : (row,) float
        [1]
    predicted : (row,) float
        R or T of Eq. 1. [1]
    shape : (int, int)
        Rows and columns of squares.
    """

    square: IntArray
    frame: IntArray
    shown: FloatArray
    predicted: FloatArray
    shape: tuple[int, int]

    @property
    def count(self) -> int:
        """Of squares."""
        return self.shape[0] * self.shape[1]

    def some(self, rows: BoolArray) -> "Line":
        """Some of its rows, (row,) bool."""
        return Line(
            square=self.square[rows], frame=self.frame[rows], shown=self.shown[rows], predicted=self.predicted[rows],
            shape=self.shape,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """The coefficient of some squares together.

    Parameters
    ----------
    share, deviation : float
        ρ or τ and its standard deviation, by clusters that are frames. [1]
    gain : float
        G of Eq. 2, over a matt surface. [1]
    own : float
        Share of the light that is the squares' own, in the median. [1]
    frames : int
    """

    share: float
    deviation: float
    gain: float
    own: float
    frames: int


def fitted(line: Line) -> Fit:
    """One ρ or τ for all squares of some rows."""
    if not len(line.shown):
        return Fit(share=0.0, deviation=0.0, gain=0.0, own=1.0, frames=0)
    weight, share = np.ones(len(line.shown)), 0.0
    for _ in range(ROUNDS):
        y, x = _centred(line, weight)
        share = float(np.sum(weight * x * y) / max(float(np.sum(weight * x**2)), LEAST))
        weight = _weights(y - share * x, line.shown)
    y, x = _centred(line, weight)
    left = y - share * x
    frames, which = np.unique(line.frame, return_inverse=True)
    score = np.bincount(which, weights=weight * left * x)
    spread = max(float(np.sum(weight * x**2)), LEAST)
    variance = float(np.sum(score**2)) / spread**2 * frames.size / max(frames.size - 1, 1)
    floor = (weight * (NOISE * line.shown) ** 2).sum()
    matt, mirrored = ((weight * each**2).sum() + floor for each in (y, left))
    own = np.median((line.shown - share * line.predicted) / np.maximum(line.shown, 1e-6))
    return Fit(
        share=share, deviation=float(np.sqrt(variance)),
        gain=float(0.5 * frames.size * np.log(matt / max(mirrored, LEAST))), own=float(own), frames=int(frames.size),
    )  # fmt: skip


def gains_of_squares(line: Line) -> tuple[FloatArray, FloatArray]:
    """Gain of each square with the squares around it, and its coefficient.

    Parameters
    ----------
    line : Line

    Returns
    -------
    gain, share : (row, column) float
        NaN where too few frames show it. [1]
    """
    weight = np.ones(len(line.shown))
    gain = share = np.zeros(line.shape)
    for _ in range(ROUNDS):
        y, x = _centred(line, weight)
        sums = [_windowed(line, weight * first * second) for first, second in ((x, x), (x, y), (y, y))]
        share = sums[1] / np.maximum(sums[0], LEAST)
        left = y - share.ravel()[line.square] * x
        weight = _weights(left, line.shown)
        floor = _windowed(line, weight * (NOISE * line.shown) ** 2)
        explained = (sums[1] * share) / np.maximum(sums[2] + floor, LEAST)
        gain = -0.5 * _views(line) * np.log(np.maximum(1.0 - np.clip(explained, 0.0, 1.0), 1e-6))
    few = _views(line) < MIN_VIEWS
    return np.where(few, np.nan, gain), np.where(few, np.nan, share)


def gains_over_matt(line: Line, share: float) -> FloatArray:
    """(row, column) gain of each square by itself if its coefficient is `share`; 0 where none shows it."""
    weight = np.ones(len(line.shown))
    y, x = _centred(line, weight)
    left = y - share * x
    floor = (NOISE * line.shown) ** 2
    matt, mirrored = (
        np.bincount(line.square, weights=each**2 + floor, minlength=line.count).reshape(line.shape)
        for each in (y, left)
    )
    rows = np.bincount(line.square, minlength=line.count).reshape(line.shape)
    return np.where(rows >= MIN_VIEWS, 0.5 * rows * np.log(np.maximum(matt, LEAST) / np.maximum(mirrored, LEAST)), 0.0)


def best_rectangle(gain: FloatArray) -> tuple[slice, slice]:
    """Rows and columns of the rectangle whose (row, column) gains have the largest sum (Kadane, along columns).

    Squares of no gain, which no frame shows or which are another pane's, may lie in it but not along its edges.
    """
    total = np.vstack([np.zeros(gain.shape[1]), np.cumsum(gain, axis=0)])
    best, found = -np.inf, (slice(0, 0), slice(0, 0))
    for low in range(gain.shape[0]):
        for high in range(low + 1, gain.shape[0] + 1):
            band = np.concatenate([[0.0], np.cumsum(total[high] - total[low])])
            least = np.minimum.accumulate(band)
            right = int(np.argmax(band - least))
            if band[right] - least[right] > best:
                best = float(band[right] - least[right])
                found = (slice(low, high), slice(int(np.argmin(band[: right + 1])), right))
    told = gain[found] != 0.0
    rows, columns = (np.flatnonzero(told.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return found
    low, left = found[0].start, found[1].start
    return slice(low + int(rows[0]), low + int(rows[-1]) + 1), slice(
        left + int(columns[0]), left + int(columns[-1]) + 1
    )


def _centred(line: Line, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What is shown and predicted, less the weighted means of each square."""
    total = np.maximum(np.bincount(line.square, weights=weight, minlength=line.count), LEAST)

    def less_mean(values: FloatArray) -> FloatArray:
        mean = np.bincount(line.square, weights=weight * values, minlength=line.count) / total
        return np.asarray(values - mean[line.square], dtype=np.float64)

    return less_mean(line.shown), less_mean(line.predicted)


def _weights(left: FloatArray, shown: FloatArray) -> FloatArray:
    """(row,) weights of Cauchy's loss."""
    spread = 1.4826 * float(np.median(np.abs(left))) if left.size else 1.0
    scale = ROBUST_SCALE * np.hypot(spread, NOISE * shown)
    return np.asarray(1.0 / (1.0 + (left / np.maximum(scale, 1e-9)) ** 2), dtype=np.float64)


def _windowed(line: Line, values: FloatArray) -> FloatArray:
    """(row, column) sums of rows' values over the window around each square."""
    total = np.bincount(line.square, weights=values, minlength=line.count).reshape(line.shape)
    return np.asarray(ndimage.uniform_filter(total, WINDOW, mode="constant") * WINDOW**2, dtype=np.float64)


def _views(line: Line) -> FloatArray:
    """(row, column) about how many frames show the squares around each: the most that show one of them."""
    rows = np.bincount(line.square, minlength=line.count).reshape(line.shape)
    return np.asarray(ndimage.maximum_filter(rows, WINDOW), dtype=np.float64)
