"""What `annual` is asked for: its weather, its sensors, and the hours whose maps it writes."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from lidarspectra.config import RunFile
from lidarspectra.errors import LampError, RunFileError, WorkspaceError
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.radiance.scene.daylight import Window, daylight_lamps
from lidarspectra.radiance.scene.sky import ALTITUDES_DEG, AZIMUTHS_DEG, SKY_WAVELENGTHS_NM, Sky
from lidarspectra.radiance.scene.sky_patches import SkyPatches, patch_geometry
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.applications import week_of_run
from lidarspectra.workflow.applications.annual import (
    _calibrated_windows,
    _calibration_notes,
    _glass_notes,
    _hour_at,
    annual_daylight,
    channel_notes,
    clear_windows,
)
from lidarspectra.workflow.room_model import RoomModel
from lidarspectra.workflow.run_folder.annual_inputs import changed_since, with_inputs, year_inputs
from lidarspectra.workflow.run_folder.light_of_run import dimmed_notes

WINDOW = {"name": "south", "center": [0, 0, 1], "size": [1, 1], "normal": [0, 1, 0]}
DAYLIGHT = {"latitude_deg": 48, "longitude_deg": 9, "time": "2026-06-21T12:00:00+02:00", "windows": [WINDOW]}


def run_file(weather: str | None, **sensors: object) -> RunFile:
    return RunFile.model_validate(
        {
            "scan": {"file": "room.glb"},
            "daylight": {**DAYLIGHT, "weather": weather},
            "sensors": {"grid": {"count": 9}, **sensors},
        }
    )


def test_without_a_weather_or_windows_there_is_no_year(tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="no weather there"):
        annual_daylight(run_file(None), tmp_path)
    without = RunFile.model_validate({"scan": {"file": "room.glb"}, "lamps_from_scan": {"cct_k": 3000}})
    with pytest.raises(RunFileError, match=r"no \[daylight\]"):
        annual_daylight(without, tmp_path)


def test_a_weather_file_that_is_not_there_is_refused_before_any_stage(tmp_path: Path) -> None:
    with pytest.raises(LampError, match="weather file in EPW form"):
        annual_daylight(run_file("nowhere.epw"), tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_narrow_sensor_has_no_illuminance(tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="cosine receptor"):
        annual_daylight(run_file("synthetic", field_of_view_deg=20), tmp_path)


@pytest.fixture
def year() -> xr.Dataset:
    """The hours from 6 to 18 h of every day."""
    times = pd.date_range("2023-01-01 00:30", periods=8760, freq="h")
    lit = times[(times.hour >= 6) & (times.hour < 18)]
    return xr.Dataset(coords={"time": ("hour", lit)}, attrs={"utc_offset_h": 1.0})


@pytest.mark.parametrize(
    "words", ["06-21 12:30", "06-21 12:00", "2025-06-21 12:59", "2030-06-21T12:10", "2024-06-21T13:30+02:00"]
)
def test_an_hour_is_named_with_or_without_a_year(year: xr.Dataset, words: str) -> None:
    found = year["time"].to_numpy()[_hour_at(year, words)]
    assert found == np.datetime64("2023-06-21T12:30")


@pytest.mark.parametrize(
    ("words", "says"), [("06-21 03:00", "there is none"), ("noon", "'noon'"), ("13-40 12", "13-40")]
)
def test_an_hour_that_is_none_is_refused(year: xr.Dataset, words: str, says: str) -> None:
    with pytest.raises(RunFileError, match=says):
        _hour_at(year, words)


def test_a_calibrated_window_may_send_more_than_clear_glass_lets_through_of_the_models_sky() -> None:
    given = run_file("synthetic")
    brighter = _calibrated_windows(given.changed(calibration={"lamps": {"south": 1.6}}))  # 1.28 of its pane's .8
    grid = (AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size)
    sky = Sky(radiance=np.ones(grid), sun_direction=None, sun_irradiance=np.zeros(grid[2]))
    (before,), (after,) = (daylight_lamps(sky, each) for each in (_calibrated_windows(given), brighter))
    assert after.flux.values == pytest.approx(1.6 * before.flux.values)
    geometry = [patch_geometry(SkyPatches(), each, 0.0) for each in (_calibrated_windows(given), brighter)]
    assert geometry[1] == pytest.approx(1.6 * geometry[0])


def test_a_window_behind_the_scanned_wall_is_moved_before_it_as_a_run_of_one_moment_does() -> None:
    room = RoomModel.from_box(4.0, 3.0, 2.5)
    window = Window(name="south", center=(2.0, -0.03, 1.4), normal=(0.0, 1.0, 0.0), size=(1.5, 1.0))
    placed = clear_windows((window,), (), room.scan)
    assert 0.0 < placed.windows[0].center[1] < 0.01
    assert replace(placed.windows[0], center=window.center) == window
    assert len(placed.notes) == 1
    assert "'south', so that the center was moved by up to 3.5 cm" in placed.notes[0]
    outside = clear_windows((replace(window, center=(2.0, -0.8, 1.4)),), (), room.scan)
    assert "outside the scan" in outside.notes[0]


def test_glass_before_a_window_is_told_and_the_windows_own_pane_is_not() -> None:
    places = {"x": ("point", [0.5, 0.5]), "y": ("point", [1.0, 3.0]), "z": ("point", [1.0, 1.0])}
    pane = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 2.0], [0.0, 0.0, 2.0]])
    window = Window(name="south", center=(0.5, 0.05, 1.0), normal=(0.0, 1.0, 0.0), size=(0.8, 0.8))
    for depth, words in ((0.0, ()), (2.0, ("At 1 of 2 points",))):
        scan = bare_scan(pane + [0.0, depth, 0.0], np.array([[0, 1, 2], [0, 2, 3]]))
        glass = SimpleNamespace(materials=(SimpleNamespace(transmittance=0.8),), face_material=np.zeros(2, dtype=int))
        notes = _glass_notes(SimpleNamespace(scan=scan, materials=glass), xr.Dataset(coords=places), (window,))
        assert len(notes) == len(words)
        assert all(note.startswith(word) for note, word in zip(notes, words, strict=True))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"daylight": {"windows": [{**WINDOW, "size": [2, 1]}]}}, "windows or sky"),
        ({"trace": {"accuracy": "low"}}, "number of reflections"),
        ({"sensors": {"grid": {"count": 16}}}, "points"),
        ({"daylight": {"time": "2026-12-21T12:00:00+02:00", "cloud_cover": 1.0}}, None),
        ({"rules": {"glare": False}}, None),
    ],
)
def test_a_year_tells_what_changed_since_it_was_made(
    tmp_path: Path, change: dict[str, dict[str, Any]], name: str | None
) -> None:
    for stage in ("1-scan", "3-materials"):
        (tmp_path / stage).mkdir()
        (tmp_path / stage / "made.npz").write_bytes(b"1")
    first = run_file("synthetic")
    inputs = year_inputs(first, tmp_path, tmp_path)
    year = with_inputs(xr.Dataset(), inputs)
    assert changed_since(year, inputs) == ()
    given = first.model_dump(mode="json", exclude_none=True)
    later = RunFile.model_validate({**given, **{key: {**given.get(key, {}), **value} for key, value in change.items()}})
    assert changed_since(year, year_inputs(later, tmp_path, tmp_path)) == (() if name is None else (name,))
    (tmp_path / "1-scan" / "made.npz").write_bytes(b"2")
    assert "scan" in changed_since(year, year_inputs(first, tmp_path, tmp_path))
    assert changed_since(xr.Dataset(), inputs) == tuple(inputs)  # of a version that kept nothing


def test_a_week_takes_no_year_of_another_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # points are the same; the window is twice as wide as when the year was made
    for stage in ("1-scan", "3-materials", "annual"):
        (tmp_path / stage).mkdir()
        (tmp_path / stage / "annual.nc").write_bytes(b"1")
    given = run_file("synthetic")
    places = xr.Dataset(coords={axis: ("point", [0.5, 1.5]) for axis in "xyz"})
    year = with_inputs(places, year_inputs(given, tmp_path, tmp_path))
    monkeypatch.setattr(week_of_run, "load_year", lambda _: year)
    for run, changed in ((given, None), (wider(given), "windows or sky")):
        request = {"name": "room.toml", "folder": ".", "sha256": "", "text": run.to_toml(), "seed": 0}
        (tmp_path / "lidarspectra-run.json").write_text(json.dumps({"run_file": request}), encoding="utf-8")
        if changed is None:
            assert week_of_run._year_of_run(tmp_path, places) is year
        else:
            with pytest.raises(WorkspaceError, match=changed):
                week_of_run._year_of_run(tmp_path, places)


def wider(given: RunFile) -> RunFile:
    return given.changed(daylight={"windows": [{**WINDOW, "size": [2, 1]}]})


def test_a_window_s_factor_from_one_moment_is_told_of_a_year() -> None:
    given = run_file("synthetic")
    assert _calibration_notes(given) == ()
    assert _calibration_notes(given.changed(calibration={"lamps": {"south": 1.05}})) == ()
    (note,) = _calibration_notes(given.changed(calibration={"lamps": {"south": 0.2, "panel": 3.0}}))
    assert "'south' x 0.2. Its readings" in note


def test_a_schedule_of_lamps_that_the_run_dims_says_what_1_is(tmp_path: Path) -> None:
    lamp = {"name": "a", "shape": "panel", "center": [0, 0, 2], "size": [1, 1], "cct_k": 3000, "luminous_flux_lm": 100}
    for dims, told in (((1.0, 0.0), False), ((0.4, 1.0), True)):
        lamps = [{**lamp, "dim": dims[0]}, {**lamp, "name": "b", "dim": dims[1]}]
        text = run_file(None).changed(lamps=lamps).to_toml()
        request = {"name": "room.toml", "folder": ".", "sha256": "", "text": text, "seed": 0}
        (tmp_path / "lidarspectra-run.json").write_text(json.dumps({"run_file": request}), encoding="utf-8")
        notes = dimmed_notes(tmp_path)
        assert bool(notes) == told
        assert all("dims 'a' to 0.4, and" in note for note in notes)


def test_channels_beyond_computed_daylight_are_told_and_no_others() -> None:
    (note,) = channel_notes(sensor_bands("as7265x-18"))
    assert "up to 800 nm: the maps' 810, 860, 900, 940 nm lack" in note
    assert channel_notes(sensor_bands("as7265x-14")) == ()
