"""Light behind walls and through doors: sensors that share paths do not share light that only one of them sees.

Truths are Mitsuba's: `python -m research.benchmarks.rooms_and_walls --rooms door ajar --write-truth
tests/physics/trace/walls_truth.csv`.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.radiance.scene.scene import write_scene
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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["door", "ajar"])
def test_light_through_a_door_is_what_another_engine_finds_lamp_by_lamp(name: str, tmp_path: Path) -> None:
    case = ROOMS[name]()
    transport = traced(case, tmp_path / "scene", "standard")
    batches = transport["coefficient_batches"].to_numpy()[..., 0].astype(float)
    with TRUTH.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["room"] == name]
    for lamp, place in ((NEAR, case.is_far), (FAR, ~case.is_far), (NEAR, ~case.is_far), (FAR, case.is_far)):
        own = [row for row in rows if row["lamp"] == case.room.lamps[lamp].name]
        truth = np.array([float(row["irradiance_W_m2_nm"]) for row in own])[place]
        doubt = np.array([float(row["standard_error_W_m2_nm"]) for row in own])[place]
        on = np.zeros((2, 3))
        on[lamp] = 1.0
        error = np.hypot(standard_error_of_sum(transport, on)[place, 0], doubt)
        off = batches.mean(axis=0)[lamp, place] - truth
        # Shared by the two sides of the door's edge, light came out 12 % too bright (ajar: 90 % and more) with 20 to
        # 60 % of the points within two errors. Of a true error bar 95 % are; points err together in tens.
        assert np.mean(np.abs(off) < 2.0 * error) > 0.8
        means = batches[:, lamp, place].mean(axis=1)
        uncertain = np.hypot(means.std(ddof=1) / np.sqrt(len(means)), np.sqrt((doubt**2).sum()) / len(doubt))
        # Of eight batches t is above 6 once in a thousand runs.
        assert abs(off.mean()) < 6.0 * uncertain
