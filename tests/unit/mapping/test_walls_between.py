"""Maps beside thin walls: no light of the other side is read off them."""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.mapping.figures.field_drawing import draw_isolines, field_grid
from lidarspectra.mapping.figures.figure_style import new_figure, place
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.maps.interpolation import grid_values, interpolant, leave_one_out
from lidarspectra.mapping.maps.readings_on_map import match_readings
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.maps.walls_between import Between
from lidarspectra.mapping.report.room_view import point_triangles
from lidarspectra.room.partitions import Partitions

OUTLINE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])
WALL_X, WALL_END_Y = 1.5, 2.0  # [m] the wall leaves a passage between its end and y = 3 m
LEVEL_M = 0.8
BRIGHT, DARK = 510.0, 40.0  # [lx] no isolux line has either


def wall(height_m: float = 2.7, *, x: float = WALL_X, end_y: float = WALL_END_Y) -> Scan:
    """A sheet without thickness across the room, from the floor up."""
    corners = np.array([[x, 0, 0], [x, end_y, 0], [x, end_y, height_m], [x, 0, height_m]], dtype=np.float64)
    return bare_scan(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def points() -> FloatArray:
    """A grid of 0.4 m, none nearer to the wall than 0.1 m."""
    axis = np.arange(0.2, 3.0, 0.4)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def light_of(places: FloatArray) -> FloatArray:
    """(place, 1) bright on one side of the wall."""
    return np.where(places[:, :1] < WALL_X, BRIGHT, DARK)


def between(scan: Scan) -> Between:
    return partial(Partitions(scan, 2.7).between, level_m=LEVEL_M)


def test_a_value_right_beside_a_wall_is_that_of_its_own_side() -> None:
    places = points()
    read = interpolant(places, light_of(places), "linear", between(wall()))
    beside = np.array([[WALL_X - 0.02, 0.7], [WALL_X + 0.02, 0.7], [WALL_X - 0.02, 1.5], [WALL_X + 0.02, 1.5]])
    np.testing.assert_allclose(read(beside)[:, 0], [BRIGHT, DARK, BRIGHT, DARK])
    # Without the wall, the same place is between the two sides' points.
    assert interpolant(places, light_of(places), "linear")(beside)[1, 0] > 5 * DARK


def test_along_a_wall_the_value_follows_the_points_beside_it() -> None:
    places = points()
    values = light_of(places) + 10.0 * places[:, 1:]
    beside = np.array([[WALL_X + 0.02, 0.8], [WALL_X + 0.02, 1.1]])
    read = interpolant(places, values, "linear", between(wall()))(beside)[:, 0]
    np.testing.assert_allclose(read, DARK + 10.0 * beside[:, 1])


def test_through_a_passage_the_map_goes_on_as_without_a_wall() -> None:
    places = points()
    passage = np.array([[1.3, 2.7], [1.5, 2.75], [1.6, 2.65]])
    walled, free = (interpolant(places, light_of(places), "linear", each)(passage) for each in (between(wall()), None))
    np.testing.assert_allclose(walled, free)


def test_a_part_of_the_room_without_points_has_no_value() -> None:
    places = points()
    places = places[places[:, 0] < WALL_X]
    closed = wall(end_y=3.0)
    grid = grid_values(places, light_of(places), OUTLINE, cell_m=0.05, between=between(closed))
    behind = grid.x > WALL_X + 0.15  # the rim before it counts as the wall's thickness
    assert np.isnan(grid.cells[0][:, behind]).all()
    assert (grid.cells[0][:, grid.x < WALL_X] == BRIGHT).all()


@pytest.mark.parametrize(("height_m", "separates"), [(0.9, False), (1.2, True)])
def test_what_ends_a_hand_above_the_level_separates_no_light(height_m: float, separates: bool) -> None:
    first, second = np.array([[1.3, 1.0]]), np.array([[1.7, 1.0]])
    assert between(wall(height_m))(first, second).tolist() == [separates]
    assert between(wall(height_m))(first, first).tolist() == [False]


def test_below_a_ceiling_what_is_below_the_level_tells() -> None:
    high = Partitions(wall(), 2.7)
    assert high.between(np.array([[1.3, 1.0]]), np.array([[1.7, 1.0]]), 2.6).tolist() == [True]


def test_a_point_is_predicted_from_those_on_its_side(make_transport: object) -> None:
    light = spectral_map(make_transport(points=49))  # type: ignore[operator]
    places = np.stack([light["x"].to_numpy(), light["y"].to_numpy()], axis=1)
    step = np.where(places[:, 0] < WALL_X, 1.0, 0.01)
    light["irradiance"] = light["irradiance"] * 0 + xr.DataArray(step, dims="point") * 1e-3
    x = light["x"].to_numpy()
    scan = wall(x=0.5 * (x[x < WALL_X].max() + x[x >= WALL_X].min()), end_y=3.0)
    level = partial(Partitions(scan, 2.7).between, level_m=float(light["z"][0]))
    assert leave_one_out(light, between=level).nrmse.max() < 1e-6
    assert leave_one_out(light).nrmse.max() > 0.1


def test_isolux_lines_end_at_a_wall_and_none_runs_along_it() -> None:
    plan = FloorPlan(outline=OUTLINE, partitions=Partitions(wall(), 2.7))
    places = points()
    grid = field_grid(
        np.column_stack([places, np.full(len(places), LEVEL_M)]), light_of(places), plan, cells_across=100
    )
    assert grid is not None
    row = int(np.abs(grid.y - 1.0).argmin())
    np.testing.assert_allclose(grid.cells[0][row], light_of(np.column_stack([grid.x, grid.x]))[:, 0])
    axes = place(new_figure(4.0, 4.0), 0.5, 0.5, 3.0, 3.0)
    draw_isolines(axes, grid, plan, LEVEL_M)
    lines = np.concatenate([path.vertices for group in axes.collections for path in group.get_paths()])
    assert len(lines)
    assert lines[:, 1].min() > 1.7  # right behind its end the light of the passage is seen


def test_the_ground_in_3d_is_not_filled_across_a_wall(make_transport: object) -> None:
    light = spectral_map(make_transport(points=49))  # type: ignore[operator]
    x = light["x"].to_numpy()
    at = 0.5 * (x[x < WALL_X].max() + x[x >= WALL_X].min())
    triangles = point_triangles(light, Partitions(wall(x=at, end_y=3.0), 2.7))
    assert len(triangles) > 40
    assert (np.ptp(np.sign(x[triangles] - at), axis=1) == 0).all()


def test_a_reading_belongs_to_no_point_behind_a_wall() -> None:
    places = np.array([[1.2, 1.0, 0.8], [1.6, 1.0, 0.8], [0.4, 1.0, 0.8], [1.7, 1.5, 0.8], [2.4, 1.0, 0.8]])
    columns = {name: ("point", column) for name, column in zip("xyz", places.T, strict=True)}
    columns |= {name: ("point", np.full(5, value)) for name, value in (("nx", 0.0), ("ny", 0.0), ("nz", 1.0))}
    light = xr.Dataset(columns | {"buried": ("point", np.zeros(5, np.bool_))})
    rows = [[1.42, 1.0, 0.8], [0.4, 1.0, 0.8], [2.4, 1.0, 0.8], [1.7, 1.5, 0.8], [1.4, 1.5, 0.8]]
    readings = pd.DataFrame(rows, columns=list("xyz"))
    here = Path("readings.csv")
    assert match_readings(light, readings, 0.35, here).points.tolist() == [1, 2, 4, 3, 3]
    matched = match_readings(light, readings, 0.35, here, Partitions(wall(), 2.7))
    assert matched.points.tolist() == [0, 2, 4, 3]
    assert matched.notes[0].startswith("1 reading is left out, since a wall stands between them")
