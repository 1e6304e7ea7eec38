"""Where, and in which direction, readings of a run tell most."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arguments import number_of, path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ArgumentError, MapError, SensorError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.sensor.measured_readings import Scale
from lidarspectra.io.files import write_whole, writing
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.calibration.figures import readings_figure
from lidarspectra.mapping.calibration.model import UNKNOWN_METER_SD, error_covariance
from lidarspectra.mapping.calibration.planning import choose_readings
from lidarspectra.mapping.calibration.promised import stated_after
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.light_unknowns import error_scale
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.sampling.transport import TRANSPORT_FILE, load_transport
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_points import SensorPoints, grid_points
from lidarspectra.workflow.calibration.calibrating import map_model, own_error_on, priors_of
from lidarspectra.workflow.calibration.light import run_room, traced_light, weights_of
from lidarspectra.workflow.calibration.readings import CALIBRATED_SD, LUX
from lidarspectra.workflow.run_folder.workspace import require_stage

MAX_PLACES = 40  # that are traced
HAND_M = 1.2  # [m] above the floor, where a person holds a meter
REACHED_M = 1.9  # [m] above the floor, up to which an arm reaches
CLEAR_M = 0.15  # [m] of the run's own points from walls and furniture: a hand and a meter fit in
LAMP_M = 0.7  # [m] from a lamp: nearer, 5 cm beside the place are 15 % of the light
MARGIN_M = 0.25  # [m] of places at hand from walls and furniture: the person stands beside the meter
DIRECTIONS = {
    "up": (0.0, 0.0, 1.0), "down": (0.0, 0.0, -1.0), "+x": (1.0, 0.0, 0.0), "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0), "-y": (0.0, -1.0, 0.0),
}  # fmt: skip
NAME = "readings-to-take"
RARELY = 0.9  # [1] of the rooms in which a calibration states less than the larger number
MOSTLY, AT_WORST = "map's deviation after [%]", "in one room of ten above [%]"


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

    Places are 40, spread evenly over what a person can reach: see `reachable_places`. Directions are up, down, and
    along the axes. A further place is taken where it is worth the walk.

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
    if number_of(count, name="count of readings") < 1:
        raise ArgumentError(expected="1 or more", found=f"{count}", where="count of readings")
    room = run_room(run)
    transport = load_transport(require_stage(run, "trace") / TRANSPORT_FILE)
    own = np.stack([transport[axis].to_numpy() for axis in "xyz"], axis=1)
    up = np.stack([transport[f"n{axis}"].to_numpy() for axis in "xyz"], axis=1)
    free = np.flatnonzero(~transport["buried"].to_numpy().astype(bool))
    places = reachable_places(room.scan, room.room, room.lamps, own[free])
    if free.size == 0 or len(places) == 0:
        raise MapError(
            expected="sensor points in free air, and places that a person can reach",
            found=f"{free.size} points and {len(places)} places",
            where=str(run),
            todo="Give the run a [sensors.grid].",
        )
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
    on_map = map_model(room, light, first_point=len(positions))
    own = candidates.light.sum(axis=1)
    model_error = error_covariance(
        positions, np.tile(normals, (len(places), 1)), error_scale(own, float(on_map.light.sum(axis=1).mean()))
    )
    chosen = choose_readings(candidates, numbers // len(normals), on_map, priors, count, model_error=model_error).chosen
    stated = 100.0 * stated_after(
        candidates.some(chosen),
        on_map,
        priors,
        model_error=model_error[np.ix_(chosen, chosen)],
        own_error=own_error_on(on_map),
    )
    looks = [list(DIRECTIONS)[index % len(normals)] for index in chosen]
    frame = pd.DataFrame(
        {
            "reading": np.arange(1, chosen.size + 1),
            "looks": looks,
            "x [m]": positions[chosen, 0],
            "y [m]": positions[chosen, 1],
            "z [m]": positions[chosen, 2],
            MOSTLY: np.median(stated[1:], axis=1),
            AT_WORST: np.quantile(stated[1:], RARELY, axis=1),
        }
    )
    table = Table(
        name=NAME,
        caption=f"Where readings tell most. Before them the map's light is known to {stated[0, 0]:.1f} %; after each, "
        "what a calibration will state: in half of all rooms no more than the first number, in nine of ten no more "
        "than the second. It depends on how well the readings fit, which tells how far the model can be trusted.",
        frame=frame,
        formats={"x [m]": ".2f", "y [m]": ".2f", "z [m]": ".2f", MOSTLY: ".1f", AT_WORST: ".1f"},
    )
    return ReadingPlan(
        table=table, positions=positions[chosen], normals=normals[[index % len(normals) for index in chosen]]
    )


def save_plan(plan: ReadingPlan, run: str | PathLike[str]) -> tuple[Path, Path]:
    """Write the readings as a CSV to be filled in (column lux), and as a picture on the plan.

    A file of an earlier plan that was filled in is kept; the new one then has a number behind its name.

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
    name = _free_name(folder)
    target = folder / f"{name}.csv"
    with writing(target, error=MapError):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(target, frame.to_csv(index=False, lineterminator="\n"))
    plan_view = floor_plan(room.scan, room.room)
    pictures = save_figure(readings_figure(plan.positions, plan.normals, plan_view, room.lamps), folder, name)
    return target, next(path for path in pictures if path.suffix == ".png")


