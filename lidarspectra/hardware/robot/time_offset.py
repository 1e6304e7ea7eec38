"""Time offset between the robot's clock and that of the readings, estimated from the readings themselves.

Two readings taken near one another in space are similar, whenever they were taken. With a wrong offset the positions
are wrong: rows that a robot drives to and fro are shifted against each other. So the offset is estimated as the one for
which readings near in space, but apart in time, differ least. Its standard error is from a jackknife over stretches of
the drive.

A drive in equal rows coincides with itself when shifted by the time of a row. Of such offsets, all of which fit, the
one nearest to zero is used and the others are reported: without more information the clocks must agree to half a row's
time. A map of the expected light, where there is one, decides between them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.robot.trajectory import Trajectory

RANGE_S = 30.0  # [s] largest offset tried, in both directions
STEP_S = 0.5  # [s] between them
APART_S = 8.0  # [s] readings closer in time are similar with any offset
MAX_READINGS = 400  # readings used; more do not reduce the error
STRETCHES = 8  # stretches of the drive in the jackknife
MIN_PAIRS = 100  # pairs near in space and apart in time; a drive that crosses no place twice has too few
MIN_CONTRAST = 0.1  # smallest relative gain of the best offset over the median one
KERNEL_OVER_SPACING = 1.0  # width of "near" over the distance between neighbouring rows
MIN_KERNEL_M = 0.1  # [m] however close the rows lie
MIN_LIGHT = 0.01  # share of a channel's median below which values are noise, whose logarithm would dominate
ALIKE = 1.5  # an offset with up to this multiple of the smallest misfit is also plausible
NEIGHBOURHOOD_S = 3.0  # [s] in which the jackknife looks for the same minimum again

ExpectedLight = Callable[[FloatArray], FloatArray]
"""Light that is expected at positions (n, 3) [m]: (n, channel), in any unit."""


@dataclass(frozen=True, kw_only=True)
class TimeOffset:
    """How much is added to the readings' times to get the robot's.

    Parameters
    ----------
    seconds : float
        [s]
    standard_error_s : float
        NaN where it was given or is not known. [s]
    is_known : bool
        False where the readings do not determine it, and 0 is used.
    words : str
        For logs.
    """

    seconds: float
    standard_error_s: float
    is_known: bool
    words: str


def given_offset(seconds: float) -> TimeOffset:
    """An offset that the user knows; ReadingError if it is no number."""
    if not np.isfinite(seconds):
        raise ReadingError(expected="a finite time offset", found=f"{seconds:g} s", where="--offset")
    return TimeOffset(
        seconds=seconds, standard_error_s=float("nan"), is_known=True, words=f"time offset {seconds:+.2f} s, as given"
    )


def estimate_time_offset(
    unix_s: ArrayLike,
    light: ArrayLike,
    trajectory: Trajectory,
    *,
    longest_gap_s: float,
    range_s: float = RANGE_S,
    expected: ExpectedLight | None = None,
) -> TimeOffset:
    """Estimate the offset of the robot's clock.

    Parameters
    ----------
    unix_s : (reading,) float
        Times of the readings, by their clock. [s]
    light : (reading, channel) float
        Any unit; NaN where masked.
    trajectory : Trajectory
        By the robot's clock.
    longest_gap_s : float
        See `Trajectory.at`. [s]
    range_s : float
        Largest offset that is tried. [s]
    expected : callable, optional
        Light of a map at positions in the trajectory's frame, in the same channels. Only its shape counts.

    Returns
    -------
    offset : TimeOffset
    """
    times, values = _chosen(np.asarray(unix_s, dtype=np.float64), np.asarray(light, dtype=np.float64))
    if times.size < 2 * STRETCHES:
        return _unknown("there are too few readings")
    offsets: FloatArray = np.arange(-range_s, range_s + STEP_S / 2, STEP_S)
    stretch = np.arange(times.size) * STRETCHES // times.size
    if expected is not None:
        parts = _map_costs(times, values, trajectory, offsets, longest_gap_s, stretch, expected)
    else:
        parts = _neighbour_costs(times, values, trajectory, offsets, longest_gap_s, stretch)
    weights, costs = parts[..., 0], parts[..., 1]
    if np.median(weights.sum(axis=1)) < MIN_PAIRS and expected is None:
        return _unknown("the robot passed too few places twice")
    with np.errstate(divide="ignore", invalid="ignore"):
        curve = costs.sum(axis=1) / weights.sum(axis=1)
        left_out = [
            np.delete(costs, k, axis=1).sum(axis=1) / np.delete(weights, k, axis=1).sum(axis=1)
            for k in range(STRETCHES)
        ]
    if not np.isfinite(curve).any() or np.nanmin(curve) > (1.0 - MIN_CONTRAST) * np.nanmedian(curve):
        return _unknown("the light differs too little from place to place")
    minima = _minima(offsets, curve)
    if not minima:
        return _unknown(f"it may be more than {range_s:.0f} s")
    best = min(minima, key=abs)
    near = np.abs(offsets - best) <= NEIGHBOURHOOD_S
    again = np.array([_refined(offsets[near], part[near], int(np.nanargmin(part[near]))) for part in left_out])
    error = float(np.sqrt((STRETCHES - 1) / STRETCHES * np.sum((again - again.mean()) ** 2)))
    # of neighbours, a drive that is not the same forth and back shifts the minimum by up to about half a step
    error = float(np.hypot(error, STEP_S / np.sqrt(12.0) / 2.0 if expected is not None else STEP_S / 2.0))
    others = [f"{other:+.1f} s" for other in minima if other != best]
    doubt = f"; {', '.join(others)} fit as well, so check the clocks or give --map" if others else ""
    how = "the readings agree best with the map" if expected is not None else "readings near in space agree best"
    words = f"time offset {best:+.2f} s ± {error:.2f} s, for which {how}{doubt}"
    return TimeOffset(seconds=best, standard_error_s=error, is_known=True, words=words)


def _unknown(why: str) -> TimeOffset:
    words = (
        f"time offset 0 s assumed, because the readings do not determine it ({why}): set both clocks, or give --offset"
    )
    return TimeOffset(seconds=0.0, standard_error_s=float("nan"), is_known=False, words=words)


def _chosen(times: FloatArray, light: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and centred logarithms of the channels that are always there, of at most `MAX_READINGS` readings."""
    lit = np.nanmedian(np.where(np.isfinite(light), light, 0.0), axis=0) > 0.0
    known = (np.isfinite(light).mean(axis=0) > 0.8) & lit
    usable = np.flatnonzero(np.isfinite(times) & np.isfinite(light[:, known]).any(axis=1))
    if usable.size == 0 or not known.any():
        return np.zeros(0), np.zeros((0, 1))
    places = np.unique(np.linspace(0, usable.size - 1, min(MAX_READINGS, usable.size)).astype(int))
    chosen = usable[places]
    floor = MIN_LIGHT * np.nanmedian(light[:, known], axis=0)
    values = np.full((chosen.size, light.shape[1]), np.nan)
    values[:, known] = np.log(np.maximum(light[np.ix_(chosen, known)], floor))
    return times[chosen], values


