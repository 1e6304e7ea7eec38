"""Pixels' classes reach the faces they show, geometry and neighbours decide what they leave open."""

import numpy as np
import pytest

from lidarspectra.errors import MaterialError
from lidarspectra.material.segmentation.face_groups import agreement, face_adjacency
from lidarspectra.material.segmentation.fusion import FaceClasses, fuse, split_by_class, view_votes
from lidarspectra.material.segmentation.place_priors import KINDS, PRIORS, class_prior, find_places
from lidarspectra.material.segmentation.segmentation import Classifier
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import linear_srgb_to_lab

from .conftest import COLORS, box_scan
from .tiny_models import write_model

CLASSES = ("painted", "carpet", "wood")


@pytest.fixture(scope="module")
def room():
    scan, part = box_scan()
    views = render_views(scan, settings=ViewSettings(width=96, height=96, samples=1, sample_spacing_m=0.3))
    return scan, part, views, find_room(scan)


@pytest.fixture(scope="module")
def neighbors(room):
    scan, part, _, _ = room
    lab = linear_srgb_to_lab(np.array(list(COLORS.values())))[part]
    return agreement(face_adjacency(scan), lab, scan.normals)


def classes_of(belief, votes=100.0):
    belief = np.asarray(belief, dtype=float)
    return FaceClasses(classes=CLASSES, belief=belief, votes=np.full(len(belief), votes))


def test_a_face_hears_the_pixels_that_show_it(room, tmp_path):
    scan, part, views, _ = room
    votes = view_votes(Classifier(write_model(tmp_path / "m.onnx", size=16, stride=16, card=CARD_16)), scan, views)
    seen = votes.votes > 3.0
    assert seen.mean() > 0.9
    # The floor is blue and the walls are orange; near an edge a square of 16 pixels shows both.
    assert (votes.best[seen & (part == 0)] == 2).mean() > 0.8
    assert (votes.best[seen & (part == 2)] == 0).mean() > 0.8
    assert np.allclose(votes.belief.sum(axis=1), 1.0)


CARD_16 = """
classes = ["red", "green", "blue"]
input_px = 16
stride_px = 16
scale = 0.05
"""


def test_views_of_another_scan_are_refused(room, tmp_path):
    _, _, views, _ = room
    with pytest.raises(MaterialError, match="views of this scan"):
        view_votes(Classifier(write_model(tmp_path / "m.onnx")), box_scan(cells=2)[0], views)


def test_faces_that_no_view_shows_take_their_neighbours_class(room, neighbors):
    _, part, _, _ = room
    belief = np.full((len(part), 3), 1 / 3)
    belief[part == 0] = (0.1, 0.8, 0.1)
    votes = np.full(len(part), 100.0)
    hidden = np.flatnonzero(part == 0)[::3]
    belief[hidden], votes[hidden] = 1 / 3, 0.0
    fused = fuse(FaceClasses(classes=CLASSES, belief=belief, votes=votes), neighbors)
    assert (fused.best[hidden] == 1).all()


def test_scattered_wrong_faces_are_smoothed_away(room, neighbors):
    _, part, _, _ = room
    right = np.where(part == 0, 1, 0)
    said = np.where(np.random.default_rng(0).random(len(part)) < 0.15, 2, right)
    belief = np.full((len(part), 3), 0.2)
    belief[np.arange(len(part)), said] = 0.6
    assert (fuse(classes_of(belief), neighbors).best == right).mean() > 0.97


def test_where_the_picture_says_nothing_geometry_decides(room, neighbors):
    scan, part, _, found = room
    prior = class_prior(find_places(scan, found, face_adjacency(scan)), CLASSES)
    fused = fuse(classes_of(np.full((len(part), 3), 1 / 3)), neighbors, prior)
    assert (fused.best[part == 1] == 0).all()
    assert (fused.best[part == 2] == 0).all()
    assert (fused.best[part == 0] != 0).all()


@pytest.mark.parametrize(("painted", "wanted"), [(0.5, 2), (0.9, 0)])
def test_a_picture_that_is_sure_decides_between_what_geometry_leaves_open(neighbors, painted, wanted):
    count = neighbors.shape[0]
    prior = np.tile([painted, 0.02, 0.98 - painted], (count, 1))
    belief = np.tile([0.02, 0.02, 0.96], (count, 1))
    assert (fuse(classes_of(belief), neighbors, prior).best == wanted).all()


def test_faces_of_a_box_are_floor_ceiling_and_walls(room):
    scan, part, _, found = room
    places = find_places(scan, found, face_adjacency(scan))
    wanted = np.array([KINDS.index("floor"), KINDS.index("ceiling"), KINDS.index("wall")])[part]
    assert (places.kind == wanted).all()
    assert np.isclose(places.patch_m2[part == 0].max(), 12.0)


def test_priors_are_probabilities_for_any_classes(room):
    scan, _, _, found = room
    places = find_places(scan, found, face_adjacency(scan))
    assert all(sum(named.values()) < 0.99 for named in PRIORS.values())  # something is left to what is not named
    for classes in (CLASSES, ("velvet", "painted", "sky"), ("a", "b")):
        prior = class_prior(places, classes)
        assert np.allclose(prior.sum(axis=1), 1.0)
        assert (prior > 0).all()


def test_a_colour_group_of_two_classes_becomes_two_segments():
    label = np.array([0, 0, 0, 0, 1, 1, -1])
    belief = np.array([[0.8, 0.1, 0.1]] * 2 + [[0.1, 0.1, 0.8]] * 2 + [[0.1, 0.8, 0.1]] * 3)
    found, count, names = split_by_class(label, classes_of(belief), np.array([3.0, 3, 1, 1, 9, 1, 1]), most=9)
    assert count == 3
    assert names == ("carpet", "painted", "wood")
    assert found.tolist() == [1, 1, 2, 2, 0, 0, -1]


def test_a_class_that_holds_little_of_a_colour_group_is_no_segment():
    label = np.zeros(4, dtype=int)
    belief = np.array([[0.8, 0.1, 0.1]] * 3 + [[0.1, 0.3, 0.6]])
    found, count, names = split_by_class(label, classes_of(belief), np.array([3.0, 3, 3, 0.2]), most=9)
    assert (count, names) == (1, ("painted",))
    assert (found == 0).all()


def test_small_groups_keep_their_likeliest_class():
    belief = [[0.2, 0.5, 0.3]] * 2
    found, count, names = split_by_class(np.zeros(2, dtype=int), classes_of(belief), np.full(2, 1e-3), most=9)
    assert (count, names) == (1, ("carpet",))
    assert (found == 0).all()


def test_no_more_segments_than_asked_for_and_the_largest_parts_first():
    label = np.array([0, 0, 1, 1])
    belief = np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.8, 0.1, 0.1], [0.1, 0.1, 0.8]])
    areas = np.array([9.0, 2.0, 9.0, 3.0])
    _, count, names = split_by_class(label, classes_of(belief), areas, most=3)
    assert count == 3
    assert names.count("painted") == 2
    assert names[2] == "wood"
    assert split_by_class(label, classes_of(belief), areas, most=1)[1] == 2  # each colour stays a segment
