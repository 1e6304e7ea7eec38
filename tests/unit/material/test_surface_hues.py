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
