"""A year of daylight at points, hour by hour, from the transport of the sky's patches.

With C the coefficient of a patch, D its part that comes straight through the windows, and R = C - D,

    E(hour) = Σ_patch C_p G_p L_p(hour)  +  E_n(hour) (Σ_patch R_p A_p(hour) + s(hour)),

L the patches' radiance, E_n the sun's irradiance, A_p its flux through the windows shared out to the patches around it,
and s what share of it reaches the point straight (`radiance.sampling.sky_transport`). All light of an hour's sky has
one spectrum, so that any quantity ∫ E s dλ needs one product of matrices a band.

A year is an xarray Dataset with the dims (hour, point), of the hours with light:

    illuminance, illuminance_se  (hour, point)       [lx]    daylight, without electric lamps; its standard error
    sun_illuminance              (hour, point)       [lx]    straight from the sun
    melanopic_edi                (hour, point)       [lx]    melanopic equivalent daylight illuminance (CIE S 026)
    ppfd                         (hour, point)  [umol m-2 s-1]  photons from 400 to 700 nm
    time                         (hour,)                     middle of the hour, local standard time
    luminance                    (hour, lamp)        [cd m-2]  of the patches of the sky
    sun_normal_illuminance       (hour,)             [lx]    outside, facing the sun
    sky_spectrum, ground_spectrum, sun_spectrum  (hour, wavelength)  [W nm-1 lm-1]  of one lumen
"""

from pathlib import Path

import numpy as np
import xarray as xr
from scipy.special import ndtr, stdtrit

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.io.netcdf import check_numbers, read_netcdf, write_netcdf
from lidarspectra.mapping.maps.map_schema import check_map, map_dataset
from lidarspectra.mapping.maps.response_weights import lamp_weights
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.radiance.sampling.uncertainty import COVERAGE_FACTOR, standard_error
from lidarspectra.radiance.scene.sky import SKY_WAVELENGTHS_NM, sky_spectrum
from lidarspectra.radiance.scene.sky_patches import GROUND
from lidarspectra.radiance.scene.weather import Weather
from lidarspectra.radiance.scene.year_sky import YearSky
from lidarspectra.spectra.spectrum import BandSet, Spectrum

SCHEMA = "lidarspectra year 2"
YEAR_FILE = "annual.nc"
_PLACES = ("x", "y", "z", "nx", "ny", "nz", "buried")
_SPECTRA = ("sky_spectrum", "ground_spectrum", "sun_spectrum")
_SHAPES = {
    "illuminance": ("hour", "point"),
    "illuminance_se": ("hour", "point"),
    "sun_illuminance": ("hour", "point"),
    "melanopic_edi": ("hour", "point"),
    "ppfd": ("hour", "point"),
    "luminance": ("hour", "lamp"),
    "sun_normal_illuminance": ("hour",),
} | dict.fromkeys(_SPECTRA, ("hour", "wavelength"))


def annual_light(transport: xr.Dataset, sky: YearSky, weather: Weather) -> xr.Dataset:
    """Daylight of every hour at every point (see the module's text).

    Parameters
    ----------
    transport : xarray.Dataset
        Of `trace_sky`, for this sky.
    sky : YearSky
    weather : Weather
        The sky's.

    Returns
    -------
    year : xarray.Dataset

    Raises
    ------
    MapError
        If the channels do not cover V(λ).
    """
    centers = transport["band"].to_numpy()
    if not covers_vision(centers):
        raise MapError(
            expected="channels that cover the eye's sensitivity V(λ)",
            found=f"{centers[0]:g} to {centers[-1]:g} nm",
            where="annual daylight",
            todo="Choose a device whose channels cover 430 to 680 nm ([sensors] device in the run file).",
        )
    lamps = _Lamps(transport, sky)
    visible = light_quantity("illuminance_lx").response
    melanopic = light_quantity("melanopic_edi_lx").response
    coefficient, direct = _coefficients(transport)
    straight = transport["sunlit"].transpose("hour", "point").to_numpy() * sky.sun_illuminance[:, None]
    values = {
        "illuminance": lamps.weigh(coefficient, direct, centers, visible),
        "illuminance_se": _standard_error(lamps, transport, centers, visible),
        "sun_illuminance": straight,
        "melanopic_edi": lamps.weigh(coefficient, direct, centers, melanopic),
        "ppfd": lamps.weigh(coefficient, direct, centers, light_quantity("ppfd_umol_m2_s").response),
        "luminance": lamps.luminance,
        "sun_normal_illuminance": sky.sun_illuminance,
        "sky_spectrum": sky.sky_spectra,
        "ground_spectrum": sky.ground_spectra,
        "sun_spectrum": sky.sun_spectra,
    }
    return _dataset(values, transport, sky, weather)


