"""Figures of localization: distribution of errors, errors in the room, and change of fingerprints with time."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import (
    DASHES,
    ERROR_MAP,
    INK,
    MARKERS,
    MUTED,
    OKABE_ITO,
    PAGE_WIDTH_IN,
    new_figure,
    place,
    plain,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, plan_extent, single_plan
from lidarspectra.mapping.figures.plan_drawing import draw_frame
from lidarspectra.mapping.localization.location_errors import LocationErrors

MAX_CURVES = 8  # more curves in one figure are not distinguishable
SHOWN_PERCENT = 99.0  # [1] the axis ends there, so that a few lost readings do not press the curves together
MARGIN_M = 0.5  # [m] around the places where no floor plan is given


@styled
def error_curves_figure(panels: Mapping[str, Mapping[str, LocationErrors]]) -> Figure:
    """Share of the readings within a distance, a panel for each room and a curve for each entry (Figures 14 and 16).

    Parameters
    ----------
    panels : mapping of str to mapping of str to LocationErrors
        By title, then by the words of the legend. Distances must be known.

    Raises
    ------
    MapError
        If there is nothing to draw, or more than `MAX_CURVES`.
    """
    _require_curves(panels)
    width = (PAGE_WIDTH_IN - 0.7 - 0.45 * (len(panels) - 1)) / max(len(panels), 2)
    figure = new_figure(0.7 + len(panels) * (width + 0.45) - 0.25, 3.7)
    for number, (title, curves) in enumerate(panels.items()):
        axes = place(figure, 0.6 + number * (width + 0.45), 0.55, width - 0.1, 2.75)
        for line, (words, errors) in enumerate(curves.items()):
            _curve(axes, errors.error_m, line, words)
        ends = [np.percentile(errors.error_m, SHOWN_PERCENT) for errors in curves.values()]
        axes.set_xlim(0.0, 1.05 * max(float(max(ends)), 0.1))
        axes.set_ylim(0.0, 100.0)
        axes.set_xlabel("distance from the true position [m]")
        axes.set_ylabel("readings within it [%]" if number == 0 else "")
        axes.set_title(plain(title))
        axes.grid(True)
        axes.legend(loc="lower right", title="median error")
    return figure


@styled
def error_map_figure(errors: LocationErrors, plan: FloorPlan | None = None) -> Figure:
    """The true places in the colour of their median error, and from each a line to its mean located position.

    Parameters
    ----------
    errors : LocationErrors
        With distances.
    plan : FloorPlan, optional
        Walls and furniture; without it only the places are drawn.

    Raises
    ------
    MapError
        If distances are not known.
    """
    if not errors.has_distances:
        raise MapError(expected="positions in metres", found="none", where="map of errors", todo="Give --positions.")
    places, put, median = _by_place(errors)
    ground = plan or FloorPlan(outline=_frame_around(np.vstack([places, put])))
    figure, box, bar_box = single_plan(ground)
    axes = place(figure, *box)
    if plan is not None:
        draw_frame(axes, plan, left=True, bottom=True)
    else:
        low, high = plan_extent(ground)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
    norm = Normalize(0.0, max(float(median.max()), 0.1))
    for here, there in zip(places, put, strict=True):
        axes.plot(*np.stack([here, there]).T, color=INK, linewidth=1.0, zorder=6)
    axes.plot(*put.T, ".", color=INK, markersize=3.0, zorder=6)
    axes.scatter(
        places[:, 0],
        places[:, 1],
        c=median,
        norm=norm,
        cmap=ERROR_MAP,
        s=46.0,
        edgecolors=INK,
        linewidths=0.6,
        zorder=7,
    )
    bar = figure.colorbar(ScalarMappable(norm=norm, cmap=ERROR_MAP), cax=place(figure, *bar_box))
    bar.outline.set_visible(False)
    bar.set_label("median error [m]")
    return figure


@styled
def two_times_figure(first: FloatArray, second: FloatArray, sensors: Sequence[str], band_nm: float) -> Figure:
    """Readings of sensors in a channel at the same places at two times (Figure 15).

    Parameters
    ----------
    first, second : (place, sensor) float
        Readings at T1 and T2, over the sensor's own mean at T1. [1]
    sensors : sequence of str
    band_nm : float
        Centre of the channel. [nm]
    """
    figure = new_figure(PAGE_WIDTH_IN, 3.4)
    axes = place(figure, 0.75, 0.75, PAGE_WIDTH_IN - 0.95, 2.3)
    columns = np.arange(len(sensors))
    for readings, shift, number, words in ((first, -0.18, 0, "T1"), (second, 0.18, 1, "T2")):
        across = np.repeat(columns[None, :] + shift, len(readings), axis=0)
        axes.plot(
            across.ravel(),
            readings.ravel(),
            linestyle="none",
            marker=MARKERS[number],
            markersize=2.6,
            alpha=0.6,
            color=OKABE_ITO[number],
            label=f"{words}, one mark per place",
        )
    axes.axhline(1.0, color=MUTED, linewidth=0.7, zorder=0)
    axes.set_xticks(columns, [plain(name, longest=6) for name in sensors])
    axes.set_xlim(-0.6, len(sensors) - 0.4)
    axes.set_xlabel("sensor")
    axes.set_ylabel("reading over the mean at T1 [1]")
    axes.set_title(f"{band_nm:.0f} nm")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 1.16), ncols=2)
    return figure


@styled
def gain_curve_figure(sizes: Sequence[int], curves: Mapping[str, Sequence[float]], label: str) -> Figure:
    """Error over the number of sensors.

    Parameters
    ----------
    sizes : sequence of int
        Numbers of sensors.
    curves : mapping of str to sequence of float
        By the words of the legend; NaN where a size was not tried.
    label : str
        Of the upright axis, with its unit.
    """
    figure = new_figure(6.0, 3.6)
    axes = place(figure, 0.8, 0.6, 4.95, 2.75)
    for number, (words, values) in enumerate(curves.items()):
        axes.plot(
            sizes, values, marker=MARKERS[number], linestyle=DASHES[number], color=OKABE_ITO[number], label=plain(words)
        )
    axes.set_xlabel("sensors [1]")
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(True)
    axes.legend()
    return figure


def _curve(axes: Axes, error_m: FloatArray, number: int, words: str) -> None:
    ordered = np.sort(error_m)
    share = 100.0 * np.arange(1, ordered.size + 1) / ordered.size
    axes.step(
        np.concatenate([[0.0], ordered]),
        np.concatenate([[0.0], share]),
        where="post",
        color=OKABE_ITO[number],
        linestyle=DASHES[number],
        label=f"{plain(words)}: {np.median(error_m):.2f} m",
    )


def _by_place(errors: LocationErrors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(place, 2) true positions, (place, 2) mean of where they are put, and (place,) median error [m]."""
    labels = np.array(errors.labels)
    rows = [labels == label for label in dict.fromkeys(errors.labels)]
    places = np.array([errors.true_m[own, :2].mean(axis=0) for own in rows])
    put = np.array([errors.located_m[own, :2].mean(axis=0) for own in rows])
    return places, put, np.array([np.median(errors.error_m[own]) for own in rows])


def _frame_around(points: FloatArray) -> FloatArray:
    """(4, 2) corners of a rectangle around points [m]."""
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])


def _require_curves(panels: Mapping[str, Mapping[str, LocationErrors]]) -> None:
    if not panels or not all(panels.values()) or max(map(len, panels.values())) > MAX_CURVES:
        raise MapError(
            expected=f"one to {MAX_CURVES} curves a panel",
            found=f"{[len(curves) for curves in panels.values()]}",
            where="figure of errors",
        )
    if not all(errors.has_distances for curves in panels.values() for errors in curves.values()):
        raise MapError(expected="positions in metres", found="none", where="figure of errors", todo="Give --positions.")
