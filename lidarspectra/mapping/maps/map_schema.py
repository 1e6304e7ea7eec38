"""The dataset of a spectral map, and the checks that it passes wherever it is made or read.

A map is an xarray Dataset with the dims (point, band):

    irradiance, irradiance_se   (point, band)  [W m-2 nm-1]  band value, and its standard error
    truncation                  (point, band)  [W m-2 nm-1]  estimate of the light that is missing, since it was
                                                             reflected more often than was followed; where it is known
    opening                     (point, band)  [W m-2 nm-1]  what a bright wall in openings of the scan would add;
                                                             where default walls close them, what comes from those
    irradiance_sd               (point, band)  [W m-2 nm-1]  standard uncertainty for everything that is not known,
                                                             the standard error among it (`light_unknowns`)
    illuminance, illuminance_se (point,)       [lx]          where the bands cover V(λ) (`visible_bands`)
    illuminance_sd              (point,)       [lx]          where irradiance_sd is
    x, y, z                     (point,)       [m]
    nx, ny, nz                  (point,)       [1]           direction that the sensor faces
    buried                      (point,)                     inside furniture or outside the room: value is meaningless
    band, band_width, band_label (band,)       [nm]          centre, full width at half maximum, short name

`check_map` validates this schema wherever a map is made or read. The attribute `illuminance_from` says whether the
illuminance was computed from the lamps' whole spectra ('lamps') or from the band values alone ('bands'); `assumed`, in
the map of a run, what of it is a guess (`assumptions`); `uncertainty` and `uncertainty_of_...` the root mean square of
the uncertainty over points, over the mean light, in all and by cause; `unknown_channels`, of what channels the lamps'
spectra tell a part of the light at most. Maps of earlier versions are read without what they lack.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from lidarspectra.arguments import instance_of
from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import ArrayError, MapError
from lidarspectra.io.netcdf import LARGEST_VALUE
from lidarspectra.lamps.lamp_spectra import DARK_CHANNEL

IRRADIANCE_UNIT = "W m-2 nm-1"
ILLUMINANCE_UNIT = "lx"
SCHEMA = "lidarspectra spectral map 1"
POSITION = ("x", "y", "z")
DIRECTION = ("nx", "ny", "nz")
UNIT_LENGTH_TOLERANCE = 1e-6  # [1] of directions that were written to a text file with nine digits
LARGEST_COORDINATE_M = 1e9  # [m] as of a scan's
UNKNOWN_CHANNELS = "unknown_channels"  # attribute: labels, one a line
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
IRRADIANCES = {
    "irradiance": "spectral irradiance, mean over the channel's response",
    "irradiance_se": "standard error of the spectral irradiance",
}
ESTIMATES = {
    "truncation": "estimate of the light that is missing, since it was reflected more often than followed",
    "opening": "light that a bright wall in the openings of the scan would add, or that default walls there add",
}
UNCERTAINTIES = {
    "irradiance_sd": "standard uncertainty of the spectral irradiance, for everything that is not known",
}
ILLUMINANCES = {
    "illuminance": "illuminance",
    "illuminance_se": "standard error of the illuminance, the largest that any correlation of the bands allows",
}


UNCERTAIN_ILLUMINANCES = {
    "illuminance_sd": "standard uncertainty of the illuminance, for everything that is not known",
}


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
    require_variables(dataset, wanted | dict.fromkeys(IRRADIANCES, ("point", "band")), where=where)
    units = {name: unit for name, (_, unit, _) in _COORDINATES.items()} | dict.fromkeys(IRRADIANCES, IRRADIANCE_UNIT)
    # Not in the maps of earlier versions; estimates are not in those of plain rtrace either.
    for name in (ESTIMATES | UNCERTAINTIES).keys() & dataset.keys():
        require_variables(dataset, {name: ("point", "band")}, where=where)
        units[name] = IRRADIANCE_UNIT
    if has_illuminance(dataset):
        require_variables(dataset, dict.fromkeys(ILLUMINANCES, ("point",)), where=where)
        units |= dict.fromkeys(ILLUMINANCES, ILLUMINANCE_UNIT)
    for name in UNCERTAIN_ILLUMINANCES.keys() & dataset.keys():
        require_variables(dataset, {name: ("point",)}, where=where)
        units[name] = ILLUMINANCE_UNIT
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


def dark_bands(dataset: xr.Dataset) -> BoolArray:
    """(band,) those with less than a thousandth of the brightest one's mean light; none where all is dark."""
    mean = dataset["irradiance"].transpose("point", "band").to_numpy().astype(np.float64).mean(axis=0)
    return np.asarray((mean <= DARK_CHANNEL * mean.max()) & (mean.max() > 0), dtype=np.bool_)


def has_illuminance(dataset: xr.Dataset) -> bool:
    """Whether a map has an illuminance, or a part of one."""
    return any(name in dataset.variables for name in ILLUMINANCES)


