"""The textures that the frames' claim is tried against: gains as a panorama's software compensates them."""

import numpy as np
import pytest

from research.benchmarks.blended_texture import pairwise_gains


def test_gains_are_found_along_a_chain_of_pictures_that_show_other_places() -> None:
    random = np.random.default_rng(3)
    true = random.normal(size=(6, 3))
    light = random.uniform(0.05, 0.5, size=(60, 3))
    shown = np.exp(true)[:, None] * light
    for frame in range(6):
        seen = slice(8 * frame, 8 * frame + 16)  # half of it is what the next one shows
        shown[frame, np.setdiff1d(np.arange(60), np.arange(60)[seen])] = np.nan
    assert pairwise_gains(shown) == pytest.approx(true - true.mean(axis=0), abs=1e-6)


def test_gains_are_the_best_for_all_pairs_where_a_curve_lets_none_fit_them_all() -> None:
    random = np.random.default_rng(4)
    shown = random.uniform(0.05, 0.5, size=(4, 40, 3))
    shown[random.random((4, 40)) < 0.3] = np.nan

    def misfit(gain: np.ndarray) -> float:
        apart = np.log(shown) - gain[:, None]
        pairs = apart[:, None] - apart[None]
        means, common = np.nanmean(pairs, axis=2), np.isfinite(pairs).sum(axis=2)
        return float((common * means**2).sum())

    best = pairwise_gains(shown)
    assert all(misfit(best) < misfit(best + 0.01 * random.normal(size=(4, 3))) for _ in range(50))
