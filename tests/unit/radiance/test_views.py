"""Views of pictures: solid angles, and what is refused."""

import numpy as np
import pytest

from lidarspectra.errors import SceneError
from lidarspectra.radiance.pictures.view import View

FORWARD = np.array([0.0, 1.0, 0.0])


def test_a_fisheye_covers_its_hemisphere_once() -> None:
    view = View(eye=np.zeros(3), direction=FORWARD, projection="fisheye", angle_deg=180.0, pixels=(300, 300))
    directions, _ = view.directions()
    assert view.solid_angles().sum() == pytest.approx(2.0 * np.pi, rel=2e-3)  # pixels at the rim are in or out
    assert (view.solid_angles() * (directions @ FORWARD)).sum() == pytest.approx(np.pi, rel=1e-3)


def test_a_perspective_covers_the_solid_angle_of_its_pyramid() -> None:
    view = View(eye=np.zeros(3), direction=FORWARD, angle_deg=90.0, pixels=(200, 100))
    a, b = 1.0, 0.5  # half sides of the picture at distance 1
    assert view.solid_angles().sum() == pytest.approx(
        4.0 * np.arcsin(a * b / np.sqrt((1 + a**2) * (1 + b**2))), rel=1e-4
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"direction": np.array([0.0, 0.0, -1.0])},
        {"direction": np.zeros(3)},
        {"pixels": (0, 5)},
        {"angle_deg": 170.0},
        {"projection": "fisheye", "pixels": (20, 10)},
    ],
)
def test_no_view_is_made_of_what_is_none(wrong) -> None:
    with pytest.raises(SceneError):
        View(**{"eye": np.zeros(3), "direction": FORWARD, **wrong})
