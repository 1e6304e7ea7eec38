"""A phone's tone curve: the mapping from scene radiance to the values in its picture.

Phones lift shadows and compress highlights, so that a wall with half the illuminance looks more than half as bright.
Two parameters describe most of them: a shoulder s (the curve of Reinhard et al., scaled to end in white) and a power g,

    shown = (1 + s) x^g / (1 + s x^g),          x = [shown / (1 + s - s shown)]^(1/g),

with x and `shown` linear, 0 to 1, for each sRGB channel by itself. g = 1, s = 0 is a linear camera.

References
----------
Reinhard, Stark, Shirley, Ferwerda (2002) Photographic tone reproduction for digital images, ACM TOG 21, 267, Eq. 3.
Narkowicz (2015) ACES filmic tone mapping curve. Hejl, Burgess-Dawson (2010) Filmic tonemapping for real-time
rendering, SIGGRAPH course.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ArrayError

DARKEST = 1e-4  # [1] of what a picture shows: half of the lowest level of 8 bits is 1.5e-4


@dataclass(frozen=True, kw_only=True)
class TonePrior:
    """What is known of a tone curve before a fit.

    Parameters
    ----------
    family : str
        What such curves are called in sentences for the user.
    power, power_deviation : float
        Mean and standard deviation of log g. [1]
    shoulder, shoulder_deviation : float
        Mean and standard deviation of log(1 + s); phones lift shadows, most by less than 2.5. [1]
    """

    family: str = "plain"
    power: float = 0.0
    power_deviation: float = 0.15
    shoulder: float = 0.4
    shoulder_deviation: float = 0.5


USUAL_TONE = TonePrior()
"""Of a picture that shows what the camera saw, or with its shadows lifted."""
FILMIC_TONE = TonePrior(
    family="filmic", power=0.43, power_deviation=0.12, shoulder=2.18, shoulder_deviation=0.4,
)  # fmt: skip
"""Of a picture by a filmic curve, with a toe and a strong shoulder.

Its means are half-way between the curves of Narkowicz, (.47, 1.94), and of Hejl, (.38, 2.42), as a power and a shoulder
come nearest to them (`research/benchmarks/tone_curves.py`).
"""


@dataclass(frozen=True, kw_only=True)
class ToneCurve:
    """A tone curve.

    Parameters
    ----------
    power : float
        g, over 0; below 1 it lifts shadows, over 1 it adds contrast. [1]
    shoulder : float
        s, 0 or more; shadows are lifted by up to 1 + s, highlights compressed. [1]
    """

    power: float = 1.0
    shoulder: float = 0.0

    def __post_init__(self) -> None:
        if not (self.power > 0 and self.shoulder >= 0):
            raise ArrayError(
                expected="a power over 0 and a shoulder of 0 or more",
                found=f"power {self.power}, shoulder {self.shoulder}",
                where="tone curve",
            )

    def shown(self, light: FloatArray) -> FloatArray:
        """What the picture shows of light; both linear, 0 to 1, of any shape."""
        raised = np.clip(light, 0.0, 1.0) ** self.power
        return np.asarray((1.0 + self.shoulder) * raised / (1.0 + self.shoulder * raised), dtype=np.float64)

    def light(self, shown: FloatArray) -> FloatArray:
        """Light that the picture shows so, nothing below that of the darkest level; the inverse of `shown`."""
        value = np.clip(shown, DARKEST, 1.0)
        pressed = value / (1.0 + self.shoulder - self.shoulder * value)
        return np.asarray(pressed ** (1.0 / self.power), dtype=np.float64)

    def slope(self, shown: FloatArray) -> FloatArray:
        """Slope of log light over log shown, how much it spreads differences; 1 if the camera shows what it sees."""
        value = np.clip(shown, DARKEST, 1.0)
        return np.asarray(
            (1.0 + self.shoulder) / (1.0 + self.shoulder - self.shoulder * value) / self.power, dtype=np.float64
        )
