"""Automatic gain: the brightest channel stays inside what the sensor counts, and what is logged is what was set."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.hardware.sensor.as7265x import FLAG_SATURATED
from lidarspectra.hardware.sensor.autogain import MAX_SHARE, best_settings, full_scale
from lidarspectra.hardware.sensor.identify import Wishes
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log
from lidarspectra.hardware.sensor.reading_log import LogWriter
from lidarspectra.hardware.sensor.recorder import RecordOptions, record
from lidarspectra.hardware.virtual.emulator import AtModule, SketchBoard, office_light
from lidarspectra.hardware.virtual.faults import FaultyWire, VirtualClock, VirtualPort


@pytest.mark.parametrize("basic_peak", np.geomspace(1e-4, 200.0, 25))
def test_the_settings_hold_the_peak_below_its_limit_wherever_any_can(basic_peak: float) -> None:
    settings = best_settings(basic_peak, longest_ms=333.0)
    fraction = basic_peak * settings.gain * settings.integration_ms / full_scale(settings.integration_steps)
    assert fraction <= MAX_SHARE
    assert settings.integration_ms <= 333.0
    assert fraction > 0.1 or settings.gain == 64.0  # bright enough, or nothing brighter is left


@pytest.mark.parametrize("kind", [AtModule, SketchBoard])
def test_light_that_changes_a_thousandfold_is_followed(kind: type[AtModule], tmp_path: Path) -> None:
    def light(now_s: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return office_light(now_s) * (0.01 if now_s < 100.0 else 30.0 if now_s < 200.0 else 0.3)

    clock = VirtualClock()
    options = RecordOptions(wishes=Wishes(period_s=1.0), duration_s=300.0, auto_gain=True)
    with LogWriter(tmp_path / "log.csv", sync=lambda descriptor: None) as log:
        record(VirtualPort(FaultyWire(kind(light)), clock), log, options=options, clock=clock)
    held = read_sensor_log(tmp_path / "log.csv")
    readings = held.readings
    saturated = (readings["flag"].to_numpy() & FLAG_SATURATED).any(axis=1)
    assert saturated.sum() < 25  # those until the change was followed
    second = readings["unix_s"].to_numpy() - readings["unix_s"].to_numpy()[0]
    counts, gain, time_ms = (readings[name].to_numpy() for name in ("counts", "gain", "integration_ms"))
    for start, factor in ((60.0, 0.01), (160.0, 30.0), (260.0, 0.3)):
        settled = (second > start) & (second < start + 30.0)
        basic = counts[settled] / (gain * time_ms)[settled, None]
        wanted = office_light(0.0) * factor
        bright = wanted > 0.3 * wanted.max()
        # gain and time of each reading are those it was measured with: the light comes out whatever they are
        assert np.nanmedian(basic[:, bright] / wanted[bright]) == pytest.approx(1.0, abs=0.02)
        assert not saturated[settled].any()
    assert held.events["detail"].str.contains("automatic gain").sum() >= 2
