"""Glare in pictures that are made by hand, so that every number has a closed form."""

import numpy as np
import pytest

from lidarspectra.radiance.pictures.glare import luminaires_of, position_index
from lidarspectra.radiance.pictures.render import Picture
from lidarspectra.radiance.pictures.view import View

BACKGROUND, PANEL, WINDOW = 30.0, 8000.0, 3000.0  # [cd/m²]
FORWARD, UP = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
SPOT_DEG = 5.0


def toward(azimuth_deg: float, altitude_deg: float) -> np.ndarray:
    """Unit vector, azimuth clockwise from the line of sight."""
    azimuth, altitude = np.radians([azimuth_deg, altitude_deg])
    return np.array([np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), np.sin(altitude)])


@pytest.fixture(scope="module")
def picture() -> Picture:
    """A grey room with a round panel (lamp 0) 40 degrees above the line of sight, and a window (lamp 1) beside it."""
    view = View(eye=np.zeros(3), direction=FORWARD, projection="fisheye", angle_deg=180.0, pixels=(360, 360))
    directions, inside = view.directions()
    lamp = np.full(inside.shape, -1)
    lamp[directions @ toward(0.0, 40.0) > np.cos(np.radians(SPOT_DEG))] = 0
    lamp[directions @ toward(30.0, 0.0) > np.cos(np.radians(2.0 * SPOT_DEG))] = 1
    luminance = np.choose(lamp + 1, [BACKGROUND, PANEL, WINDOW]) * inside
    return Picture(view=view, xyz=np.repeat(luminance[..., None], 3, axis=-1), lamp=np.where(inside, lamp, -1))


def test_ugr_is_that_of_the_electric_luminaires_and_a_window_lights_the_background(picture: Picture) -> None:
    seen = luminaires_of(picture, daylight=[1])
    assert seen.lamp.tolist() == [0]
    sine = np.sin(np.radians([SPOT_DEG, 2.0 * SPOT_DEG])) ** 2  # over π: projected solid angle of a disc ahead
    panel, window = np.pi * sine * np.array([np.cos(np.radians(40.0)), np.cos(np.radians(30.0))])
    behind = BACKGROUND * (np.pi - panel - window) + WINDOW * window
    assert seen.indirect_lx == pytest.approx(behind, rel=0.01)  # the edges of spots in pixels of half a degree
    solid = 2.0 * np.pi * (1.0 - np.cos(np.radians(SPOT_DEG)))
    index = position_index(toward(0.0, 40.0), FORWARD, UP)
    expected = 8.0 * np.log10(0.25 * np.pi / behind * PANEL**2 * solid / index**2)
    assert seen.ugr == pytest.approx(expected, abs=0.1)


def test_a_window_alone_has_no_ugr(picture: Picture) -> None:
    assert luminaires_of(picture, daylight=[0, 1]).ugr == -np.inf


@pytest.mark.parametrize(
    ("below_deg", "expected"),
    [
        (30.0, 1.0 + 0.8 * np.tan(np.radians(30.0))),
        (60.0, 1.0 + 1.2 * np.tan(np.radians(60.0))),
        (80.0, 4.6),  # evalglare takes R for 3 at most: 1 + 1.2 * 3, where the formula alone has 7.8
        (90.0, 4.6),
    ],
)
def test_the_position_index_below_the_line_of_sight_is_iwata_s(below_deg: float, expected: float) -> None:
    assert float(position_index(toward(0.0, -below_deg), FORWARD, UP)) == pytest.approx(expected, rel=1e-6)


def test_the_position_index_above_the_line_of_sight_is_that_of_guth_s_table() -> None:
    height = np.arange(0.0, 1.8, 0.2)  # H/R straight above, T/R = 0 (CIE 117:1995, table of position indices)
    table = np.array([1.0, 1.53, 2.35, 3.50, 5.00, 7.00, 9.25, 11.70, 14.70])
    rays = np.stack([toward(0.0, altitude) for altitude in np.degrees(np.arctan(height))])
    # 3 %: how well Levin's formula fits the table
    assert position_index(rays, FORWARD, UP) == pytest.approx(table, rel=0.03)
