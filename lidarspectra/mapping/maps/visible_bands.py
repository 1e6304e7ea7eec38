"""Whether bands suffice for illuminance: they must span V(λ) without wide gaps."""

from functools import cache

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamp_spectra import photopic_efficiency
from lidarspectra.spectra.spectrum import LUMINOUS_EFFICACY_LM_W, Spectrum

MIN_COVER = 0.99  # [1] share of ∫V(λ)dλ that the bands must span, so that less than 1 % is missed
WIDEST_GAP_NM = 40.0  # [nm] between centres; V(λ) is 100 nm wide, so wider steps no longer follow it
MIN_EFFICIENCY = 1e-3  # [1] V(λ) above which a gap between bands matters


def covers_vision(centers_nm: FloatArray) -> bool:
    """Whether bands with these centres [nm] cover V(λ) well enough for illuminance."""
    return uncovered(centers_nm) is None


@cache
def luminosity() -> Spectrum:
    """Spectral luminous efficacy, 683 lm/W V(λ) [lm/W]."""
    return photopic_efficiency().scaled(LUMINOUS_EFFICACY_LM_W)


def uncovered(centers: FloatArray) -> str | None:
    """What keeps bands with these centres [nm] from covering V(λ), as part of a sentence; None if they cover it."""
    if centers.size < 2:
        return f"{centers.size} band"
    efficiency = photopic_efficiency()
    within = (efficiency.wavelengths_nm >= centers[0]) & (efficiency.wavelengths_nm <= centers[-1])
    cover = float(efficiency.values[within].sum() / efficiency.values.sum())
    if cover < MIN_COVER:
        return f"bands from {centers[0]:g} to {centers[-1]:g} nm, which span {cover:.0%} of V(λ)"
    matters = efficiency.at(0.5 * (centers[1:] + centers[:-1]), outside="zero") > MIN_EFFICIENCY
    widest = float(np.where(matters, np.diff(centers), 0.0).max())
    return f"a gap of {widest:g} nm between bands" if widest > WIDEST_GAP_NM else None
