"""The spectral map: how much light of each band arrives at each point, E_b = Σ_lamp coefficient x flux.

A map is an xarray Dataset with the dims (point, band):

    irradiance, irradiance_se   (point, band)  [W m-2 nm-1]  band value, and its standard error
    truncation                  (point, band)  [W m-2 nm-1]  estimate of the light that is missing, since it was
                                                             reflected more often than was followed; where it is known
    illuminance, illuminance_se (point,)       [lx]          where the bands cover V(λ) (`visible_bands`)
    x, y, z                     (point,)       [m]
    nx, ny, nz                  (point,)       [1]           direction that the sensor faces
    buried                      (point,)                     inside furniture or outside the room: value is meaningless
    band, band_width, band_label (band,)       [nm]          centre, full width at half maximum, short name

`check_map` validates this schema wherever a map is made or read. The attribute `illuminance_from` says whether the
illuminance was computed from the lamps' whole spectra ('lamps') or from the band values alone ('bands'). Maps written
by versions without illuminance are read without it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arguments import all_of, instance_of, path_of
from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import ArrayError, LidarSpectraError, MapError
from lidarspectra.io.netcdf import LARGEST_VALUE, read_netcdf, write_netcdf
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.response_weights import band_weights, lamp_weights
from lidarspectra.mapping.maps.visible_bands import covers_vision, luminosity
from lidarspectra.radiance.sampling.folding import spectrum_error, with_spectrum
from lidarspectra.radiance.sampling.stated_error import stated_error
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.spectra.spectrum import BandSet, Spectrum

IRRADIANCE_UNIT = "W m-2 nm-1"
SCHEMA = "lidarspectra spectral map 1"
SPECTRUM_ERROR = "spectrum_error"  # attribute of a relit map [1]
MAP_FILE, MAP_TABLE_FILE = "map.nc", "map.csv"  # in the folder of a run's map stage, and of a relighting
POSITION = ("x", "y", "z")
DIRECTION = ("nx", "ny", "nz")
UNIT_LENGTH_TOLERANCE = 1e-6  # [1] of directions that were written to a text file with nine digits
CENTER_TOLERANCE_NM = 1e-6  # [nm] two band sets are the same within float noise
LARGEST_COORDINATE_M = 1e9  # [m] as of a scan's
NOISE_BELOW_ZERO = 6.0  # [1] standard errors by which Monte Carlo noise may take an estimate below zero

_COORDINATES: dict[str, tuple[str, str | None, str]] = {  # name: (dim, unit, long name)
    "x": ("point", "m", "x coordinate"),
    "y": ("point", "m", "y coordinate"),
    "z": ("point", "m", "height"),
    "nx": ("point", "1", "x component of the sensor's direction"),
    "ny": ("point", "1", "y component of the sensor's direction"),
    "nz": ("point", "1", "z component of the sensor's direction"),
    "buried": ("point", None, "point lies inside furniture or outside the room"),
    "band": ("band", "nm", "centre wavelength"),
    "band_width": ("band", "nm", "full width at half maximum"),
    "band_label": ("band", None, "short name of the channel"),
}
_VARIABLES = {
    "irradiance": "spectral irradiance, mean over the channel's response",
    "irradiance_se": "standard error of the spectral irradiance",
}


_TRUNCATION = {"truncation": "estimate of the light that is missing, since it was reflected more often than followed"}
_ILLUMINANCE = {
    "illuminance": "illuminance",
    "illuminance_se": "standard error of the illuminance, the largest that any correlation of the bands allows",
}
_LUX_COLUMNS = {"illuminance": "illuminance_lx", "illuminance_se": "SE_illuminance_lx"}  # of the table
ILLUMINANCE_UNIT = "lx"
_TRANSPORT = {
    "coefficient": ("lamp", "point", "band"),
    "coefficient_se": ("lamp", "point", "band"),
    "flux": ("lamp", "band"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class LampChange:
    """A change to one lamp in relighting.

    Parameters
    ----------
    flux : Spectrum or (band,) float or None
        Its new spectral radiant flux, or that flux in every band; None keeps the traced one. [W/nm]
    dim : float
        Factor on that flux; 0 switches the lamp off, 1 is as traced. [0-1]
    """

    flux: Spectrum | FloatArray | None = None
    dim: float = 1.0

    def __post_init__(self) -> None:
        if not 0 <= self.dim <= 1:
            raise MapError(
                expected="a dim factor from 0 to 1, as in the run file",
                found=f"{self.dim}",
                where="lamp change",
                todo="Give a fraction: 0.4 for 40 %. For more light than was traced give the new flux.",
            )


def spectral_map(
    transport: xr.Dataset, flux: ArrayLike | None = None, *, lamps: Sequence[Lamp] | None = None
) -> xr.Dataset:
    """Spectral irradiance at every point, E_b = Σ_lamp coefficient[lamp, b] x flux[lamp, b] (docs/concepts.md, Eq. 3).

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients [m-2] with the dims (lamp, point, band), and the flux they were traced for.
    flux : (lamp, band) float, optional
        Band values of every lamp's spectral flux; the traced ones if left out. [W/nm]
    lamps : sequence of Lamp, optional
        The traced ones. With them, and without `flux`, the illuminance is E_v = 683 lm/W Σ_lamp ∫ V c_lamp Φ_lamp dλ
        over their whole spectra; without them it is taken from the band values, a few per cent off for lamps with
        lines.

    Returns
    -------
    map : xarray.Dataset
        See the module docstring; it carries the transport's attributes (accuracy, noise, ...).

    Raises
    ------
    ArgumentError
        If the transport is no Dataset.
    MapError
        If the transport lacks a variable, the flux has another shape or is negative, or a lamp is missing.
    """
    instance_of(transport, xr.Dataset, name="transport", todo="trace gives one.")
    _require(transport, _TRANSPORT, where="transport")
    spectra = None
    if lamps is not None and flux is None:
        spectra = {lamp.name: lamp.flux for lamp in all_of(lamps, Lamp, name="lamps")}
    return _light_map(transport, flux, spectra)


def _light_map(transport: xr.Dataset, flux: ArrayLike | None, spectra: Mapping[str, Spectrum] | None) -> xr.Dataset:
    """The map for a flux in every band and, for the illuminance, the spectra [W/nm] that it comes of."""
    traced = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64)
    used = traced if flux is None else _checked_flux(flux, traced.shape)
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy()
    values = {
        "irradiance": np.einsum("lpb,lb->pb", coefficient, used),
        "irradiance_se": standard_error_of_sum(transport, used),
    }
    if "truncation_coefficient" in transport:
        missing = transport["truncation_coefficient"].transpose("lamp", "point", "band").to_numpy()
        values["truncation"] = np.einsum("lpb,lb->pb", missing, used)
    centers = transport["band"].to_numpy()
    if not covers_vision(centers):
        return check_map(_dataset(values, transport), where="spectral map")
    values |= _illuminance(values, centers, coefficient, _visible_flux(transport, spectra))
    light = _dataset(values, transport)
    light.attrs["illuminance_from"] = "bands" if spectra is None else "lamps"
    return check_map(light, where="spectral map")


def _visible_flux(transport: xr.Dataset, spectra: Mapping[str, Spectrum] | None) -> FloatArray | None:
    """(lamp, band) weights with E_v = Σ weight x coefficient [lm], or None where the spectra are not known."""
    if spectra is None:
        return None
    centers, names = transport["band"].to_numpy(), [str(name) for name in transport["lamp"].to_numpy()]
    for name in names:
        if name not in spectra:
            raise MapError(expected=f"the lamp '{name}', which was traced", found=_listed(spectra), where="lamps")
    return np.stack([lamp_weights(centers, luminosity(), spectra[name]) for name in names])


def _illuminance(
    values: Mapping[str, FloatArray], centers: FloatArray, coefficient: FloatArray, weights: FloatArray | None
) -> dict[str, FloatArray]:
    """Illuminance and its standard error [lx]; the bands' errors add up, as if they all had the same sign."""
    irradiance, error = values["irradiance"], values["irradiance_se"]
    if weights is None:
        by_band = irradiance * band_weights(centers, luminosity())
    else:
        by_band = np.einsum("lpb,lb->pb", coefficient.astype(np.float64), weights)
    relative = error / np.where(irradiance > 0, irradiance, np.inf)
    return {"illuminance": by_band.sum(axis=1), "illuminance_se": (np.abs(by_band) * relative).sum(axis=1)}


