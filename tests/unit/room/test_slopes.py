"""Rooms under a roof: their plan reaches to the knee walls, and lamps on the slopes are found."""

from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.orientation import find_orientation
from lidarspectra.material.lit_lamps.lit_lamps import search_lit_lamps
from lidarspectra.room.closing import close_room
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import grid_points
from lidarspectra.workflow.init.proposed_lamps import PANEL_M, propose_panels

NOISE_M = 0.006  # [m] of a phone's mesh
LENGTH_M, WIDTH_M = 5.0, 4.0
GABLE_STRIPS = 20
PLAN_TOLERANCE = 0.05  # [1] of the area


def attic(
    builder: Any, knee_m: float, top_m: float, run_m: float, *, lit: Any = None, window: Any = None, strip: Any = None
) -> Scan:
    """A room between knee walls and slopes that rise over `run_m` each, with a flat ceiling between them or none."""
    room = builder(step_m=0.08, noise_m=NOISE_M)
    rise = top_m - knee_m
    room.rectangle([0, 0, 0], [WIDTH_M, 0, 0], [0, LENGTH_M, 0])
    room.rectangle([0, 0, 0], [0, LENGTH_M, 0], [0, 0, knee_m])
    room.rectangle([WIDTH_M, 0, 0], [0, 0, knee_m], [0, LENGTH_M, 0])
    room.rectangle([0, 0, knee_m], [0, LENGTH_M, 0], [run_m, 0, rise], picture=lit)
    room.rectangle([WIDTH_M, 0, knee_m], [-run_m, 0, rise], [0, LENGTH_M, 0], picture=window)
    if 2 * run_m < WIDTH_M:
        room.rectangle([run_m, 0, top_m], [0, LENGTH_M, 0], [WIDTH_M - 2 * run_m, 0, 0], picture=strip)
    edges = np.linspace(0.0, WIDTH_M, GABLE_STRIPS + 1)
    for x, next_x in pairwise(edges.tolist()):
        middle = 0.5 * (x + next_x)
        height = min(top_m, knee_m + rise / run_m * min(middle, WIDTH_M - middle))
        room.rectangle([x, 0, 0], [0, 0, height], [next_x - x, 0, 0])
        room.rectangle([x, LENGTH_M, 0], [next_x - x, 0, 0], [0, 0, height])
    return room.scan()


@pytest.mark.parametrize(
    ("knee_m", "top_m", "run_m"),
    [(1.0, 2.3, 1.3), (1.0, 2.6, 1.0), (1.0, 3.0, 2.0), (0.6, 2.6, 2.0), (1.4, 2.5, 2.0)],
)
def test_the_plan_of_an_attic_reaches_below_its_slopes(builder, knee_m: float, top_m: float, run_m: float) -> None:
    scan = attic(builder, knee_m, top_m, run_m)
    room = find_room(scan)
    assert room.area_m2 == pytest.approx(LENGTH_M * WIDTH_M, rel=PLAN_TOLERANCE)
    assert room.other_outlines == ()
    assert room.height_m == pytest.approx(top_m, abs=0.06)
    assert room.ceiling_confidence > 0.9
    _, openness = close_room(scan, room, ceiling=True, floor=True, sides=False)
    assert openness.closed_ceiling_m2 == 0.0, "nothing is missing"


def shed(builder: Any, tilt_deg: float) -> Scan:
    """A room of 4 m x 3 m under one slope that begins at 2.4 m."""
    room = builder(step_m=0.08, noise_m=NOISE_M)
    rise = 4.0 * float(np.tan(np.radians(tilt_deg)))
    room.rectangle([0, 0, 0], [4, 0, 0], [0, 3, 0])
    room.rectangle([0, 0, 2.4], [0, 3, 0], [4, 0, rise])
    room.rectangle([0, 0, 0], [0, 3, 0], [0, 0, 2.4])
    room.rectangle([4, 0, 0], [0, 0, 2.4 + rise], [0, 3, 0])
    for x in np.linspace(0.0, 4.0, 40, endpoint=False).tolist():
        height = 2.4 + rise * (x + 0.05) / 4.0
        room.rectangle([x, 0, 0], [0, 0, height], [0.1, 0, 0])
        room.rectangle([x, 3, 0], [0.1, 0, 0], [0, 0, height])
    return room.scan()


@pytest.mark.parametrize("tilt_deg", [8.0, 10.0, 13.0, 16.0, 19.0, 22.0, 25.0, 28.0])
def test_the_plan_below_one_slope_is_whole_however_gentle(builder, tilt_deg: float) -> None:
    room = find_room(shed(builder, tilt_deg))
    assert room.area_m2 == pytest.approx(12.0, rel=PLAN_TOLERANCE)
    assert room.ceiling_z == pytest.approx(2.4 + 4.0 * np.tan(np.radians(tilt_deg)), abs=0.06)
    assert room.ceiling_confidence > 0.9
    assert room.ceiling_area_m2 == pytest.approx(12.0 / np.cos(np.radians(tilt_deg)), rel=0.08)


@pytest.mark.parametrize("tilt_deg", [9.0, 14.0, 18.0, 22.0, 26.0])
def test_the_plan_below_a_gentle_gable_is_whole(builder, tilt_deg: float) -> None:
    top_m = 2.4 + 2.0 * float(np.tan(np.radians(tilt_deg)))
    room = find_room(attic(builder, 2.4, top_m, 2.0))
    assert room.area_m2 == pytest.approx(LENGTH_M * WIDTH_M, rel=PLAN_TOLERANCE)
    assert room.other_outlines == ()
    assert room.ceiling_z == pytest.approx(top_m, abs=0.06)
    assert room.ceiling_confidence > 0.9


