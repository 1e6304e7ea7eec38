"""One radiometry for all frames: gains, tone curve and vignetting are found from what frames show of common points."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames.gains import Observations, Radiometry, solve_radiometry

FRAMES, POINTS = 40, 1200
VIGNETTING = np.array([-0.1, -0.05])


def observed(
    generator: np.random.Generator,
    *,
    tone: ToneCurve,
    loop: bool = True,
    outliers: float = 0.0,
    told: bool = False,
    spread: float = 0.5,
) -> tuple[Observations, np.ndarray]:
    """Frames along a ring (or a corridor) of points, each seeing a sixth of it, and their true log gains."""
    place = generator.random(POINTS)
    radiance = np.exp(generator.normal(-1.6, 0.5, size=(POINTS, 1)) + generator.normal(0, 0.1, size=(POINTS, 3)))
    middle = np.arange(FRAMES) / FRAMES
    apart = np.abs(place[:, None] - middle[None])
    apart = np.minimum(apart, 1 - apart) if loop else apart
    point, frame = np.nonzero(apart < 1 / 12)
    log_gain = generator.normal(0, spread, size=(FRAMES, 1)) + generator.normal(0, 0.04, size=(FRAMES, 3))
    radius2 = generator.random(point.size)
    fall = np.exp(np.stack([radius2, radius2**2], axis=1) @ VIGNETTING)[:, None]
    light = radiance[point] * np.exp(log_gain[frame]) * fall * np.exp(generator.normal(0, 0.01, size=(point.size, 3)))
    wrong = generator.random(point.size) < outliers
    light[wrong] *= np.exp(generator.normal(0, 0.7, size=(int(wrong.sum()), 1)))
    kept = (light < 0.9).all(axis=1) & (light > 0.01).all(axis=1)
    exposure = log_gain[:, 1] - log_gain[:, 1].mean() if told else np.full(FRAMES, np.nan)
    seen = Observations(
        point=point, frame=frame, shown=tone.shown(light), uneven=np.zeros(point.size), radius2=radius2,
        cell=(8 * place[point]).astype(np.int64), frames=FRAMES, points=POINTS, exposure=exposure,
    )  # fmt: skip
    return seen.some(kept), log_gain - log_gain.mean(axis=0)


def solved(seed: int, **settings: object) -> tuple[Radiometry, np.ndarray]:
    generator = np.random.default_rng(seed)
    seen, true = observed(generator, tone=ToneCurve(shoulder=0.8), **settings)  # type: ignore[arg-type]
    return solve_radiometry(seen, generator), true


def test_gains_of_a_loop_are_found_in_three_channels_within_two_per_cent() -> None:
    found, true = solved(1)
    assert np.abs(found.log_gain - true).std() < 0.02  # of gains that differ by a factor of e
    assert found.vignetting.sum() == pytest.approx(VIGNETTING.sum(), abs=0.03)


def test_the_shoulder_is_told_by_overlaps_at_different_gains() -> None:
    found, _ = solved(2)
    assert np.log1p(found.tone.shoulder) == pytest.approx(np.log(1.8), abs=0.1)
    same, _ = solved(2, spread=0.0)
    assert same.shoulder_deviation > 2 * found.shoulder_deviation  # equal gains tell nothing of the curve


def test_one_observation_in_ten_that_is_wrong_does_not_move_the_gains() -> None:
    found, true = solved(3, outliers=0.1)
    assert np.abs(found.log_gain - true).std() < 0.03


def test_held_out_observations_agree_better_than_as_they_are_shown() -> None:
    found, _ = solved(4)
    assert found.before > 0.15  # gains differ by half
    assert found.after < 0.03


def test_the_deviation_of_gains_grows_along_a_chain_and_not_around_a_loop() -> None:
    loop, _ = solved(5)
    chain, true = solved(5, loop=False)
    assert chain.deviation[0] > 1.5 * loop.deviation[0]
    assert chain.deviation[[0, -1]].min() > 1.2 * chain.deviation[FRAMES // 2]
    assert (np.abs(chain.log_gain - true)[:, 1] < 4 * chain.deviation + 0.02).all()


def test_a_power_of_the_curve_is_told_by_known_exposures_alone() -> None:
    generator = np.random.default_rng(6)
    seen, _ = observed(generator, tone=ToneCurve(power=0.85, shoulder=0.4), told=True)
    told = solve_radiometry(seen, generator)
    assert np.log(told.tone.power) == pytest.approx(np.log(0.85), abs=0.06)
    assert told.power_deviation < 0.1
    untold = solve_radiometry(replace(seen, exposure=np.full(FRAMES, np.nan)), generator)
    assert untold.tone.power == 1.0
    assert untold.power_deviation == 0.15


def test_two_frames_that_share_one_point_have_gains_of_no_certainty() -> None:
    one = np.zeros(2, dtype=np.int64)
    seen = Observations(
        point=one, frame=np.arange(2), shown=np.full((2, 3), 0.3), uneven=np.zeros(2), radius2=np.zeros(2), cell=one,
        frames=2, points=1, exposure=np.full(2, np.nan),
    )  # fmt: skip
    found = solve_radiometry(seen, np.random.default_rng(195))  # a seed that holds out both
    assert found.log_gain == pytest.approx(0.0, abs=1e-6)
