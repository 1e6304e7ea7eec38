"""Spectral irradiance of a clear sky and sun by SPECTRL2, which scales the angular distribution by genssky.

genssky's scattering leaves too little light in the sky and too much in the sun's beam. With an aerosol optical depth of
.1 its sky has 17 to 25 % less from 380 to 780 nm than SPECTRL2, and up to 39 % less at 390 nm, where light is scattered
more than once. A plain Monte Carlo of photons through a plane-parallel atmosphere sides with SPECTRL2, which was fitted
to rigorous models and to measurements (`python -m research.benchmarks.daylight` prints all three). So genssky's sky
keeps its spread over the directions, and each 20 nm bin of sky and sun is scaled to what SPECTRL2 has there; its beam
also has the absorption by ozone, oxygen and water. With the sun lower than 5 degrees, where a flat atmosphere no longer
holds, the scaling fades, and from the horizon down (twilight) genssky's numbers stand as they are.
"""

from datetime import datetime
from typing import Protocol

import numpy as np

from lidarspectra.arrays import FloatArray

OZONE_ATM_CM = 0.31  # [atm-cm] SPECTRL2's examples; a tenth more takes .7 % of the sun at 610 nm
WATER_CM = 1.42  # [cm] of the standard spectrum ASTM G173; water absorbs little below 780 nm
PRESSURE_PA = 101325.0  # [Pa] sea level
ANGSTROM_EXPONENT = 1.14  # [1] of SPECTRL2's rural aerosol; turns the optical depth at 550 nm to its 500 nm
FADE_DEG = 5.0  # [deg] sun's altitude below which the scaling fades
BIN_NM = 20.0  # [nm]
FIRST_NM, LAST_NM = 380.0, 780.0  # [nm] genssky's range


class ClearDay(Protocol):
    """Place, time, air and ground, as `sky.Daylight` has them."""

    @property
    def latitude_deg(self) -> float:
        """North is positive [deg]."""

    @property
    def longitude_deg(self) -> float:
        """East is positive [deg]."""

    @property
    def time(self) -> datetime:
        """With its offset from UTC."""

    @property
    def aerosol_optical_depth(self) -> float:
        """At 550 nm [1]."""

    @property
    def ground_reflectance(self) -> float:
        """At all wavelengths [0-1]."""


def spectrl2_light(daylight: ClearDay) -> tuple[FloatArray, FloatArray, float]:
    """Clear-sky light by SPECTRL2 in genssky's bins.

    Parameters
    ----------
    daylight : ClearDay
        Its cloud cover is ignored.

    Returns
    -------
    sun : (wavelength,) float
        On a plane that faces the sun. [W/m²/nm]
    sky : (wavelength,) float
        Of the sky without the sun, on level ground. [W/m²/nm]
    altitude : float
        Of the sun, with refraction. [deg]

    References
    ----------
    Bird and Riordan, Simple solar spectral model for direct and diffuse irradiance on horizontal and tilted planes at
    the earth's surface for cloudless atmospheres, Journal of Climate and Applied Meteorology 25, 1986 (as in pvlib).
    """
    import pandas as pd
    import pvlib  # here, since it takes over a second

    time = pd.DatetimeIndex([daylight.time])
    place = pvlib.solarposition.get_solarposition(time, daylight.latitude_deg, daylight.longitude_deg)
    altitude = 90.0 - float(place["apparent_zenith"].iloc[0])
    bins = round((LAST_NM - FIRST_NM) / BIN_NM)
    if altitude <= 0:
        return np.zeros(bins), np.zeros(bins), altitude
    zenith = np.array([90.0 - altitude])
    found = pvlib.spectrum.spectrl2(
        apparent_zenith=zenith,
        aoi=zenith,
        surface_tilt=0.0,
        ground_albedo=daylight.ground_reflectance,
        surface_pressure=PRESSURE_PA,
        relative_airmass=pvlib.atmosphere.get_relative_airmass(zenith),
        precipitable_water=WATER_CM,
        ozone=OZONE_ATM_CM,
        aerosol_turbidity_500nm=daylight.aerosol_optical_depth * (500.0 / 550.0) ** -ANGSTROM_EXPONENT,
        dayofyear=daylight.time.timetuple().tm_yday,
    )
    fine = np.arange(FIRST_NM + 0.5, LAST_NM)
    sun, sky = (
        np.interp(fine, found["wavelength"], found[name][:, 0]).reshape(bins, -1).mean(axis=1)
        for name in ("dni", "dhi")
    )
    return sun, sky, altitude


def scaling(wanted: FloatArray, found: FloatArray, altitude_deg: float) -> FloatArray:
    """(wavelength,) factors that bring what was found to what is wanted; they fade to 1 from 5 degrees down."""
    share = float(np.clip(altitude_deg / FADE_DEG, 0.0, 1.0))
    full = np.divide(wanted, found, out=np.ones_like(wanted), where=(found > 0) & (wanted > 0))
    return 1.0 + share * (full - 1.0)
