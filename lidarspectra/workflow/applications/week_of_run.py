"""A week of light in a finished run: its electric lamps by a schedule, and where it is wanted daylight of its year."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.photometry.annual_light import YEAR_FILE, load_year
from lidarspectra.mapping.photometry.annual_metrics import SUMMER_TIME
from lidarspectra.mapping.photometry.week import daylight_of_week, read_week, week_of_light
from lidarspectra.workflow.run_folder.annual_inputs import FOLDER, changed_in_run
from lidarspectra.workflow.run_folder.assumed import notes_of_light
from lidarspectra.workflow.run_folder.light_of_run import dimmed_notes, light_of_run, present_lamps_of_run
from lidarspectra.workflow.trace_notes import receptor_notes

SAME_PLACE_M = 1e-3  # [m] between the run's points and the year's


@dataclass(frozen=True, kw_only=True, eq=False)
class RunWeek:
    """A week of light at the points of a run.

    Parameters
    ----------
    week : xarray.Dataset
        Of `week.week_of_light`.
    kept : (kept point,) int
        Points that are no longer within a surface.
    notes : tuple of str
        Caveats, as full sentences.
    """

    week: xr.Dataset
    kept: IntArray
    notes: tuple[str, ...]


def week_of_run(run: Path, schedule: Path, *, daylight_from: str | None = None) -> RunWeek:
    """Light of a week at a run's points.

    Parameters
    ----------
    run : Path
        Run folder with a finished trace.
    schedule : Path
        See `week.read_week`. Its rows, '*' too, are of electric lamps; the run's moment of daylight has no say.
    daylight_from : str, optional
        Month and day of the year of daylight (`annual_daylight` in the run folder) on which the week begins.

    Raises
    ------
    WorkspaceError
        If the run is not finished, or has no year of daylight of its present room.
    MapError
        If the schedule cannot be understood, or the year is of other points.
    """
    found = light_of_run(run)
    of_sky = {lamp.name for lamp in present_lamps_of_run(run) if is_daylight(lamp)}
    electric = [number for number, name in enumerate(found.lamp_names) if name not in of_sky]
    light = replace(found.light, lamps=tuple(found.light.lamps[number] for number in electric))
    names = [found.lamp_names[number] for number in electric]
    notes = (*receptor_notes(found.places.attrs), *dimmed_notes(run), *notes_of_light(run))
    daylight: dict[str, FloatArray] | None = None
    if daylight_from is not None:
        year = _year_of_run(run, found.places)
        daylight = daylight_of_week(year, daylight_from)
        clock = (
            "The schedule's hours are those of the clock, by the year's summer_time."
            if year.attrs.get(SUMMER_TIME)
            else "The year of daylight is in local standard time, and the schedule is taken for the same: where clocks "
            "change, give summer_time in [daylight] and make the year again."
        )
        notes = (*notes, f"{clock} No blinds are drawn.")
    elif of_sky:
        notes = (
            *notes,
            "The run has windows, whose light changes by the hour and is left out here. Run 'lidarspectra annual', "
            "then give --daylight MM-DD, the day on which the week begins.",
        )
    week = week_of_light(light, names, read_week(schedule), daylight)
    return RunWeek(week=week, kept=kept_points(found.places), notes=notes)


def _year_of_run(run: Path, places: xr.Dataset) -> xr.Dataset:
    """The year of daylight of the run's present room, at its points."""
    path = run / FOLDER / YEAR_FILE
    if not path.is_file():
        raise WorkspaceError(
            expected="a year of daylight",
            found="none",
            where=str(path),
            todo="Make it with 'lidarspectra annual' from the same run file.",
        )
    year = load_year(path)
    own, other = (np.stack([each[axis].to_numpy() for axis in "xyz"], axis=1) for each in (places, year))
    if own.shape != other.shape or not np.allclose(own, other, atol=SAME_PLACE_M):
        raise MapError(
            expected=f"a year of daylight at the {len(own)} points of the run",
            found=f"one at {len(other)} points, or elsewhere",
            where=str(path),
            todo="Make it again with 'lidarspectra annual' from the run file of this run.",
        )
    if changed := changed_in_run(year, run):
        raise WorkspaceError(
            expected="a year of daylight of the run as it is now",
            found=f"one of before these were changed: {', '.join(changed)}",
            where=str(path),
            todo="Make it again with 'lidarspectra annual', then give this command again.",
        )
    return year
