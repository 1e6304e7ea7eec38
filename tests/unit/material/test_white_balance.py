"""Whites among a scan's surfaces tell the colour of the light where its pattern does not."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.material.delighting.albedo import FIT_SHARES, fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import WHITE_HUE, WHITE_HUE_DEVIATION, _from_white
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.material.delighting.surface_light import MIN_EMISSION, LightAt
from lidarspectra.material.delighting.tone_curve import ToneCurve

from .lit_walls import WHITE, evidence


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
    assert len(told) > len(FIT_SHARES)
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


def test_light_at_some_points_is_that_of_the_equations_for_every_tone_and_beam() -> None:
    random = np.random.default_rng(3)
    data = evidence(1)
    count = len(data.shown)
    shares = random.random((count, count + 1)) * (random.random((count, count + 1)) < 0.05)  # the last sees nothing
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-9)
    lamp = random.random(count) < 0.1
    data = replace(
        data,
        exchange=csr_array(shares),
        face_area=random.random(count),
        face_lamp=lamp,
        emission=np.where(np.arange(count) % 3, random.random((1, count)), 1.0),
        tint=1.0 + random.random((count, 3)),
        face_excess=1.0 + random.random((count, 3)),
    )
    some, mean_direct, factors = np.arange(5, 60, 2), np.array([0.5, 0.6, 0.7]), np.array([1.3])
    at = LightAt(data, some, mean_direct)
    for power, beam in ((1.0, 0.0), (0.8, 0.0), (0.8, 1.5), (1.0, 0.5)):
        tone = ToneCurve(power=power, shoulder=0.4)
        sent = cones_of_srgb(tone.light(data.face_shown) * data.face_excess)
        sent[lamp] = 0.0
        elsewhere = np.average(sent, axis=0, weights=data.face_area)
        seen, gathered = at.shown(tone)
        np.testing.assert_allclose(gathered, (shares @ np.vstack([sent, elsewhere]))[some], rtol=1e-12)
        np.testing.assert_allclose(seen, (cones_of_srgb(tone.light(data.shown)) / data.tint)[some], rtol=1e-12)
        cosine = data.emission[0, some, None]
        narrowed = np.where(cosine < 1.0, (1.0 + 0.5 * beam) * np.maximum(cosine, MIN_EMISSION) ** beam, 1.0)
        expected = factors[0] * narrowed * data.direct[0, some] / mean_direct
        np.testing.assert_allclose(at.direct(beam, factors), expected, rtol=1e-12)
