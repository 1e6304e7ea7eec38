"""How well a power and a shoulder make tone curves that are published, and how far each lies from what is expected.

    python -m research.benchmarks.tone_curves

Of each curve the log of the power and of 1 + shoulder that come nearest over two decades of light, the largest error of
the light that they give back, and the distance of both from the two families that the fit knows, in its deviations:
cameras that show what they see or lift shadows (`USUAL_TONE`), and filmic ones (`FILMIC_TONE`).
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, USUAL_TONE, ToneCurve, TonePrior
from research.virtual_rooms.camera import filmic_curve, tone_curve

LIGHT = np.geomspace(0.01, 1.0, 80)  # [1] of white


def hable(white: float) -> Callable[[FloatArray], FloatArray]:
    """Hable's curve (2010), with the constants that he gives, for a linear white."""

    def curve(light: FloatArray) -> FloatArray:
        raised = (light * (0.15 * light + 0.05) + 0.004) / (light * (0.15 * light + 0.5) + 0.06)
        return np.asarray(raised - 0.02 / 0.3, dtype=np.float64)

    return lambda light: curve(white * light) / curve(np.array([white]))


def hejl(light: FloatArray) -> FloatArray:
    """Hejl's and Burgess-Dawson's curve (2010), 2 being white; theirs ends in values encoded with 2.2."""

    def curve(light: FloatArray) -> FloatArray:
        above = np.maximum(light - 0.004, 0.0)
        encoded = above * (6.2 * above + 0.5) / (above * (6.2 * above + 1.7) + 0.06)
        return np.asarray(encoded**2.2, dtype=np.float64)

    return curve(2.0 * light) / curve(np.array([2.0]))


CURVES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "none": lambda light: light,
    "Reinhard, k = .6": lambda light: tone_curve(light, 0.6),
    "Reinhard, k = 2": lambda light: tone_curve(light, 2.0),
    "Hable, white 4": hable(4.0),
    "Hable, white 11.2": hable(11.2),
    "Narkowicz (ACES)": filmic_curve,
    "Hejl": hejl,
}


def nearest(curve: Callable[[FloatArray], FloatArray]) -> tuple[ToneCurve, float]:
    """A power and a shoulder that come nearest to a curve, and the largest error of the log of light."""
    shown = np.clip(curve(LIGHT), 1e-4, 1.0)

    def errors(logs: FloatArray) -> FloatArray:
        return np.log(_curve_of(logs).light(shown) / LIGHT)

    found = least_squares(errors, [0.1, 0.5], bounds=([-1.0, 0.0], [1.0, 4.0])).x
    return _curve_of(found), float(np.abs(errors(found)).max())


def deviations_of(tone: ToneCurve, prior: TonePrior) -> float:
    """How many standard deviations a curve is from a family's mean [1]."""
    power = (np.log(tone.power) - prior.power) / prior.power_deviation
    shoulder = (np.log1p(tone.shoulder) - prior.shoulder) / prior.shoulder_deviation
    return float(np.hypot(power, shoulder))


def _curve_of(logs: FloatArray) -> ToneCurve:
    return ToneCurve(power=float(np.exp(logs[0])), shoulder=float(np.expm1(logs[1])))


def main() -> None:
    """Print a line a curve."""
    print(f"{'curve':20s} {'log g':>6s} {'log(1+s)':>9s} {'worst':>6s} {'usual':>6s} {'filmic':>7s}")
    for name, curve in CURVES.items():
        tone, worst = nearest(curve)
        power, shoulder = np.log(tone.power), np.log1p(tone.shoulder)
        apart = [deviations_of(tone, prior) for prior in (USUAL_TONE, FILMIC_TONE)]
        print(f"{name:20s} {power:+6.2f} {shoulder:9.2f} {100 * worst:4.0f} % {apart[0]:6.1f} {apart[1]:7.1f}")


if __name__ == "__main__":
    main()
