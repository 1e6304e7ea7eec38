"""Surfaces sorted by plane and hue: the same groups, whatever the seed and the round-off."""

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.delighting import surface_hues

COUNT = 3_000


def groups(colors: FloatArray) -> IntArray:
    """Of points on a floor."""
    generator = np.random.default_rng(5)
    positions = np.column_stack([generator.uniform(0.0, 4.0, (COUNT, 2)), np.zeros(COUNT)])
    normals = np.tile([0.0, 0.0, 1.0], (COUNT, 1))
    return surface_hues.surface_groups(colors, positions, normals, np.ones(COUNT, dtype=np.bool_), turn_deg=0.0)


@pytest.fixture(params=range(3))
def colors(request: pytest.FixtureRequest) -> FloatArray:
    """Of a dozen paints, more than groups: which of them are put together is what may tip."""
    generator = np.random.default_rng(request.param)
    paints = generator.uniform(0.1, 0.8, (12, 3))
    paint = generator.choice(12, COUNT, p=generator.dirichlet(np.ones(12)))
    return np.asarray(paints[paint] * np.exp(0.1 * generator.standard_normal((COUNT, 3))), dtype=np.float64)


def test_surfaces_are_sorted_alike_whatever_the_seed(colors: FloatArray, monkeypatch: pytest.MonkeyPatch) -> None:
    first = groups(colors)
    for seed in range(4):
        monkeypatch.setattr(surface_hues, "SEED", seed)
        assert adjusted_rand_score(first, groups(colors)) > 0.95


def test_round_off_in_a_texture_changes_hardly_a_group(colors: FloatArray) -> None:
    levels = np.random.default_rng(7).integers(-1, 2, colors.shape)
    assert adjusted_rand_score(groups(colors), groups(colors + levels / 255.0)) > 0.9


PAINTS = np.array(
    [
        [0.7, 0.7, 0.7],
        [0.6, 0.1, 0.1],
        [0.1, 0.5, 0.1],
        [0.1, 0.1, 0.6],
        [0.6, 0.5, 0.1],
        [0.1, 0.5, 0.5],
        [0.5, 0.1, 0.5],
    ]
)  # [1] seven hues


def test_as_many_hues_as_a_room_has_are_told_apart_and_brightness_is_not() -> None:
    paint = np.arange(COUNT) % len(PAINTS)
    dimmed = PAINTS[paint] * np.where(np.arange(COUNT) < COUNT // 2, 1.0, 0.5)[:, None]
    assert adjusted_rand_score(groups(dimmed), paint) == pytest.approx(1.0)


def test_hues_that_cover_much_are_told_apart_before_those_that_cover_little() -> None:
    """Seven greys that a picture can tell, on nearly all of a room, and three strong colours on a few points of it."""
    warmth = np.linspace(-0.45, 0.45, 7)[:, None] * [1.0, 0.0, -1.0]
    common, rare = 0.4 * np.exp(warmth), np.array([[0.1, 0.5, 0.1], [0.1, 0.35, 0.1], [0.1, 0.2, 0.1]])
    paint = np.concatenate([np.arange(COUNT - 81) % 7, 7 + np.arange(81) % 3])
    found = groups(np.concatenate([common, rare])[paint])
    assert all(np.unique(found[paint == one]).size == 1 for one in range(7))
    assert np.unique(found[paint < 7]).size >= 6  # unweighted, the strong colours take three of seven groups


def test_only_what_lies_in_one_plane_of_the_room_and_looks_one_way_is_grouped() -> None:
    count = 100
    generator = np.random.default_rng(6)
    flat = np.column_stack([generator.uniform(0.0, 4.0, (count, 2)), np.zeros(count)])
    up, slanted = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.6, 0.8])
    parts = [(flat, up), (flat + [0.0, 0.0, 0.75], up), (flat + [0.0, 0.0, 0.02], -up), (flat, slanted)]
    positions = np.concatenate([places for places, _ in parts])
    normals = np.repeat([normal for _, normal in parts], count, axis=0)
    color = np.tile([0.5, 0.5, 0.5], (len(positions), 1))
    usable = np.ones(len(positions), dtype=np.bool_)
    found = surface_hues.surface_groups(color, positions, normals, usable, turn_deg=0.0).reshape(4, count)
    assert all(np.unique(part).size == 1 for part in found)
    floor, table, below, slope = found[:, 0].tolist()
    assert len({floor, table, below}) == 3
    assert min(floor, table, below) >= 0
    assert slope == -1
