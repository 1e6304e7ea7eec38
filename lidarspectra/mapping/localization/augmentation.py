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
from lidarspectra.mapping.localization.features import known_median

FEW_PLACES = (1, 2, 3, 5, 9)  # that a running median spans in its first minutes
MEDIANS_OF_EACH = 60


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
    unsettled : float
        Share of the readings that are compared with a running median of few places, which still contains people. The
        network learns from these; linear locators bear them anyway. [0-1]
    repeatability : float
        Standard deviation of a reading. [1]
    """

    copies: int = 20
    strength: float = 0.15
    drift: float = 0.003
    dimming: float = 0.02
    sensor_loss: float = 0.02
    unsettled: float = 0.5
    repeatability: float = REPEATABILITY

    def __post_init__(self) -> None:
        spreads = (self.strength, self.drift, self.dimming, self.repeatability)
        if self.copies < 1 or min(spreads) < 0 or not (0 <= self.sensor_loss < 1 and 0 <= self.unsettled <= 1):
            raise MapError(
                expected="one copy or more, spreads of 0 or more, a loss from 0 to below 1, a share from 0 to 1",
                found=f"{self.copies}, {min(spreads):g}, {self.sensor_loss:g}, {self.unsettled:g}",
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


def unsettled_references(
    counts: FloatArray, reference: FloatArray, drawn: int, share: float, generator: np.random.Generator
) -> FloatArray:
    """References as a running median gives them in its first minutes, while it still contains people.

    Parameters
    ----------
    counts : (fingerprint, sensor, band) float
        NaN where missing. [count]
    reference : (sensor, band) float
        N0, with nobody there. [count]
    drawn : int
        Number of readings.
    share : float
        Of the readings that get the median of `FEW_PLACES` fingerprints by lot; the others get the reference. [0-1]
    generator : Generator

    Returns
    -------
    references : (drawn, sensor, band) float
        [count]
    """
    medians = [
        known_median(counts[generator.integers(0, len(counts), few)], axis=0)
        for few in FEW_PLACES
        for _ in range(MEDIANS_OF_EACH)
    ]
    chosen = np.array(medians)[generator.integers(0, len(medians), drawn)]
    settled = generator.random((drawn, 1, 1)) >= share
    return np.asarray(np.where(settled, reference, chosen), dtype=np.float64)