def _neighbour_costs(
    times: FloatArray,
    values: FloatArray,
    trajectory: Trajectory,
    offsets: FloatArray,
    longest_gap_s: float,
    stretch: IntArray,
) -> FloatArray:
    """(offset, stretch, 2) weights of pairs near in space and apart in time, and their weighted squared difference."""
    known = np.isfinite(values).any(axis=0)
    centred = values[:, known] - np.nanmedian(values[:, known], axis=0)
    # channels of little light are mostly noise: the strongest principal components carry the signal
    u, s, _ = np.linalg.svd(np.nan_to_num(centred), full_matrices=False)
    features = u[:, :3] * s[:3]
    kernel_m = _kernel_width(trajectory)
    return np.array([_costs(times, features, trajectory, d, kernel_m, longest_gap_s, stretch) for d in offsets])


def _map_costs(
    times: FloatArray,
    values: FloatArray,
    trajectory: Trajectory,
    offsets: FloatArray,
    longest_gap_s: float,
    stretch: IntArray,
    expected: ExpectedLight,
) -> FloatArray:
    """(offset, stretch, 2) readings, and the squared difference of their logarithms from a map's, levels taken out."""
    parts = np.zeros((offsets.size, STRETCHES, 2))
    for k, offset in enumerate(offsets):
        places, _ = trajectory.at(times + offset, longest_gap_s=longest_gap_s)
        there = np.isfinite(places).all(axis=1)
        wanted = np.full_like(values, np.nan)
        wanted[there] = np.log(np.maximum(expected(places[there]), 1e-30))
        difference = values - wanted
        usable = np.isfinite(difference).any(axis=0)
        difference = difference[:, usable] - np.nanmedian(difference[:, usable], axis=0)
        misfit = np.nanmean(difference[there] ** 2, axis=1)
        known = np.isfinite(misfit)
        part = stretch[there][known]
        parts[k, :, 0] = np.bincount(part, minlength=STRETCHES)
        parts[k, :, 1] = np.bincount(part, weights=misfit[known], minlength=STRETCHES)
    return parts


