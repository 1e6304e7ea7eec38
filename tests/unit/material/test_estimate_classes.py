"""Segments have a material class: from the model that the run file names, or none at all."""

import numpy as np
import pytest

from lidarspectra.errors import MaterialError
from lidarspectra.material.estimate import UNKNOWN, estimate_materials
from lidarspectra.material.material_map import load_materials, save_materials
from lidarspectra.material.segmentation.segmentation import Classifier
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room

from .conftest import box_scan
from .tiny_models import write_model

COLOR_CARD = """
classes = ["painted", "foliage", "carpet"]
input_px = 16
stride_px = 16
scale = 0.05
"""  # red is paint, blue is carpet


@pytest.fixture(scope="module")
def room():
    scan, part = box_scan(noise=0.05)
    views = render_views(scan, settings=ViewSettings(width=96, height=96, samples=1, sample_spacing_m=0.3))
    return scan, part, views


def test_segments_have_the_class_that_the_named_model_gives(room, tmp_path):
    scan, part, views = room
    write_model(tmp_path / "mine.onnx", size=16, stride=16, card=COLOR_CARD)
    found = estimate_materials(scan, views, model=tmp_path / "mine.onnx")
    category = np.array([material.category for material in found.materials])[found.face_material]
    assert (category[part == 0] == "carpet").mean() > 0.9
    assert (category[part == 2] == "painted").mean() > 0.9
    save_materials(found, tmp_path, face_areas=scan.areas)
    assert [m.category for m in load_materials(tmp_path).materials] == [m.category for m in found.materials]


def test_without_a_model_classes_stay_unknown_and_spectra_are_what_the_colors_say(room):
    scan, _, views = room
    found = estimate_materials(scan, views, model=None)
    assert {material.category for material in found.materials} == {UNKNOWN}
    assert len(found.materials) == 3


def test_the_shipped_model_gives_its_own_classes_and_no_colour_is_lost(room):
    scan, part, views = room
    found = estimate_materials(scan, views, room=find_room(scan))
    assert {material.category for material in found.materials} <= set(Classifier().classes)
    assert len(found.materials) < 10
    for number in range(3):  # no segment joins two colours
        own = set(found.face_material[part == number])
        assert not own & set(found.face_material[part != number])


def test_a_ceiling_seen_as_nothing_in_particular_is_painted(room, tmp_path):
    scan, part, views = room
    write_model(tmp_path / "blind.onnx", size=16, stride=16, gain=0.0, card=COLOR_CARD)
    found = estimate_materials(scan, views, model=tmp_path / "blind.onnx", room=find_room(scan))
    assert {found.materials[n].category for n in found.face_material[part == 1]} == {"painted"}


def test_a_model_that_is_missing_is_our_error(room, tmp_path):
    with pytest.raises(MaterialError, match=r"no\.toml"):
        estimate_materials(room[0], room[2], model=tmp_path / "no.onnx")