class _Lamps:
    """The fluxes of the patches in every hour, and of the sun."""

    def __init__(self, transport: xr.Dataset, sky: YearSky) -> None:
        self._sky = sky
        self._ground = transport["patch"].to_numpy() == GROUND
        self._sunlit = transport["sunlit"].transpose("hour", "point").to_numpy().astype(np.float64)
        self._area = transport["sun_area"].transpose("hour", "lamp").to_numpy().astype(np.float64)
        self.luminance = sky.luminance[:, transport["patch"].to_numpy()]
        self._flux = self.luminance * transport["geometry"].to_numpy()  # [lm]

    def weigh(
        self, coefficient: FloatArray, direct: FloatArray, centers_nm: FloatArray, response: Spectrum
    ) -> FloatArray:
        """(hour, point) ∫ E s dλ from a coefficient (lamp, point, band) that is linear between the bands' centres.

        Its part `direct` (lamp, point) comes straight through the windows.
        """
        of_sun = self._sky.sun_spectra @ self._units(centers_nm, response)
        normal = self._sky.sun_illuminance[:, None]
        straight = self._sunlit * of_sun.sum(axis=1, keepdims=True) * normal
        return np.asarray(straight + self.reflected(coefficient, direct, centers_nm, response), dtype=np.float64)

    def reflected(
        self, coefficient: FloatArray, direct: FloatArray, centers_nm: FloatArray, response: Spectrum
    ) -> FloatArray:
        """The same without what comes straight from the sun."""
        units = self._units(centers_nm, response)
        of_sky, of_ground, of_sun = (
            spectra @ units for spectra in (self._sky.sky_spectra, self._sky.ground_spectra, self._sky.sun_spectra)
        )
        above, below = self._flux * ~self._ground, self._flux * self._ground
        sun = self._area * self._sky.sun_illuminance[:, None]
        found = np.zeros((len(self._sky), coefficient.shape[1]))
        for band in range(centers_nm.size):
            whole = coefficient[:, :, band]
            found += (above @ whole) * of_sky[:, band : band + 1]
            found += (below @ whole) * of_ground[:, band : band + 1]
            found += (sun @ (whole - direct)) * of_sun[:, band : band + 1]
        return found

    @staticmethod
    def _units(centers_nm: FloatArray, response: Spectrum) -> FloatArray:
        """(wavelength, band) parts of ∫ c S s dλ for a coefficient of 1 in a band and light in one bin of the sky's."""
        bins = np.eye(SKY_WAVELENGTHS_NM.size)
        return np.array([lamp_weights(centers_nm, response, sky_spectrum(unit, "bin")) for unit in bins])