def _kernel_width(trajectory: Trajectory) -> float:
    """Distance that counts as near: the distance between places of the drive that are apart in time."""
    every = max(1, len(trajectory) // MAX_READINGS)
    places, times = trajectory.positions[::every, :2], trajectory.unix_s[::every]
    distance = np.linalg.norm(places[:, None] - places[None], axis=2)
    distance[np.abs(times[:, None] - times[None]) <= APART_S] = np.inf
    nearest = distance.min(axis=1)
    known = nearest[np.isfinite(nearest)]
    return max(MIN_KERNEL_M, KERNEL_OVER_SPACING * float(np.median(known))) if known.size else MIN_KERNEL_M


def _costs(
    times: FloatArray,
    features: FloatArray,
    trajectory: Trajectory,
    offset_s: float,
    kernel_m: float,
    longest_gap_s: float,
    stretch: IntArray,
) -> FloatArray:
    """(stretch, 2) sum of weights of near pairs, and of their weighted squared differences."""
    places, _ = trajectory.at(times + offset_s, longest_gap_s=longest_gap_s)
    there = np.isfinite(places).all(axis=1)
    p, f, t, part = places[there, :2], features[there], times[there], stretch[there]
    squared = ((p[:, None] - p[None]) ** 2).sum(axis=2)
    weight = np.exp(-0.5 * squared / kernel_m**2) * (np.abs(t[:, None] - t[None]) > APART_S)
    difference = ((f[:, None] - f[None]) ** 2).sum(axis=2)
    sums = np.stack([weight.sum(axis=1), (weight * difference).sum(axis=1)], axis=1)
    return np.stack([np.bincount(part, weights=sums[:, i], minlength=STRETCHES) for i in (0, 1)], axis=1)


def _minima(offsets: FloatArray, curve: FloatArray) -> list[float]:
    """Where a curve has minima about as low as its lowest, away from its ends."""
    inner = np.arange(1, curve.size - 1)
    dips = inner[(curve[inner] <= curve[inner - 1]) & (curve[inner] < curve[inner + 1])]
    low = dips[curve[dips] <= ALIKE * np.nanmin(curve)]
    return [_refined(offsets, curve, int(k)) for k in low]


def _refined(offsets: FloatArray, curve: FloatArray, k: int) -> float:
    """Where a curve is least near its sample k, by the parabola through three samples."""
    k = int(np.clip(k, 1, curve.size - 2))
    below, at, above = curve[k - 1 : k + 2]
    bend = below - 2.0 * at + above
    shift = 0.5 * (below - above) / bend if bend > 0 else 0.0
    return float(offsets[k] + np.clip(shift, -1.0, 1.0) * (offsets[1] - offsets[0]))
