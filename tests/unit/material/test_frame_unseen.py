"""The app's texture fills what no frame saw, on the frames' scale, and only where it tells."""

import numpy as np
import pytest

from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames.unseen import MAX_LOCAL, FromTexture, Places, light_of_texture

GAIN = np.array([2.0, 1.5, 1.2])  # of the frames' scale over the texture's
CURVE = ToneCurve(power=1.1, shoulder=0.4)


def wall(count: int, seed: int, x_m: tuple[float, float]) -> tuple[Places, np.ndarray]:
    """Places on a wall of many paints as a texture shows them, and their radiance by the frames."""
    random = np.random.default_rng(seed)
    points = np.column_stack([random.uniform(*x_m, count), np.zeros(count), random.uniform(0.0, 2.5, count)])
    shown = random.uniform(0.05, 0.7, (count, 3))
    places = Places(points=points, normals=np.tile([0.0, 1.0, 0.0], (count, 1)), texture=shown)
    return places, GAIN * CURVE.light(shown)


def filled(exposure_per_m: float, noise: float = 0.0) -> tuple[FromTexture | None, np.ndarray]:
    """What a part of the wall gets that no frame saw, and its true radiance.

    The texture's exposure rises along the wall by a share of e per metre, and scatters from place to place.
    """
    (both, light), (unseen, truth) = wall(4000, 1, (0.0, 4.0)), wall(300, 2, (3.0, 4.0))
    scatter = noise * np.random.default_rng(3).normal(size=len(light))
    seen = light * np.exp(exposure_per_m * both.points[:, :1] + scatter[:, None])
    found = light_of_texture(both, seen, unseen, np.random.default_rng(4))
    return found, truth * np.exp(exposure_per_m * unseen.points[:, :1])


def test_the_curve_and_the_gain_of_a_texture_follow_from_what_both_show() -> None:
    found, truth = filled(0.0)
    assert found is not None
    np.testing.assert_allclose(found.light, truth, rtol=1e-3)
    assert found.spread < 1e-3
    assert not found.cut.any()


def test_the_blends_exposure_is_that_of_the_places_nearby() -> None:
    # One gain for the whole wall would leave the unseen end .22 too dark.
    found, truth = filled(0.15)
    assert found is not None
    np.testing.assert_allclose(found.light, truth, rtol=0.07)  # in the wall's corners all neighbours lie on one side
    assert np.median(found.light / truth) == pytest.approx(1.0, abs=0.01)
    assert 0.1 < found.spread < 0.3


@pytest.mark.parametrize("noise", [0.5, 1.0])
def test_a_texture_that_shows_something_else_is_not_used(noise: float) -> None:
    assert filled(0.0, noise)[0] is None


def test_what_the_texture_shows_cut_at_white_is_a_lower_bound() -> None:
    both, light = wall(1000, 1, (0.0, 4.0))
    unseen, _ = wall(10, 2, (0.0, 4.0))
    unseen.texture[:4] = 1.0
    found = light_of_texture(both, light, unseen, np.random.default_rng(4))
    assert found is not None
    assert found.cut.tolist() == [True] * 4 + [False] * 6


def test_few_places_that_both_show_tell_no_curve() -> None:
    both, light = wall(150, 1, (0.0, 4.0))
    assert light_of_texture(both, light, wall(10, 2, (0.0, 4.0))[0], np.random.default_rng(4)) is None


def test_black_in_the_texture_and_places_without_light_tell_nothing_and_do_no_harm() -> None:
    (both, light), (unseen, truth) = wall(4000, 1, (0.0, 4.0)), wall(300, 2, (0.0, 4.0))
    both.texture[:200] = 0.0
    light[200:300], light[300:400] = np.nan, 0.0
    found = light_of_texture(both, light, unseen, np.random.default_rng(4))
    assert found is not None
    np.testing.assert_allclose(found.light, truth, rtol=1e-3)


def test_the_exposure_is_that_of_the_side_of_a_thin_wall_that_is_looked_at() -> None:
    (front, light), (back, other) = wall(2000, 1, (0.0, 4.0)), wall(2000, 5, (0.0, 4.0))
    both = Places(
        points=np.concatenate([front.points, back.points - [0.0, 0.1, 0.0]]),
        normals=np.concatenate([front.normals, -back.normals]),
        texture=np.concatenate([front.texture, back.texture]),
    )
    seen = np.concatenate([light * np.exp(0.15), other * np.exp(-0.15)])
    unseen, truth = wall(300, 2, (0.0, 4.0))
    found = light_of_texture(both, seen, unseen, np.random.default_rng(4))
    assert found is not None
    np.testing.assert_allclose(found.light, truth * np.exp(0.15), rtol=0.01)


def test_what_the_texture_shows_otherwise_beside_an_unseen_place_moves_it_by_a_factor_of_two_at_most() -> None:
    (both, light), (unseen, truth) = wall(4000, 1, (0.0, 4.0)), wall(300, 2, (3.7, 4.0))
    moved = both.points[:, 0] > 3.4  # there a poster hangs in the picture that was taken off before the frames
    found = light_of_texture(both, np.where(moved[:, None], 5.0 * light, light), unseen, np.random.default_rng(4))
    assert found is not None
    np.testing.assert_allclose(found.light, truth * np.exp(MAX_LOCAL), rtol=0.05)
    assert np.exp(MAX_LOCAL) == pytest.approx(2.0, rel=0.05)


def test_gloss_in_the_frames_does_not_bend_the_textures_curve() -> None:
    (both, light), (unseen, truth) = wall(4000, 1, (0.0, 4.0)), wall(300, 2, (0.0, 4.0))
    gloss = both.texture.mean(axis=1) > np.quantile(both.texture.mean(axis=1), 0.85)
    found = light_of_texture(both, np.where(gloss[:, None], 2.5 * light, light), unseen, np.random.default_rng(4))
    assert found is not None
    np.testing.assert_allclose(found.light, truth, rtol=0.04)