def _standard_error(lamps: _Lamps, transport: xr.Dataset, centers: FloatArray, response: Spectrum) -> FloatArray:
    """(hour, point) from the trace's independent estimates, widened as `uncertainty` does; else an upper bound."""
    if "coefficient_batches" not in transport:
        error = transport["coefficient_se"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
        return lamps.reflected(error, np.zeros(error.shape[:2]), centers, response)
    batches = transport["coefficient_batches"].transpose("batch", "lamp", "point", "band").to_numpy()
    count, direct = len(batches), _coefficients(transport)[1]
    middle = lamps.reflected(batches[0].astype(np.float64), direct, centers, response)
    total, squares = np.zeros((2, *middle.shape))  # one batch after the other: all together may take gigabytes
    for batch in batches[1:]:
        offset = lamps.reflected(batch.astype(np.float64), direct, centers, response) - middle
        total, squares = total + offset, squares + offset**2
    variance = np.maximum(squares - total**2 / count, 0.0) / (count - 1)
    widening = stdtrit(count - 1, ndtr(COVERAGE_FACTOR)) / COVERAGE_FACTOR
    return np.asarray(widening * np.sqrt(variance / count))


def _coefficients(transport: xr.Dataset) -> tuple[FloatArray, FloatArray]:
    """(lamp, point, band) coefficients, and their (lamp, point) part straight through the windows [m⁻²]."""
    whole = transport["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    return whole, transport["direct_coefficient"].transpose("lamp", "point").to_numpy().astype(np.float64)


def _dataset(values: dict[str, FloatArray], transport: xr.Dataset, sky: YearSky, weather: Weather) -> xr.Dataset:
    units = {
        "luminance": ("cd m-2", "luminance of the patch"),
        "sun_normal_illuminance": ("lx", "facing the sun outside"),
        "ppfd": ("umol m-2 s-1", "photons from 400 to 700 nm"),
    }
    units |= dict.fromkeys(_SPECTRA, ("W nm-1 lm-1", "spectrum of one lumen"))
    words = {
        "illuminance": "illuminance by daylight, without electric lamps",
        "illuminance_se": "standard error of the illuminance, of the simulation alone",
        "sun_illuminance": "illuminance straight from the sun",
        "melanopic_edi": "melanopic equivalent daylight illuminance",
    }
    units |= {name: ("lx", text) for name, text in words.items()}
    times = weather.times[sky.hours].tz_localize(None)
    coordinates: dict[str, object] = {name: transport[name] for name in _PLACES}
    coordinates["lamp"] = transport["lamp"]
    coordinates["time"] = ("hour", times.to_numpy().astype("datetime64[ns]"), {"long_name": "local standard time"})
    coordinates["wavelength"] = ("wavelength", SKY_WAVELENGTHS_NM, {"units": "nm"})
    return xr.Dataset(
        {
            name: (_SHAPES[name], array.astype(np.float32), {"units": units[name][0], "long_name": units[name][1]})
            for name, array in values.items()
        },
        coordinates,
        {
            "schema": SCHEMA,
            "Conventions": "CF-1.11",
            "weather": weather.name,
            "latitude_deg": weather.latitude_deg,
            "longitude_deg": weather.longitude_deg,
            "utc_offset_h": weather.offset_h,
            **{
                name: transport.attrs[name]
                for name in ("achieved_relative_se", "target_relative_se", "truncated_share", "sky_subdivision")
                if name in transport.attrs
            },
        },
    )


def save_year(year: xr.Dataset, path: Path) -> Path:
    """Write a year as NetCDF-4, whole or not at all; raises WorkspaceError if that cannot be done."""
    encoding = {name: {"zlib": True, "complevel": 1} for name in year.data_vars}
    write_netcdf(year, path, encoding=encoding)
    return path


def load_year(path: Path) -> xr.Dataset:
    """Read what `save_year` wrote.

    Raises
    ------
    WorkspaceError
        If the file is missing, damaged, or no year.
    """
    try:
        year = read_netcdf(path)
        if str(year.attrs.get("schema")) != SCHEMA:
            raise ValueError(f"schema {year.attrs.get('schema')!r}")
        for name, dims in _SHAPES.items():
            check_numbers(year, name, dims)
        year = year.assign_coords(time=xr.decode_cf(year[["time"]].reset_coords())["time"])
        if year["time"].dtype.kind != "M":
            raise ValueError("'time' that is no time")
    except (ValueError, KeyError) as cause:
        raise WorkspaceError(
            expected=f"a year of daylight in NetCDF-4 of schema '{SCHEMA}'",
            found=str(cause),
            where=str(path),
            todo="Make it with 'lidarspectra annual'.",
        ) from cause
    return year


def map_of_hour(year: xr.Dataset, transport: xr.Dataset, bands: BandSet, hour: int) -> xr.Dataset:
    """Spectral map of one hour.

    Parameters
    ----------
    year : xarray.Dataset
        Of `annual_light`.
    transport : xarray.Dataset
        That it was made of.
    bands : BandSet
        Its channels.
    hour : int
        Place among the year's hours with light.

    Returns
    -------
    map : xarray.Dataset
        See `map_schema`; its illuminance is the year's.
    """
    then = year.isel(hour=hour)
    spectra = {name: bands.band_values(sky_spectrum(then[name].to_numpy(), name), outside="zero") for name in _SPECTRA}
    below = (transport["patch"].to_numpy() == GROUND)[:, None]
    luminous = (then["luminance"].to_numpy() * transport["geometry"].to_numpy())[:, None]
    sky = luminous * np.where(below, spectra["ground_spectrum"], spectra["sky_spectrum"])
    normal = float(then["sun_normal_illuminance"]) * spectra["sun_spectrum"]  # [W/m²/nm]
    sun = transport["sun_area"].to_numpy()[hour][:, None] * normal
    coefficient, direct = _coefficients(transport)
    irradiance = np.einsum("lpb,lb->pb", coefficient, sky + sun)
    irradiance += transport["sunlit"].to_numpy()[hour][:, None] * normal - direct.T @ sun
    if "coefficient_batches" in transport:
        batches = transport["coefficient_batches"].transpose("batch", "lamp", "point", "band").to_numpy()
        repeats = np.einsum("klpb,lb->kpb", batches, sky + sun)
        error = standard_error(repeats)
    else:
        each = transport["coefficient_se"].transpose("lamp", "point", "band").to_numpy()
        error = np.einsum("lpb,lb->pb", each, sky + sun)
    values = {
        "irradiance": irradiance,
        "irradiance_se": error,
        "illuminance": then["illuminance"].to_numpy().astype(np.float64),
        "illuminance_se": then["illuminance_se"].to_numpy().astype(np.float64),
    }
    light = map_dataset(values, transport)
    light.attrs |= {
        "illuminance_from": "lamps",
        "time": str(np.datetime_as_string(then["time"].to_numpy(), unit="m")),
        "weather": year.attrs["weather"],
    }
    return check_map(light, where=f"map of hour {hour}")
