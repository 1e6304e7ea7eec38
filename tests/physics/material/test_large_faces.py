"""Walls of two triangles each, as apps export them to save space: the light is what the texture shows along them."""

from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.appearance import Appearance
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.workflow.materials.delighting import take_light_out

from .lit_rooms import Part, all_light, exchange, joined, lamp_light, painted, plane

pytestmark = [
    pytest.mark.slow,  # a room photographed by radiosity and de-lit
    pytest.mark.usefixtures("half_samples"),
]

SIZE_M = (5.0, 3.0, 2.6)
EDGE_M = 0.25  # [m] of a pixel of the texture
FLOOR, WALLS, CEILING, TABLE, WHITE = 0.2, 0.6, 0.8, 0.35, 0.85
EXPOSURE = 0.25  # of the mean
Side = tuple[float, FloatArray, FloatArray, FloatArray]
"""Reflectance, corner and both sides of a rectangle."""


def sides() -> list[Side]:
    """The room's surfaces, and the top of a table."""
    x, y, z = np.diag(SIZE_M)
    zero, top = np.zeros(3), np.array([3.2, 1.0, 0.75])
    return [
        (FLOOR, zero, x, y),
        (CEILING, z, y, x),
        (WALLS, zero, y, z),
        (WALLS, x, z, y),
        (WALLS, y, x, z),
        (WALLS, zero, z, x),
        (TABLE, top, 0.24 * x, 0.3 * y),
    ]


def texture_of(seen: FloatArray, along: FloatArray, across: FloatArray) -> np.ndarray:
    """Of the faces of a fine rectangle, as `plane` orders them: a pixel for two triangles."""
    columns, rows = (max(1, round(float(np.linalg.norm(side)) / EDGE_M)) for side in (along, across))
    pixels = seen.reshape(2, columns, rows).mean(axis=0).T[::-1]
    encoded = np.round(255 * encode_srgb(np.clip(pixels, 0, 1))).astype(np.uint8)
    return np.repeat(encoded[:, :, None], 3, axis=2)


def photographed(lamps: list[Lamp], folder: Path) -> Scan:
    """The lit room, of two triangles a side, with what a camera shows as textures."""
    fine: list[Part] = [(value, plane(corner, u, v, EDGE_M)) for value, corner, u, v in sides()]
    scan, member, reflectance = joined(fine)
    direct = lamp_light(scan, lamps, folder)
    seen = reflectance * all_light(exchange(scan), reflectance, direct)
    seen *= EXPOSURE / seen.mean()
    coarse, part, _ = joined([(value, plane(corner, u, v, 99.0)) for value, corner, u, v in sides()])
    images = tuple(
        texture_of(seen[member == number], along, across) for number, (_, _, along, across) in enumerate(sides())
    )
    corner_uv = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]] * len(images), dtype=np.float64)
    appearance = Appearance(
        images=images, face_image=part, corner_uv=corner_uv, corner_color=np.full((len(part), 3, 3), 0.5)
    )
    bare = bare_scan(coarse.vertices, coarse.faces)
    return Scan(vertices=bare.vertices, faces=bare.faces, appearance=appearance, record=bare.record)


def test_a_wall_that_is_cut_at_white_beside_a_lamp_has_its_own_paint(tmp_path: Path) -> None:
    """In a picture exposed for the floor; the panel itself hangs free and is in no picture."""
    lamp = ls.make_lamp("panel", (3.8, 1.4, 2.0), name="one", size=0.6, spectrum="LED-B3", luminous_flux_lm=3000)
    values = [*(value for value, *_ in sides()[:-1]), WHITE]
    fine: list[Part] = [(value, plane(*side[1:], EDGE_M)) for value, side in zip(values, sides(), strict=True)]
    scan, member, reflectance = joined(fine)
    direct = lamp_light(scan, [lamp], tmp_path)
    seen = reflectance * all_light(exchange(scan), reflectance, direct)
    wall = reflectance == WALLS
    shown = seen / np.quantile(seen[wall], 0.93)
    found = take_light_out(painted(scan, shown), find_room(scan), [lamp], workers=2)
    cut = wall & (shown > 1.0)
    assert cut.sum() > 30
    assert found.face_color is not None
    assert found.face_deviation is not None
    told = np.abs(found.face_color.mean(axis=1) - WALLS) < 0.08
    assert (told & cut).sum() > 0.9 * cut.sum()  # where the fit has too little light for white, nothing is told
    # Of the table, which is cut as a whole, limits are known alone, and the deviation says so.
    table = member == len(values) - 1
    assert (shown[table] > 1.0).all()
    off = np.log(found.face_color[table].mean(axis=1) / WHITE)
    assert (np.abs(off) < 2.0 * found.face_deviation[table].mean(axis=1)).all()
    assert found.face_deviation[table].min() > np.median(found.face_deviation[told & cut]) + 0.02


def test_reflectances_of_large_triangles_are_told_by_the_light_along_them(tmp_path: Path) -> None:
    lamp = ls.make_lamp("panel", (1.2, 1.5, 2.5), name="one", size=0.6, spectrum="LED-B3", luminous_flux_lm=3000)
    scan = photographed([lamp], tmp_path)
    found = take_light_out(scan, find_room(scan), [lamp], workers=2)
    assert found.fit is not None, found.warnings  # of two triangles a wall, too few places told of the light
    assert found.fit.explained > 0.95
    assert found.face_color is not None
    assert found.face_color.shape == (len(scan.faces), 3)
    truth = np.repeat([value for value, *_ in sides()], 2)
    np.testing.assert_allclose(found.face_color.mean(axis=1), truth, atol=0.075)  # most on the wall beside the lamp
