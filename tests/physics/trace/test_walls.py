"""Light behind walls and through doors: sensors that share paths do not share light that only one of them sees.

Truths are Mitsuba's: `python -m research.benchmarks.rooms_and_walls --rooms door ajar --write-truth
tests/physics/trace/walls_truth.csv`.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.radiance.sampling import own_light
from lidarspectra.radiance.sampling.stated_error import own_relative_se
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from research.benchmarks.rooms_and_walls import ROOMS, Rooms

TRUTH = Path(__file__).parent / "walls_truth.csv"
NEAR, FAR = 0, 1  # lamps


def traced(case: Rooms, folder: Path, noise: str) -> xr.Dataset:
    room = case.room
    scene = write_scene(room.scan, room.materials, room.lamps, room.bands, folder, crease_deg=0.0)
    return trace(scene, room.points, accuracy="ultra", noise=noise, seed=1, workers=2)


@pytest.mark.parametrize("name", ["wall", "sheet", "noisy"])
def test_no_light_at_all_comes_through_a_closed_wall(name: str, tmp_path: Path) -> None:
    case = ROOMS[name]()
    transport = traced(case, tmp_path / "scene", "draft")
    coefficient, error = transport["coefficient"].to_numpy(), transport["coefficient_se"].to_numpy()
    for lamp, dark in ((NEAR, case.is_far), (FAR, ~case.is_far)):
        assert np.all(coefficient[lamp, dark] == 0.0)
        assert np.all(error[lamp, dark] == 0.0)
        assert np.all(coefficient[lamp, ~dark] > 0.0)


TRACES = 4


@pytest.mark.slow
@pytest.mark.chance("errors of points that share paths come together: one trace in sixteen has under .8 within two")
@pytest.mark.parametrize("name", ["door", "ajar"])
def test_light_through_a_door_is_what_another_engine_finds_lamp_by_lamp(name: str, tmp_path: Path) -> None:
    case = ROOMS[name]()
    traces = [traced(case, tmp_path / f"scene{number}", "standard") for number in range(TRACES)]
    with TRUTH.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["room"] == name]
    for lamp, place in ((NEAR, case.is_far), (FAR, ~case.is_far), (NEAR, ~case.is_far), (FAR, case.is_far)):
        own = [row for row in rows if row["lamp"] == case.room.lamps[lamp].name]
        truth = np.array([float(row["irradiance_W_m2_nm"]) for row in own])[place]
        doubt = np.array([float(row["standard_error_W_m2_nm"]) for row in own])[place]
        on = np.zeros((2, 3))
        on[lamp] = 1.0
        light = np.array([t["coefficient_batches"].to_numpy()[:, lamp, place, 0] for t in traces], dtype=float)
        error = np.array([np.hypot(standard_error_of_sum(t, on)[place, 0], doubt) for t in traces])
        # Shared by the two sides of the door's edge, light came out 12 % too bright (ajar: 90 % and more) with 20 to
        # 60 % of the points within two errors. Of a true error bar 95 % are; points err together in tens. In 238 traces
        # of the door ajar the share was .59 to 1, and .90 in the mean.
        assert np.mean(np.abs(light.mean(axis=1) - truth) < 2.0 * error) > 0.75
        means = light.mean(axis=2).ravel()  # of each trace's batches
        uncertain = np.hypot(means.std(ddof=1) / np.sqrt(means.size), np.sqrt((doubt**2).sum()) / len(doubt))
        assert abs(means.mean() - truth.mean()) < 6.0 * uncertain


def lit_by_one(case: Rooms, folder: Path) -> RadianceScene:
    room = case.room
    return write_scene(room.scan, room.materials, room.lamps[:1], room.bands, folder, crease_deg=0.0)


def own_errors(transport: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """(point, band) light, and (point,) its relative standard error."""
    light = np.einsum("lpb,lb->pb", transport["coefficient"].to_numpy(), transport["flux"].to_numpy())
    return light, own_relative_se(transport["irradiance_se"].to_numpy(), light)


@pytest.mark.chance("holds the error of a trace, whose shadow rays are seeded by the clock, against its target")
@pytest.mark.slow
def test_behind_a_door_each_point_comes_down_to_the_target_where_it_is_asked_of_its_own_light(tmp_path: Path) -> None:
    case = ROOMS["door"]()
    scene = lit_by_one(case, tmp_path / "scene")
    mean, point = (
        trace(scene, case.room.points, accuracy="ultra", noise="draft", noise_of=of, seed=1, workers=2)
        for of in ("mean", "point")
    )
    target = mean.attrs["target_relative_se"]
    assert mean.attrs["target_met"] == 1
    assert "missed_target" not in mean
    assert np.median(own_errors(mean)[1][case.is_far]) > 3.0 * target  # 15 %, in a room of a twelfth of the light
    light, own = own_errors(point)
    missed = point["missed_target"].to_numpy()
    assert np.array_equal(missed, own > target)
    assert missed.sum() <= 3  # none in two runs; at the shadow of the edge rounds may end a step of sizes short
    assert point.attrs["target_met"] == int(not missed.any())
    with TRUTH.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if (row["room"], row["lamp"]) == ("door", "near")]
    truth, doubt = (
        np.array([float(row[name]) for row in rows]) for name in ("irradiance_W_m2_nm", "standard_error_W_m2_nm")
    )
    off = (light[:, 0] - truth)[case.is_far] / np.hypot(own * light[:, 0], doubt)[case.is_far]
    assert np.mean(np.abs(off) < 2.0) > 0.7  # points err together in tens; 0.89 and more in three runs


def test_dark_points_beyond_the_budget_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_light, "MAX_OWN_PATHS", 2**8)
    monkeypatch.setattr(own_light, "MAX_SHARED_PATHS", 2**11)
    case = ROOMS["door"]()
    scene = lit_by_one(case, tmp_path / "scene")
    transport = trace(scene, case.room.points, accuracy="low", noise="draft", noise_of="point", seed=1, workers=2)
    _, own = own_errors(transport)
    missed = transport["missed_target"].to_numpy()
    assert missed[case.is_far].any()
    assert np.array_equal(missed, own > transport.attrs["target_relative_se"])
    assert transport.attrs["target_met"] == 0


def test_points_in_the_dark_want_nothing_and_miss_nothing(tmp_path: Path) -> None:
    case = ROOMS["wall"]()
    scene = lit_by_one(case, tmp_path / "scene")
    transport = trace(scene, case.room.points, accuracy="low", noise="draft", noise_of="point", seed=1, workers=2)
    assert not transport["missed_target"].to_numpy()[case.is_far].any()
