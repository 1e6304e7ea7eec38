"""A run's year of daylight against EN 17037 and LM-83, where it has one of its present room."""

from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import ASSUMED_FLUX_SD
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.photometry.annual_light import YEAR_FILE, load_year
from lidarspectra.mapping.rules.daylight_rules import daylight_criteria
from lidarspectra.mapping.rules.limits import Criterion
from lidarspectra.workflow.rules.light import LUX, RuleLight
from lidarspectra.workflow.run_folder.annual_inputs import FOLDER, changed_since, year_inputs

PLANE_M = (0.7, 1.0)  # [m] above the floor: 0.85 in EN 17037, 0.76 in LM-83
LEAST_UP = 0.95  # cosine, of the angle between a point's normal and up
SEED = 20261123


def year_of_run(run: Path) -> Path:
    """File of a run's year of daylight, if it has one."""
    return run / FOLDER / YEAR_FILE


def year_criteria(run: Path, light: RuleLight) -> tuple[tuple[Criterion, ...], tuple[str, ...]]:
    """Requirements on the run's year of daylight, and notes; none without a year of the run as it is.

    Parameters
    ----------
    run : Path
    light : RuleLight

    Raises
    ------
    WorkspaceError
        If the year cannot be read.
    """
    path = year_of_run(run)
    if not path.is_file():
        return (), ()
    year, room = load_year(path), light.room
    changed = changed_since(year, year_inputs(room.run_file, room.base, run))
    if changed:
        return (), (
            f"The year of daylight in {FOLDER}/{YEAR_FILE} is not of the run as it is now (changed since: "
            f"{', '.join(changed)}), so that EN 17037 and LM-83 are left out. Make it again "
            "by 'lidarspectra annual', then give this command again.",
        )
    floor_m = room.room.floor_at(np.stack([year["x"], year["y"]], axis=1))
    return daylight_criteria(year, daylight_factors(light)), plane_notes(year, floor_m)


def daylight_factors(light: RuleLight) -> FloatArray:
    """(draw,) factors on all daylight: that of the run's windows and sun at the task points, in every state.

    So they have the windows' deviation of the run's covariance, which readings may have narrowed. Where the run's
    moment is dark, windows are as uncertain as a guessed flux.
    """
    index: IntArray = np.concatenate([each.task for each in light.points.areas])
    daylight = light.drawn(LUX, index, lamps=~light.electric)
    traced = float(daylight.traced.mean())
    if traced > 0:
        return np.asarray(daylight.states.mean(axis=1) / traced, dtype=np.float64)
    slope = light.model(LUX, index).slope.mean(axis=(0, 1))
    flux = ASSUMED_FLUX_SD * np.random.default_rng(SEED).standard_normal(light.draws.level.size)
    return np.asarray(np.exp(flux + light.draws.reflectance @ slope) * light.draws.level, dtype=np.float64)


def plane_notes(year: xr.Dataset, floor_m: float | FloatArray) -> tuple[str, ...]:
    """A note where the year's points are not the plane that the rules judge.

    Parameters
    ----------
    year : xarray.Dataset
    floor_m : float or (point,) float
        Height of the floor below its points. [m]
    """
    kept = kept_points(year)
    height, up = (year["z"].to_numpy() - floor_m)[kept], year["nz"].to_numpy()[kept]
    off = (height < PLANE_M[0]) | (height > PLANE_M[1])
    turned = up < LEAST_UP
    if not (off | turned).any():
        return ()
    return (
        "EN 17037 and LM-83 ask for daylight on a level plane about 0.85 m above the floor. Of the run's "
        f"{off.size} points {int(off.sum())} are elsewhere (from {height.min():.2f} to {height.max():.2f} m) and "
        f"{int(turned.sum())} do not face up: what is found here holds for these points, not for the plane. "
        "For a verdict give [sensors.grid] height = 0.85 and make the year again.",
    )
