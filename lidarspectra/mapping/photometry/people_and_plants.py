"""Every quantity of light for people and plants at every point of a run, as one Dataset and as tables."""

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.maps.point_values import places_of
from lidarspectra.mapping.photometry.channel_color import channel_color
from lidarspectra.mapping.photometry.channel_estimate import Method, channel_estimate
from lidarspectra.mapping.photometry.color_quality import COLOR_GRID_NM, color_quality, temperature_of_tristimulus
from lidarspectra.mapping.photometry.indoor_spectra import IndoorSpectra, indoor_spectra
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photometry.quantities import light_quantities
from lidarspectra.progress import Progress, silent
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.words import counted

FIRST = "illuminance_lx"  # what a reader looks for
MAX_RENDERED = 500  # points whose colour rendering is computed, at about 50 ms each, spread evenly over the list
METHOD_WORDS = {
    "lamps": "the lamps' full spectra, with the room's effect on them from the channels",
    "lines": "the channels alone, with linear interpolation between them",
    "learned": "the channels alone, with weights fitted to an ensemble of indoor spectra",
}
COLOR_COLUMNS = {
    "cct_K": ("correlated colour temperature", "K"),
    "duv": ("distance from the Planckian locus", "1"),
    "cri_Ra": ("colour rendering index", "1"),
    "tm30_Rf": ("TM-30 fidelity index", "1"),
    "tm30_Rg": ("TM-30 gamut index", "1"),
}


def method_for(light: PointLight) -> Method:
    """'lamps' where their spectra are known; else 'lines' for fine bands and 'learned' for coarse ones."""
    if light.route == "lamps":
        return "lamps"
    return "lines" if light.is_full_spectrum else "learned"


def light_at_points(
    light: PointLight,
    places: xr.Dataset,
    bands: BandSet,
    *,
    ensemble: IndoorSpectra | None = None,
    rendering: bool = True,
    progress: Progress = silent,
) -> xr.Dataset:
    """All quantities at all points.

    Parameters
    ----------
    light : PointLight
        See `point_light`.
    places : xarray.Dataset
        The map or transport whose points these are: x, y, z, nx, ny, nz, buried.
    bands : BandSet
        The light's channels.
    ensemble : IndoorSpectra, optional
        Spectra for the error of the channels and, where only the channels are known, for fitting their weights;
        `indoor_spectra()` if left out.
    rendering : bool
        Compute CRI and TM-30 too, where the spectra are fine enough: about 50 ms per point.
    progress : callable
        See `lidarspectra.progress`.

    Returns
    -------
    quantities : xarray.Dataset
        Dim point; a variable for each of `light_quantities` with its standard error (`..._se`), and those of
        `COLOR_COLUMNS`. Colour rendering is NaN where only bands more than 10 nm apart are known, and at points that
        are not among the 500 for which it is computed. Attribute `method`: see `method_for`; attribute
        `channel_error_percent` of each integral and of the colour temperature: 95th percentile of the channels' error
        over indoor spectra.
    """
    tried = indoor_spectra() if ensemble is None else ensemble
    method = method_for(light)
    variables: dict[str, tuple[str, FloatArray, dict[str, object]]] = {}
    for quantity in light_quantities():
        estimate = channel_estimate(tried, bands, quantity.response, method=method)
        value, error = light.weigh(quantity.response)
        if method == "learned":
            value, error = light.irradiance @ estimate.weights, light.irradiance_se @ np.abs(estimate.weights)
        about = {"units": quantity.unit, "long_name": quantity.words}
        attributes = {"channel_error_percent": 100.0 * estimate.percentile(95.0)}
        variables[quantity.name] = ("point", value, {**about, **attributes})
        variables[quantity.name + "_se"] = ("point", error, {**about, "long_name": f"standard error, {quantity.words}"})
    told = channel_color(tried, bands, method=method)
    colors = _colors(light, kept_points(places), rendering, progress)
    if method == "learned":
        colors["cct_K"], colors["duv"] = temperature_of_tristimulus(light.irradiance @ told.weights.T)
    for name, values in colors.items():
        words, unit = COLOR_COLUMNS[name]
        variables[name] = ("point", values, {"units": unit, "long_name": words})
    variables["cct_K"][2]["channel_error_percent"] = told.cct_error_percent
    return xr.Dataset(variables, places_of(places), {"method": method, "bands": len(bands)})


def _colors(light: PointLight, kept: IntArray, rendering: bool, progress: Progress) -> dict[str, FloatArray]:
    count = light.irradiance.shape[0]
    spectra = light.spectra(COLOR_GRID_NM)
    every = color_quality(spectra, rendering=False)
    columns = {name: np.full(count, np.nan) for name in COLOR_COLUMNS}
    columns["cct_K"], columns["duv"] = every.cct_k, every.duv
    if rendering and light.is_full_spectrum:
        chosen = kept[np.unique(np.linspace(0, kept.size - 1, MAX_RENDERED).astype(int))]
        found = color_quality(spectra[chosen], progress=progress)
        for name, values in (("cri_Ra", found.cri_ra), ("tm30_Rf", found.tm30_rf), ("tm30_Rg", found.tm30_rg)):
            columns[name][chosen] = values
    return columns


def summary_table(quantities: xr.Dataset, *, before: PointLight | None = None) -> Table:
    """Mean and range of every quantity over the points that are not buried, and the error due to the channels.

    Parameters
    ----------
    quantities : xarray.Dataset
        Of `light_at_points`.
    before : PointLight, optional
        The light before its lamps were changed, for the columns 'mean as traced' and 'change'.

    Returns
    -------
    table : Table
        The illuminance first. 'channels' is the 95th percentile of the error due to these channels over the ensemble,
        lamps and surfaces of all kinds; it adds to the standard error of the trace. Empty for Duv and colour rendering.
    """
    kept = kept_points(quantities)
    rows = []
    ordered = sorted(light_quantities(), key=lambda quantity: quantity.name != FIRST)
    for quantity in ordered:
        values = quantities[quantity.name]
        rows.append((quantity.words, quantity.unit, values, float(values.attrs["channel_error_percent"])))
    rows += [
        (words, unit, quantities[name], float(quantities[name].attrs.get("channel_error_percent", np.nan)))
        for name, (words, unit) in COLOR_COLUMNS.items()
    ]
    frame = pd.DataFrame(
        [_row(words, unit, values.to_numpy()[kept], error) for words, unit, values, error in rows],
        columns=["quantity", "unit", "mean", "lowest", "highest", "channels [%]"],
    )
    if before is not None:
        means = [float(before.weigh(quantity.response)[0][kept].mean()) for quantity in ordered]
        traced = np.array([*means, *(len(rows) - len(means)) * [np.nan]])
        frame.insert(3, "mean as traced", traced)
        frame.insert(4, "change [%]", 100.0 * (frame["mean"].to_numpy() / np.where(traced > 0, traced, np.nan) - 1.0))
    caption = (
        f"Light at {counted(kept.size, 'point')}, computed from {METHOD_WORDS[quantities.attrs['method']]}. The last "
        f"column is the error due to having only {quantities.attrs['bands']} channels: it is smaller for 95 % of "
        "indoor spectra, "
        "and comes on top of the noise of the simulation."
    )
    return Table(
        name="people-and-plants", caption=caption, frame=frame, formats={"channels [%]": ".1f", "change [%]": "+.1f"}
    )


def _row(words: str, unit: str, values: FloatArray, error: float) -> tuple[str, str, float, float, float, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return words, unit, np.nan, np.nan, np.nan, error
    return words, unit, float(known.mean()), float(known.min()), float(known.max()), error
