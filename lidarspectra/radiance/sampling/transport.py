"""The transport: what every lamp sends to every sensor point in every band, for any flux the lamp may have.

A transport is an xarray Dataset with the dims (lamp, point, band):

    coefficient          (lamp, point, band)         [m-2]      irradiance per flux, E = Σ_lamp coefficient x flux
    coefficient_se       (lamp, point, band)         [m-2]      its standard error
    coefficient_batches  (batch, lamp, point, band)  [m-2]      independent estimates whose mean is `coefficient`
    flux                 (lamp, band)                [W nm-1]   what the lamps were traced with
    irradiance_se        (point, band)               [W m-2 nm-1]  standard error of the sum over lamps with that flux
    truncation_coefficient (lamp, point, band)       [m-2]      estimate of what the coefficient lacks: light that was
                                                                reflected more often than is followed
    truncation           (point, band)               [W m-2 nm-1]  the same of the sum over lamps with that flux
    opening_coefficient  (lamp, point, band)         [m-2]      where the scan is open: what a bright wall there would
                                                                add; where default walls close it, what comes from them
    opening              (point, band)               [W m-2 nm-1]  the same of the sum over lamps with that flux
    open_share           (point,)                    [1]        of what the sensor sees: openings, or such walls
    slot_error           (band,)                     [1]        predicted relative error of reflected light, from
                                                                reflectances that change within a slot
    missed_target        (point,)                               with `noise_of` 'point': its error is above the target
    slot_coefficient, slot_flux, slot_share, slot_channel, slot_weights   the same in finer slots (see `folding`)
    x y z nx ny nz buried (point,), lamp (lamp,), band band_width band_label (band,)

Lamps of one pass share their paths, so their errors are correlated and those of a sum do not follow from theirs;
`standard_error_of_sum` takes it from the batches. Large jobs leave the batches out (`KEPT_BATCH_VALUES`).
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import EngineError, WorkspaceError
from lidarspectra.io.netcdf import check_numbers, read_netcdf, write_netcdf
from lidarspectra.radiance.sampling.folding import SLOT_DIMS, slot_variables
from lidarspectra.radiance.sampling.stated_error import opening_stated
from lidarspectra.radiance.sampling.uncertainty import standard_error
from lidarspectra.radiance.scene.scene import RadianceScene

if TYPE_CHECKING:
    from lidarspectra.room.sensor_points import SensorPoints  # which loads what finds free space

SCHEMA = "lidarspectra transport 1"
MET_BY_CHANCE = "lamps_met_by_chance"  # attribute: names, a line each
SEEN_BY = "seen_by"  # attribute: the sensors' response in words, where it is not the cosine
TRANSPORT_FILE = "transport.nc"  # in the folder of a run's trace stage
KEPT_BATCH_VALUES = 8_000_000  # batches of more values (32 MB) than this are not kept
_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {  # name: (dims, unit, long name)
    "coefficient": (("lamp", "point", "band"), "m-2", "spectral irradiance per spectral flux of the lamp"),
    "coefficient_se": (("lamp", "point", "band"), "m-2", "standard error of the coefficient"),
    "flux": (("lamp", "band"), "W nm-1", "spectral radiant flux of the lamp, mean over the channel's response"),
    "irradiance_se": (("point", "band"), "W m-2 nm-1", "standard error of the irradiance by all lamps' flux"),
}
_OPTIONAL: dict[str, tuple[tuple[str, ...], str, str]] = {  # not in the files of earlier versions
    "truncation_coefficient": (
        ("lamp", "point", "band"),
        "m-2",
        "estimate of what the coefficient lacks: light that was reflected more often than was followed",
    ),
    "truncation": (
        ("point", "band"),
        "W m-2 nm-1",
        "estimate of the light by all lamps' flux that was reflected more often than was followed, and is missing",
    ),
    "opening_coefficient": (
        ("lamp", "point", "band"),
        "m-2",
        "what a bright wall in the openings of the scan would add to the coefficient, or what default walls there add",
    ),
    "opening": (
        ("point", "band"),
        "W m-2 nm-1",
        "light by all lamps' flux that a bright wall in the openings of the scan would add, or that default walls add",
    ),
    "open_share": (("point",), "1", "share of what the sensor sees that leaves the scan, or meets a default wall"),
    "slot_error": (
        ("band",),
        "1",
        "predicted relative error of reflected light, from reflectances that change within a slot of the channel",
    ),
}
_BATCHES = ("batch", "lamp", "point", "band")


def make_transport(
    scene: RadianceScene,
    points: "SensorPoints",
    *,
    coefficient: NDArray[np.floating],
    slot_coefficient: NDArray[np.floating] | None = None,
    coefficient_se: NDArray[np.floating],
    irradiance_se: NDArray[np.floating],
    truncation: NDArray[np.floating] | None = None,
    batches: NDArray[np.floating] | None,
    missed: BoolArray | None = None,
    attributes: dict[str, str | int | float],
) -> xr.Dataset:
    """Put traced numbers into a Dataset with units and coordinates (see the module's text).

    Parameters
    ----------
    scene : RadianceScene
        Lamps, bands and flux.
    points : SensorPoints
    coefficient, coefficient_se : (lamp, point, band) float
        [m⁻²]
    slot_coefficient : (lamp, point, slot) float, optional
        The same in the slots that were traced, from which other spectra are made. [m⁻²]
    irradiance_se : (point, band) float
        [W/m²/nm]
    truncation : (lamp, point, band) float, optional
        Estimate of what the coefficient lacks beyond the last reflection traced. [m⁻²]
    batches : (batch, lamp, point, band) float or None
        [m⁻²]
    missed : (point,) bool, optional
        Points whose error is above a target that was asked of each.
    attributes : dict
        How it was traced.

    Returns
    -------
    transport : xarray.Dataset

    Raises
    ------
    EngineError
        If a number is not finite.
    """
    values = {
        "coefficient": coefficient,
        "coefficient_se": coefficient_se,
        "flux": scene.flux,
        "irradiance_se": irradiance_se,
        "slot_error": scene.slots.error,
    }
    if truncation is not None:
        values["truncation_coefficient"] = truncation
        values["truncation"] = np.einsum("lpb,lb->pb", truncation, scene.flux, dtype=np.float64).astype(np.float32)
    for name, array in values.items():
        if not np.isfinite(array).all():
            raise EngineError(expected="finite numbers", found=f"NaN or infinity in {name}", where=str(scene.folder))
    variables: dict[str, tuple[object, ...]] = {
        name: (dims, values[name], {"units": unit, "long_name": text})
        for name, (dims, unit, text) in (_VARIABLES | _OPTIONAL).items()
        if name in values
    }
    coordinates = _coordinates(scene, points)
    if slot_coefficient is not None and (parts := slot_variables(scene, slot_coefficient)):
        variables |= parts
        grid = {"units": "nm", "long_name": "wavelength of the slots' weights"}
        coordinates["wavelength"] = ("wavelength", scene.slots.bands.wavelengths_nm, grid)
    if batches is not None:
        text = "independent estimates of the coefficient"
        variables["coefficient_batches"] = (_BATCHES, batches, {"units": "m-2", "long_name": text})
    if missed is not None:
        text = "standard error is above the target, of the point's own light"
        variables["missed_target"] = ("point", missed, {"long_name": text})
    return xr.Dataset(variables, coordinates, {**attributes, "Conventions": "CF-1.11", "schema": SCHEMA})


def with_opening(transport: xr.Dataset, *, share: FloatArray, coefficient: FloatArray, closed: bool) -> xr.Dataset:
    """The same transport with the light by way of openings (`opening_light`).

    Parameters
    ----------
    transport : xarray.Dataset
    share : (point,) float
        [0-1]
    coefficient : (lamp, point, band) float
        [m⁻²]
    closed : bool
        Whether default walls close the openings.

    Returns
    -------
    transport : xarray.Dataset
        Its attributes have `open_share` and `opening_share` (see `stated_error.opening_stated`) and `opening_closed`.
    """
    flux = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64)
    values = {
        "open_share": share,
        "opening_coefficient": coefficient,
        "opening": np.einsum("lpb,lb->pb", coefficient, flux),
    }
    variables = {
        name: (
            _OPTIONAL[name][0],
            array.astype(np.float32),
            {"units": _OPTIONAL[name][1], "long_name": _OPTIONAL[name][2]},
        )
        for name, array in values.items()
    }
    irradiance = np.einsum("lpb,lb->pb", transport["coefficient"].transpose("lamp", "point", "band").to_numpy(), flux)
    kept = ~transport["buried"].to_numpy()
    counted = kept if kept.any() else ~kept
    stated = opening_stated(values["opening"], irradiance, counted)
    attributes = {"open_share": float(share[counted].mean()), "opening_closed": int(closed), **stated}
    return transport.assign(variables).assign_attrs(attributes)


def standard_error_of_sum(transport: xr.Dataset, flux: ArrayLike | None = None) -> FloatArray:
    """Standard error of the irradiance Σ_lamp coefficient x flux.

    Parameters
    ----------
    transport : xarray.Dataset
    flux : (lamp, band) float, optional
        The traced one if left out. [W/nm]

    Returns
    -------
    error : (point, band) float
        From the batches where they were kept; else, for the traced flux, as the trace found it; else the sum of the
        lamps' errors, the largest that any correlation between them allows. [W/m²/nm]
    """
    traced = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64)
    used = traced if flux is None else np.asarray(flux, dtype=np.float64)
    if "coefficient_batches" in transport:
        batches = transport["coefficient_batches"].transpose(*_BATCHES).to_numpy()
        return standard_error(np.einsum("klpb,lb->kpb", batches, used, dtype=np.float64))
    if "irradiance_se" in transport and np.array_equal(used, traced):
        return np.asarray(transport["irradiance_se"].transpose("point", "band").to_numpy(), dtype=np.float64)
    errors = transport["coefficient_se"].transpose("lamp", "point", "band").to_numpy()
    return np.asarray(np.einsum("lpb,lb->pb", errors, used, dtype=np.float64))


def save_transport(transport: xr.Dataset, path: Path) -> Path:
    """Write a transport as NetCDF-4, whole or not at all.

    Raises
    ------
    WorkspaceError
        If the file cannot be written.
    """
    encoding = {name: {"zlib": True, "complevel": 1} for name in transport.data_vars}
    write_netcdf(transport, path, encoding=encoding)
    return path


def load_transport(path: Path) -> xr.Dataset:
    """Read a transport that `save_transport` wrote.

    Raises
    ------
    WorkspaceError
        If the file is missing, damaged, or no transport.
    """
    todo = "Run the trace stage again."
    try:
        transport = read_netcdf(path)
        if str(transport.attrs.get("schema")) != SCHEMA:
            raise ValueError(f"schema {transport.attrs.get('schema')!r}")
        for name, (dims, _, _) in _VARIABLES.items():
            check_numbers(transport, name, dims)
        if "coefficient_batches" in transport:
            check_numbers(transport, "coefficient_batches", _BATCHES)
        for name in _OPTIONAL.keys() & transport.keys():
            check_numbers(transport, name, _OPTIONAL[name][0])
        if "slot_coefficient" in transport:  # all or none: relighting needs them together
            for name, dims in SLOT_DIMS.items():
                check_numbers(transport, name, dims)
            channel = transport["slot_channel"].to_numpy()
            if channel.dtype.kind not in "iu" or not np.isin(channel, np.arange(transport.sizes["band"])).all():
                raise ValueError("'slot_channel' that names a channel which is not there")
    except ValueError as cause:
        raise WorkspaceError(
            expected=f"a transport in NetCDF-4 of schema '{SCHEMA}'", found=str(cause), where=str(path), todo=todo
        ) from cause
    return transport


def _coordinates(scene: RadianceScene, points: "SensorPoints") -> dict[str, object]:
    coordinates: dict[str, object] = {"lamp": ("lamp", list(scene.lamp_names), {"long_name": "lamp"})}
    for axis, name in enumerate("xyz"):
        coordinates[name] = ("point", points.positions[:, axis], {"units": "m", "long_name": f"{name} coordinate"})
        text = f"{name} component of the sensor's direction"
        coordinates[f"n{name}"] = ("point", points.normals[:, axis], {"units": "1", "long_name": text})
    text = "point lies inside furniture or outside the room"
    coordinates["buried"] = ("point", points.buried, {"long_name": text})
    wavelength = {"units": "nm", "standard_name": "radiation_wavelength", "long_name": "centre wavelength"}
    coordinates["band"] = ("band", scene.bands.centers_nm, wavelength)
    width = {"units": "nm", "long_name": "full width at half maximum"}
    coordinates["band_width"] = ("band", scene.bands.widths_nm, width)
    coordinates["band_label"] = ("band", list(scene.bands.labels), {"long_name": "short name of the channel"})
    return coordinates
