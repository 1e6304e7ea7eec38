"""The running reference moved along the trend of the light."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization.features import FeatureSettings, FeatureSpace
from lidarspectra.mapping.localization.light_trend import MAX_STEPS, follow_trend
from lidarspectra.mapping.localization.running_reference import (
    MEANS_OF_TREND,
    REFRESH_FRAMES,
    LightTrend,
    MedianWindow,
    RunningMedian,
    references_and_trends,
)

SENSORS, BANDS = 15, 4
SHAPE = (SENSORS, BANDS)
LEVEL = 500.0  # [count] of the empty room
BODY = -0.3  # [1] what a body changes at three sensors
AT = (2, 7, 11)
TREND: FloatArray = 0.05 * np.linspace(0.0, 2.0, SENSORS)[:, None] * np.ones(SHAPE)  # a window on one side


def space(*, usable: np.ndarray | None = None) -> FeatureSpace:
    return FeatureSpace(
        sensors=tuple(f"s{number}" for number in range(SENSORS)),
        bands_nm=np.array([460.0, 560.0, 610.0, 680.0]),
        usable=np.ones(SHAPE, dtype=np.bool_) if usable is None else usable,
        noise=np.full(SHAPE, 0.005),
        settings=FeatureSettings(),
    )


def steadily(change: FloatArray, scatter: float = 0.0) -> LightTrend:
    return LightTrend(change=change, scatter=np.full(SHAPE, scatter))


def body() -> FloatArray:
    change = np.zeros(SHAPE)
    change[list(AT)] = BODY
    return change


def followed(change: FloatArray, trend: FloatArray, scatter: float = 0.0) -> FloatArray:
    """Logarithm of the reference that a change of the empty room gets, over what it was before."""
    found = follow_trend(space(), LEVEL * np.exp(change)[None], np.full(SHAPE, LEVEL), steadily(trend, scatter))
    return np.asarray(np.log(found[0] / LEVEL))


@pytest.mark.parametrize("steps", [-1.0, 0.5, 1.0, 2.5])
def test_the_light_that_went_on_as_before_is_no_change_and_the_body_is(steps: float) -> None:
    """Of a change by the light and a body the reference takes the light's part, more or less of it than before."""
    moved = followed(steps * TREND + body(), TREND)
    left = steps * TREND + body() - moved
    level = np.median(left)
    # The trend of 5 % is 15 sensors of 2.7 % in the median: it is drawn to 0 by a hundredth, .1 % of the light here.
    assert left - level == pytest.approx(body(), abs=0.004)


def test_a_dimming_of_all_lamps_is_left_to_the_level() -> None:
    moved = followed(np.full(SHAPE, -0.5) + body(), TREND)
    assert np.abs(moved).max() < 0.002


def test_where_nothing_but_noise_changed_the_reference_stays() -> None:
    noise = 0.0005 * np.random.default_rng(0).standard_normal(SHAPE)
    assert np.abs(followed(body(), noise)).max() < 0.001  # a body of 30 % is no trend of .05 %


def test_somebody_who_stayed_is_no_trend_of_the_light_and_is_still_there() -> None:
    """The older half of the window has nobody, the later one has who stands there now: few sensors, no trend."""
    assert np.abs(followed(body(), body())).max() < 1e-6


def test_a_trend_within_what_people_scatter_says_little_of_the_light() -> None:
    """Where everybody changes all sensors by ten times the trend, medians of some minutes differ by chance."""
    certain, doubtful = (np.abs(followed(TREND, TREND, scatter)).max() for scatter in (0.0, 0.5))
    assert certain == pytest.approx(TREND.max(), rel=0.05)
    assert doubtful < 0.1 * certain


def test_the_reference_is_moved_by_a_few_times_the_trend_at_most() -> None:
    moved = followed(20.0 * TREND, TREND)
    assert moved == pytest.approx(MAX_STEPS * TREND, rel=0.01)


def test_missing_readings_dark_references_and_unused_channels_tell_nothing_and_stay() -> None:
    readings, reference = LEVEL * np.exp(TREND + body())[None], np.full((1, *SHAPE), LEVEL)
    whole = follow_trend(space(), readings, reference, steadily(TREND))
    readings[0, 4], reference[0, 5] = np.nan, 0.0
    usable = np.ones(SHAPE, dtype=np.bool_)
    usable[:, 3] = False
    readings[0, :, 3] *= 3.0
    found = follow_trend(space(usable=usable), readings, reference, steadily(TREND))
    assert found[0, 5].tolist() == [0.0] * BANDS
    others = [number for number in range(SENSORS) if number != 5]
    # The level is the median of 13 sensors, where it was that of 15, which differ by .3 % of trend each.
    assert found[0, others] == pytest.approx(whole[0, others], rel=0.005)
    nothing = np.full_like(readings, np.nan)
    assert follow_trend(space(), nothing, reference, steadily(TREND)) == pytest.approx(reference)
    assert follow_trend(space(), readings[:0], reference[:0], steadily(TREND)).shape == (0, *SHAPE)


def test_the_trend_is_the_change_between_the_halves_of_the_window() -> None:
    window = MedianWindow(frames=600, first=60)
    light = np.concatenate([np.full(300, 100.0), np.full(300, 110.0)])[:, None, None] * np.ones((1, 2, 1))
    light[:, 1] = np.nan
    references, trend = references_and_trends(light, window)
    trends = trend.change
    assert trends[-1, :, 0] == pytest.approx([np.log(1.1), 0.0])
    rising = np.linspace(1.0, 2.0, 600)[:, None, None]
    known = np.flatnonzero(references_and_trends(light * rising, window)[1].change[:, 0, 0])
    assert known[0] == pytest.approx(2 * MEANS_OF_TREND * REFRESH_FRAMES, abs=10)
    assert np.isnan(references[0]).all()
    assert not trends[:59].any()
    assert RunningMedian(window).trend is None


def test_the_scatter_is_that_of_means_about_their_half_and_not_the_trend() -> None:
    generator = np.random.default_rng(0)
    light = 100.0 * np.exp(0.1 * generator.standard_normal((600, 40, 1)))
    light[300:] *= 1.5
    trend = RunningMedian(MedianWindow(frames=600, first=60))
    for frame in light:
        trend.take(frame)
    assert trend.trend is not None
    # Means of ten frames; a median deviation of 60 means is known to 15 %, its mean over 40 sensors to 3 %.
    assert trend.trend.scatter.mean() == pytest.approx(0.1 / np.sqrt(10.0), rel=0.1)
