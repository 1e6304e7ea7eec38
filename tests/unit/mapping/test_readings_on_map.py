"""The point of a map that a reading belongs to."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.readings_on_map import match_readings

HERE = Path("readings.csv")
UP, DOWN = [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]
POINTS = [
    ([0.0, 0.0, 1.0], UP),
    ([0.0, 0.0, 1.02], DOWN),
    ([0.3, 0.0, 1.0], DOWN),
    ([2.0, 0.0, 1.0], UP),
    ([4.0, 0.0, 1.0], UP),
]


@pytest.fixture
def light() -> xr.Dataset:
    """Five points, some of which look down."""
    rows = np.array([[*place, *way] for place, way in POINTS])
    names = ("x", "y", "z", "nx", "ny", "nz")
    columns = {name: ("point", column) for name, column in zip(names, rows.T, strict=True)}
    return xr.Dataset({"buried": ("point", np.zeros(len(rows), np.bool_))} | columns)


def table(*rows: tuple[float, ...], directions: bool = True) -> pd.DataFrame:
    """Readings at x, y, z that look along nx, ny, nz."""
    return pd.DataFrame(rows, columns=["x", "y", "z", "nx", "ny", "nz"] if directions else ["x", "y", "z"])


def test_a_reading_belongs_to_the_nearest_point_that_looks_its_way(light: xr.Dataset) -> None:
    readings = table((0.2, 0, 1, 0, 0, -1), (0.02, 0, 1, 0, 0, -1), (2, 0, 1, 0, 0, 1), (0.01, 0, 1, 0, 0, 1))
    assert match_readings(light, readings, 0.5, HERE).points.tolist() == [2, 1, 3, 0]


def test_directions_may_be_of_any_length(light: xr.Dataset) -> None:
    readings = table((0, 0, 1, 0, 0, -3.0), (2, 0, 1, 0, 0, 0.2), (4, 0, 1, 0, 0, 1))
    assert match_readings(light, readings, 0.5, HERE).points.tolist() == [1, 3, 4]


def test_a_reading_without_direction_among_others_looks_the_way_of_the_nearest_point(light: xr.Dataset) -> None:
    readings = table((0, 0, 1.02, np.nan, np.nan, np.nan), (2, 0, 1, 0, 0, 1), (4, 0, 1, 0, 0, 1))
    assert match_readings(light, readings, 0.5, HERE).points.tolist() == [1, 3, 4]


def test_a_reading_far_away_is_not_searched_by_its_direction(light: xr.Dataset) -> None:
    readings = table((9, 0, 1, 0, 0, 1), (0, 0, 1, 0, 0, 1), (2, 0, 1, 0, 0, 1), (4, 0, 1, 0, 0, 1))
    matched = match_readings(light, readings, 0.5, HERE)
    assert matched.rows.tolist() == [1, 2, 3]
    assert [note.split(", since")[0] for note in matched.notes] == ["1 of 4 readings are left out"]


def test_what_looks_another_way_and_what_is_far_are_counted_apart(light: xr.Dataset) -> None:
    readings = table(
        (9, 0, 1, 0, 0, 1), (2, 0, 1, 0, 0, -1), (0, 0, 1, 0, 0, 1), (0.3, 0, 1, 0, 0, -1), (4, 0, 1, 0, 0, 1)
    )  # fmt: skip
    turned, far = match_readings(light, readings, 0.5, HERE).notes
    assert turned.startswith("1 reading is left out, since the map's points beside them look another way")
    assert far.startswith("1 of 4 readings are left out, since they are farther than 0.5 m")


def test_readings_without_a_place_are_none_of_the_map(light: xr.Dataset) -> None:
    with pytest.raises(MapError, match="no reading has a place"):
        match_readings(light, table(*[(np.nan, 0, 1)] * 4, directions=False), 0.5, HERE)
