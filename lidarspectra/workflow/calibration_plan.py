"""Where, and in which direction, readings of a run tell most."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.measured_readings import Scale
from lidarspectra.io.files import write_whole, writing
from lidarspectra.mapping.calibration.figures import readings_figure
from lidarspectra.mapping.calibration.model import UNKNOWN_METER_SD
from lidarspectra.mapping.calibration.planning import choose_readings
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.sampling.transport import TRANSPORT_FILE, load_transport
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow.calibrating import map_model, priors_of
from lidarspectra.workflow.calibration_light import run_room, traced_light, weights_of
from lidarspectra.workflow.calibration_readings import CALIBRATED_SD, LUX
from lidarspectra.workflow.workspace import require_stage

MOST_PLACES = 40
DIRECTIONS = {
    "up": (0.0, 0.0, 1.0), "down": (0.0, 0.0, -1.0), "+x": (1.0, 0.0, 0.0), "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0), "-y": (0.0, -1.0, 0.0),
}  # fmt: skip
NAME = "readings-to-take"


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadingPlan:
    """Readings to take, the most telling first.

    Parameters
    ----------
    table : Table
        Places, directions, and the map's deviation after each.
    positions, normals : (reading, 3) float
        [m], and unit vectors.
    """

    table: Table
    positions: FloatArray
    normals: FloatArray


def plan_readings(
    run: str | PathLike[str],
    count: int,
    *,
    scale: Scale = "none",
    workers: int | None = None,
    progress: Progress = silent,
) -> ReadingPlan:
    """Choose places and directions for readings of illuminance.

    Places are those of the run's own sensor points that are not inside anything, 40 of them spread evenly: a person or
    a robot can reach them. Directions are up, down, and along the axes.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace.
    count : int
        Readings.
    scale : str
        'none' for a calibrated meter, anything else for one of unknown factor.
    workers : int, optional
    progress : callable

    Returns
    -------
    plan : ReadingPlan
    """
    run = path_of(run, name="run")
    room = run_room(run)
    transport = load_transport(require_stage(run, "trace") / TRANSPORT_FILE)
    own = np.stack([transport[axis].to_numpy() for axis in "xyz"], axis=1)
    up = np.stack([transport[f"n{axis}"].to_numpy() for axis in "xyz"], axis=1)
    free = np.flatnonzero(~transport["buried"].to_numpy().astype(bool))
    if free.size == 0:
        raise MapError(
            expected="sensor points in free air", found="none", where=str(run), todo="Give the run a [sensors.grid]."
        )
    places = own[free[spread(own[free], MOST_PLACES)]]
    normals = np.array(list(DIRECTIONS.values()))
    positions = np.repeat(places, len(normals), axis=0)
    points = SensorPoints(
        positions=np.concatenate([positions, own[free]]),
        normals=np.concatenate([np.tile(normals, (len(places), 1)), up[free]]),
    )
    light = traced_light(room, points, workers=workers, progress=progress)
    numbers = np.arange(len(positions))
    candidates = light.model(weights_of([LUX] * numbers.size, room), numbers)
    priors = priors_of(room, np.array([CALIBRATED_SD if scale == "none" else UNKNOWN_METER_SD]))
    planned = choose_readings(
        candidates, numbers // len(normals), map_model(room, light, first_point=len(positions)), priors, count
    )
    looks = [list(DIRECTIONS)[index % len(normals)] for index in planned.chosen]
    chosen = planned.chosen
    frame = pd.DataFrame(
        {
            "reading": np.arange(1, chosen.size + 1),
            "looks": looks,
            "x [m]": positions[chosen, 0],
            "y [m]": positions[chosen, 1],
            "z [m]": positions[chosen, 2],
            "map's deviation after [%]": 100 * planned.map_sd[1:],
        }
    )
    table = Table(
        name=NAME,
        caption=f"Where readings tell most. Before them the map's light is known to {100 * planned.map_sd[0]:.1f} %.",
        frame=frame,
        formats={"x [m]": ".2f", "y [m]": ".2f", "z [m]": ".2f", "map's deviation after [%]": ".1f"},
    )
    return ReadingPlan(
        table=table, positions=positions[chosen], normals=normals[[index % len(normals) for index in chosen]]
    )


def save_plan(plan: ReadingPlan, run: str | PathLike[str]) -> tuple[Path, Path]:
    """Write the readings as a CSV to be filled in (column lux), and as a picture on the plan.

    Parameters
    ----------
    plan : ReadingPlan
    run : str or path
        The run that it is for.

    Returns
    -------
    table, picture : Path
        In RUN/calibration.

    Raises
    ------
    MapError
        If they cannot be written.
    """
    run = path_of(run, name="run")
    room = run_room(run)
    folder = run / "calibration"
    looks = plan.table.frame["looks"]
    names = [f"{number} {look}" for number, look in enumerate(looks, start=1)]
    frame = pd.DataFrame({"name": names})
    for index, axis in enumerate("xyz"):
        frame[axis] = plan.positions[:, index].round(3)
    for index, axis in enumerate("xyz"):
        frame[f"n{axis}"] = plan.normals[:, index]
    frame["lux"] = ""
    target = folder / f"{NAME}.csv"
    with writing(target, error=MapError):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(target, frame.to_csv(index=False, lineterminator="\n"))
    plan_view = floor_plan(room.scan, room.room)
    pictures = save_figure(readings_figure(plan.positions, plan.normals, plan_view, room.lamps), folder, NAME)
    return target, next(path for path in pictures if path.suffix == ".png")


def spread(places: FloatArray, count: int) -> np.ndarray:
    """Indices of so many places as lie farthest from one another, beginning with that nearest to their middle."""
    chosen = [int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < min(count, len(places)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.array(chosen)
