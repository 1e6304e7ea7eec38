"""Whites among a scan's surfaces tell the colour of the light where its pattern does not."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.material.albedo import (
    FIT_COSTS,
    WHITE_HUE,
    WHITE_HUE_DEVIATION,
    LightEvidence,
    _from_white,
    fit_light,
)
from lidarspectra.material.sharpened_cones import srgb_of_cones

PER_GROUP = 60
BALANCE = np.array([0.30, 0.36, 0.42])  # [1] k of the picture: bluish light
WHITE = 0.8 * np.exp([0.0, *WHITE_HUE])
GREY = np.array([0.2, 0.22, 0.18])


def evidence(white_groups: int) -> LightEvidence:
    """Surfaces that see nothing of each other, so that only what is known beforehand tells k."""
    groups = white_groups + 1
    group = np.repeat(np.arange(groups), PER_GROUP)
    direct = np.linspace(0.5, 1.5, group.size)[np.argsort(np.argsort(np.sin(1.0 + np.arange(group.size))))]
    reflectance = np.where((group < white_groups)[:, None], WHITE, GREY)
    shown = srgb_of_cones(BALANCE * reflectance * direct[:, None])
    return LightEvidence(
        shown=shown,
        direct=np.repeat(direct[None, :, None], 3, axis=2),
        emission=np.ones((1, group.size)),
        exchange=csr_array((group.size, group.size + 1)),
        face_shown=shown,
        face_area=np.ones(group.size),
        face_lamp=np.zeros(group.size, dtype=np.bool_),
        group=group,
        cell=np.arange(group.size),
        ceiling=np.zeros(group.size, dtype=np.bool_),
        white=group < white_groups,
        unsure=np.zeros((group.size, 3)),
    )


def hue(data: LightEvidence) -> np.ndarray:
    """Log cone ratios green and blue over red of the first group."""
    fit = fit_light(data, flux_deviation=np.array([0.15]))
    logs = np.log(fit.reflectance[data.group == 0]).mean(axis=0)
    return logs[1:] - logs[0]


def test_white_surfaces_come_out_white() -> None:
    data = evidence(1)
    assert np.abs(hue(data) - WHITE_HUE).max() < 0.05
    blind = replace(data, white=np.zeros_like(data.white))
    assert np.abs(hue(blind) - WHITE_HUE).max() > 0.1


def test_a_fit_tells_every_step_and_never_goes_back() -> None:
    told: list[float] = []
    fit_light(evidence(1), flux_deviation=np.array([0.15]), progress=lambda fraction, words: told.append(fraction))
    assert len(told) > len(FIT_COSTS)
    assert told == sorted(told)
    assert told[0] == 0.0
    assert told[-1] < 1.0


def test_one_paint_on_many_walls_is_one_witness() -> None:
    alone, together = hue(evidence(1)), hue(evidence(5))
    assert np.abs(alone - together).max() < 0.02


def test_a_yellow_surface_counts_less_than_its_distance_from_white() -> None:
    near, far = (np.log(WHITE) - [[0.0, 0.0, WHITE_HUE_DEVIATION[1] * deviations]] for deviations in (0.5, 10.0))
    assert abs(_from_white(near)[0, 1] + 0.5) < 0.02
    assert -4.0 < _from_white(far)[0, 1] < -2.0
