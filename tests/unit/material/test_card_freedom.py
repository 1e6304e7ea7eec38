"""What cards of known grey tell of a camera's tone curve where the light on them is known to be the same."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.tone_curve import USUAL_TONE, ToneCurve

TRUE = ToneCurve(power=0.7)
WHITE = 0.4  # [1] light that the lightest card sends, over the picture's white
SURE = 1e-3  # [1] of the logarithm of what a card sends


def likeliest(*greys: float) -> ToneCurve:
    """The likeliest of all curves under which what a camera shows of cards is their reflectance times one light."""
    log_grey = np.log(np.array(greys))
    shown = TRUE.shown(WHITE * np.array(greys) / max(greys))

    def residuals(logs: FloatArray) -> FloatArray:
        curve = ToneCurve(power=float(np.exp(logs[0])), shoulder=float(np.expm1(logs[1])))
        apart = np.log(curve.light(shown)) - log_grey
        believed = [
            logs[0] / USUAL_TONE.power_deviation,
            (logs[1] - USUAL_TONE.shoulder) / USUAL_TONE.shoulder_deviation,
        ]
        return np.concatenate([(apart - apart.mean()) / SURE, believed])

    found = least_squares(residuals, [0.0, 0.4], bounds=([-1.0, 0.0], [1.0, 3.0]))
    return ToneCurve(power=float(np.exp(found.x[0])), shoulder=float(np.expm1(found.x[1])))


def error_of_light(curve: ToneCurve, grey: float, *, level_at: tuple[float, ...]) -> float:
    """By how much a curve gets a grey's reflectance wrong, the level fixed at others [1]."""
    every = np.array([grey, *level_at])
    logs = np.log(curve.light(TRUE.shown(WHITE * every / 0.85)) / every)
    return float(np.expm1(logs[0] - logs[1:].mean()))


def test_two_cards_fix_reflectances_between_them_and_neither_power_nor_darker_ones() -> None:
    curve = likeliest(0.18, 0.85)
    assert curve.power == pytest.approx(0.85, abs=0.01)  # where the truth is .7: a shoulder of 1.1 makes up for it
    assert abs(error_of_light(curve, 0.18, level_at=(0.18, 0.85))) < 0.005
    assert abs(error_of_light(curve, 0.4, level_at=(0.18, 0.85))) < 0.045
    assert error_of_light(curve, 0.05, level_at=(0.18, 0.85)) > 0.1


def test_a_third_darker_card_fixes_the_power_too() -> None:
    curve = likeliest(0.05, 0.18, 0.85)
    assert curve.power == pytest.approx(TRUE.power, abs=0.01)
    assert abs(error_of_light(curve, 0.1, level_at=(0.18, 0.85))) < 0.01
