"""What an app left black for want of a picture sends light as what lies beside it, and is of its paint."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials.delighting import take_light_out

from .lit_rooms import all_light, exchange, joined, lamp_light, painted, plane


def lit_room(folder: Path) -> tuple[Scan, list[Lamp], np.ndarray]:
    """A room of 4 m x 3.2 m x 2.6 m with two lamps, as a linear camera shows it, and its reflectances."""
    x, y, z = np.diag([4.0, 3.2, 2.6])
    zero = np.zeros(3)
    scan, _, reflectance = joined(
        [
            (0.25, plane(zero, x, y, 0.2)),
            (0.8, plane(z, y, x, 0.2)),
            *((0.6, plane(a, b, c, 0.2)) for a, b, c in ((zero, y, z), (x, z, y), (y, x, z), (zero, z, x))),
        ]
    )
    lamps = [
        ls.make_lamp("panel", (at_x, 1.6, 2.4), name=f"{at_x}", size=0.5, spectrum="LED-B3", luminous_flux_lm=3000)
        for at_x in (1.0, 3.0)
    ]
    shown = reflectance * all_light(exchange(scan), reflectance, lamp_light(scan, lamps, folder))
    return painted(scan, 0.55 * shown / np.quantile(shown, 0.97)), lamps, reflectance


@pytest.mark.slow  # a room photographed by radiosity and de-lit
@pytest.mark.usefixtures("half_samples")
def test_the_light_of_a_room_is_taken_out_as_if_it_were_pictured(tmp_path: Path) -> None:
    """A sixth of a room left black made its walls .36 for .6, since so little light came from there."""
    scan, lamps, reflectance = lit_room(tmp_path)
    random = np.random.default_rng(3)
    middles = scan.centers[random.integers(len(scan.faces), size=12)]
    holes = (np.linalg.norm(scan.centers[:, None] - middles, axis=2) < 0.55).any(axis=1)
    assert 0.1 < scan.areas[holes].sum() / scan.areas.sum() < 0.3
    color = scan.appearance.corner_color.copy()
    color[holes] = 0.0
    black = replace(scan, appearance=replace(scan.appearance, corner_color=color))
    found = take_light_out(black, find_room(black), lamps, workers=1)
    assert found.face_color is not None
    away = np.abs(found.face_color.mean(axis=1) - reflectance)
    assert np.average(away, weights=scan.areas) < 0.02
    assert np.average(away[holes], weights=scan.areas[holes]) < 0.03
    assert any("no picture shows" in words for words in found.warnings)