def relight(
    transport: xr.Dataset,
    changes: Mapping[str, LampChange],
    *,
    bands: BandSet | None = None,
    lamps: Sequence[Lamp] | None = None,
) -> xr.Dataset:
    """A new map for new lamp spectra or dimming, without tracing again.

    Superposition makes dimming exact. A new spectrum is exact but for what each slot assumed of the old one: its
    reflectances are weighted by the lamp that was traced. Slots are cut so fine that lamps of the common kinds are
    right to about 1 % (`radiance.scene.slots`); the error foretold for this one, as a share of the reflected light in
    the worst channel, is the attribute 'spectrum_error'.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients.
    changes : mapping of str to LampChange
        By lamp name; lamps that are not named stay as traced.
    bands : BandSet, optional
        The transport's channels, needed where a change holds a Spectrum.
    lamps : sequence of Lamp, optional
        The traced ones, for an illuminance over whole spectra as in `spectral_map`; not where a change holds band
        values.

    Returns
    -------
    map : xarray.Dataset

    Raises
    ------
    MapError
        If a lamp is unknown, or the bands are missing or are not the transport's.
    """
    _require(transport, {"flux": ("lamp", "band")}, where="transport")
    names = [str(name) for name in transport["lamp"].to_numpy()]
    flux = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64).copy()
    spectra: dict[str, Spectrum] | None = None if lamps is None else {lamp.name: lamp.flux for lamp in lamps}
    errors: list[float] = []
    for name, change in changes.items():
        instance_of(
            change, LampChange, name=f"change of lamp '{name}'", todo="Write LampChange(dim=0.5), for instance."
        )
        if name not in names:
            raise MapError(
                expected=f"one of the traced lamps ({_listed(names)})",
                found=f"'{name}'",
                where="relighting",
                todo="Name one of these; to add a lamp, put it into the run file and run again.",
            )
        row = names.index(name)
        if change.flux is not None:
            flux[row] = _band_flux(change.flux, transport, bands)
        if isinstance(change.flux, Spectrum):
            errors.append(float(np.abs(spectrum_error(transport, name, change.flux)).max(initial=0.0)))
            transport = with_spectrum(transport, name, change.flux)
        flux[row] *= change.dim
        spectra = _changed_spectra(spectra, name, change)
    _require(transport, _TRANSPORT, where="transport")
    light = _light_map(transport, flux, spectra)
    light.attrs[SPECTRUM_ERROR] = max(errors, default=0.0)
    return _with_its_own_error(light, transport)


