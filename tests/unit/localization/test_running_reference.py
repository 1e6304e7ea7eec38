"""The running median that stands for the empty room."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.running_reference import (
    FIRST_QUANTILE,
    REFRESH_FRAMES,
    MedianWindow,
    RunningMedian,
    running_references,
)
from lidarspectra.mapping.localization.scoring import errors_of
from research.experiments.virtual_readings import Visits, watch_by_sensors

Maker = Callable[..., xr.Dataset]


def test_the_median_is_that_of_the_latest_frames_and_follows_every_few() -> None:
    frames = np.arange(100.0).reshape(-1, 1, 1)
    references = running_references(frames, MedianWindow(frames=20, first=5))
    assert np.isnan(references[:4]).all()
    for number in range(4 + REFRESH_FRAMES, 100, REFRESH_FRAMES):
        if number >= 10:  # half of the window is full
            assert references[number, 0, 0] == np.median(np.arange(max(0, number - 19), number + 1))
        assert (references[number : number + REFRESH_FRAMES] == references[number]).all()


def test_the_first_reference_is_a_higher_quantile_and_comes_down_to_the_median() -> None:
    window = MedianWindow(frames=600, first=60)
    assert window.quantile(60) == FIRST_QUANTILE
    assert window.quantile(180) == pytest.approx((FIRST_QUANTILE + 0.5) / 2.0)
    assert window.quantile(300) == window.quantile(900) == 0.5
    assert MedianWindow(frames=9, first=9).quantile(9) == 0.5  # half of the window is full at once


@pytest.mark.parametrize(("quantile", "share"), [(0.4, 0.5), (1.0, 0.5), (0.8, 1.2)])
def test_a_window_that_is_no_upper_quantile_is_refused(quantile: float, share: float) -> None:
    with pytest.raises(MapError, match="first quantile"):
        MedianWindow(first_quantile=quantile, settled_share=share)


def test_who_stays_for_more_than_half_of_the_first_minute_is_not_part_of_the_empty_room() -> None:
    """One sensor is a tenth darker for 40 of the first 60 frames, another for the other 20."""
    frames = np.full((60, 2, 1), 100.0)
    frames[:40, 0] = frames[40:, 1] = 90.0
    assert running_references(frames)[-1, :, 0].tolist() == [100.0, 100.0]


def test_noise_does_not_lift_the_first_reference_above_the_level() -> None:
    frames = 100.0 * (1.0 + 0.02 * np.random.default_rng(0).standard_normal((60, 200, 1)))
    reference = running_references(frames)[-1]
    # A quantile of 0.9 lies 1.28 standard deviations above the level: 2.6 % of single frames, 0.8 % of means of ten.
    assert reference.mean() / 100.0 - 1.0 < 0.009


@pytest.mark.parametrize("first", [60, 65])
def test_the_first_reference_comes_with_the_first_frames_that_suffice(first: int) -> None:
    references = running_references(np.ones((80, 1, 1)), MedianWindow(first=first))
    assert np.flatnonzero(np.isfinite(references[:, 0, 0]))[0] == first - 1


def test_missing_readings_are_not_counted_and_nothing_is_dark() -> None:
    median = RunningMedian(MedianWindow(frames=3, first=3))
    frames = ([5.0, np.nan], [np.nan, np.nan], [7.0, np.nan])
    found = [median.take(np.array([frame])) for frame in frames]
    assert found[:2] == [None, None]
    assert found[2] is not None
    assert found[2].tolist() == [[6.0, 0.0]]


def test_a_watch_is_located_against_its_running_median(model: LocationModel, make_table: Maker) -> None:
    """Ten hours after the empty room was read, sensors have drifted by more than people change; the median has too."""
    read = watch_by_sensors(make_table(9, draws=1), Visits(stay_s=(20.0, 40.0), after_h=10.0), seed=2)
    running, own = (errors_of(model, read, against=against) for against in ("running", "own"))
    for method in running:
        assert running[method].percentile_m(50) < 0.5, method  # [m]; places are 1.3 m and 1.5 m apart
        assert running[method].top(1) > own[method].top(1), method


def test_frames_before_the_median_is_believed_are_no_fixes(model: LocationModel, make_table: Maker) -> None:
    read = watch_by_sensors(make_table(9, draws=1), Visits(stay_s=(20.0, 40.0), lead_s=0.0), seed=2)
    found = errors_of(model, read, against="running")["ridge"]
    assert len(found) == read.sizes["fingerprint"] - 59
    assert len(errors_of(model, read)["ridge"]) == read.sizes["fingerprint"]


def test_a_recording_too_short_for_a_running_median_is_refused(model: LocationModel, make_table: Maker) -> None:
    readings = make_table(9, draws=1, gains=np.full(6, 1e6))
    with pytest.raises(MapError, match="needs 60 readings"):
        errors_of(model, readings, against="running")
