"""Sky and sun of every hour of a year: the luminance of the sky's patches, and their spectra.

How much light, and from where, is the Perez model's, as Radiance's gendaymtx has it: from the irradiance by sun and by
sky, with its luminous efficacies. What colour it has is SPECTRL2's, as for a single moment (`clear_sky`): the sun's
light is its beam's; of the sky's light the share x = (1 - c) D_clear/D is blue sky, and the rest has passed clouds,
which leave the spectrum of sun and sky together. The cloud cover c follows from how much of the clear sun is left,
1 - c = DNI/DNI_clear. All patches of an hour have one spectrum; the ground has that of all light on level ground.

References
----------
Perez, Seals and Michalsky, All-weather model for sky luminance distribution, Solar Energy 50, 1993. Perez, Ineichen,
Seals, Michalsky and Stewart, Modeling daylight availability and irradiance components, Solar Energy 44, 1990.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import LampError
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.radiance.engine.engine import Engine, float_rows
from lidarspectra.radiance.scene.clear_sky import clear_light
from lidarspectra.radiance.scene.sky import SKY_WAVELENGTHS_NM, sky_spectrum
from lidarspectra.radiance.scene.sky_patches import GROUND, SkyPatches
from lidarspectra.radiance.scene.weather import Weather

GENDAYMTX_EFFICACY_LM_W = 179.0  # [lm/W] Radiance's convention for white, by which gendaymtx divides luminance
WEATHER_FILE = "year.wea"


@dataclass(frozen=True, kw_only=True, eq=False)
class YearSky:
    """Sky and sun of the hours in which there is light.

    Parameters
    ----------
    hours : (hour,) int
        Their places in the weather's year.
    luminance : (hour, patch) float
        Of every patch of the sky, the ground's first. [cd/m²]
    sun_illuminance : (hour,) float
        On a plane that faces the sun; 0 where it is behind clouds or down. [lx]
    sun_direction : (hour, 3) float
        Unit vectors towards the sun: x east, y north, z up.
    sky_spectra, ground_spectra, sun_spectra : (hour, wavelength) float
        In `sky.SKY_WAVELENGTHS_NM`, of 1 lm. [W/nm/lm]
    """

    hours: IntArray
    luminance: FloatArray
    sun_illuminance: FloatArray
    sun_direction: FloatArray
    sky_spectra: FloatArray
    ground_spectra: FloatArray
    sun_spectra: FloatArray

    def __len__(self) -> int:
        return len(self.hours)

    @property
    def mean_radiance(self) -> FloatArray:
        """(patch, wavelength) mean over these hours, without the sun [W/m²/sr/nm]."""
        sky = self.luminance.T @ self.sky_spectra
        sky[GROUND] = self.luminance[:, GROUND] @ self.ground_spectra
        return np.asarray(sky / max(len(self), 1))


def year_sky(
    weather: Weather,
    patches: SkyPatches,
    folder: Path,
    engine: Engine,
    *,
    aerosol_optical_depth: float = 0.1,
    ground_reflectance: float = 0.2,
) -> YearSky:
    """Sky and sun of a year (see the module's text).

    Parameters
    ----------
    weather : Weather
    patches : SkyPatches
    folder : Path
        For the file that gendaymtx reads.
    engine : Engine
    aerosol_optical_depth : float
        At 550 nm; of the clear sky's spectrum. [1]
    ground_reflectance : float
        Of what lies outside. [0-1]

    Returns
    -------
    sky : YearSky

    Raises
    ------
    LampError
        If the weather has no light at all.
    EngineError
        If gendaymtx fails.
    """
    clear = clear_light(
        weather.times,
        weather.latitude_deg,
        weather.longitude_deg,
        aerosol_optical_depth=aerosol_optical_depth,
        ground_reflectance=ground_reflectance,
    )
    luminance = _gendaymtx(weather, patches, folder, engine, part="-s")
    of_sun = _gendaymtx(weather, patches, folder, engine, part="-d")
    hours = np.flatnonzero((luminance[:, 1:].max(axis=1) > 0) & (clear.altitude_deg > 0))
    if not hours.size:
        raise LampError(
            expected="a year with some daylight",
            found="none",
            where=f"weather '{weather.name}'",
            todo="Look whether the file has radiation, and latitude, longitude and time zone that belong together.",
        )
    luminance, clear_sun, clear_sky = luminance[hours], clear.sun[hours], clear.sky[hours]
    up = clear.direction[hours, 2]
    sun_illuminance = of_sun[hours, 1:] @ patches.solid_angles[1:]
    blue = _blue_share(weather, clear.dni, clear.dhi)[hours, None]
    through_clouds = _of_one_lumen(clear_sun * up[:, None] + clear_sky)
    sky_spectra = blue * _of_one_lumen(clear_sky) + (1.0 - blue) * through_clouds
    level = patches.solid_angles[1:] * patches.centers[1:, 2]
    from_sky, from_sun = luminance[:, 1:] @ level, sun_illuminance * up
    sun_spectra = _of_one_lumen(clear_sun)
    luminance[:, GROUND] = ground_reflectance / np.pi * (from_sky + from_sun)
    return YearSky(
        hours=hours,
        luminance=luminance,
        sun_illuminance=sun_illuminance,
        sun_direction=clear.direction[hours],
        sky_spectra=sky_spectra,
        ground_spectra=_of_one_lumen(from_sky[:, None] * sky_spectra + from_sun[:, None] * sun_spectra),
        sun_spectra=sun_spectra,
    )


def _blue_share(weather: Weather, clear_dni: FloatArray, clear_dhi: FloatArray) -> FloatArray:
    """(hour,) share of the sky's light that comes from blue sky, (1 - c) D_clear/D with 1 - c = DNI/DNI_clear [1]."""
    unclouded = np.divide(weather.dni, clear_dni, out=np.zeros_like(clear_dni), where=clear_dni > 0)
    share = np.divide(
        np.minimum(unclouded, 1.0) * clear_dhi, weather.dhi, out=np.zeros_like(clear_dhi), where=weather.dhi > 0
    )
    return np.minimum(share, 1.0)


def luminous_weights() -> FloatArray:
    """(wavelength,) lumens of a watt per nanometre in each of `SKY_WAVELENGTHS_NM` [lm nm/W]."""
    return np.array([luminous_flux_lm(sky_spectrum(unit, "bin")) for unit in np.eye(SKY_WAVELENGTHS_NM.size)])


def _of_one_lumen(spectra: FloatArray) -> FloatArray:
    """(hour, wavelength) scaled to one lumen each; even where a spectrum is dark, since there no light follows."""
    filled = np.where(spectra.max(axis=1, keepdims=True) > 0, spectra, 1.0)
    return np.asarray(filled / (filled @ luminous_weights())[:, None])


def _gendaymtx(weather: Weather, patches: SkyPatches, folder: Path, engine: Engine, *, part: str) -> FloatArray:
    """(hour, patch) luminance of the sky without the sun ('-s') or of the sun spread over patches ('-d') [cd/m²]."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / WEATHER_FILE).write_text(_weather_text(weather), encoding="utf-8", newline="\n")
    options = ["-h", "-of", "-m", str(patches.subdivision), "-c", "1", "1", "1", part, "-O0", WEATHER_FILE]
    run = engine.run("gendaymtx", options, folder=folder)
    values = float_rows(run, rows=len(patches), columns=3 * len(weather.times))
    return np.maximum(GENDAYMTX_EFFICACY_LM_W * values[:, ::3].T, 0.0)


def _weather_text(weather: Weather) -> str:
    """The form that gendaymtx reads, with longitude and time zone positive in the west."""
    head = (
        f"place weather\nlatitude {weather.latitude_deg:.6f}\nlongitude {-weather.longitude_deg:.6f}\n"
        f"time_zone {-15.0 * weather.offset_h:.6f}\nsite_elevation 0\nweather_data_file_units 1\n"
    )
    hours = weather.times.hour + weather.times.minute / 60.0
    rows = zip(weather.times.month, weather.times.day, hours, weather.dni, weather.dhi, strict=True)
    return head + "".join(f"{month} {day} {hour:.3f} {dni:.2f} {dhi:.2f}\n" for month, day, hour, dni, dhi in rows)