def _with_its_own_error(light: xr.Dataset, transport: xr.Dataset) -> xr.Dataset:
    """A relit map whose attributes state its own error in place of the traced light's."""
    if "target_relative_se" not in light.attrs:
        return light
    for name in ("achieved_relative_se", "truncated_share", "slot_error", "target_met"):
        light.attrs.pop(name, None)
    known = transport["slot_error"].to_numpy() if "slot_error" in transport else np.zeros(light.sizes["band"])
    stated, _ = stated_error(
        irradiance=light["irradiance"].to_numpy(),
        irradiance_se=light["irradiance_se"].to_numpy(),
        truncation=light["truncation"].to_numpy() if "truncation" in light else None,
        slot_error=np.maximum(known, light.attrs[SPECTRUM_ERROR]),
        counted=np.isin(np.arange(light.sizes["point"]), kept_points(light)),
        target=float(light.attrs["target_relative_se"]),
        each_point=light.attrs.get("noise_of") == "point",
    )
    light.attrs.update(stated)
    return light


def _changed_spectra(spectra: dict[str, Spectrum] | None, name: str, change: LampChange) -> dict[str, Spectrum] | None:
    """The lamps' spectra after a change; None where it holds band values, which are no spectrum."""
    if spectra is None or not (change.flux is None or isinstance(change.flux, Spectrum)):
        return None
    flux = spectra.get(name) if change.flux is None else change.flux
    return spectra if flux is None else {**spectra, name: flux.scaled(change.dim)}


