"""Figures of light for people and plants: a map of each quantity over the floor plan."""

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lidarspectra.arrays import IntArray
from lidarspectra.mapping.figures.field_drawing import draw_field, field_grid, has_unknown
from lidarspectra.mapping.figures.figure_style import ERROR_MAP, LIGHT_MAP, PAGE_WIDTH_IN, new_figure, place, styled
from lidarspectra.mapping.figures.floor_plan import FloorPlan, PanelLayout
from lidarspectra.mapping.figures.plan_drawing import (
    draw_colorbar,
    draw_frame,
    draw_panel_legend,
    draw_points,
    facing_words,
    legend_handles,
)
from lidarspectra.mapping.maps.interpolation import point_planes, positions

SHOWN = {
    "illuminance_lx": "illuminance [lx]",
    "melanopic_edi_lx": "melanopic EDI [lx]",
    "cct_kK": "CCT [kK]",
    "ppfd_umol_m2_s": "PPFD [µmol m⁻² s⁻¹]",
    "ypfd_umol_m2_s": "YPFD [µmol m⁻² s⁻¹]",
}
FROM_LOWEST = ("cct_kK",)  # quantities whose scale does not begin at zero
PANEL_CELLS = 120  # across a panel


@styled
def quantities_figure(quantities: xr.Dataset, plan: FloorPlan) -> Figure:
    """Five maps: illuminance, melanopic EDI, colour temperature, PPFD and YPFD.

    Parameters
    ----------
    quantities : xarray.Dataset
        Of `light_at_points`.
    plan : FloorPlan
        The room.
    """
    values = quantities.assign(cct_kK=1e-3 * quantities["cct_K"])
    return point_maps(values, plan, SHOWN, colors=dict.fromkeys(FROM_LOWEST, ERROR_MAP))


@styled
def point_maps(
    values: xr.Dataset, plan: FloorPlan, wanted: Mapping[str, str], *, colors: Mapping[str, str] | None = None
) -> Figure:
    """One map per variable over the floor plan, each with its own scale, for the largest plane of points.

    Parameters
    ----------
    values : xarray.Dataset
        Dim point, with x, y, z, nx, ny, nz and buried.
    plan : FloorPlan
        The room.
    wanted : mapping of str to str
        Variables, and the titles of their panels; a variable without any value on the plane has no panel.
    colors : mapping of str to str, optional
        Other colour maps by variable; their scale begins at the lowest value, not at zero.

    Returns
    -------
    figure : Figure
    """
    planes = point_planes(values)
    chosen = planes[0] if planes else np.arange(values.sizes["point"])
    shown = {name: words for name, words in wanted.items() if np.isfinite(values[name].to_numpy()[chosen]).any()}
    layout = PanelLayout.of(plan, max(len(shown), 3), colorbars=True)
    figure = new_figure(PAGE_WIDTH_IN, layout.height_in)
    unknown = False
    for number, (name, words) in enumerate(shown.items()):
        field = values[name].to_numpy()
        known = chosen[np.isfinite(field[chosen])]
        map_name = (colors or {}).get(name, LIGHT_MAP)
        low = float(field[known].min()) if name in (colors or {}) else 0.0
        norm = Normalize(low, max(float(field[known].max()), low + 1e-12))
        grid = field_grid(positions(values)[known], field[known, None], plan, cells_across=PANEL_CELLS)
        axes = place(figure, *layout.box(number))
        draw_field(axes, plan, grid, 0, norm, map_name)
        draw_points(axes, values, known, field if grid is None else None, norm, map_name)
        draw_frame(axes, plan, left=number % layout.columns == 0, bottom=number + layout.columns >= len(shown))
        axes.set_title(words, pad=3.0)
        draw_colorbar(figure, layout.colorbar_box(number), norm, map_name)
        unknown = unknown or has_unknown(grid, plan)
    draw_panel_legend(figure, layout, legend_handles(values, plan, unknown=unknown), _which(values, planes))
    return figure


def _which(values: xr.Dataset, planes: tuple[IntArray, ...]) -> str:
    """Which points are drawn, where there are others: how many of all, their height, and where they look."""
    if len(planes) < 2:
        return ""
    height = float(np.median(values["z"].to_numpy()[planes[0]]))
    return f"{planes[0].size} of {sum(map(len, planes))} points:\nz {height:.2f} m, {facing_words(values, planes[0])}"
