"""The running reference moved along how the light has lately changed, as far as each reading tells.

The running median is of minutes ago. Daylight through blinds, sensors that warm up and lamps that run in change all
sensors meanwhile, each by its own amount, so that no common level takes it out; but within minutes they go on in the
direction in which they went. Between the older and the later half of the median's window the light has changed by the
trend t, and a reading is compared with

    N0' = N0 exp(a t)          a = argmin Σ |u - v - a t| / sqrt(σ² + s²)          u = ln(N/N0)

over all channels, with the level v, the median over sensors of what is left. A person changes few sensors, which a sum
of absolute values does not follow: for a given v, a is the median of (u - v)/t weighted by |t|/sqrt(σ² + s²). Where all
that changed is noise, or few sensors, as by somebody who stayed, the trend says nothing of the light: a is drawn to 0,

    a → a i / (1 + i)          i = S (median over S sensors of |t|/s)²

with s of each sensor how much people scatter its readings in the window, two hundredths or more.

    Gurwitz (1990) Weighted median algorithms for L1 approximation, BIT 30, 301-310 (regression through the origin).
"""

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.mapping.localization.features import FeatureSpace, known_median
from lidarspectra.mapping.localization.running_reference import LightTrend

MIN_SCATTER = 0.02  # [1] of s: half as much takes long stays for light, on virtual offices 2 to 4
MAX_STEPS = 4.0  # [1] of a: by a quickly passing cloud light changes in a minute as before in five
ROUNDS = 3  # of level and amplitude in turn; more change neither


def follow_trend(
    space: FeatureSpace,
    readings: FloatArray,
    reference: FloatArray,
    trend: LightTrend,
    *,
    usable: BoolArray | None = None,
) -> FloatArray:
    """N0': references of readings, moved along the trend of the light.

    Parameters
    ----------
    space : FeatureSpace
    readings : (reading, sensor, band) float
        NaN where missing.
    reference : (sensor, band) or (reading, sensor, band) float
        N0, the running median; NaN or 0 where there is none. [unit of the readings]
    trend : LightTrend
        t and s, of the same shape.
    usable : (sensor, band) or (reading, sensor, band) bool, optional
        Of these readings; channels that are too dark in them do not count.

    Returns
    -------
    moved : (reading, sensor, band) float
        [unit of the readings]
    """
    known = np.isfinite(readings) & (readings > 0) & (reference > 0) & space.usable
    if usable is not None:
        known = known & usable
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(known, np.log(readings / reference), np.nan)
    scatter = np.broadcast_to(np.hypot(trend.scatter, MIN_SCATTER), readings.shape)
    steady = np.where(known, trend.change, np.nan)
    of_sensor = space.sensor_changes(steady)
    level = known_median(of_sensor, axis=1)
    steady = np.nan_to_num(steady - level[:, None, None])
    weight = np.abs(steady) / np.hypot(space.noise, scatter)
    slope = np.where(steady == 0, np.inf, steady)
    amplitude = np.zeros(len(readings))
    for _ in range(ROUNDS):
        left = change - amplitude[:, None, None] * steady
        common = known_median(space.sensor_changes(left), axis=1)[:, None, None]
        amplitude = _weighted_median(np.nan_to_num(change - common) / slope, weight)
    apart = np.abs(of_sensor - level[:, None]) / space.sensor_changes(np.where(known, scatter, np.nan))
    told = np.isfinite(apart).sum(axis=1) * known_median(apart, axis=1) ** 2
    amplitude = np.clip(amplitude * told / (1.0 + told), -MAX_STEPS, MAX_STEPS)
    return np.asarray(reference * np.exp(amplitude[:, None, None] * trend.change), dtype=np.float64)


def _weighted_median(values: FloatArray, weights: FloatArray) -> FloatArray:
    """(reading,) median over sensors and bands of (reading, sensor, band) values; 0 where all weights are 0."""
    flat, weight = (each.reshape(len(each), np.prod(each.shape[1:], dtype=int)) for each in (values, weights))
    order = np.argsort(flat, axis=1)
    total = np.cumsum(np.take_along_axis(weight, order, axis=1), axis=1)
    middle = (total >= 0.5 * total[:, -1:]).argmax(axis=1)
    found = np.take_along_axis(np.take_along_axis(flat, order, axis=1), middle[:, None], axis=1)[:, 0]
    return np.asarray(np.where(total[:, -1] > 0, found, 0.0), dtype=np.float64)
