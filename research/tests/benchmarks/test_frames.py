"""The frames' benchmark: the row with the true radiance has what lamps truly send, far above white."""

import numpy as np

from lidarspectra.geometry.appearance import NEUTRAL_COLOR, PHOTOGRAPHED, Appearance
from research.benchmarks.frames import _texel_each


def test_a_face_shows_its_own_light_also_far_above_white() -> None:
    light = np.random.default_rng(0).uniform(0.0, 30.0, (1234, 3))
    image, corner_uv = _texel_each(light)
    shown = Appearance(
        images=(image,), face_image=np.zeros(len(light), dtype=np.int64), corner_uv=corner_uv,
        corner_color=np.full((len(light), 3, 3), NEUTRAL_COLOR), color_source=np.full(len(light), PHOTOGRAPHED),
    )  # fmt: skip
    middle = np.full((len(light), 3), 1.0 / 3.0)
    np.testing.assert_allclose(
        shown.sample(np.arange(len(light)), middle), light, rtol=1e-5, atol=1e-5
    )  # single precision, of lights up to 30
