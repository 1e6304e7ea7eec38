"""By how much usual lamps differ from a guessed spectrum, in each channel and at one luminous flux."""

import math
from functools import cache

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import BandSet, Spectrum

USUAL = (
    *("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1", "LED-RGB1", "LED-V1", "LED-V2"),
    *("FL2", "FL7", "FL11"),
)
"""What CIE 015:2018 takes as typical: its LEDs, and the three fluorescent lamps that it gives priority."""
LARGEST_RATIO = 10.0  # [1] of two lamps in a channel; where one is nearly dark it would be without limit


def spread_of_usual_lamps(guess: Spectrum, bands: BandSet) -> FloatArray:
    """Standard deviation of the logarithm of a lamp's light in each channel, where its spectrum is a guess.

    With the mean L_b of a lamp's spectrum over channel b and its luminous flux Φ_v, it is the root mean square of
    ln[(L_b / Φ_v) / (L_b / Φ_v of the guess)] over the lamps in `USUAL`, each ratio from 1/10 to 10.

    Parameters
    ----------
    guess : Spectrum
        Of any scale. [W/nm or 1]
    bands : BandSet

    Returns
    -------
    deviation : (band,) float
        0 where the guess sends nothing. [1]
    """
    guessed = bands.band_values(guess, outside="zero") / luminous_flux_lm(guess)
    usual = np.stack([bands.band_values(each, outside="zero") / luminous_flux_lm(each) for each in _usual()])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(usual / guessed)
    limit = math.log(LARGEST_RATIO)
    off = np.clip(np.nan_to_num(ratio, nan=0.0, posinf=limit, neginf=-limit), -limit, limit)
    return np.asarray(np.where(guessed > 0, np.sqrt((off**2).mean(axis=0)), 0.0), dtype=np.float64)


@cache
def _usual() -> tuple[Spectrum, ...]:
    return tuple(lamp_spectrum(name).spectrum for name in USUAL)
