"""Rooms whose light is found by rays alone: energy is kept, and a point's light is that of a closed form."""

import re

import numpy as np
import pytest

from research.benchmarks.odd_rooms import block, flat, globe, panel, shell, with_true_light
from research.virtual_rooms.ray_room import RayRoom


def test_what_lamps_send_is_what_surfaces_absorb() -> None:
    room = RayRoom(edge_m=0.3)
    shell(room, (3.0, 2.0, 2.5), (0.3, 0.5, 0.7), (0.5,) * 4, 0.7)
    panel(room, (1.5, 1.0, 2.5), (0.4, 0.4), 100.0)
    true = room.solved(rays=400)
    absorbed = ((1.0 - true.reflectance) * true.irradiance * true.mesh.area_faces[:, None]).sum(axis=0)
    assert absorbed == pytest.approx(np.full(3, room.lamps[0][1]), rel=0.03)


def test_a_globe_in_black_gives_the_inverse_square() -> None:
    room = RayRoom(edge_m=0.5)
    shell(room, (6.0, 6.0, 5.0), 0.0, (0.0,) * 4, 0.0)
    globe(room, (3.0, 3.0, 3.0), 0.1, 1000.0)
    places = np.array([[3.0, 3.0, 1.0], [5.0, 3.0, 1.0]])
    squared = ((places - [3.0, 3.0, 3.0]) ** 2).sum(axis=1)
    ideal = np.pi * 0.1**2 * 1000.0 / squared * (2.0 / np.sqrt(squared))
    assert room.solved(rays=10).illuminance(places) == pytest.approx(ideal, rel=0.03)


def test_a_wall_between_keeps_the_lamps_light_away() -> None:
    room = RayRoom(edge_m=0.5)
    shell(room, (4.0, 3.0, 2.5), 0.5, (0.5,) * 4, 0.5)
    room.add(block((1.9, 0.0, 0.0), (2.1, 3.0, 2.5)), 0.5)
    panel(room, (1.0, 1.5, 2.5), (0.5, 0.5), 100.0)
    lit, dark = room.solved(rays=50).illuminance(np.array([[1.0, 1.5, 0.5], [3.0, 1.5, 0.5]]))
    assert lit > 1.0
    assert dark < 1e-3 * lit  # rays along an edge


def test_a_run_file_gets_the_flux_of_the_lamp_in_the_same_place() -> None:
    room = RayRoom(edge_m=1.0)
    room.add(flat((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0.5)
    for x, radiance in ((1.0, 100.0), (3.0, 200.0)):
        panel(room, (x, 1.0, 2.5), (0.5, 0.5), radiance)
    found = "".join(
        f'[[lamps]]\nname = "{x}"\ncenter = [{x}, 1.0, 2.4]\nrotation_deg = 0.0\nspectrum = "LED-B3"\n'
        'luminous_flux_lm = 800.0\nassumed = ["flux", "spectrum"]\n\n'
        for x in (2.95, 1.05, 8.0)
    )
    text, right, wrong = with_true_light("[scan]\n\n" + found, room)
    assert (right, wrong) == (2, 1)
    fluxes = [float(word) for word in re.findall(r"luminous_flux_lm = (\S+)", text)]
    assert fluxes[:2] == pytest.approx([np.pi * 0.25 * 200.0, np.pi * 0.25 * 100.0], abs=0.1)
    assert text.count("dim = 0\n") == 1
    assert "assumed" not in text
    higher, *_ = with_true_light("[scan]\n\n" + found, room, true_height=True)
    assert re.findall(r"^center = .*$", higher, re.MULTILINE)[:2] == [
        "center = [2.95, 1.0, 2.480]", "center = [1.05, 1.0, 2.480]",
    ]  # fmt: skip
