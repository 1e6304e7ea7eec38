"""Pictures for the eye: white is white, bright stays brighter, and nothing leaves the display's range."""

import numpy as np
import pytest

from lidarspectra.mapping.figures.room_pictures import luminance_figure, tone_mapped

WARM = np.array([1.1, 1.0, 0.35])  # XYZ of a filament lamp


def test_what_has_the_colour_of_the_lamps_is_grey() -> None:
    levels = np.geomspace(1.0, 100.0, 16).reshape(4, 4)
    pixels = tone_mapped(levels[..., None] * WARM, WARM).astype(int)
    assert np.ptp(pixels, axis=-1).max() <= 1
    assert (np.diff(pixels[..., 1].ravel()) > 0).all()


def test_saturated_colours_keep_their_order_of_luminance() -> None:
    xyz = np.array([[[20.0, 10.0, 0.1], [40.0, 20.0, 0.2], [5.0, 20.0, 90.0]]])
    pixels = tone_mapped(xyz, np.array([0.95, 1.0, 1.09])).astype(float)
    assert pixels[0, 1, 0] > pixels[0, 0, 0] > pixels[0, 0, 2]
    assert pixels[0, 2, 2] > pixels[0, 2, 0]


def test_a_dark_picture_is_black_and_has_a_figure() -> None:
    assert not tone_mapped(np.zeros((2, 3, 3)), WARM).any()
    assert luminance_figure(np.zeros((2, 3))).axes


def test_the_legend_spans_the_luminances() -> None:
    bar = luminance_figure(np.array([[1.0, 10.0], [200.0, 0.0]]), title="x").axes[1]
    assert bar.get_ylim()[1] == pytest.approx(200.0)
