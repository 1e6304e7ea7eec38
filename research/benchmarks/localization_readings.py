"""What the localization experiment learns from and tests on: people, places, and what virtual sensors read of them."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import xarray as xr

from lidarspectra.io.files import write_whole
from lidarspectra.mapping.figures.tables import Table, table_csv, table_markdown
from lidarspectra.mapping.localization.person import Positions
from lidarspectra.radiance.engine.options import Accuracy
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.workflow.pipeline import run
from research.benchmarks.localization_rooms import TracedRoom, scanned_room, traced, true_traced_room
from research.experiments.provenance import note
from research.experiments.virtual_readings import Visits, read_by_sensors, watch_by_sensors
from research.virtual_rooms.room_plan import RoomPlan, read_plan

SCENES = ("large-office", "apartment")
SPACING_M = {"large-office": 1.2, "apartment": 0.4}  # [m] between places, as far as furniture lets people stand
PEOPLE = {"large-office": 4, "apartment": 2}  # [1] at each place to learn from; see the experiment 'people'
TRIED_PEOPLE = {"large-office": (1, 2, 4, 8), "apartment": (1, 2, 4, 8)}  # [1]
READINGS = 5  # of each person of a survey, each at a time of its own within two hours of the empty room's
VISITS = Visits()  # of those who are tested: how long they stay, and since when sensors drift
BETWEEN = 12  # places by lot that were not learned
LEARNED_SEED, TESTED_SEED, MEASURED_SEED = 0, 1, 2  # of people
SENSORS_SEED = 11


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueReadings:
    """What virtual sensors read in the true room.

    Parameters
    ----------
    room : TracedRoom
    positions : Positions
        Its places.
    survey : xarray.Dataset
        Other people at the places, to learn from.
    tested, between : xarray.Dataset
        People who visit the places, and people who visit places that nobody learned, in order of time.
    light : xarray.Dataset
        What is traced of those tested.
    """

    room: TracedRoom
    positions: Positions
    survey: xr.Dataset
    tested: xr.Dataset
    between: xr.Dataset
    light: xr.Dataset


def save(table: Table, folder: Path) -> None:
    """Write a table as CSV and Markdown."""
    write_whole(folder / f"{table.name}.csv", table_csv(table))
    write_whole(folder / f"{table.name}.md", f"{table.caption}\n\n{table_markdown(table)}")
    note(folder, table.name)


def plan_of(scene: str) -> RoomPlan:
    """The truth of a scene."""
    return read_plan(scenes_folder() / scene / "plan.toml")


def people_of(scene: str, arguments: argparse.Namespace) -> int:
    """How many people to learn from at each place."""
    return int(arguments.draws or PEOPLE[scene])


def true_readings(scene: str, work: Path, people: int) -> TrueReadings:
    """The true room, and what virtual sensors read there; the survey has so many people at each place."""
    room = true_traced_room(plan_of(scene), scene, work / f"{scene}-true")
    positions = room.positions(SPACING_M[scene])
    tested = traced(room, positions, work, f"{scene}-tested", accuracy="ultra", draws=1, seed=TESTED_SEED)
    between = traced(
        room, room.places_between(BETWEEN, TESTED_SEED), work, f"{scene}-between", accuracy="ultra", draws=1,
        seed=TESTED_SEED,
    )  # fmt: skip
    measured = traced(room, positions, work, f"{scene}-measured", accuracy="ultra", draws=people, seed=MEASURED_SEED)
    return TrueReadings(
        room=room,
        positions=positions,
        survey=read_by_sensors(measured, seed=SENSORS_SEED, noise_seed=2, readings=READINGS),
        tested=watch_by_sensors(tested, VISITS, seed=SENSORS_SEED, noise_seed=0),
        between=watch_by_sensors(between, VISITS, seed=SENSORS_SEED, noise_seed=1),
        light=tested,
    )


def simulated(
    scene: str, accuracies: Sequence[Accuracy], positions: Positions, work: Path, people: int
) -> dict[str, xr.Dataset]:
    """Fingerprints in the scanned room, with so many people at each place; the room is made where one is not kept."""

    @cache
    def room() -> TracedRoom:
        return scanned_room(_run_of(scene, work), scene)

    return {
        accuracy: traced(
            room, positions, work, f"{scene}-{accuracy}", accuracy=accuracy, draws=people, seed=LEARNED_SEED
        )
        for accuracy in accuracies
    }


def _run_of(scene: str, work: Path) -> Path:
    """The scene's own run up to its Radiance model."""
    folder = work / f"{scene}.run"
    run(scenes_folder() / scene / "room.toml", folder, last="scene")
    return folder