def test_sensors_in_an_attic_are_below_its_slopes(builder) -> None:
    scan = attic(builder, 0.6, 2.6, 2.0)
    room = find_room(scan)
    points = grid_points(scan, room, height=1.2, spacing=0.3).positions
    highest = 0.6 + np.minimum(points[:, 0], WIDTH_M - points[:, 0])
    assert (points[:, 2] < highest).all()
    where_one_can_be = LENGTH_M * (WIDTH_M - 2 * 0.6)
    assert len(points) == pytest.approx(where_one_can_be / 0.3**2, rel=0.15)


def test_panels_are_proposed_below_all_of_a_slope(builder) -> None:
    found = []
    for tilt_deg in (0.0, 12.0):
        scan = shed(builder, tilt_deg)
        room = find_room(scan)
        found.append(propose_panels(room, FreeSpace(scan, room)).centers[:, :2])
    np.testing.assert_allclose(found[0], found[1], atol=0.05)


def test_panels_that_are_proposed_under_slopes_alone_hang_below_them(builder) -> None:
    scan = attic(builder, knee_m=1.0, top_m=3.0, run_m=2.0)
    room = find_room(scan)
    free = FreeSpace(scan, room)
    panels = propose_panels(room, free)
    corners = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * PANEL_M
    assert free.inside((panels.centers[:, None] + corners).reshape(-1, 3)).all()
    assert len(panels) > 1


def painted_slope(paint: Any, run_m: float, rise_m: float, size_m: tuple[float, float], *, is_round: bool) -> Any:
    """The picture of a slope with something lit in its middle; its sides are told by their lengths."""
    height, width = float(np.hypot(run_m, rise_m)), LENGTH_M
    picture = paint(height, width)
    rows, columns = picture.shape[:2]
    y, x = np.meshgrid(
        (np.arange(rows) + 0.5) / rows * height - height / 2, (np.arange(columns) + 0.5) / columns * width - width / 2,
        indexing="ij",
    )  # fmt: skip
    inside = (
        np.hypot(x, y) <= size_m[0] / 2 if is_round else (np.abs(x) <= size_m[0] / 2) & (np.abs(y) <= size_m[1] / 2)
    )
    picture[inside] = 255.0
    return cv2.GaussianBlur(picture, (0, 0), 1.5)


@pytest.mark.parametrize(("knee_m", "top_m", "run_m"), [(1.0, 2.3, 1.3), (0.6, 2.6, 2.0), (1.4, 2.5, 2.0)])
def test_a_downlight_in_a_slope_is_a_lamp_and_a_roof_window_is_none(builder, painted, knee_m, top_m, run_m) -> None:
    rise = top_m - knee_m
    lit = painted_slope(painted, run_m, rise, (0.14, 0.14), is_round=True)
    window = painted_slope(painted, run_m, rise, (1.1, 0.8), is_round=False)
    scan = attic(builder, knee_m, top_m, run_m, lit=lit, window=np.rot90(window))
    found = search_lit_lamps(scan, find_room(scan))
    (lamp,) = found.lamps
    length = float(np.hypot(run_m, rise))
    assert lamp.shape.word == "disc"
    np.testing.assert_allclose(lamp.normal, [rise / length, 0.0, -run_m / length], atol=0.03)
    np.testing.assert_allclose(
        lamp.center, np.array([run_m / 2, LENGTH_M / 2, knee_m + rise / 2]) + 0.06 * lamp.normal, atol=0.03
    )
    assert any(patch.center[0] > WIDTH_M / 2 and patch.area_m2 > 0.5 for patch in found.left_out)


@pytest.mark.parametrize("lean_deg", [0.0, 4.0, 12.0])
@pytest.mark.parametrize(("knee_m", "top_m", "run_m"), [(1.0, 2.3, 1.3), (1.4, 2.5, 2.0), (0.6, 2.6, 2.0)])
def test_an_attic_is_set_upright_by_its_floor_and_not_by_a_slope(builder, knee_m, top_m, run_m, lean_deg) -> None:
    scan = attic(builder, knee_m, top_m, run_m)
    lean = Rotation.from_rotvec(np.radians(lean_deg) * np.array([0.6, 0.8, 0.0])).as_matrix()
    found = find_orientation(scan.vertices @ lean.T, scan.faces, up="+z")
    np.testing.assert_allclose(found.apply(scan.vertices @ lean.T), scan.vertices, atol=0.02)


def test_lamps_in_the_roof_above_another_storey_are_not_the_rooms(builder, painted) -> None:
    lit = painted_slope(painted, 2.0, 2.0, (0.14, 0.14), is_round=True)
    house = builder(step_m=0.08, noise_m=NOISE_M)
    house.box([0, 0, -2.8], [WIDTH_M, LENGTH_M, -0.3], inward=True)
    attic(lambda **_: house, 0.6, 2.6, 2.0, lit=lit)
    scan = house.scan()
    room = find_room(scan)
    assert room.floor_z == pytest.approx(-2.8, abs=0.01)
    assert room.ceiling_z == pytest.approx(-0.3, abs=0.01)
    assert room.ceiling_area_m2 == pytest.approx(WIDTH_M * LENGTH_M, rel=0.05), "the roof is not its ceiling"
    assert search_lit_lamps(scan, room).lamps == ()


def test_slopes_above_a_ceiling_that_is_given_are_not_the_rooms(builder) -> None:
    scan = attic(builder, 1.0, 3.0, 2.0)
    room = find_room(scan, ceiling_z=1.6)
    assert room.ceiling_z == pytest.approx(1.6)
    assert room.ceiling_confidence == 0.0, "none was scanned there"
