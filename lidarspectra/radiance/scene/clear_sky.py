"""Spectral irradiance of a clear sky and sun by SPECTRL2, which scales the angular distribution by genssky.

genssky's scattering leaves too little light in the sky and too much in the sun's beam. With an aerosol optical depth of
.1 its sky has 17 to 25 % less from 380 to 780 nm than SPECTRL2, and up to 39 % less at 390 nm, where light is scattered
more than once. A plain Monte Carlo of photons through a plane-parallel atmosphere sides with SPECTRL2, which was fitted
to rigorous models and to measurements (`python -m research.benchmarks.daylight` prints all three). So genssky's sky
keeps its spread over the directions, and each 20 nm bin of sky and sun is scaled to what SPECTRL2 has there; its beam
also has the absorption by ozone, oxygen and water. With the sun lower than 5 degrees, where a flat atmosphere no longer
holds, the scaling fades, and from the horizon down (twilight) genssky's numbers stand as they are.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lidarspectra.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd

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

    light = clear_light(
        pd.DatetimeIndex([daylight.time]),
        daylight.latitude_deg,
        daylight.longitude_deg,
        aerosol_optical_depth=daylight.aerosol_optical_depth,
        ground_reflectance=daylight.ground_reflectance,
    )
    return light.sun[0], light.sky[0], float(light.altitude_deg[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class ClearLight:
    """Clear-sky light at many times.

    Parameters
    ----------
    sun : (time, wavelength) float
        On a plane that faces it, in genssky's bins. [W/m²/nm]
    sky : (time, wavelength) float
        Without the sun, on level ground. [W/m²/nm]
    altitude_deg : (time,) float
        Of the sun, with refraction; no light from 0 down. [deg]
    direction : (time, 3) float
        Unit vectors towards the sun, with refraction: x east, y north, z up.
    dni, dhi : (time,) float
        Sun and sky at all wavelengths, from 300 to 4000 nm. [W/m²]
    """

    sun: FloatArray
    sky: FloatArray
    altitude_deg: FloatArray
    direction: FloatArray
    dni: FloatArray
    dhi: FloatArray


def clear_light(
    times: "pd.DatetimeIndex",
    latitude_deg: float,
    longitude_deg: float,
    *,
    aerosol_optical_depth: float,
    ground_reflectance: float,
) -> ClearLight:
    """Clear-sky light by SPECTRL2 at many times; see `spectrl2_light`.

    Parameters
    ----------
    times : pandas.DatetimeIndex
        With its offset from UTC.
    latitude_deg, longitude_deg : float
        North and east are positive. [deg]
    aerosol_optical_depth : float
        At 550 nm. [1]
    ground_reflectance : float
        At all wavelengths. [0-1]
    """
    import pvlib  # here, since it takes over a second

    place = pvlib.solarposition.get_solarposition(times, latitude_deg, longitude_deg)
    altitude = 90.0 - place["apparent_zenith"].to_numpy()
    azimuth = np.radians(place["azimuth"].to_numpy())
    level = np.cos(np.radians(altitude))
    direction = np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(np.radians(altitude))], axis=1)
    bins = round((LAST_NM - FIRST_NM) / BIN_NM)
    sun, sky = np.zeros((2, len(times), bins))
    dni, dhi = np.zeros((2, len(times)))
    up = np.flatnonzero(altitude > 0)
    if up.size:
        zenith = 90.0 - altitude[up]
        found = pvlib.spectrum.spectrl2(
            apparent_zenith=zenith,
            aoi=zenith,
            surface_tilt=0.0,
            ground_albedo=ground_reflectance,
            surface_pressure=PRESSURE_PA,
            relative_airmass=pvlib.atmosphere.get_relative_airmass(zenith),
            precipitable_water=WATER_CM,
            ozone=OZONE_ATM_CM,
            aerosol_turbidity_500nm=aerosol_optical_depth * (500.0 / 550.0) ** -ANGSTROM_EXPONENT,
            dayofyear=times.day_of_year.to_numpy()[up],
        )
        grid = found["wavelength"]
        fine = np.arange(FIRST_NM + 0.5, LAST_NM)
        for kind, spectrum, whole in (("dni", sun, dni), ("dhi", sky, dhi)):
            values = np.nan_to_num(found[kind].T)
            binned = [np.interp(fine, grid, each).reshape(bins, -1).mean(axis=1) for each in values]
            spectrum[up], whole[up] = binned, np.trapezoid(values, grid, axis=1)
    return ClearLight(sun=sun, sky=sky, altitude_deg=altitude, direction=direction, dni=dni, dhi=dhi)


def scaling(wanted: FloatArray, found: FloatArray, altitude_deg: float) -> FloatArray:
    """(wavelength,) factors that bring what was found to what is wanted; they fade to 1 from 5 degrees down."""
    share = float(np.clip(altitude_deg / FADE_DEG, 0.0, 1.0))
    full = np.divide(wanted, found, out=np.ones_like(wanted), where=(found > 0) & (wanted > 0))
    return 1.0 + share * (full - 1.0)