def map_dataset(values: Mapping[str, FloatArray], source: xr.Dataset) -> xr.Dataset:
    """Values with the coordinates and attributes of a transport or table, with the schema's units and long names.

    Parameters
    ----------
    values : mapping of str to float array
        By the schema's names: irradiances and their errors (point, band), illuminances and theirs (point,).
        [W/m²/nm, lx]
    source : xarray.Dataset
        Has the coordinates of points and bands; its plain attributes are carried over.

    Returns
    -------
    dataset : xarray.Dataset

    Raises
    ------
    MapError
        If the source lacks a coordinate, or has it along another dimension.
    """
    require_variables(source, {name: (dim,) for name, (dim, _, _) in _COORDINATES.items()}, where="transport")
    coords: dict[str, tuple[str, np.ndarray[Any, Any], dict[str, str]]] = {}
    for name, (dim, unit, long_name) in _COORDINATES.items():
        attrs = {"long_name": long_name} | ({"units": unit} if unit is not None else {})
        if name == "band":
            attrs["standard_name"] = "radiation_wavelength"
        coords[name] = (dim, source[name].to_numpy(), attrs)
    variables: dict[str, tuple[tuple[str, ...], FloatArray, dict[str, str]]] = {
        name: (("point", "band"), values[name], {"units": IRRADIANCE_UNIT, "long_name": long_name})
        for name, long_name in (IRRADIANCES | ESTIMATES | UNCERTAINTIES).items()
        if name in values
    }
    variables |= {
        name: (("point",), values[name], {"units": ILLUMINANCE_UNIT, "long_name": long_name})
        for name, long_name in (ILLUMINANCES | UNCERTAIN_ILLUMINANCES).items()
        if name in values
    }
    carried = {key: value for key, value in source.attrs.items() if isinstance(value, str | int | float | np.generic)}
    return xr.Dataset(variables, coords, {**carried, "Conventions": "CF-1.11", "schema": SCHEMA})


def require_variables(dataset: xr.Dataset, wanted: Mapping[str, tuple[str, ...]], *, where: str) -> None:
    """Raise MapError if a variable is missing or has other dims, ArgumentError if it is no Dataset."""
    instance_of(dataset, xr.Dataset, name=where, todo="load_map reads one from a run's map.nc.")
    for name, dims in wanted.items():
        if name not in dataset.variables:
            raise MapError(expected=f"a variable '{name}'", found=listed(map(str, dataset.variables)), where=where)
        if set(dataset[name].dims) != set(dims):
            raise MapError(
                expected=f"'{name}' with the dims ({', '.join(dims)})", found=f"{dataset[name].dims}", where=where
            )


def listed(names: Iterable[object]) -> str:
    """Names for an error, twenty at most."""
    words = [str(name) for name in names]
    return ", ".join(words[:20]) + (f" and {len(words) - 20} more" if len(words) > 20 else "")


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
        raise ArrayError(expected="a label of its own for each band", found=listed(labels), where="band_label")
    lengths = np.linalg.norm([dataset[name].to_numpy() for name in DIRECTION], axis=0)
    if np.abs(lengths - 1.0).max() > UNIT_LENGTH_TOLERANCE:
        raise ArrayError(
            expected="directions of length 1", found=f"lengths {lengths.min()} to {lengths.max()}", where="nx, ny, nz"
        )
    if dataset["buried"].dtype != np.bool_:
        raise ArrayError(expected="true or false", found=f"{dataset['buried'].dtype}", where="buried")
    _check_values(dataset, points, channels)


def _check_values(dataset: xr.Dataset, points: int, channels: int) -> None:
    for name in (*IRRADIANCES, *((ESTIMATES | UNCERTAINTIES).keys() & dataset.keys())):
        largest = float(np.abs(dataset[name]).max()) if dataset[name].dtype.kind in "fiu" else np.inf
        if largest > LARGEST_VALUE:
            raise ArrayError(expected=f"numbers up to {LARGEST_VALUE:g}", found=f"{largest:g}", where=name)
    for name in (ESTIMATES | UNCERTAINTIES).keys() & dataset.keys():
        float_array(dataset[name].to_numpy(), name=name, shape=(points, channels))
    if has_illuminance(dataset):
        for name in (*ILLUMINANCES, *(UNCERTAIN_ILLUMINANCES.keys() & dataset.keys())):
            float_array(dataset[name].to_numpy(), name=name, shape=(points,))
    irradiance = float_array(dataset["irradiance"].to_numpy(), name="irradiance", shape=(points, channels))
    errors = float_array(dataset["irradiance_se"].to_numpy(), name="irradiance_se", shape=(points, channels))
    if errors.min() < 0 or np.any(irradiance < -NOISE_BELOW_ZERO * errors):
        raise ArrayError(
            expected="irradiances that are not negative beyond their noise",
            found=f"a least irradiance of {irradiance.min():g} and a least standard error of {errors.min():g}",
            where="irradiance",
        )
