"""A picture that keeps much of warm lamps' hue tells the hues of paint as one that is balanced does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.sharpened_cones import cones_of_light, cones_of_srgb, srgb_of_cones
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.spectra.databases import lamp_spectrum, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.workflow.materials.delighting import take_light_out

from .lit_rooms import all_light, exchange, joined, lamp_light, plane

pytestmark = [
    pytest.mark.slow,  # a room photographed by radiosity and de-lit
    pytest.mark.usefixtures("half_samples"),
]

WOOD, SKIN, GREY, WHITE = (0.39, 0.21, 0.10), (0.56, 0.31, 0.22), (0.6, 0.6, 0.6), (0.8, 0.8, 0.8)  # linear sRGB


def warm_room(folder: Path) -> tuple[Scan, list[Lamp], FloatArray, FloatArray]:
    """A room with two lamps of 2700 K: its scan, lamps, (face, 3) reflectances in sRGB and (face, 3) light in cones."""
    x, y, z = np.diag([5.0, 4.0, 2.7])
    zero = np.zeros(3)
    paints = (WOOD, WHITE, GREY, SKIN, GREY, GREY)
    corners = ((zero, x, y), (z, y, x), (zero, y, z), (x, z, y), (y, x, z), (zero, z, x))
    scan, member, _ = joined([(0.5, plane(a, b, c, 0.2)) for a, b, c in corners])
    lamps = [
        ls.make_lamp("panel", (at_x, 2.0, 2.5), name=f"{at_x}", size=0.5, spectrum="LED-B1", luminous_flux_lm=3000)
        for at_x in (1.3, 3.7)
    ]
    reflectance = np.array(paints)[member]
    hue = cones_of_light(lamps[0].flux, lamp_spectrum("D65").spectrum, COLOR_GRID_NM, tristimulus_table())
    straight, shares = lamp_light(scan, lamps, folder), exchange(scan)
    cones = cones_of_srgb(reflectance)
    light = np.stack([all_light(shares, cones[:, n], straight * hue[n]) for n in range(3)], axis=1)
    return scan, lamps, reflectance, light


@pytest.mark.parametrize("degree", [0.3, 0.6, 1.0])
def test_hues_are_told_however_far_the_camera_balances_warm_light(tmp_path: Path, degree: float) -> None:
    """With a balance of .3 the blue of grey walls came out at less than half of what it is."""
    scan, lamps, reflectance, light = warm_room(tmp_path)
    white = light.mean(axis=0) / light.mean()
    shown = srgb_of_cones(cones_of_srgb(reflectance) * light / white**degree)
    color = encode_srgb(np.clip(0.55 * shown / np.quantile(shown.max(axis=1), 0.97), 0.0, 1.0))
    appearance = replace(
        scan.appearance, corner_color=np.repeat(color[:, None], 3, axis=1), known=True, color_source=None
    )
    picture = replace(scan, appearance=appearance)
    found = take_light_out(picture, find_room(picture), lamps, workers=1)
    assert found.face_color is not None
    hue = np.log(found.face_color / reflectance)
    blue_over_red = np.average(hue[:, 2] - hue[:, 0], weights=scan.areas)
    assert abs(blue_over_red) < 0.3
    assert np.average(np.abs(found.face_color - reflectance).mean(axis=1), weights=scan.areas) < 0.07
