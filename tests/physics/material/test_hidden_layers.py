"""A wall behind a door, and walls scanned twice: what is before them has its own light, so its own reflectance."""

from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials.delighting import take_light_out

from .lit_rooms import Part, all_light, exchange, joined, lamp_light, painted, plane

pytestmark = pytest.mark.slow  # a room photographed by radiosity and de-lit, twice

LENGTH_M, WIDTH_M, HEIGHT_M = 4.0, 3.0, 2.6
DOOR = (1.2, 2.2, 2.1)  # [m] from x to x, and its height
BEFORE_M = 0.04
EDGE_M = 0.35
FLOOR, WALLS, CEILING, OF_DOOR = 0.25, 0.7, 0.8, 0.33
EXPOSURE = 0.004


def surfaces(wall_edge_m: float) -> list[Part]:
    """Reflectance and mesh of the room's surfaces; the door, the last one, hangs before the wall at y = 0."""
    x, y, z = np.diag([LENGTH_M, WIDTH_M, HEIGHT_M])
    zero = np.zeros(3)
    door = np.array([DOOR[1], BEFORE_M, 0.0]), np.array([DOOR[0] - DOOR[1], 0, 0]), np.array([0, 0, DOOR[2]])
    return [
        (FLOOR, plane(zero, x, y, EDGE_M)),
        (CEILING, plane(z, y, x, EDGE_M)),
        (WALLS, plane(zero, y, z, EDGE_M)),
        (WALLS, plane(x, z, y, EDGE_M)),
        (WALLS, plane(y, x, z, EDGE_M)),
        (WALLS, plane(zero, z, x, wall_edge_m)),
        (OF_DOOR, plane(*door, 0.15)),
    ]


def photographed(wall_edge_m: float, lamps: list[Lamp], folder: Path) -> Scan:
    """The lit room as a camera shows it."""
    parts = surfaces(wall_edge_m)
    scan, member, reflectance = joined(parts)
    direct = lamp_light(scan, lamps, folder)
    seen = reflectance * all_light(exchange(scan), reflectance, direct)
    behind = (member == 5) & (scan.centers[:, 0] > DOOR[0]) & (scan.centers[:, 0] < DOOR[1])
    seen[behind & (scan.centers[:, 2] < DOOR[2])] = seen[member == 6].mean()  # the camera paints it like the door
    return painted(scan, EXPOSURE / direct.mean() * 60.0 * seen)


@pytest.fixture(scope="module")
def lamps() -> list[Lamp]:
    return [
        ls.make_lamp("panel", (x, 1.5, 2.5), name=f"{x}", size=0.6, spectrum="LED-B3", luminous_flux_lm=3000)
        for x in (1.2, 2.8)
    ]


@pytest.mark.parametrize("wall_edge_m", [0.2, 9.0])
def test_a_door_before_a_wall_has_the_reflectance_that_it_has_without_the_wall(
    lamps: list[Lamp], wall_edge_m: float, tmp_path: Path
) -> None:
    """Of small triangles the hidden part of the wall is left out; of two large ones, no sample is taken there."""
    shown = photographed(wall_edge_m, lamps, tmp_path)
    scan = repair_scan(shown, close_holes=False)
    assert (scan.record.hidden_area_m2 > 1.0) == (wall_edge_m < 1.0)
    door = np.abs(scan.centers[:, 1] - BEFORE_M) < 1e-6
    found = take_light_out(scan, find_room(scan), lamps, workers=2)
    assert found.face_color is not None
    values = found.face_color[door].mean(axis=1)
    walls = float(found.face_color[scan.centers[:, 1] > WIDTH_M - 1e-6].mean())
    # The scale of all reflectances has its own uncertainty, 10 %; the door over the walls has not. It was 1.6 times too
    # high, and from .38 to .84 over one flat door.
    assert values.mean() / walls == pytest.approx(OF_DOOR / WALLS, rel=0.1)
    assert values.max() < 1.35 * values.min()
