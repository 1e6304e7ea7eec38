"""Mirrors and panes of virtual rooms show what lies before and behind them, with the shares of Fresnel's equations."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.room.panes.pane import Pane
from research.virtual_rooms.pane_light import ABSORBED, INDEX, NONE, ShownPane, ShownPanes

AT = 2.0  # [m] of a pane in the plane x = 2, seen from smaller x
GLASS = Pane(kind="glass", center=np.array([AT, 0.0, 1.0]), size_m=(2.0, 2.0), normal=np.array([-1.0, 0.0, 0.0]))


def test_a_clear_pane_reflects_and_passes_what_two_surfaces_do() -> None:
    reflectance, transmittance = ShownPane(pane=GLASS).shares(np.array([1.0]))
    once = ((INDEX - 1.0) / (INDEX + 1.0)) ** 2
    clear = 1.0 - ABSORBED
    through = (1.0 - once) ** 2 * clear / (1.0 - (once * clear) ** 2)
    assert transmittance[0] == pytest.approx(through)
    assert reflectance[0] == pytest.approx(once * (1.0 + clear * through))
    assert 0.07 < reflectance[0] < 0.09  # window glass


def test_no_pane_makes_light_and_flat_views_are_mirrored() -> None:
    cosine = np.linspace(0.02, 1.0, 50)
    reflectance, transmittance = ShownPane(pane=GLASS).shares(cosine)
    assert (reflectance + transmittance < 1.0).all()
    assert (np.diff(transmittance) > 0).all()
    assert reflectance[0] > 0.8


def _sees(start: FloatArray, ways: FloatArray) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    """A pane in x = 2 before a wall of light .5 in x = 5, and behind the camera one of light .2 in x = -1."""
    ahead = ways[:, 0] > 0
    wall = np.where(ahead, np.where(start[:, 0] < AT, AT, 5.0), -1.0)
    light = np.where(ahead, np.where(start[:, 0] < AT, 0.01, 0.5), 0.2)
    distance = (wall - start[:, 0]) / ways[:, 0]
    texel = np.stack([np.zeros(len(ways)), ahead & (start[:, 0] < AT)], axis=1).astype(np.int64)
    return np.repeat(light[:, None], 3, axis=1), distance, texel, np.arange(len(ways))


@pytest.mark.parametrize("kind", ["mirror", "glass"])
def test_a_pane_shows_what_lies_before_and_behind_it_at_its_distance(kind: str) -> None:
    shown = ShownPane(pane=Pane(kind=kind, center=GLASS.center, size_m=GLASS.size_m, normal=GLASS.normal))
    panes = ShownPanes(panes=[shown], number=np.array([[NONE, 0]], dtype=np.int8))
    way = np.array([[1.0, 0.2, 0.0]])
    light, beyond, met = panes.seen(np.array([[0.0, 0.0, 1.0]]), way, _sees)
    reflectance, transmittance = shown.shares(np.array([1.0 / np.hypot(1.0, 0.2)]))
    assert met[0] == 0
    assert light[0, 0] == pytest.approx(0.01 + 0.2 * reflectance[0] + 0.5 * transmittance[0])
    assert beyond[0] == pytest.approx(5.0, abs=0.05)  # 2 m there and 3 m back, or 5 m on


def test_a_lidar_measures_a_pane_as_often_as_it_is_told_to_and_else_what_is_beyond() -> None:
    shown = ShownPane(pane=GLASS, surface_share=0.3)
    panes = ShownPanes(panes=[shown], number=np.array([[0]], dtype=np.int8))
    depth, beyond = np.full((480, 640), 2.0), np.full((480, 640), 5.0)
    met = np.zeros((480, 640), dtype=np.int64)
    met[:, 320:] = NONE
    measured = panes.lidar(depth, beyond, met, np.random.default_rng(1))
    assert (measured[:, 320:] == 2.0).all()
    assert (measured[:, :320] == 2.0).mean() == pytest.approx(0.3, abs=0.1)  # patches: 280 of them
