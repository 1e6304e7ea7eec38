"""Lamps that are a part of the room's surface: how much light is missing where they reflect nothing."""

from typing import Any

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.radiance.scene.black_lamps import black_lamps_loss, black_lamps_note


def lamp(side_m: float, *, name: str = "panel", shape: str = "panel", x: float = 2.5) -> Lamp:
    light: dict[str, Any] = {"spectrum": "LED-B3", "luminous_flux_lm": 3000.0, "size": (side_m, side_m)}
    if shape == "window":
        light["normal"] = (0.0, 1.0, 0.0)
    return make_lamp(name=name, shape=shape, center=(x, 2.0, 2.55), **light)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def room() -> ls.RoomModel:
    """5 m x 4 m x 2.6 m as `research.benchmarks.odd_rooms` paints its living room."""
    return ls.RoomModel.from_box(5.0, 4.0, 2.6, floor=0.30, walls=0.70, ceiling=0.82)


@pytest.mark.parametrize(("side_m", "by_rays"), [(0.6, 0.0050), (1.5, 0.0309), (3.0, 0.1145)])
def test_the_loss_is_that_of_a_room_whose_light_is_found_by_rays(
    room: ls.RoomModel, side_m: float, by_rays: float
) -> None:
    """The numbers: light at desk height in `research.virtual_rooms.ray_room`, with lamps of reflectance 0 and .8."""
    loss = black_lamps_loss([lamp(side_m)], room.scan, room.materials) * 0.8 / 0.7
    assert loss == pytest.approx(by_rays, rel=0.35)


def test_the_user_is_told_of_a_luminous_ceiling_and_of_no_usual_lamp(room: ls.RoomModel) -> None:
    assert black_lamps_note([lamp(0.6)], room.scan, room.materials) == ()
    (note,) = black_lamps_note([lamp(3.0)], room.scan, room.materials)
    assert "too dark by some 1" in note


def test_two_lights_of_one_luminaire_are_one_surface_and_a_window_is_none(room: ls.RoomModel) -> None:
    one = black_lamps_loss([lamp(1.0)], room.scan, room.materials)
    both = [lamp(1.0, name="warm"), lamp(1.0, name="cold")]
    assert black_lamps_loss(both, room.scan, room.materials) == pytest.approx(one)
    apart = [lamp(1.0, name="left", x=1.0), lamp(1.0, name="right", x=4.0)]
    assert black_lamps_loss(apart, room.scan, room.materials) == pytest.approx(2.0 * one)
    assert black_lamps_loss([lamp(1.0, shape="window")], room.scan, room.materials) == 0.0
    assert np.isfinite(one)
