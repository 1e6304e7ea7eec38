"""Figures over the floor plan: the maps of every band, their standard error, illuminance, lamps and sensors."""

from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.field_drawing import draw_field, draw_isolines, field_grid, has_unknown
from lidarspectra.mapping.figures.figure_style import (
    BLUE,
    DIFFERENCE_MAP,
    ERROR_MAP,
    INK,
    LIGHT_MAP,
    PAGE_WIDTH_IN,
    VERMILION,
    Prefix,
    irradiance_unit,
    new_figure,
    place,
    prefix_of,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, PanelLayout, plan_extent, single_plan
from lidarspectra.mapping.figures.places_figure import places_figure
from lidarspectra.mapping.figures.plan_drawing import (
    color_norm,
    draw_colorbar,
    draw_frame,
    draw_panel_legend,
    draw_points,
    legend_handles,
    plane_words,
)
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.interpolation import Method, map_planes, positions
from lidarspectra.mapping.maps.map_schema import check_map, dark_bands, kept_points
from lidarspectra.words import two_digits

ColorScale = Literal["panel", "shared", "shape"]

MAX_PANELS = 24  # of more bands an even selection is drawn: smaller panels are unreadable
PANEL_CELLS = 120  # across a panel of a few centimetres
TITLE_IN, LEGEND_IN = 0.25, 0.3  # [in] above and below a map
SINGLE_CELLS = 200  # across a map of half a page


@styled
def maps_figure(
    dataset: xr.Dataset,
    plan: FloorPlan,
    *,
    points: IntArray | None = None,
    scale: ColorScale = "panel",
    method: Method = "linear",
) -> Figure:
    """One interpolated map per band (paper, Figure 1), with the points, the outline and the furniture.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    plan : FloorPlan
        The room.
    points : (n,) int, optional
        Points on one plane; the largest of `map_planes` if left out. Too few for a map are drawn as points alone.
    scale : 'panel', 'shared' or 'shape'
        A colour scale for each band, which shows where its light is; one for all, which shows how much; or what differs
        between the bands: each over its own mean, against the mean of that over all bands, those with next to no light
        left out. [%]
    method : str
        See `grid_map`.

    Returns
    -------
    figure : Figure
    """
    checked = check_map(dataset, where="map to draw")
    chosen = _chosen(checked, points)
    bands = np.arange(checked.sizes["band"])
    if scale == "shape":
        bands = np.flatnonzero(~dark_bands(checked.isel(point=chosen)))
    shown = bands[_shown_bands(bands.size)]
    values = checked["irradiance"].to_numpy()[:, shown]
    prefix = Prefix(symbol="", factor=1.0) if scale == "shape" else prefix_of(values[chosen])
    values = _shapes_percent(values, chosen) if scale == "shape" else values
    grid = field_grid(positions(checked)[chosen], values[chosen], plan, cells_across=PANEL_CELLS, method=method)
    labels = checked["band_label"].to_numpy()[shown]
    layout = PanelLayout.of(plan, len(shown), colorbars=scale == "panel")
    figure = new_figure(PAGE_WIDTH_IN, layout.height_in)
    shared, colors = Normalize(0.0, float(values[chosen].max()) * prefix.factor or 1.0), LIGHT_MAP
    if scale == "shape":
        most = float(np.abs(values[chosen]).max()) or 1.0
        shared, colors = Normalize(-most, most), DIFFERENCE_MAP
    for number in range(len(shown)):
        axes = place(figure, *layout.box(number))
        field = values[:, number] * prefix.factor
        norm = color_norm(field[chosen]) if scale == "panel" else shared
        draw_field(axes, plan, grid, number, norm, colors, factor=prefix.factor)
        draw_points(axes, checked, chosen, field if grid is None else None, norm, colors)
        draw_frame(axes, plan, left=number % layout.columns == 0, bottom=number + layout.columns >= len(shown))
        axes.set_title(f"{labels[number]} nm", y=1.0, pad=3.0)  # a place of its own: none is looked for
        if scale == "panel":
            draw_colorbar(figure, layout.colorbar_box(number), norm, LIGHT_MAP)
    what = ["deviation from the channels' mean shape", "[%]"]
    if scale != "shape":
        what = ["spectral irradiance", f"[{irradiance_unit(prefix)}]"]
    number_words = f"{len(shown)} of {checked.sizes['band']} bands" if len(shown) < checked.sizes["band"] else ""
    what += filter(None, [plane_words(plan, checked, chosen), number_words])
    words = "\n".join(what)
    if scale != "panel":
        draw_colorbar(figure, layout.shared_box(), shared, colors, label=f"{what[0]} {', '.join(what[1:])}")
        words = ""
    draw_panel_legend(figure, layout, legend_handles(checked, plan, unknown=has_unknown(grid, plan)), words)
    return figure


def _shapes_percent(values: FloatArray, chosen: IntArray) -> FloatArray:
    """(point, band) each band over its mean at the chosen points, against the mean of that over bands [%]."""
    mean = values[chosen].mean(axis=0)
    relative = values / np.where(mean > 0, mean, 1.0)
    level = relative.mean(axis=1, keepdims=True)
    return np.asarray(100.0 * (relative / np.where(level > 0, level, 1.0) - 1.0), dtype=np.float64)


@styled
def error_figure(
    dataset: xr.Dataset, plan: FloorPlan, *, points: IntArray | None = None, target: float | None = None
) -> Figure:
    """The standard error: a map of its mean over bands, and its histogram over all points and bands.

    Parameters
    ----------
    dataset, plan, points
        As in `maps_figure`.
    target : float, optional
        Relative standard error that was asked for, relative to the mean irradiance of the band. [1]
    """
    checked = check_map(dataset, where="map to draw")
    chosen = _chosen(checked, points)
    relative = 100.0 * relative_error(checked)
    per_point = relative.mean(axis=1)
    low, high = plan_extent(plan)
    width, height = (float(size) * min(3.9 / (high - low)[0], 3.3 / (high - low)[1]) for size in high - low)
    figure = new_figure(PAGE_WIDTH_IN, 4.2 + LEGEND_IN)
    up = 0.6 + LEGEND_IN
    axes = place(figure, 0.6, up, width, height)
    norm = Normalize(0.0, float(per_point[chosen].max()) or 1.0)
    grid = field_grid(positions(checked)[chosen], per_point[chosen, None], plan, cells_across=SINGLE_CELLS)
    draw_field(axes, plan, grid, 0, norm, ERROR_MAP)
    draw_points(axes, checked, chosen, per_point if grid is None else None, norm, ERROR_MAP)
    draw_frame(axes, plan, left=True, bottom=True)
    axes.set_title(", ".join(filter(None, ["mean over bands", plane_words(plan, checked, chosen)])), pad=4.0)
    _legend_below(figure, legend_handles(checked, plan, unknown=has_unknown(grid, plan)))
    label = "standard error [% of the band's mean]"
    draw_colorbar(figure, (0.7 + width, up + 0.05 * height, 0.12, 0.9 * height), norm, ERROR_MAP, label=label)
    _draw_histogram(place(figure, 2.5 + width, up, 7.3 - width, 3.0), relative[chosen].ravel(), target)
    return figure


@styled
def illuminance_figure(
    dataset: xr.Dataset, plan: FloorPlan, illuminance_lx: FloatArray, *, points: IntArray | None = None
) -> Figure:
    """Map of illuminance with isolux lines.

    Parameters
    ----------
    dataset, plan, points
        As in `maps_figure`.
    illuminance_lx : (point,) float
        [lx]
    """
    checked = check_map(dataset, where="map to draw")
    chosen = _chosen(checked, points)
    figure, box, bar = single_plan(plan, title_in=TITLE_IN, below_in=LEGEND_IN)
    axes = place(figure, *box)
    norm = Normalize(0.0, float(illuminance_lx[chosen].max()) or 1.0)
    grid = field_grid(positions(checked)[chosen], illuminance_lx[chosen, None], plan, cells_across=SINGLE_CELLS)
    draw_field(axes, plan, grid, 0, norm, LIGHT_MAP)
    draw_isolines(axes, grid, plan, float(np.median(checked["z"].to_numpy()[chosen])))
    draw_points(axes, checked, chosen, illuminance_lx if grid is None else None, norm, LIGHT_MAP)
    draw_frame(axes, plan, left=True, bottom=True)
    draw_colorbar(figure, bar, norm, LIGHT_MAP, label="illuminance [lx]")
    axes.set_title(", ".join(filter(None, ["illuminance", plane_words(plan, checked, chosen)])), pad=4.0)
    _legend_below(figure, legend_handles(checked, plan, unknown=has_unknown(grid, plan)))
    return figure


def _legend_below(figure: Figure, handles: list[Line2D | Patch]) -> None:
    """A legend along the lower edge of a figure."""
    figure.legend(handles=handles, loc="lower left", ncols=len(handles), borderaxespad=0.2, handlelength=1.6)


def plan_figure(dataset: xr.Dataset, plan: FloorPlan, lamps: tuple[Lamp, ...]) -> Figure:
    """The room of a map from above: see `places_figure`."""
    checked = check_map(dataset, where="map to draw")
    return places_figure(
        plan,
        lamps,
        positions=np.stack([checked[axis].to_numpy() for axis in "xyz"], axis=1),
        buried=checked["buried"].to_numpy(),
        assumed=assumptions_of(checked).all_lamps,
    )


def relative_error(dataset: xr.Dataset) -> FloatArray:
    """(point, band) standard error over the mean irradiance of the band, buried points left out of the mean [1]."""
    irradiance = dataset["irradiance"].to_numpy()
    mean = irradiance[kept_points(dataset)].mean(axis=0)
    return np.asarray(dataset["irradiance_se"].to_numpy() / np.where(mean > 0, mean, 1.0), dtype=np.float64)


def _draw_histogram(axes: Axes, relative_percent: FloatArray, target: float | None) -> None:
    axes.hist(relative_percent, bins=40, color=BLUE, edgecolor="none", alpha=0.85)
    median = float(np.median(relative_percent))
    axes.axvline(median, color=INK, linewidth=1.2, label=f"median {two_digits(median)} %")
    if target is not None:
        axes.axvline(100.0 * target, color=VERMILION, linewidth=1.4, linestyle="--", label=f"target {100 * target:g} %")
    axes.set_xlabel("standard error [% of the band's mean irradiance]")
    axes.set_ylabel("number of values [1]")
    axes.set_title("all points and bands", pad=22.0)
    axes.set_xlim(left=0.0)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 0.99), ncols=2, borderaxespad=0.2)


def _chosen(dataset: xr.Dataset, points: IntArray | None) -> IntArray:
    if points is not None:
        return points
    groups = map_planes(dataset)
    # Where every point is buried the requested points are still drawn, as crosses.
    return groups[0] if groups else np.arange(dataset.sizes["point"])


def _shown_bands(count: int) -> IntArray:
    if count <= MAX_PANELS:
        return np.arange(count)
    return np.linspace(0, count - 1, MAX_PANELS).round().astype(np.int64)