def check_map(dataset: xr.Dataset, *, where: str) -> xr.Dataset:
    """Validate a Dataset against the schema of a spectral map.

    Parameters
    ----------
    dataset : xarray.Dataset
    where : str
        File or step, for the error.

    Returns
    -------
    map : xarray.Dataset
        The same, its variables in (point, band) order.

    Raises
    ------
    MapError
        If a variable, dim, unit or label is missing or differs, a number is NaN, infinite or clearly negative, bands
        do not ascend, or a direction is not a unit vector.
    """
    wanted = {name: (dim,) for name, (dim, _, _) in _COORDINATES.items()}
    _require(dataset, wanted | dict.fromkeys(_VARIABLES, ("point", "band")), where=where)
    units = {name: unit for name, (_, unit, _) in _COORDINATES.items()} | dict.fromkeys(_VARIABLES, IRRADIANCE_UNIT)
    if "truncation" in dataset:  # not in the maps of earlier versions, nor of plain rtrace
        _require(dataset, {"truncation": ("point", "band")}, where=where)
        units["truncation"] = IRRADIANCE_UNIT
    if _has_illuminance(dataset):
        _require(dataset, dict.fromkeys(_ILLUMINANCE, ("point",)), where=where)
        units |= dict.fromkeys(_ILLUMINANCE, ILLUMINANCE_UNIT)
    for name, unit in units.items():
        found = dataset[name].attrs.get("units")
        if unit is not None and str(found) != unit:
            raise MapError(expected=f"'{name}' in {unit}", found=f"unit {found!r}", where=where)
    ordered = dataset.transpose("point", "band", missing_dims="ignore")
    try:
        _check_numbers(ordered)
    except ArrayError as cause:
        raise MapError(
            expected=cause.expected, found=cause.found, where=f"{where}, {cause.where}", todo=cause.todo
        ) from cause
    return ordered


def kept_points(dataset: xr.Dataset) -> IntArray:
    """Indices of the points that are not buried, for statistics; of all where every point is buried."""
    kept = ~dataset["buried"].to_numpy()
    return np.flatnonzero(kept if kept.any() else np.ones(kept.size, dtype=np.bool_))


def save_map(dataset: xr.Dataset, path: str | PathLike[str]) -> Path:
    """Write a spectral map as NetCDF-4, atomically.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    path : str or path
        map.nc, for instance.

    Returns
    -------
    path : Path

    Raises
    ------
    MapError
        If the Dataset is not a spectral map.
    WorkspaceError
        If the file cannot be written.
    """
    path = path_of(path, name="path")
    checked = check_map(dataset, where="map to save")
    encoding = {name: {"zlib": True, "complevel": 4} for name in checked.data_vars}
    write_netcdf(checked, path, encoding=encoding)
    return path


def load_map(path: str | PathLike[str]) -> xr.Dataset:
    """Read a spectral map that a run wrote (`6-map/map.nc`), or `save_map`.

    Parameters
    ----------
    path : str or path
        NetCDF-4.

    Returns
    -------
    map : xarray.Dataset
        (point, band) irradiance and irradiance_se [W m-2 nm-1] with their coordinates: see the module docstring.

    Raises
    ------
    MapError
        If the file is missing, or holds no spectral map in NetCDF-4.
    """
    path = path_of(path, name="path", meaning="the name of a map's file (map.nc), as a str or a Path")
    with _reported(path, expected="a spectral map in NetCDF-4", todo="Run the map stage again."):
        dataset = read_netcdf(path)
    return check_map(dataset, where=str(path))


def map_table(dataset: xr.Dataset) -> pd.DataFrame:
    """A spectral map as a wide table, one row per point.

    Returns
    -------
    table : pandas.DataFrame
        x, y, z [m], nx, ny, nz [1], buried (0 or 1), E_410 ... and their standard errors SE_410 ... [W/m²/nm]; where
        the bands tell it illuminance_lx and SE_illuminance_lx [lx].
    """
    checked = check_map(dataset, where="map to tabulate")
    columns: dict[str, ArrayLike] = {name: checked[name].to_numpy() for name in (*POSITION, *DIRECTION)}
    columns["buried"] = checked["buried"].to_numpy().astype(np.int64)
    for prefix, name in (("E", "irradiance"), ("SE", "irradiance_se")):
        values = checked[name].to_numpy()
        columns |= {f"{prefix}_{label}": values[:, b] for b, label in enumerate(checked["band_label"].to_numpy())}
    if _has_illuminance(checked):
        columns |= {column: checked[name].to_numpy() for name, column in _LUX_COLUMNS.items()}
    return pd.DataFrame(columns)


def save_map_table(dataset: xr.Dataset, path: str | PathLike[str]) -> Path:
    """Write `map_table` as CSV with nine significant digits.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    path : str or path
        map.csv, for instance.

    Returns
    -------
    path : Path

    Raises
    ------
    MapError
        If the Dataset is not a spectral map, or the file cannot be written.
    """
    path = path_of(path, name="path")
    table = map_table(dataset)
    with _reported(path, expected="a file that can be written", todo="Choose a folder that you may write to."):
        table.to_csv(path, index=False, float_format="%.9g", encoding="utf-8", lineterminator="\n")
    return path


