"""Factors on the parts of a room hold for its paints, and not for what is no paint."""

import numpy as np
import pytest

from lidarspectra.errors import MaterialError
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.pane_materials import pane_material
from lidarspectra.material.part_materials import typical_material
from lidarspectra.material.scaled import scaled_materials


def wall_with(*panes: str) -> MaterialMap:
    """A wall of two faces, and a face of each pane in it."""
    materials = (typical_material("wall"), *(pane_material(kind, name=kind) for kind in panes))  # type: ignore[arg-type]
    count = 2 + len(panes)
    return MaterialMap(
        materials=materials,
        face_material=np.array([0, 0, *range(1, len(materials))]),
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )


def test_a_mirror_or_screen_on_a_wall_that_is_lighter_than_it_was_estimated_stays_what_it_is() -> None:
    before = wall_with("mirror", "screen", "glass")
    after = scaled_materials(before, np.array([0, 1, 0, 0, 0]), np.array([1.3, 0.9]))
    values = [float(after.materials[number].reflectance.values[0]) for number in after.face_material]
    assert values == pytest.approx([1.3 * 0.65, 0.9 * 0.65, 0.85, 0.06, 0.15])
    wall = after.materials[after.face_material[0]]
    assert wall.uncertainty is not None
    assert wall.uncertainty.values[0] == pytest.approx(1.3 * 0.15)


def test_factors_that_are_none_are_refused() -> None:
    with pytest.raises(MaterialError, match="factors above 0"):
        scaled_materials(wall_with(), np.array([0, 0]), np.array([0.0]))
