"""Two rooms with a door between them, photographed as one scan: their ceilings lie in one plane, and are two paints."""

from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.beside_paints import settle_beside_paints
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials import delighting
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_rounds import REFLECTANCE_RANGE

from .lit_rooms import all_light, exchange, joined, lamp_light, painted, plane

pytestmark = [
    pytest.mark.slow,  # rooms photographed by radiosity and de-lit, some seconds
    pytest.mark.usefixtures("half_samples"),
]

LENGTH_M, WIDTH_M, HEIGHT_M, EDGE_M = 6.0, 3.2, 2.6, 0.2
WALL_M = (2.95, 3.05)  # [m] x of the two sides of the wall between the rooms
DOOR_M, LINTEL_M = 2.2, 2.1  # [m] y where the door begins, and its height
FLOOR, WALLS, CEILING, OTHER_CEILING = 0.25, 0.5, 0.83, 0.69
SCATTER = 0.08  # [1] of what the picture shows of a face, relative: two lightnesses are then no two peaks


def rooms(
    folder: Path, *, lit: Sequence[float] = (1.5, 4.5), white: float = 0.9, black: float = 0.0
) -> tuple[Scan, list[BoolArray], list[Lamp], FloatArray]:
    """The scan as photographed, the faces of its two ceilings, its lamps, and each face's reflectance.

    The brightest place shows `white`; `black` is added to all.
    """
    x, y, z = np.diag([LENGTH_M, WIDTH_M, HEIGHT_M])
    here, there = (np.array([at, 0.0, 0.0]) for at in WALL_M)
    wide, door = np.array([WALL_M[1] - WALL_M[0], 0, 0]), np.array([0, DOOR_M, 0])
    opening, high = np.array([0, WIDTH_M - DOOR_M, 0]), np.array([0, 0, LINTEL_M])
    lintel = np.array([0, 0, HEIGHT_M - LINTEL_M])
    scan, member, reflectance = joined(
        [
            (FLOOR, plane(np.zeros(3), x, y, EDGE_M)),
            (CEILING, plane(z, y, here, EDGE_M)),
            (OTHER_CEILING, plane(z + there, y, x - there, EDGE_M)),
            (WALLS, plane(np.zeros(3), y, z, EDGE_M)),
            (WALLS, plane(x, z, y, EDGE_M)),
            (WALLS, plane(y, x, z, EDGE_M)),
            (WALLS, plane(np.zeros(3), z, x, EDGE_M)),
            (WALLS, plane(here, z, door, EDGE_M)),
            (WALLS, plane(there, door, z, EDGE_M)),
            (WALLS, plane(here + door + high, lintel, opening, EDGE_M)),
            (WALLS, plane(there + door + high, opening, lintel, EDGE_M)),
            (WALLS, plane(here + door, high, wide, EDGE_M)),
            (WALLS, plane(here + door + high, opening, wide, EDGE_M)),
        ]
    )
    lamps = [
        ls.make_lamp("panel", (at_x, 1.6, 2.5), name=f"{at_x}", size=0.6, spectrum="LED-B3", luminous_flux_lm=3000)
        for at_x in lit
    ]
    seen = reflectance * all_light(exchange(scan), reflectance, lamp_light(scan, lamps, folder))
    seen *= np.exp(SCATTER * np.random.default_rng(4).standard_normal(len(seen)))
    return painted(scan, black + white * seen / seen.max()), [member == 1, member == 2], lamps, reflectance


def test_ceilings_that_a_wall_parts_keep_their_own_reflectance_and_single_faces_gain(tmp_path: Path) -> None:
    scan, ceilings, lamps, reflectance = rooms(tmp_path)
    with patch.object(delighting, "settle_beside_paints", wraps=settle_beside_paints) as settle:
        found = take_light_out(scan, find_room(scan), lamps, workers=2)
    assert found.face_color is not None
    for ceiling, truth in zip(ceilings, (CEILING, OTHER_CEILING), strict=True):
        # One paint on both, their mean, would be 9 % off either.
        assert np.median(found.face_color[ceiling].mean(axis=1)) == pytest.approx(truth, rel=0.05)
    _, paints, asked, _ = settle.call_args.args
    single = asked & (paints.paint < 0)
    before, now = (
        np.abs(np.clip(each[single], *REFLECTANCE_RANGE).mean(axis=1) - reflectance[single]).mean()
        for each in (paints.color, found.face_color)
    )
    assert now < 0.9 * before  # .81 of it


def test_what_an_unlit_room_reflects_is_stated_as_hardly_known(tmp_path: Path) -> None:
    # By the light through the door the other room shows some .004 of white, half as much again by the camera's black.
    scan, _, lamps, reflectance = rooms(tmp_path, lit=(1.5,), white=0.2, black=0.002)
    found = take_light_out(scan, find_room(scan), lamps, workers=2)
    assert found.face_color is not None
    assert found.face_deviation is not None
    unlit = scan.centers[:, 0] > WALL_M[1]
    apart = np.abs(np.log(found.face_color.mean(axis=1) / reflectance))
    within = apart < 2.0 * found.face_deviation.mean(axis=1)
    assert np.average(within[unlit], weights=scan.areas[unlit]) > 0.6  # .65; .25 without the error of the black
    assert any("hardly tells what they reflect" in note for note in found.warnings)