def read_map_table(path: Path, *, bands: BandSet) -> xr.Dataset:
    """Read a map from the CSV of `save_map_table`; channels are found by their column names, never by position.

    Parameters
    ----------
    path : Path
        The CSV.
    bands : BandSet
        Its channels; each needs its columns E_<label> and SE_<label>.

    Raises
    ------
    MapError
        If the file cannot be read, a column is missing or is not numeric.
    """
    with _reported(path, expected="a map table (CSV)", todo="Export the map again."):
        table = pd.read_csv(path, encoding="utf-8")
    columns = [*POSITION, *DIRECTION, "buried", *(f"{kind}_{label}" for kind in ("E", "SE") for label in bands.labels)]
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise MapError(expected=f"a column '{missing[0]}'", found=f"columns {_listed(table.columns)}", where=str(path))
    for name in columns:
        _numbers_of(table, name, path)
    values = {
        name: table[[f"{kind}_{label}" for label in bands.labels]].to_numpy(np.float64)
        for kind, name in (("E", "irradiance"), ("SE", "irradiance_se"))
    }
    if set(_LUX_COLUMNS.values()) <= set(table.columns):
        values |= {name: _numbers_of(table, column, path) for name, column in _LUX_COLUMNS.items()}
    source = xr.Dataset(
        coords={name: ("point", table[name].to_numpy(np.float64)) for name in (*POSITION, *DIRECTION)}
        | {
            "buried": ("point", table["buried"].to_numpy() != 0),
            "band": ("band", bands.centers_nm),
            "band_width": ("band", bands.widths_nm),
            "band_label": ("band", list(bands.labels)),
        }
    )
    return check_map(_dataset(values, source), where=str(path))


def _numbers_of(table: pd.DataFrame, column: str, path: Path) -> FloatArray:
    if not pd.api.types.is_numeric_dtype(table[column]):
        raise MapError(expected="numbers only", found="other text", where=f"{path}, column '{column}'")
    return table[column].to_numpy(np.float64)


def _has_illuminance(dataset: xr.Dataset) -> bool:
    return any(name in dataset.variables for name in _ILLUMINANCE)


def _dataset(values: Mapping[str, FloatArray], source: xr.Dataset) -> xr.Dataset:
    """Values with the coordinates and attributes of a transport or table, with the schema's units and long names."""
    _require(source, {name: (dim,) for name, (dim, _, _) in _COORDINATES.items()}, where="transport")
    coords: dict[str, tuple[str, np.ndarray[Any, Any], dict[str, str]]] = {}
    for name, (dim, unit, long_name) in _COORDINATES.items():
        attrs = {"long_name": long_name} | ({"units": unit} if unit is not None else {})
        if name == "band":
            attrs["standard_name"] = "radiation_wavelength"
        coords[name] = (dim, source[name].to_numpy(), attrs)
    variables: dict[str, tuple[tuple[str, ...], FloatArray, dict[str, str]]] = {
        name: (("point", "band"), values[name], {"units": IRRADIANCE_UNIT, "long_name": long_name})
        for name, long_name in (_VARIABLES | _TRUNCATION).items()
        if name in values
    }
    variables |= {
        name: (("point",), values[name], {"units": ILLUMINANCE_UNIT, "long_name": long_name})
        for name, long_name in _ILLUMINANCE.items()
        if name in values
    }
    carried = {key: value for key, value in source.attrs.items() if isinstance(value, str | int | float | np.generic)}
    return xr.Dataset(variables, coords, {**carried, "Conventions": "CF-1.11", "schema": SCHEMA})


