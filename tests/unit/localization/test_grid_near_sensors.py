"""A grid of positions has none inside of which a sensor would lie, whoever is drawn there."""

import inspect
import sys
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.cli.fingerprints import fingerprints
from lidarspectra.errors import MapError, SensorError
from lidarspectra.mapping.localization.person import Positions
from lidarspectra.mapping.localization.traced_fingerprints import person_obstacle
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.workflow.applications import fingerprints as tracing
from lidarspectra.workflow.applications.fingerprints import (
    FingerprintOrder,
    buried_sensors,
    clear_of_sensors,
    place_people,
)

ORDER = FingerprintOrder(grid_m=0.5, draws=2, postures=("standing", "walking"), seed=4)


def grid(columns: int, rows: int) -> Positions:
    x, y = np.meshgrid(0.5 * np.arange(columns), 0.5 * np.arange(rows))
    places = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return Positions(names=tuple(f"p{number + 1}" for number in range(x.size)), places_m=places)


def sensors(*positions: tuple[float, float, float]) -> SensorPoints:
    return SensorPoints(
        positions=positions, normals=np.tile([0, 0, 1.0], (len(positions), 1)), buried=np.zeros(len(positions), bool)
    )


def test_a_position_inside_whose_person_a_sensor_lies_is_left_out_and_the_rest_is_named_anew() -> None:
    points = sensors((0.5, 0.5, 1.1), (1.0, 1.0, 2.5))  # in a trunk, and over everybody's head
    positions, notes = clear_of_sensors(grid(3, 2), ORDER, points)
    assert positions.names == tuple(f"p{number}" for number in range(1, 6))
    assert not np.any(np.all(positions.places_m[:, :2] == [0.5, 0.5], axis=1))
    assert "1 of the grid's 6" in notes[0]
    library = load_reflectances()
    for placed in place_people(positions, ORDER):
        assert not person_obstacle(placed, library).holds(points.positions).any()


def test_a_grid_far_from_all_sensors_stays_as_it_is() -> None:
    positions, notes = clear_of_sensors(grid(3, 2), ORDER, sensors((1.0, 1.0, 2.5)))
    assert positions.names == grid(3, 2).names
    assert notes == ()


def test_a_grid_of_which_nothing_is_left_is_refused() -> None:
    with pytest.raises(SensorError, match="none of the grid's 1"):
        clear_of_sensors(grid(1, 1), ORDER, sensors((0.0, 0.0, 1.1)))


def test_the_command_line_draws_as_many_people_as_the_program() -> None:
    """It repeats the number, so that its help loads nothing."""
    assert inspect.signature(fingerprints).parameters["draws"].default == FingerprintOrder().draws


def test_sensors_inside_of_something_are_named_as_localization_names_them() -> None:
    points = SensorPoints(positions=np.zeros((3, 3)), buried=np.array([False, True, False]))
    (note,) = buried_sensors(points)
    assert note.startswith("Inside furniture or outside the room: s2.")
    assert buried_sensors(SensorPoints(positions=np.zeros((3, 3)))) == ()


def test_without_what_bodies_need_no_run_is_begun(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pymeshlab", None)
    monkeypatch.setattr(tracing, "run_stages", lambda *_, **__: pytest.fail("a run was begun"))
    with pytest.raises(MapError, match=r"pip install 'lidarspectra\[localize\]'"):
        tracing.fingerprint_room(tmp_path / "room.toml", FingerprintOrder(grid_m=1.0))