def _free_name(folder: Path) -> str:
    """The first name of a plan's files that holds no readings yet."""
    names = (NAME if number == 1 else f"{NAME}-{number}" for number in count(1))
    return next(name for name in names if not _is_filled_in(folder / f"{name}.csv"))


def _is_filled_in(path: Path) -> bool:
    """Whether somebody wrote into a plan's file: as it is made, every row ends with an empty cell."""
    if not path.is_file():
        return False
    with writing(path, error=MapError):
        rows = path.read_text(encoding="utf-8-sig", errors="replace").split("\n")[1:]
    return any(row.strip() and not row.rstrip().endswith(",") for row in rows)


def reachable_places(scan: Scan, room: Room, lamps: Sequence[Lamp], own: FloatArray) -> FloatArray:
    """Places where a person can hold a meter, at most `MAX_PLACES` spread evenly.

    The run's own sensor points up to `REACHED_M` above the floor, and places at `HAND_M` with some margin from walls
    and furniture; none inside anything, outside the room, or so near to a lamp that a step decides what is read.

    Parameters
    ----------
    scan : Scan
    room : Room
    lamps : sequence of Lamp
    own : (point, 3) float
        Sensor points in free air. [m]

    Returns
    -------
    places : (place, 3) float
        [m]
    """
    free = FreeSpace(scan, room)
    above_floor = own[:, 2] - room.floor_at(own)
    within = own[(above_floor >= CLEAR_M) & (above_floor <= REACHED_M)]
    if len(within):
        within = within[free.distance(within, limit_m=CLEAR_M, ignore_floor=True) >= CLEAR_M]
    spacing = max(float(np.sqrt(np.prod(np.ptp(room.outline, axis=0)) / MAX_PLACES)), MARGIN_M)
    try:
        held = grid_points(scan, room, height=HAND_M, spacing=spacing, margin=MARGIN_M, free=free).positions
    except SensorError:  # no free place at this height: too low a room, or a scan without floor
        held = np.empty((0, 3))
    places = np.concatenate([held, within])
    for lamp in lamps:
        places = places[lamp.distance(places) >= LAMP_M]
    return places[spread(places, MAX_PLACES)] if len(places) else places


def spread(places: FloatArray, count: int) -> np.ndarray:
    """Indices of so many places as lie farthest from one another, beginning with that nearest to their middle."""
    chosen = [int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < min(count, len(places)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.array(chosen)
