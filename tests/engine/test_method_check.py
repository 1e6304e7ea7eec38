"""What the doctor traces: both methods in one room."""

from typing import Any

import pytest
import xarray as xr

from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
from lidarspectra.workflow import method_check


@pytest.mark.chance("two runs of the engine, seeded by the clock, within five of their combined errors")
def test_both_methods_agree_and_one_that_is_two_percent_off_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    traced: list[xr.Dataset] = []

    def remember(*scene_and_points: Any, **options: Any) -> xr.Dataset:
        traced.append(trace_plain(*scene_and_points, **options))
        return traced[-1]

    monkeypatch.setattr(method_check, "trace_plain", remember)
    check = method_check.check_methods(find_engine())
    assert check.agrees
    assert 0 < check.standard_error < 0.003  # so that 2 % are more than five of it

    wrong = traced[0].assign(coefficient_batches=1.02 * traced[0]["coefficient_batches"])
    monkeypatch.setattr(method_check, "trace_plain", lambda *scene_and_points, **options: wrong)
    assert not method_check.check_methods(find_engine()).agrees
