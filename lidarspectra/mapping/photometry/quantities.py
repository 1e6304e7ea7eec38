"""Quantities of light that are integrals of the spectrum times a response: photometric, α-opic, photosynthetic.

References
----------
CIE S 026/E:2018, System for Metrology of Optical Radiation for ipRGC-Influenced Responses to Light: Eq. 1 to 6.
McCree 1972, Agricultural Meteorology 9, 191-216: photosynthetically active radiation, and the quantum yield curves.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import constants

from lidarspectra.arguments import one_of
from lidarspectra.mapping.maps.visible_bands import luminosity
from lidarspectra.spectra.database_files import data_folder, table
from lidarspectra.spectra.spectrum import Spectrum

UMOL_PER_J_NM = float(1e6 * 1e-9 / (constants.N_A * constants.h * constants.c))
"""Photons per joule and wavelength: 0.00836 µmol/(J nm). [µmol/(J nm)]"""

OPTICAL_NM = (380.0, 780.0)  # [nm] range of the total irradiance, as of the full-spectrum bands
PAR_NM = (400.0, 700.0)  # [nm] photosynthetically active radiation (McCree 1972)

D65_EFFICACY_W_LM = {
    "s-cone": 0.8173e-3, "m-cone": 1.4558e-3, "l-cone": 1.6289e-3, "rod": 1.4497e-3, "melanopsin": 1.3262e-3,
}  # fmt: skip  # [W/lm] α-opic efficacy of luminous radiation of daylight D65 (CIE S 026/E:2018, Table 3)
OPIC_WORDS = {"s-cone": "S-cone-opic", "m-cone": "M-cone-opic", "l-cone": "L-cone-opic", "rod": "rhodopic",
              "melanopsin": "melanopic"}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class LightQuantity:
    """Q = ∫ E(λ) s(λ) dλ.

    Parameters
    ----------
    name : str
        Of its column and variable, with the unit: 'illuminance_lx'.
    words : str
        Heading.
    unit : str
        As written in figures.
    response : Spectrum
        s(λ). [unit of Q per W/m²]
    """

    name: str
    words: str
    unit: str
    response: Spectrum


@cache
def alpha_opic_spectra() -> dict[str, Spectrum]:
    """The five α-opic action spectra, each with a peak of 1 (CIE S 026/E:2018, Table 2) [1]."""
    return {row.id: row.spectrum for row in table(data_folder() / "observers" / "alpha-opic.csv")}


@cache
def quantum_yield() -> Spectrum:
    """Relative quantum yield of photosynthesis, mean of crops grown in the field (McCree 1972, Table IV) [1]."""
    rows = table(data_folder() / "observers" / "plants.csv")
    return next(row.spectrum for row in rows if row.id == "mccree-field")


@cache
def light_quantities() -> tuple[LightQuantity, ...]:
    """Every quantity, irradiance first.

    α-opic irradiance is E_α = ∫ E s_α dλ; its equivalent daylight illuminance (EDI) is E_α / K_α,D65, the illuminance
    of D65 with the same α-opic irradiance. Photosynthetic photon flux density (PPFD) counts photons from 400 to 700 nm
    equally; yield photon flux density (YPFD) weights them by McCree's quantum yield from 350 to 725 nm.
    """
    par = np.arange(PAR_NM[0], PAR_NM[1] + 1.0)
    leaf = np.arange(350.0, 726.0)
    quantities = [
        LightQuantity(name="irradiance_W_m2", words="irradiance", unit="W/m²",
                      response=Spectrum(wavelengths_nm=np.array(OPTICAL_NM), values=np.ones(2), name="380 to 780 nm")),
        LightQuantity(name="illuminance_lx", words="illuminance", unit="lx", response=luminosity()),
        LightQuantity(name="ppfd_umol_m2_s", words="PPFD", unit="µmol/m²/s",
                      response=Spectrum(wavelengths_nm=par, values=UMOL_PER_J_NM * par, name="400 to 700 nm")),
        LightQuantity(name="ypfd_umol_m2_s", words="YPFD", unit="µmol/m²/s",
                      response=Spectrum(wavelengths_nm=leaf, name="McCree, field",
                                        values=UMOL_PER_J_NM * leaf * quantum_yield().at(leaf, outside="zero"))),
    ]  # fmt: skip
    for key, spectrum in alpha_opic_spectra().items():
        words, stem = OPIC_WORDS[key], OPIC_WORDS[key].lower().replace("-", "_")
        quantities += [
            LightQuantity(name=f"{stem}_edi_lx", words=f"{words} EDI", unit="lx",
                          response=spectrum.scaled(1.0 / D65_EFFICACY_W_LM[key])),
            LightQuantity(name=f"{stem}_irradiance_W_m2", words=f"{words} irradiance", unit="W/m²", response=spectrum),
        ]  # fmt: skip
    return tuple(quantities)


def light_quantity(name: str) -> LightQuantity:
    """A quantity of light by its name.

    Parameters
    ----------
    name : str
        With its unit: 'illuminance_lx', 'melanopic_edi_lx', 'ppfd_umol_m2_s', ...; see `light_quantities`.

    Returns
    -------
    quantity : LightQuantity
        With its `response`, for ∫ E s dλ.

    Raises
    ------
    ArgumentError
        If there is none of that name; it lists them.
    """
    known = {quantity.name: quantity for quantity in light_quantities()}
    return known[one_of(name, tuple(known), name="name of a quantity")]
