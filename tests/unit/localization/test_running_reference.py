"""The running median that stands for the empty room."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.running_reference import (
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
    assert references[4, 0, 0] == 2.0
    for number in range(4 + REFRESH_FRAMES, 100, REFRESH_FRAMES):
        assert references[number, 0, 0] == np.median(np.arange(max(0, number - 19), number + 1))
        assert (references[number : number + REFRESH_FRAMES] == references[number]).all()


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