def _checked_flux(flux: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    try:
        array = float_array(flux, name="flux", shape=shape)
    except ArrayError as cause:
        raise MapError(expected=cause.expected, found=cause.found, where="flux of the lamps") from cause
    if np.any(array < 0):
        raise MapError(expected="a flux of 0 or more", found=f"{array.min():g} W/nm", where="flux of the lamps")
    return array


def _band_flux(flux: Spectrum | FloatArray, transport: xr.Dataset, bands: BandSet | None) -> FloatArray:
    centers = transport["band"].to_numpy()
    if not isinstance(flux, Spectrum):
        return _checked_flux(flux, centers.shape)
    same = bands is not None and bands.centers_nm.shape == centers.shape
    if bands is None or not same or np.abs(bands.centers_nm - centers).max() > CENTER_TOLERANCE_NM:
        raise MapError(
            expected=f"the band set that was traced ({centers.size} channels)",
            found="none" if bands is None else f"'{bands.name}' with {len(bands)} channels",
            where="relighting with a spectrum",
        )
    return _checked_flux(bands.band_values(flux, outside="zero"), centers.shape)


def _check_numbers(dataset: xr.Dataset) -> None:
    points, channels = dataset.sizes["point"], dataset.sizes["band"]
    if not points or not channels:
        raise ArrayError(expected="at least one point and one band", found=f"{points} and {channels}", where="dims")
    for name in (*POSITION, *DIRECTION):
        numbers = float_array(dataset[name].to_numpy(), name=name, shape=(points,))
        if np.abs(numbers).max() > LARGEST_COORDINATE_M:
            found = f"{np.abs(numbers).max():g}"
            raise ArrayError(expected=f"coordinates up to {LARGEST_COORDINATE_M:g} m", found=found, where=name)
    for name in ("band", "band_width"):
        numbers = float_array(dataset[name].to_numpy(), name=name, shape=(channels,))
        if numbers.min() <= 0 or (name == "band" and np.any(np.diff(numbers) <= 0)):
            raise ArrayError(expected="positive wavelengths, centres ascending", found=f"{numbers}", where=name)
    labels = [str(label) for label in dataset["band_label"].to_numpy()]
    if len(set(labels)) != channels:
        raise ArrayError(expected="a label of its own for each band", found=_listed(labels), where="band_label")
    lengths = np.linalg.norm([dataset[name].to_numpy() for name in DIRECTION], axis=0)
    if np.abs(lengths - 1.0).max() > UNIT_LENGTH_TOLERANCE:
        raise ArrayError(
            expected="directions of length 1", found=f"lengths {lengths.min()} to {lengths.max()}", where="nx, ny, nz"
        )
    if dataset["buried"].dtype != np.bool_:
        raise ArrayError(expected="true or false", found=f"{dataset['buried'].dtype}", where="buried")
    for name in (*_VARIABLES, *(_TRUNCATION if "truncation" in dataset else ())):
        largest = float(np.abs(dataset[name]).max()) if dataset[name].dtype.kind in "fiu" else np.inf
        if largest > LARGEST_VALUE:
            raise ArrayError(expected=f"numbers up to {LARGEST_VALUE:g}", found=f"{largest:g}", where=name)
    if "truncation" in dataset:
        float_array(dataset["truncation"].to_numpy(), name="truncation", shape=(points, channels))
    if _has_illuminance(dataset):
        for name in _ILLUMINANCE:
            float_array(dataset[name].to_numpy(), name=name, shape=(points,))
    irradiance = float_array(dataset["irradiance"].to_numpy(), name="irradiance", shape=(points, channels))
    errors = float_array(dataset["irradiance_se"].to_numpy(), name="irradiance_se", shape=(points, channels))
    if errors.min() < 0 or np.any(irradiance < -NOISE_BELOW_ZERO * errors):
        raise ArrayError(
            expected="irradiances that are not negative beyond their noise",
            found=f"a least irradiance of {irradiance.min():g} and a least standard error of {errors.min():g}",
            where="irradiance",
        )


def _require(dataset: xr.Dataset, wanted: Mapping[str, tuple[str, ...]], *, where: str) -> None:
    for name, dims in wanted.items():
        if name not in dataset.variables:
            raise MapError(expected=f"a variable '{name}'", found=_listed(map(str, dataset.variables)), where=where)
        if set(dataset[name].dims) != set(dims):
            raise MapError(
                expected=f"'{name}' with the dims ({', '.join(dims)})", found=f"{dataset[name].dims}", where=where
            )


def _listed(names: Iterable[object]) -> str:
    words = [str(name) for name in names]
    return ", ".join(words[:20]) + (f" and {len(words) - 20} more" if len(words) > 20 else "")


@contextmanager
def _reported(path: Path, *, expected: str, todo: str) -> Iterator[None]:
    """Turn what file libraries raise into one error of ours."""
    try:
        yield
    except LidarSpectraError:
        raise
    except (OSError, ValueError, KeyError, RuntimeError, TypeError) as cause:
        raise MapError(
            expected=expected, found=str(cause) or type(cause).__name__, where=str(path), todo=todo
        ) from cause
