"""Rooms that the shipped model learns from: what a crop's middle shows is its class, and light falls as it must."""

import numpy as np
import pytest

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from research.training import rooms
from research.training.looks import LOOK_PX, look_at
from research.training.pictures import CLASSES, Picture
from research.training.rooms import NOT_INDOORS, room_pictures

COLORS = {"brick": (200, 30, 30), "wood": (30, 200, 30), "stone": (30, 30, 200)}


@pytest.fixture(scope="module", autouse=True)
def small_views():
    """A ninth of the pixels, to save time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rooms, "VIEW_PX", 128)
        yield


def of_one_color(name):
    return Picture(
        image=np.full((40, 50, 3), COLORS[name], np.uint8), label=CLASSES.index(name), material=name, origin="tile"
    )


@pytest.fixture(scope="module")
def crops(small_views):
    # Of these classes few surfaces are plain (`PLAIN`); those have colours of their own and another material.
    return room_pictures([of_one_color(name) for name in COLORS], 3, np.random.default_rng(0))


def test_a_crop_has_the_class_and_the_material_of_what_its_middle_shows(crops):
    dressed = [crop for crop in crops if crop.material in COLORS]
    assert len(dressed) > 50
    middles = np.array([crop.image[LOOK_PX // 2, LOOK_PX // 2] for crop in dressed]).argmax(axis=1)
    # The lamps' tint moves colours by some per cent, these differ by much more; but a pixel on an edge mixes two.
    assert np.mean(middles == [np.argmax(COLORS[crop.material]) for crop in dressed]) > 0.95
    assert all(crop.label == CLASSES.index(crop.material) for crop in dressed)
    assert {crop.origin for crop in crops} == {"room"}


def test_crops_show_edges_of_two_surfaces(crops):
    kinds = [len(np.unique(crop.image.reshape(-1, 3).argmax(axis=1))) for crop in crops]
    assert np.mean(np.array(kinds) > 1) > 0.3


def test_rooms_come_again_from_the_same_seed_and_differ_for_another():
    first, again, other = (
        room_pictures([of_one_color(name) for name in COLORS], 1, np.random.default_rng(seed)) for seed in (4, 4, 5)
    )
    assert all(np.array_equal(one.image, two.image) for one, two in zip(first, again, strict=True))
    assert not all(np.array_equal(one.image, two.image) for one, two in zip(first, other, strict=True))


def test_what_is_not_found_indoors_covers_nothing():
    hair = Picture(image=np.zeros((40, 40, 3), np.uint8), label=CLASSES.index("hair"), material="hair", origin="drawn")
    found = room_pictures([hair, of_one_color("brick")], 1, np.random.default_rng(1))
    assert {CLASSES[crop.label] for crop in found}.isdisjoint(NOT_INDOORS)


def lamp_over_a_floor(board_height):
    """Irradiance under a lamp at 2 m over a floor, with a small board between at some height, or none."""
    floor = np.array([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    vertices = floor
    if board_height is not None:
        vertices = np.concatenate([floor, 0.02 * floor + [0, 0, board_height]])
        faces = np.concatenate([faces, faces + 4])
    room = rooms.Room(
        caster=RayCaster(bare_scan(vertices, faces)),
        surface=np.zeros(len(faces), dtype=np.int64),
        covers=[of_one_color("brick")],
        px_per_m=np.array([100.0]),
        size=np.array([10.0, 10.0, 3.0]),
        lamps=np.array([[0.0, 0.0, 2.0]]),
        power=np.ones((1, 3)),
        ambient=0.25,
    )
    points, up = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    return rooms.irradiance(room, points, up, np.ones(2, dtype=bool))[:, 0] - 0.25


def test_light_of_a_lamp_falls_with_the_square_of_the_distance_and_the_cosine_and_boards_cast_shadows():
    free, shaded = lamp_over_a_floor(None), lamp_over_a_floor(1.0)
    # 1/d² and cos/d² at 45 degrees; shadow rays start a millimetre off the floor, 0.1 % of the squared distance.
    assert free == pytest.approx([1 / 4, np.sqrt(0.5) / 8], rel=2e-3)
    assert shaded == pytest.approx([0.0, free[1]], abs=1e-12)


def test_looks_at_a_room_differ_in_exposure_and_come_again(crops):
    one, again, other = (look_at(crops[:20], 7, number) for number in (0, 0, 1))
    assert all(np.array_equal(a, b) for a, b in zip(one, again, strict=True))
    assert all(look.shape == (LOOK_PX, LOOK_PX, 3) for look in one)
    levels = np.array([[look.mean() for look in looks] for looks in (one, other)])
    assert np.abs(levels[0] - levels[1]).mean() > 5.0  # of 255; exposures spread by a third of a stop or more
