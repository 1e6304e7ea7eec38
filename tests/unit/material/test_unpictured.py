"""What an app left black for want of a picture is no black paint."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.unseen_faces import unseen_faces
from lidarspectra.material.views.views import no_views

from .conftest import box_scan


def blackened(scan: Scan, faces: np.ndarray) -> Scan:
    color = scan.appearance.corner_color.copy()
    color[faces] = 0.0
    return replace(scan, appearance=replace(scan.appearance, corner_color=color))


def test_black_to_the_last_level_is_no_photograph_and_takes_what_looks_the_same_way_beside_it() -> None:
    scan, part = box_scan(cells=6)
    holes = np.arange(len(part)) % 7 == 0
    black = blackened(scan, holes)
    assert np.array_equal(black.appearance.unpictured, holes)
    assert np.array_equal(black.appearance.photographed, ~holes)
    _, known = surface_colors(black)
    unseen = unseen_faces(black, known)
    assert np.array_equal(unseen.faces, np.flatnonzero(holes))
    assert np.array_equal(part[unseen.like], part[holes])


def test_the_darkest_level_of_a_picture_is_a_photograph() -> None:
    scan, _ = box_scan(cells=2)
    color = np.zeros_like(scan.appearance.corner_color)
    color[:, 0, 2] = 1.0 / 255.0
    dark = replace(scan, appearance=replace(scan.appearance, corner_color=color))
    assert dark.appearance.photographed.all()
    assert not dark.appearance.darkened(np.ones(len(color), dtype=np.bool_)).photographed.any()


def test_estimates_give_it_the_material_beside_it() -> None:
    scan, part = box_scan(cells=6)
    holes = np.arange(len(part)) % 7 == 0
    views = no_views(len(part), coverage=0.9, why="")
    whole = estimate_materials(scan, views, model=None)
    found = estimate_materials(blackened(scan, holes), views, model=None)
    assert np.array_equal(found.face_material, whole.face_material)
    for one, other in zip(found.materials, whole.materials, strict=True):
        assert one.reflectance.values == pytest.approx(other.reflectance.values, abs=1e-6)
