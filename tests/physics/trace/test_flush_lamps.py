"""Lamps flush with a ceiling or wall that is rough by a centimetre light the room as they light a smooth one."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import lidarspectra as ls
from lidarspectra.lamps.make_lamp import GivenShape

pytestmark = pytest.mark.slow  # nine rooms of many triangles, each traced rough and smooth

LENGTH_M, WIDTH_M, HEIGHT_M = 3.0, 2.6, 2.4
NOISE_M = 0.01
LONGEST_EDGE_M = 0.25
IES = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 4 1 1 2 0.3 0.6 0\n1 1 0\n0 30 60 90\n0\n300 260 120 0\n"


def room(noise_m: float, reflectance: float) -> ls.RoomModel:
    """A box with a corner at the origin, its vertices off by so much."""
    box = trimesh.creation.box(extents=(LENGTH_M, WIDTH_M, HEIGHT_M))
    box.invert()
    while box.edges_unique_length.max() > LONGEST_EDGE_M:
        box = box.subdivide()
    noise = np.random.default_rng(5).normal(0.0, noise_m, box.vertices.shape)
    corners = box.vertices + np.array([LENGTH_M, WIDTH_M, HEIGHT_M]) / 2 + noise
    return ls.RoomModel(surfaces=[ls.Surface(corners=corners, faces=box.faces, reflectance=reflectance)])


def sensors() -> ls.SensorPoints:
    """Points 6 cm off the floor and all walls, that face into the room."""
    generator = np.random.default_rng(6)
    sides = np.array([LENGTH_M, WIDTH_M, HEIGHT_M])
    positions, normals = [], []
    for axis, high in [(2, False), (0, False), (0, True), (1, False), (1, True)]:
        places = 0.06 + generator.random((60, 3)) * (sides - 0.12)
        places[:, axis] = sides[axis] - 0.06 if high else 0.06
        normal = np.zeros(3)
        normal[axis] = -1.0 if high else 1.0
        positions.append(places)
        normals.append(np.broadcast_to(normal, places.shape))
    return ls.SensorPoints(positions=np.concatenate(positions), normals=np.concatenate(normals))


@pytest.mark.parametrize(
    ("shape", "size", "height_m", "more"),
    [
        ("panel", 0.6, 0.0, {}),
        ("strip", (1.2, 0.05), 0.0, {}),
        ("disc", 0.2, 0.0, {}),
        ("spot", 0.08, 0.0, {"beam_angle_deg": 60.0}),
        ("bulb", 0.06, 0.03, {}),
        ("point", 0.01, 0.005, {}),
        ("ies", None, 0.0, {"file": "lamp.ies"}),
        ("window", (1.0, 1.2), None, {}),
    ],
)
def test_the_light_of_every_shape_arrives(
    tmp_path: Path,
    shape: GivenShape,
    size: float | tuple[float, ...] | None,
    height_m: float | None,
    more: dict[str, object],
) -> None:
    (tmp_path / "lamp.ies").write_text(IES, encoding="utf-8")
    if height_m is None:
        center, normal = (0.0, 1.3, 1.3), (1.0, 0.0, 0.0)
    else:
        center, normal = (1.4, 1.2, HEIGHT_M - height_m), (0.0, 0.0, -1.0)
    lamp = ls.make_lamp(
        shape, center, normal=normal, size=size, spectrum="LED-B3", luminous_flux_lm=1000, folder=tmp_path, **more
    )
    points = sensors()
    rough, smooth = (
        room(noise_m, 0.0).light([lamp], points, accuracy="low", noise="standard", seed=1)["illuminance"].mean()
        for noise_m in (NOISE_M, 0.0)
    )
    # 300 points share the light of one lamp: their mean follows it, and misses some of what goes along the ceiling.
    assert float(rough / smooth) == pytest.approx(1.0, abs=0.015)


def test_a_map_under_two_flush_downlights_is_that_of_a_smooth_room() -> None:
    lamps = [
        ls.make_lamp("disc", (x, 1.3, HEIGHT_M), name=f"{x}", size=0.2, spectrum="LED-B3", luminous_flux_lm=800)
        for x in (0.8, 2.2)
    ]
    plain = room(0.0, 0.6)
    points = plain.grid(0.75, spacing=0.4)
    rough, smooth = (
        model.light(lamps, points, accuracy="medium", noise="standard", seed=2)["illuminance"].mean()
        for model in (room(NOISE_M, 0.6), plain)
    )
    # Standard errors of a hundredth each; without way made, half of the light stays behind the ceiling.
    assert float(rough / smooth) == pytest.approx(1.0, abs=0.04)
