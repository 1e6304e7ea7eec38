"""The target of noise asked of each point's own light."""

from collections.abc import Sequence

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.radiance.engine.bands import band_groups
from lidarspectra.radiance.engine.options import PassOptions
from lidarspectra.radiance.sampling import own_light
from lidarspectra.radiance.sampling.estimator import BATCHES, Component
from lidarspectra.radiance.sampling.own_light import samples_for_each_point
from lidarspectra.radiance.sampling.running_means import Batches, Weights
from lidarspectra.radiance.sampling.samplers import DIRECT, OFTEN, ONCE, VIEW, Kind
from lidarspectra.radiance.sampling.stated_error import own_relative_se

SAMPLERS = {sampler.kind: sampler for sampler in (DIRECT, ONCE, OFTEN, VIEW)}
GROUP = band_groups(3, "native")[0]
POINTS = 40
ONES = np.ones((1, 3))
NO_LIGHT = Weights(written=ONES, flux_ratio=ONES, shares=np.eye(3), folding=np.eye(3)[np.newaxis], flux=ONES)


def component(kind: Kind, *, samples: int = 34, seconds: float = 1.0) -> Component:
    units = 1 if kind == "often" else POINTS
    return Component(
        sampler=SAMPLERS[kind],
        options=PassOptions(group=GROUP, lamp_modifiers=("lamp0",), octree="pass0.oct", bounces=3, lamp_count=1),
        lamps=(0,),
        slots=(0, 1, 2),
        means=Batches.empty(NO_LIGHT, batches=BATCHES, points=POINTS),
        samples=np.full(units, samples),
        seconds=seconds,
        sampled=samples * BATCHES * units,
    )


def left(parts: Sequence[Component], variances: Sequence[FloatArray], wanted: Sequence[IntArray]) -> FloatArray:
    """(point,) variance that the wanted samples should leave."""
    terms = [
        variance * part.samples / (part.samples + more)
        for part, variance, more in zip(parts, variances, wanted, strict=True)
    ]
    return np.sum(terms, axis=0)


def test_the_error_of_a_point_is_over_its_own_light_in_its_worst_band() -> None:
    error = np.array([[0.1, 0.1], [0.1, 0.1], [0.0, 0.1]])
    light = np.array([[1.0, 10.0], [0.2, 1.0], [0.0, 1.0]])
    assert own_relative_se(error, light) == pytest.approx([0.1, 0.5, 0.1])
    assert own_relative_se(np.zeros((2, 2)), np.zeros((2, 2))).tolist() == [0.0, 0.0]  # the dark wants nothing


def test_every_point_comes_down_to_the_target_and_none_far_below_it() -> None:
    generator = np.random.default_rng(1)
    parts = [component("direct"), component("once"), component("often", samples=144)]
    variances = [generator.uniform(0.5, 4.0, POINTS) for _ in parts]
    wanted = samples_for_each_point(parts, variances, target=1.5)
    rest = left(parts, variances, wanted)
    # A step to the nearest size may leave a factor sqrt(4) with direct light, sqrt(1.62) with the others.
    assert rest.max() < 1.5 * 1.6
    assert np.median(rest) > 1.5 / 2.5


def test_points_without_excess_ask_for_nothing_of_their_own() -> None:
    parts = [component("once"), component("often", samples=144)]
    variances = [np.zeros(POINTS), np.zeros(POINTS)]
    variances[0][7] = 4.0
    alone, shared = samples_for_each_point(parts, variances, target=0.5)
    assert np.flatnonzero(alone).tolist() == [7]
    assert not shared.any()


def test_one_noisy_point_is_helped_by_its_own_samples_and_many_by_shared_ones() -> None:
    # The same price of a sample: shared ones that halve the error of 40 points buy 40 times as much.
    parts = [component("once"), component("often", seconds=1.0 / POINTS)]
    everywhere = [np.full(POINTS, 2.0), np.full(POINTS, 2.0)]
    here = [np.where(np.arange(POINTS) == 3, each, 0.0) for each in everywhere]
    single, common = samples_for_each_point(parts, everywhere, target=1.0)
    own, shared = samples_for_each_point(parts, here, target=1.0)
    assert common[0] > single.max()
    assert common[0] >= shared[0]
    assert own[3] >= single[3]
    assert not np.delete(own, 3).any()


def test_a_hopeless_point_gets_no_more_than_its_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_light, "MAX_OWN_PATHS", 8 * BATCHES * 34)
    part = component("once")
    variance = np.full(POINTS, 0.1)
    variance[0] = 1e6
    (wanted,) = samples_for_each_point([part], [variance], target=1.0)
    assert 0 < wanted[0] <= 1.3 * 7 * 34  # a step to the nearest size
    assert not wanted[1:].any()
    part.samples[0] = 8 * 34
    (wanted,) = samples_for_each_point([part], [variance], target=1.0)
    assert not wanted.any()


def test_shared_paths_alone_are_raised_until_the_only_wanting_point_has_enough() -> None:
    parts = [component("once"), component("often", samples=144)]
    variances = [np.zeros(POINTS), np.where(np.arange(POINTS) == 3, 8.0, 0.0)]
    rest = left(parts, variances, samples_for_each_point(parts, variances, target=1.0))
    assert 1.0 / 1.3 < rest[3] < 1.3  # a step to the nearest size, of 1.6
