"""Parts of figures over the floor plan: points, walls, lamps, colour bars and legends."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.path import Path
from matplotlib.patheffects import AbstractPathEffect, Normal, Stroke
from matplotlib.ticker import FuncFormatter, MaxNLocator

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import INK, MUTED, PAGE_WIDTH_IN, place, plain
from lidarspectra.mapping.figures.floor_plan import FloorPlan, PanelLayout, plan_extent
from lidarspectra.room.panes.pane import Pane, PaneKind
from lidarspectra.words import digits

if TYPE_CHECKING:
    import xarray as xr  # loads slowly, and a plan of a room without a map needs none

MAX_VECTOR_POINTS = 400  # more dots than this are drawn as pixels in vector files, to keep them small
MAX_DOTS = 2500  # more would cover the map below them
DOT_PT, EDGE_PT = 2.0, 0.5  # [pt] of a sensor on a map
DOT_EDGE = "#202020"
DOT_LENGTH_M = 1e-4  # [m] of a dot's line: of one without length some programs draw nothing
LAMP_COLOR = "#e6a400"
FURNITURE_COLOR = "#8a8f96"
UNKNOWN: dict[str, Any] = {"facecolor": "#c3c7cb", "edgecolor": "#8a8f96", "hatch": "////", "linewidth": 0.0}
PANE_COLORS: dict[PaneKind, str] = {"glass": "#0072b2", "mirror": "#009e73", "screen": "#cc79a7"}
HALO: list[AbstractPathEffect] = [Stroke(linewidth=2.4, foreground="white", alpha=0.85), Normal()]  # dark on any ground
UPWARDS = 0.99  # [1] cosine, of the angle between a map's direction and up
UP = "looking up"
MIN_LAMP_M = 0.06  # [m] a smaller bulb would not be seen


def color_norm(values: FloatArray) -> Normalize:
    """A scale from zero, or from the lowest value where the values differ too little to be seen on it."""
    low, high = float(values.min()), float(values.max())
    if high <= 0:
        return Normalize(0.0, 1.0)
    return Normalize(0.0 if low < 0.5 * high else low - 0.05 * (high - low), high)


def draw_points(
    axes: Axes, dataset: "xr.Dataset", chosen: IntArray, values: FloatArray | None, norm: Normalize, colors: str
) -> None:
    """Small dots where a map lies below them; without a map (`values` given) dots in the colours of the scale.

    On a map of more than `MAX_DOTS` points there are only the crosses of buried ones.
    """
    x, y = dataset["x"].to_numpy(), dataset["y"].to_numpy()
    if values is None and chosen.size > MAX_DOTS:
        chosen = chosen[:0]
    many = chosen.size > MAX_VECTOR_POINTS
    if values is None and not many:
        for size, color in ((DOT_PT + EDGE_PT, DOT_EDGE), (DOT_PT - EDGE_PT, "white")):
            axes.add_artist(_dots(x[chosen], y[chosen], size_pt=size, color=color))
        _draw_buried(axes, dataset)
        return
    shown: dict[str, Any] = {"c": "white"} if values is None else {"c": values[chosen], "norm": norm, "cmap": colors}
    size = 1.0 if many else 40.0
    axes.scatter(
        x[chosen],
        y[chosen],
        s=size,
        linewidths=0.0 if many else EDGE_PT,
        edgecolors=DOT_EDGE,
        rasterized=many,
        zorder=3,
        **shown,
    )
    _draw_buried(axes, dataset)


def _dots(x: FloatArray, y: FloatArray, *, size_pt: float, color: str) -> PathPatch:
    """Dots at places [m] as round ends of one line: an element each would make most of a page of maps."""
    ends = np.repeat(np.stack([x, y], axis=1), 2, axis=0)
    ends[1::2, 0] += DOT_LENGTH_M
    path = Path(ends, np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(x)))
    path.should_simplify = False  # which would leave out lines so short
    return PathPatch(path, fill=False, edgecolor=color, linewidth=size_pt, capstyle="round", snap=False, zorder=3)


def _draw_buried(axes: Axes, dataset: "xr.Dataset") -> None:
    """Crosses where sensor points are buried."""
    buried = dataset["buried"].to_numpy()
    if buried.any():
        x, y = dataset["x"].to_numpy()[buried], dataset["y"].to_numpy()[buried]
        axes.plot(x, y, "x", color="black", markersize=4.0, markeredgewidth=1.0, path_effects=HALO, zorder=4)


def draw_frame(axes: Axes, plan: FloorPlan, *, left: bool, bottom: bool) -> None:
    """Walls and furniture in one scale for both axes, with labels on the left and at the bottom where asked for."""
    if plan.furniture:
        shapes = closed_lines(plan.furniture)
        axes.add_artist(PathPatch(shapes, fill=False, edgecolor="white", linewidth=1.3, alpha=0.65, zorder=2.4))
        dashed: dict[str, Any] = {"edgecolor": FURNITURE_COLOR, "linewidth": 0.9, "linestyle": "--"}
        axes.add_artist(PathPatch(shapes, fill=False, zorder=2.5, **dashed))
    walls = closed_lines([plan.outline])
    axes.add_artist(PathPatch(walls, fill=False, edgecolor=INK, linewidth=1.4, zorder=5, joinstyle="miter"))
    if plan.other_outlines:
        others = closed_lines(plan.other_outlines)
        axes.add_artist(PathPatch(others, fill=False, edgecolor=MUTED, linewidth=1.0, zorder=2.3))
    low, high = plan_extent(plan)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    for spine in axes.spines.values():
        spine.set_visible(False)
    for axis, is_shown in ((axes.xaxis, bottom), (axes.yaxis, left)):
        axis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
        axis.set_visible(is_shown)  # whose marks and labels would be laid out, though none shows
    axes.tick_params(length=2.5, labelleft=left, labelbottom=bottom, left=left, bottom=bottom)
    axes.set_xlabel("x [m]" if bottom else "", labelpad=1.5)
    axes.set_ylabel("y [m]" if left else "", labelpad=1.5)


def closed_lines(shapes: Sequence[FloatArray]) -> Path:
    """Polygons of (corner, 2) places [m] as one path."""
    return Path.make_compound_path(*(Path(np.vstack([shape, shape[:1]]), closed=True) for shape in shapes))


def draw_colorbar(
    figure: Figure, box: tuple[float, float, float, float], norm: Normalize, colors: str, label: str = ""
) -> None:
    """A colour bar at a place in inches; without a label it is the small one of a panel."""
    axes = place(figure, *box)
    bar = figure.colorbar(ScalarMappable(norm=norm, cmap=colors), cax=axes)
    bar.outline.set_visible(False)
    bar.locator = MaxNLocator(nbins=4 if not label else 6, steps=[1, 2, 2.5, 5, 10])
    bar.formatter = FuncFormatter(lambda value, _: digits(value, ".3g"))
    bar.update_ticks()
    axes.tick_params(length=2.0, pad=1.5, labelsize=7.0 if not label else 8.0)
    if label:
        bar.set_label(label)


def plane_words(plan: FloorPlan, dataset: "xr.Dataset", chosen: IntArray) -> str:
    """Height of a map above the floor, where the plan knows it, and where its points look, unless it is up."""
    height = "" if plan.air is None else f"{plan.air.height_m:.2f} m above the floor"
    facing = facing_words(dataset, chosen)
    return ", ".join(filter(None, [height, facing if facing != UP else ""]))


def facing_words(dataset: "xr.Dataset", chosen: IntArray) -> str:
    """Where points of one plane look: 'looking up', 'looking down', or along a direction."""
    way = np.stack([dataset[axis].to_numpy()[chosen] for axis in ("nx", "ny", "nz")], axis=1).mean(axis=0)
    if abs(way[2]) >= UPWARDS:
        return UP if way[2] > 0 else "looking down"
    return f"looking along ({', '.join(f'{part + 0.0:.2g}' for part in way)})"


def legend_handles(dataset: "xr.Dataset", plan: FloorPlan, *, unknown: bool) -> list[Line2D | Patch]:
    """Legend entries of a map, only for what is drawn on it."""
    handles: list[Line2D | Patch] = [Line2D([], [], color=INK, linewidth=1.4, label="walls")]
    if dataset.sizes["point"] <= MAX_DOTS:
        dot: dict[str, Any] = {"color": "white", "markeredgecolor": "#202020", "markersize": 3, "linestyle": ""}
        handles.insert(0, Line2D([], [], marker="o", label="sensor", **dot))
    if dataset["buried"].to_numpy().any():
        handles.append(
            Line2D([], [], marker="x", color="black", markersize=4, linestyle="", path_effects=HALO, label="buried")
        )
    if plan.furniture:
        handles.append(Line2D([], [], color=FURNITURE_COLOR, linewidth=0.9, linestyle="--", label="furniture"))
    if unknown:
        handles.append(Patch(label="no point near" if plan.air is None else "solid or unknown", **UNKNOWN))
    return handles


def draw_panel_legend(figure: Figure, layout: "PanelLayout", handles: list[Line2D | Patch], words: str) -> None:
    """Unit and legend, in the empty place after the last panel where there is one, else below the panels."""
    if layout.has_empty_place:
        left, bottom, _, height = layout.box(layout.panels)
        corner = (left / PAGE_WIDTH_IN, (bottom + height) / layout.height_in)
        figure.legend(
            handles=handles,
            title=words,
            loc="upper left",
            bbox_to_anchor=corner,
            borderaxespad=0.0,
            handlelength=1.6,
            alignment="left",
        )
        return
    figure.legend(handles=handles, loc="lower right", ncols=len(handles), borderaxespad=0.3, handlelength=1.6)
    figure.text(layout.LEFT / PAGE_WIDTH_IN, 0.1 / layout.height_in, words.replace("\n", " "), va="bottom")


def draw_lamp(axes: Axes, lamp: Lamp, number: int, *, dashed: bool = False) -> None:
    """A lamp in its true size from above, with its number; with a dashed edge where its light is a guess."""
    look: dict[str, Any] = {"facecolor": LAMP_COLOR, "edgecolor": INK, "linewidth": 0.8, "alpha": 0.75, "zorder": 1.5}
    look["linestyle"] = "--" if dashed else "-"
    center = lamp.center[:2]
    outline = lamp.outline()[:, :2]
    small = MIN_LAMP_M / max(float(np.ptp(outline, axis=0).max()), 1e-9)
    axes.add_patch(PolygonPatch(center + max(small, 1.0) * (outline - center), **look))
    axes.annotate(
        f"L{number}",
        (float(center[0]), float(center[1])),
        ha="center",
        va="center",
        fontsize=7.5,
        fontweight="bold",
        color="black",
        path_effects=HALO,
        zorder=6,
    )


def draw_lamp_key(axes: Axes, lamps: tuple[Lamp, ...], *, below_in: float) -> None:
    """The lamps' names beside the plan, under the legend."""
    figure_height = float(axes.get_figure(root=True).get_size_inches()[1])  # type: ignore[union-attr]
    height = figure_height * axes.get_position(original=True).height
    max_lines = max(1, int((height - below_in) / 0.19))
    lines = [f"L{number}  {plain(lamp.name, longest=26)}" for number, lamp in enumerate(lamps[:max_lines], start=1)]
    if len(lamps) > max_lines:
        lines[-1] = f"and {len(lamps) - max_lines + 1} more"
    place_up = 1.0 - below_in / height
    axes.text(1.04, place_up, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=8.0, linespacing=1.5)


def draw_panes(axes: Axes, panes: Sequence[Pane]) -> list[Line2D | Patch]:
    """Glass, mirrors and screens from above, as thick lines; the entries of the legend."""
    kinds = []
    for pane in panes:
        ends = pane.center[:2] + 0.5 * pane.size_m[0] * np.array([-1.0, 1.0])[:, None] * pane.along[:2]
        axes.plot(*ends.T, color=PANE_COLORS[pane.kind], linewidth=4.0, solid_capstyle="butt", zorder=5)
        kinds += [pane.kind] if pane.kind not in kinds else []
    return [Line2D([], [], color=PANE_COLORS[kind], linewidth=4.0, label=f"{kind}, assumed") for kind in kinds]
