"""Fingerprints of a run: randomly drawn people at the user's positions, and the readings of the run's sensors."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arguments import path_of
from lidarspectra.config import RunFile
from lidarspectra.errors import SensorError
from lidarspectra.lamps.lamp_file import load_lamps
from lidarspectra.mapping.localization.body import Posture, load_thinning
from lidarspectra.mapping.localization.fingerprint_table import FINGERPRINTS_FILE, save_fingerprints
from lidarspectra.mapping.localization.person import (
    Positions,
    draw_person,
    grid_positions,
    outside_room,
    read_positions,
    standing_faults,
)
from lidarspectra.mapping.localization.traced_fingerprints import (
    TARGET,
    FingerprintRequest,
    PlacedPerson,
    person_obstacle,
    trace_fingerprints,
)
from lidarspectra.progress import Progress, silent
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.workflow.pipeline import Listener, run_stages
from lidarspectra.workflow.run_folder.inputs import read_inputs
from lidarspectra.workflow.run_folder.sensing_of_run import receptor_of_run, sensor_points, trace_engine
from lidarspectra.workflow.run_folder.workspace import made_folder

FOLDER = "fingerprints"
PARTS_FOLDER = "parts"
REACH_M = 1.2  # [m] in plan from somebody's place, beyond which no part of the body is in any posture
# People differ by half of what one changes: readings on the right place went from 62 to 73 % in a large office and from
# 49 to 70 % in an apartment with as many, where four and two were simulated before (docs/results-localization.md).
PEOPLE_AT_EACH = 8
HEAD_ROOM = 1.1  # [1] of their height: what hangs higher is over everybody's head, hair and all


@dataclass(frozen=True, kw_only=True)
class FingerprintOrder:
    """Which fingerprints to trace.

    Parameters
    ----------
    positions : str, path or None
        CSV of names and places (`read_positions`); None takes a grid.
    grid_m : float or None
        Spacing of that grid. [m]
    draws : int
        People drawn for each position. They differ by half of what a person changes, so that few are a poor lesson.
    postures : tuple of str
        To draw from.
    target, effect_target : float
        Target standard errors of a reading and of the difference that a person makes; None derives the latter from the
        size of these differences. [1]
    seed : int
        Of the people, and of the first directions of the walks.
    """

    positions: str | PathLike[str] | None = None
    grid_m: float | None = None
    draws: int = PEOPLE_AT_EACH
    postures: tuple[Posture, ...] = ("standing",)
    target: float = TARGET
    effect_target: float | None = None
    seed: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Fingerprints:
    """What was made.

    Parameters
    ----------
    table : xarray.Dataset
        See `mapping.localization.fingerprint_table`.
    path : Path
        The file that holds it.
    notes : tuple of str
        Caveats, as full sentences.
    """

    table: xr.Dataset
    path: Path
    notes: tuple[str, ...]


def fingerprint_room(
    run_file: str | PathLike[str] | RunFile,
    order: FingerprintOrder,
    folder: str | PathLike[str] | None = None,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    listener: Listener | None = None,
    progress: Progress = silent,
) -> Fingerprints:
    """Make the run's missing stages up to its scene, then trace fingerprints in it.

    Parameters
    ----------
    run_file : str, path or RunFile
        As in `run`; its `[sensors]` are the fixed sensors.
    order : FingerprintOrder
    folder : str or path, optional
        The run folder; NAME.run beside NAME.toml by default. The table goes to fingerprints/fingerprints.nc there.
    workers, cluster, listener
        As in `pipeline.run`.
    progress : Progress, optional
        Of the tracing.

    Returns
    -------
    fingerprints : Fingerprints

    Raises
    ------
    LidarSpectraError
        If anything that the user gave does not fit; what was traced is kept, and the same call goes on after it.
    """
    load_thinning()  # before minutes of a run: without it nobody can be placed
    # Differences are traced in the lamps' sum, so that the scene must be that of the present lamps.
    summary = run_stages(
        run_file, folder, last="scene", workers=workers, cluster=cluster, listener=listener, relight=False
    )
    inputs = read_inputs(run_file, workers=workers, cluster=cluster)
    free = FreeSpace(summary.scan, summary.room)
    points = sensor_points(summary.scan, summary.room, inputs.run_file.sensors, folder=inputs.base, free=free)
    positions, notes = _positions(order, free, summary.room.floor_z, points)
    out = made_folder(summary.folder / FOLDER)
    with trace_engine(cluster) as engine:
        table = trace_fingerprints(
            summary.scene,
            load_lamps(summary.results["scene"].folder),
            points,
            place_people(positions, order),
            load_reflectances(),
            out / PARTS_FOLDER,
            FingerprintRequest(
                accuracy=inputs.run_file.trace.accuracy,
                target=order.target,
                effect_target=order.effect_target,
                seed=order.seed,
                receptor=receptor_of_run(inputs.run_file.sensors, inputs.base),
                engine=engine,
                workers=inputs.workers,
            ),
            progress=progress,
        )
    notes = (*notes, *buried_sensors(points), *missed_targets(table))
    return Fingerprints(table=table, path=save_fingerprints(table, out / FINGERPRINTS_FILE), notes=notes)


def missed_targets(table: xr.Dataset) -> tuple[str, ...]:
    """A note on each standard error, of traced readings and of what people change, that is above its target."""
    notes = []
    for of, name in (("reading", ""), ("person's effect", "effect_")):
        achieved, target = (100 * table.attrs[f"{kind}_relative_{name}se"] for kind in ("achieved", "target"))
        if achieved > target:
            notes.append(
                f"The standard error of a {of} is {achieved:.3f} % of the reading, above the target of {target:.3f} %. "
                "The fingerprints are usable, with that much more noise."
            )
    return tuple(notes)


def buried_sensors(points: SensorPoints) -> tuple[str, ...]:
    """A note on sensors in furniture or walls, if there are any: nobody would change what they read."""
    buried = [f"s{number}" for number in np.flatnonzero(points.buried) + 1]
    if not buried:
        return ()
    more = f" and {len(buried) - 10} more" if len(buried) > 10 else ""
    return (
        f"Inside furniture or outside the room: {', '.join(buried[:10])}{more}. What is traced there is not "
        "what a sensor would read: move these points, or take them out of the points file.",
    )


def place_people(positions: Positions, order: FingerprintOrder) -> tuple[PlacedPerson, ...]:
    """Draw people for each position; a person depends only on the seed and the numbers of position and draw."""
    return tuple(
        PlacedPerson(
            label=name,
            place_m=place,
            person=draw_person(np.random.default_rng([order.seed, index, draw]), postures=order.postures),
            draw=draw,
        )
        for index, (name, place) in enumerate(zip(positions.names, positions.places_m, strict=True))
        for draw in range(order.draws)
    )


def clear_of_sensors(
    positions: Positions, order: FingerprintOrder, points: SensorPoints
) -> tuple[Positions, tuple[str, ...]]:
    """The positions at which nobody who is drawn has a sensor inside of the body, and a note of those left out.

    Who is drawn hangs on a position's number, so that the rest is numbered and drawn anew until all are clear.

    Raises
    ------
    SensorError
        If no position is left.
    """
    library = load_reflectances()
    first = len(positions.names)
    while positions.names:
        near = np.linalg.norm(positions.places_m[:, None, :2] - points.positions[None, :, :2], axis=2) < REACH_M
        inside = np.zeros(len(positions.names), dtype=bool)
        for number, placed in enumerate(place_people(positions, order)):
            index = number // order.draws
            head_m = placed.place_m[2] + HEAD_ROOM * placed.person.height_m
            sensors = points.positions[near[index] & (points.positions[:, 2] < head_m)]
            if len(sensors) and not inside[index]:
                inside[index] = bool(person_obstacle(placed, library).holds(sensors).any())
        if not inside.any():
            break
        kept = positions.places_m[~inside]
        positions = Positions(names=tuple(f"p{number}" for number in range(1, len(kept) + 1)), places_m=kept)
    if not positions.names:
        raise SensorError(
            expected="positions where no sensor lies inside of whoever stands there",
            found=f"none of the grid's {first}",
            where="--grid",
            todo="Choose another spacing, or give positions in a file.",
        )
    left_out = first - len(positions.names)
    note = (
        f"{left_out} of the grid's {first} positions were left out: a sensor would lie inside of somebody there. "
        "Give positions in a file if you need these."
    )
    return positions, (note,) if left_out else ()


def _positions(
    order: FingerprintOrder, free: FreeSpace, floor_z: float, points: SensorPoints
) -> tuple[Positions, tuple[str, ...]]:
    """The positions, and a note on those where an object is in the way."""
    if order.positions is None:
        if order.grid_m is None:
            raise SensorError(
                expected="positions",
                found="none",
                where="fingerprints",
                todo="Give a file of positions, or the spacing of a grid.",
            )
        return clear_of_sensors(grid_positions(free, order.grid_m), order, points)
    positions = read_positions(path_of(order.positions, name="positions"), floor_z=floor_z)
    outside = np.flatnonzero(outside_room(free, positions.places_m))
    if outside.size:
        named = ", ".join(f"'{positions.names[index]}'" for index in outside[:5])
        raise SensorError(
            expected="positions in the room's air",
            found=f"{outside.size} of {len(positions.names)} outside of it, or inside of a wall or pillar: {named}",
            where=str(order.positions),
            todo="Give them in the scan's coordinates, in metres: 'lidarspectra scan' prints the room's extent.",
        )
    faults = standing_faults(free, positions.places_m)
    blocked = [f"'{name}' {words}" for name, words in zip(positions.names, faults, strict=True) if words]
    if not blocked:
        return positions, ()
    more = f"; and {len(blocked) - 5} more" if len(blocked) > 5 else ""
    return positions, (
        f"At {len(blocked)} of {len(faults)} positions an object is in the way of a standing person: "
        f"{'; '.join(blocked[:5])}{more}. The person is traced through it; move these positions if nobody can stand "
        "there.",
    )
