"""Sharing out samples, and keeping running means of batches."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.engine.bands import band_groups
from lidarspectra.radiance.engine.engine import EngineRun
from lidarspectra.radiance.engine.options import PassOptions
from lidarspectra.radiance.sampling import estimator, rounds
from lidarspectra.radiance.sampling.estimator import (
    BATCHES,
    FALL,
    Component,
    Task,
    band_variance,
    make_tasks,
    smooth_over_neighbours,
    take_answer,
    task_job,
    wanted_samples,
)
from lidarspectra.radiance.sampling.receptors import FIBONACCI, cone_receptor, cosine_receptor
from lidarspectra.radiance.sampling.request import Log, Request
from lidarspectra.radiance.sampling.rounds import share_done
from lidarspectra.radiance.sampling.running_means import Batches, Weights
from lidarspectra.radiance.sampling.samplers import DIRECT, OFTEN, ONCE, REFLECTED_VIEW, VIEW, Kind, samplers_of
from lidarspectra.radiance.sampling.sensor_rays import Sensors

SAMPLERS = {sampler.kind: sampler for sampler in (DIRECT, ONCE, OFTEN, VIEW)}
GROUP = band_groups(3, "native")[0]
SAME = np.ones((2, 3))  # true flux over the written one, of two lamps in three slots


def weights(flux_ratio: FloatArray) -> Weights:
    """Of lamps of one unit, each slot a channel."""
    lamps = len(flux_ratio)
    folding = np.broadcast_to(np.eye(3), (lamps, 3, 3))
    return Weights(
        written=np.ones((lamps, 3)), flux_ratio=flux_ratio, shares=np.eye(3), folding=folding, flux=flux_ratio
    )


def component(points: int, kind: Kind = "once", flux_ratio: FloatArray = SAME, **more: Any) -> Component:
    return Component(
        sampler=SAMPLERS[kind],
        options=PassOptions(
            group=GROUP, lamp_modifiers=("lamp0", "lamp1"), octree="pass0.oct", bounces=3, lamp_count=2
        ),
        lamps=(0, 1),
        slots=(0, 1, 2),
        means=Batches(weights=weights(flux_ratio), mean=np.zeros((BATCHES, 2, points, 3))),
        **({"samples": np.full(points, 8), "seconds": 1.0, "sampled": 8 * BATCHES * points} | more),
    )


def kept(part: Component) -> NDArray[np.float32]:
    """(batch, lamp, point, slot) running means."""
    assert isinstance(part.means, Batches)
    return part.means.mean


def sensors(points: int) -> Sensors:
    places = np.stack([np.arange(points, dtype=float), np.zeros(points), np.zeros(points)], axis=1)
    return Sensors(positions=places, normals=np.tile([0.0, 0.0, 1.0], (points, 1)), receptor=cosine_receptor())


def predicted(parts, variances, wanted) -> float:
    """Mean over points of the variance that the wanted samples should leave."""
    return sum(
        float(np.mean(variance * (part.samples / (part.samples + more)) ** FALL))
        for part, variance, more in zip(parts, variances, wanted, strict=True)
    )


def test_wanted_samples_reach_the_target_within_a_step_of_sizes() -> None:
    generator = np.random.default_rng(1)
    parts = [component(200, "direct"), component(200)]
    variances = [generator.exponential(1.0, 200), generator.exponential(10.0, 200)]
    wanted = wanted_samples(parts, variances, points=200, target=0.5)
    assert 0.3 < predicted(parts, variances, wanted) < 0.7  # sizes are a factor of up to 2 apart


def test_what_has_more_than_its_share_keeps_it_and_the_rest_makes_up_for_it() -> None:
    """Dear rays that hold most of the variance allowed, and many unlike points of cheap ones that get what is left."""
    dear, cheap = component(400, "direct", seconds=1e4), component(400)
    variances = [np.full(400, 0.4), np.random.default_rng(2).exponential(20.0, 400)]
    wanted = wanted_samples([dear, cheap], variances, points=400, target=0.5)
    assert not wanted[0].any()
    assert predicted([dear, cheap], variances, wanted) == pytest.approx(0.5, abs=0.015)


def test_points_of_more_variance_get_more_samples() -> None:
    part = component(3)
    (wanted,) = wanted_samples([part], [np.array([1.0, 10.0, 100.0])], points=3, target=0.5)
    assert wanted[0] < wanted[1] < wanted[2]


def test_a_cheaper_component_gets_more_samples() -> None:
    dear, cheap = component(5, seconds=16.0), component(5, seconds=1.0)
    dear_wanted, cheap_wanted = wanted_samples([dear, cheap], [np.ones(5), np.ones(5)], points=5, target=0.1)
    assert np.all(cheap_wanted > 2 * dear_wanted)


def test_nothing_is_wanted_once_the_target_holds() -> None:
    part = component(4)
    (wanted,) = wanted_samples([part], [np.full(4, 0.1)], points=4, target=0.2)
    assert not wanted.any()


def test_points_without_variance_want_nothing() -> None:
    (wanted,) = wanted_samples([component(3)], [np.array([0.0, 1.0, 0.0])], points=3, target=0.01)
    assert wanted[0] == wanted[2] == 0 < wanted[1]


def test_what_is_wanted_is_a_size_that_the_estimator_has() -> None:
    (wanted,) = wanted_samples([component(50)], [np.geomspace(1e-3, 1e3, 50)], points=50, target=0.5)
    assert set(wanted) <= {0, *FIBONACCI}


def test_a_channel_whose_slots_are_divided_among_passes_comes_down_to_the_target_as_a_whole() -> None:
    points, slots, target = 40, 12, 0.01
    generator = np.random.default_rng(5)
    spread = np.sqrt(0.7 * BATCHES) * target  # of one batch: each part holds seven tenths of what all may have
    parts = []
    for number in range(slots // 3):
        folding = np.ones((1, 3, 1))
        carried = Weights(written=np.ones((1, 3)), flux_ratio=np.ones((1, 3)), shares=np.ones((3, 1)), folding=folding,
                          flux=np.ones((1, 1)))  # fmt: skip
        noise = generator.normal(size=(BATCHES, 1, points, 1))
        noise = (noise - noise.mean(axis=0)) / noise.std(axis=0, ddof=1)
        mean = np.broadcast_to(1.0 / slots + spread / 3.0 * noise, (BATCHES, 1, points, 3)).astype(np.float32)
        three = tuple(range(3 * number, 3 * number + 3))
        parts.append(replace(component(points), slots=three, lamps=(0,), means=Batches(weights=carried, mean=mean)))
    scene = cast(Any, SimpleNamespace(slots=SimpleNamespace(matrix=np.ones((slots, 1)))))
    counted = np.ones(points, dtype=np.bool_)
    wanted = rounds._missing(scene, parts, sensors(points), counted, np.ones(1), target)
    left = predicted(parts, [band_variance(part)[:, 0] for part in parts], wanted)
    assert left < 1.05 * target**2


def test_paths_that_all_points_share_are_wanted_as_one_number() -> None:
    alone, shared = component(50), component(50, "often", samples=np.array([8]))
    single, common = wanted_samples([alone, shared], [np.ones(50), np.array([50.0])], points=50, target=0.5)
    assert single.shape == (50,)
    assert common.shape == (1,)
    assert common[0] > single.max()  # one path of it serves fifty points


def test_running_means_weigh_by_samples() -> None:
    part = component(2)
    part.samples[:] = 0
    everywhere = np.arange(2)
    part.add(everywhere, 8, np.full((BATCHES, 2, 2, 3), 1.0))
    part.add(np.array([1]), 24, np.full((BATCHES, 2, 1, 3), 5.0))
    assert part.samples.tolist() == [8, 32]
    assert np.all(kept(part)[:, :, 0] == 1.0)
    assert kept(part)[:, :, 1] == pytest.approx((8 * 1.0 + 24 * 5.0) / 32)


def test_tasks_cover_every_wanting_point_once() -> None:
    part = component(100)
    wanted = np.where(np.arange(100) % 3 == 0, 0, np.where(np.arange(100) % 3 == 1, 8, 34))
    tasks = list(
        make_tasks(part, wanted, sensors(100), rays_per_job=34 * BATCHES * 5, generator=np.random.default_rng(1))
    )
    assert sorted(np.concatenate([task.points for task in tasks]).tolist()) == np.flatnonzero(wanted).tolist()
    assert all(np.all(wanted[task.points] == task.size) for task in tasks)
    assert max(task.points.size * task.size for task in tasks) <= 34 * 5


def test_a_point_that_wants_more_than_a_job_gets_a_job_of_its_own() -> None:
    part = component(2)
    tasks = list(
        make_tasks(part, np.array([987, 987]), sensors(2), rays_per_job=10, generator=np.random.default_rng(1))
    )
    assert [task.points.tolist() for task in tasks] == [[0], [1]]


def shared_tasks(rays: int, workers: int, monkeypatch: pytest.MonkeyPatch, *, seed: int = 1) -> tuple[list[Task], int]:
    """Tasks of one leg of so many shared rays, and a number that the generator draws after them."""
    leg = SimpleNamespace(rays=np.zeros((rays, 6)))
    monkeypatch.setattr(estimator, "draw_pooled_paths", lambda *_, **__: SimpleNamespace(missing=rays, legs=[leg]))
    part = component(3, "often", samples=np.zeros(1, dtype=np.int64), surfaces=SimpleNamespace())
    generator = np.random.default_rng(seed)
    given = make_tasks(part, np.array([8]), sensors(3), rays_per_job=2**15, workers=workers, generator=generator)
    return list(given), int(generator.integers(2**40))


def test_a_lone_job_of_shared_paths_is_cut_evenly_for_all_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    tasks, after = shared_tasks(16_501, 3, monkeypatch)
    assert [(task.part.start, task.part.stop) for task in tasks] == [(0, 5500), (5500, 11001), (11001, 16501)]
    assert len({task.burn for task in tasks}) == 3  # jobs of one second must not be in step
    (alone,), after_alone = shared_tasks(16_501, 1, monkeypatch)
    assert (alone.part.start, alone.part.stop, alone.burn) == (0, 16_501, tasks[0].burn)
    assert after == after_alone  # nothing that is drawn depends on the workers


def test_what_is_burned_by_parts_of_shared_paths_is_any_of_64_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = [task for seed in range(300) for task in shared_tasks(16_501, 3, monkeypatch, seed=seed)[0]]
    assert {task.burn for task in tasks} == set(range(1, 65))


@pytest.mark.parametrize(("rays", "workers", "count"), [(8_191, 2, 1), (8_192, 2, 2), (8_192, 0, 1), (40_000, 2, 2)])
def test_shared_paths_are_cut_only_where_each_process_gets_enough(
    rays: int, workers: int, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks, _ = shared_tasks(rays, workers, monkeypatch)
    assert len(tasks) == count  # the last are two jobs as it is
    assert sum(task.rays for task in tasks) == rays


@pytest.mark.parametrize(("wanted", "cut_for"), [((8, 0), 4), ((8, 8), 2), ((0, 0), 4)])
def test_workers_are_shared_by_the_components_that_want_samples(
    wanted: tuple[int, int], cut_for: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def no_tasks(*_: Any, workers: int = 1, **__: Any) -> Iterator[Task]:
        asked.append(workers)
        return iter(())

    monkeypatch.setattr(rounds, "make_tasks", no_tasks)
    request = cast(Request, SimpleNamespace(workers=4, engine=SimpleNamespace(run_jobs=lambda jobs, **_: list(jobs))))
    rounds._sample(
        [component(3), component(3)],
        [np.full(3, more) for more in wanted],
        sensors(3),
        cast(Any, SimpleNamespace(folder=Path())),
        request,
        generator=np.random.default_rng(1),
        log=Log(),
        progress=lambda *_: None,
    )
    assert asked == [cut_for, cut_for]


def test_answers_go_to_their_points_lamps_and_bands() -> None:
    part = component(3)
    part.samples[:] = 0
    task = Task(component=part, points=np.array([2, 0]), size=8, burn=0)
    wanted = np.arange(2 * BATCHES * 2 * 3, dtype=np.float32).reshape(2, BATCHES, 2, 3)  # point batch lamp slot
    run = EngineRun(argv=("rcontrib",), status=0, stderr="", seconds=1.0, output=wanted.tobytes())
    take_answer(task, run, sensors(3), generator=np.random.default_rng(1))
    for row, point in enumerate((2, 0)):
        assert kept(part)[:, :, point] == pytest.approx(np.pi * wanted[row][..., ::-1])  # slots come long end first
    assert np.all(kept(part)[:, :, 1] == 0.0)
    assert part.samples.tolist() == [8, 0, 8]


def test_a_direct_job_burns_its_first_results() -> None:
    part = component(2, "direct")
    task = Task(component=part, points=np.array([0, 1]), size=2, burn=3)
    job = task_job(task, sensors(2), folder=None, generator=np.random.default_rng(1))  # type: ignore[arg-type]
    rays = np.frombuffer(job.stdin).reshape(-1, 6)
    assert len(rays) == 3 * 2 + 2 * BATCHES * 2
    assert np.all(rays[: 3 * 2] == rays[0])
    assert np.all(rays[6 + BATCHES * 2 :, 0] == 1.0)


@pytest.mark.parametrize("kind", ["direct", "once", "view"])
def test_every_job_throws_results_away_so_that_none_uses_another_s_numbers_in_step(kind: Kind) -> None:
    # Within a second the engine's numbers are the same for all jobs; a lone sensor's batches then erred alike, and its
    # error bar came out a third too small.
    part, given = component(60, kind), sensors(60)
    generator = np.random.default_rng(1)
    tasks = list(make_tasks(part, np.full(60, 8), given, rays_per_job=8 * BATCHES, generator=generator))
    assert len({task.burn for task in tasks}) > 4
    assert min(task.burn for task in tasks) > 0
    for task in tasks[:3]:
        rays = np.frombuffer(task_job(task, given, None, generator=generator).stdin).reshape(-1, 6)  # type: ignore[arg-type]
        assert len(rays) == 8 * (task.burn + BATCHES)
        assert np.all(rays[8 * task.burn :, :2].round() == given.positions[task.points, :2])


def test_the_variance_is_that_of_the_sum_over_lamps() -> None:
    # Lamps whose batches move against one another: their sum does not vary at all.
    part = component(1)
    swing = np.arange(BATCHES, dtype=float)[:, None, None]
    kept(part)[:, 0], kept(part)[:, 1] = swing, -swing
    assert np.all(band_variance(part) == 0.0)
    first = component(1, flux_ratio=np.array([[1.0] * 3, [0.0] * 3]))
    kept(first)[...] = kept(part)
    alone = band_variance(first)
    assert alone == pytest.approx(swing.var(ddof=1) / BATCHES)


def test_smoothing_averages_over_the_nearest_points() -> None:
    values = np.zeros(100)
    values[50] = 9.0
    smoothed = smooth_over_neighbours(values, sensors(100))
    assert smoothed[50] == pytest.approx(1.0)
    assert smoothed[20] == 0.0
    assert smooth_over_neighbours(np.array([3.0]), sensors(1)) == pytest.approx(3.0)


def test_the_share_that_is_done_counts_what_is_wanted_at_the_price_of_what_was_taken() -> None:
    cheap, dear = component(10, "direct", seconds=1.0), component(10, seconds=3.0)
    as_many = [np.full(10, 8), np.full(10, 8)]  # as were taken so far
    assert share_done([cheap, dear], as_many) == pytest.approx(0.5)
    assert share_done([cheap, dear], [np.full(10, 8), np.zeros(10, dtype=np.int64)]) == pytest.approx(4.0 / 5.0)


def test_where_many_passes_add_up_a_single_direction_of_each_may_do() -> None:
    alone, shared = component(4), component(4, sharers=16)
    assert alone.sizes[0] == FIBONACCI[0]
    assert shared.sizes[0] == 1
    assert set(alone.sizes) < set(shared.sizes)
    assert component(4, "often", sharers=16).sizes == FIBONACCI


def test_the_samplers_of_a_receptor_make_up_its_light() -> None:
    options = component(1).options
    for all_cast in (True, False):
        samplers = samplers_of(cosine_receptor(), all_cast=all_cast)
        assert [sampler.bounces(options) for sampler in samplers] == [3, 1, 3]
    assert samplers_of(cone_receptor(20.0), all_cast=False) == (VIEW,)
    assert samplers_of(cone_receptor(20.0), all_cast=True) == (DIRECT, REFLECTED_VIEW)
    assert [sampler.kind for sampler in SAMPLERS.values() if sampler.lamps_visible] == ["view"]
    assert DIRECT.measure_sr(cosine_receptor()) == 1.0  # the engine's answer is irradiance
    assert ONCE.measure_sr(cosine_receptor()) == pytest.approx(np.pi)  # a mean radiance
