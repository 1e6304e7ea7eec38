"""Data augmentation: random variations of fingerprints, as other days, lamps and sensors would give them.

    ln N = ln N0 + s u + d_sensor + d_level,      N' = round(N (1 + 0.004 ε))

with the change u of a fingerprint against its reference N0. The factor s (model error: another person, an inexact
material) is drawn for each fingerprint and for each sensor; d_sensor is each sensor's drift since the reference was
read, d_level a dimming of all lamps; with a small probability a sensor has no reading. Pose and clothing are not varied
here: a table has several fingerprints of each place, each of another person.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import REPEATABILITY


@dataclass(frozen=True, kw_only=True)
class Augmentation:
    """How readings are varied.

    Parameters
    ----------
    copies : int
        Readings drawn from each fingerprint.
    strength : float
        Standard deviation of ln s, by fingerprint and again by sensor. [1]
    drift : float
        Standard deviation of d_sensor. [1]
    dimming : float
        Standard deviation of d_level. [1]
    sensor_loss : float
        Probability that a sensor has no reading. [0-1]
    repeatability : float
        Standard deviation of a reading. [1]
    """

    copies: int = 20
    strength: float = 0.15
    drift: float = 0.003
    dimming: float = 0.02
    sensor_loss: float = 0.02
    repeatability: float = REPEATABILITY

    def __post_init__(self) -> None:
        spreads = (self.strength, self.drift, self.dimming, self.repeatability)
        if self.copies < 1 or min(spreads) < 0 or not 0 <= self.sensor_loss < 1:
            raise MapError(
                expected="one copy or more, spreads of 0 or more, a loss from 0 to below 1",
                found=f"{self.copies}, {min(spreads):g}, {self.sensor_loss:g}",
                where="augmentation",
            )


def augmented_counts(
    counts: FloatArray,
    reference: FloatArray,
    augmentation: Augmentation,
    generator: np.random.Generator,
    *,
    are_whole: bool = False,
) -> FloatArray:
    """Draw augmented counts.

    Parameters
    ----------
    counts : (fingerprint, sensor, band) float
        Expected counts; NaN where missing.
    reference : (sensor, band) float
        N0. [count]
    augmentation : Augmentation
    generator : Generator
    are_whole : bool
        Whether the counts were rounded already; then a uniform rounding error is drawn first.

    Returns
    -------
    drawn : (fingerprint x copies, sensor, band) float
        The copies of one fingerprint stand together. Whole counts, NaN where missing.
    """
    many = np.repeat(counts, augmentation.copies, axis=0)
    n, sensors, _ = many.shape
    if are_whole:
        many = many + generator.uniform(-0.5, 0.5, many.shape)
    lit = np.where(reference > 0, reference, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.log(np.maximum(many, 0.0) / lit)
    strength = np.exp(
        augmentation.strength * (generator.standard_normal((n, 1, 1)) + generator.standard_normal((n, sensors, 1)))
    )
    drift = augmentation.drift * generator.standard_normal((n, sensors, 1))
    level = augmentation.dimming * generator.standard_normal((n, 1, 1))
    noise = 1.0 + augmentation.repeatability * generator.standard_normal(many.shape)
    drawn = np.rint(lit * np.exp(strength * change + drift + level) * noise)
    lost = generator.random((n, sensors, 1)) < augmentation.sensor_loss
    return np.asarray(np.where(lost, np.nan, drawn), dtype=np.float64)
