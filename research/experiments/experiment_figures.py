"""Figures 8 to 11 in our terms, the error over the number of reflections, and the tornado of inputs."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.figure_style import (
    DASHES,
    INK,
    MARKERS,
    MUTED,
    OKABE_ITO,
    PAGE_WIDTH_IN,
    irradiance_unit,
    new_figure,
    place,
    prefix_of,
    styled,
)
from lidarspectra.radiance.engine.options import BOUNCES
from research.experiments.accuracy import MapDeviation
from research.experiments.microbenchmarks import Cloths, InverseSquare, Superposition
from research.experiments.sensitivity import Influence

SHOWN_DISTANCES = 5  # spectra of Figure 8, left
SHOWN_CHANNELS = 4  # lines of Figure 8, right


@styled
def inverse_square_figure(result: InverseSquare) -> Figure:
    """Figure 8: spectra at some distances, and irradiance over 1/d² with the closed form as lines."""
    prefix = prefix_of(result.irradiance)
    figure = new_figure(PAGE_WIDTH_IN, 3.6)
    left, right = place(figure, 0.75, 0.6, 3.9, 2.6), place(figure, 5.7, 0.6, 3.9, 2.6)
    rows = np.linspace(0, result.distances_m.size - 1, SHOWN_DISTANCES).round().astype(int)
    for number, row in enumerate(rows):
        left.plot(
            result.centers_nm,
            result.irradiance[row] * prefix.factor,
            color=OKABE_ITO[number],
            marker=MARKERS[number],
            linestyle=DASHES[number],
            label=f"{100 * result.distances_m[row]:.1f} cm",
        )
    _spectral_axes(left, prefix.symbol)
    left.set_title("the shape stays, the level falls")
    left.legend(title="distance")
    squared = 1.0 / result.distances_m**2
    bands = np.linspace(1, result.centers_nm.size - 1, SHOWN_CHANNELS).round().astype(int)
    for number, band in enumerate(bands):
        right.plot(squared, result.expected[:, band] * prefix.factor, color=OKABE_ITO[number], linewidth=1.0)
        right.plot(
            squared[::4],
            result.irradiance[::4, band] * prefix.factor,
            color=OKABE_ITO[number],
            marker=MARKERS[number],
            linestyle="none",
            label=f"{result.centers_nm[band]:.0f} nm, R² = {_floored(float(result.r_squared[band]))}",
        )
    right.set_xlabel("1/d² [m⁻²]")
    right.set_ylabel(f"spectral irradiance [{irradiance_unit(prefix)}]")
    right.set_title("marks: traced; lines: closed form")
    right.set_ylim(0.0, 1.45 * float(result.irradiance[:, bands].max()) * prefix.factor)  # room for the legend
    right.legend()
    return figure


@styled
def superposition_setup_figure(result: Superposition) -> Figure:
    """Figure 9: where lamps and sensor stand, seen from above, and the spectra of the lamps."""
    figure = new_figure(PAGE_WIDTH_IN, 3.6)
    left, right = place(figure, 0.75, 0.6, 3.6, 2.65), place(figure, 5.3, 0.6, 4.3, 2.65)
    (x, y, _), (toward_x, toward_y, _) = result.sensor
    wavelengths: FloatArray = np.arange(400.0, 761.0, 2.0)
    spectra = [lamp.flux.at(wavelengths, outside="zero") for lamp in result.lamps]
    prefix = prefix_of(np.array(spectra))
    for number, (lamp, flux) in enumerate(zip(result.lamps, spectra, strict=True)):
        color = OKABE_ITO[number]
        left.add_patch(Circle(tuple(lamp.center[:2]), lamp.size[0] / 2, facecolor=color, edgecolor=INK))
        left.plot([x, lamp.center[0]], [y, lamp.center[1]], color=color, linestyle=DASHES[number])
        words = f"{lamp.name}\n({lamp.size[0] * 100:.0f} cm)"
        left.annotate(words, (lamp.center[0], lamp.center[1]), (0, 12), textcoords="offset points", ha="center")
        right.plot(wavelengths, flux * prefix.factor, color=color, linestyle=DASHES[number], label=lamp.name)
    middle = np.mean([lamp.center for lamp in result.lamps], axis=0)
    apart = float(np.linalg.norm(result.lamps[1].center - result.lamps[0].center))
    left.plot([lamp.center[0] for lamp in result.lamps], [lamp.center[1] for lamp in result.lamps], color=MUTED)
    left.annotate(
        f"{100 * apart:.0f} cm", (middle[0], middle[1]), (0, 5), textcoords="offset points", ha="center", color=MUTED
    )
    left.plot([x, middle[0]], [y, middle[1]], color=MUTED)
    away = float(np.linalg.norm(middle - result.sensor[0]))
    between = 0.5 * (middle[:2] + result.sensor[0, :2])
    left.annotate(f"{100 * away:.0f} cm", (between[0], between[1]), (5, 0), textcoords="offset points", color=MUTED)
    left.plot(x, y, marker="s", markersize=8, color=INK)
    arrow = {"arrowstyle": "->", "color": INK, "linewidth": 1.4}
    left.annotate("", (x + 0.1 * toward_x, y + 0.1 * toward_y), (x, y), arrowprops=arrow)
    left.annotate("sensor", (x, y), (10, -4), textcoords="offset points")
    left.set_aspect("equal")
    left.set_xlim(-0.4, 0.4)
    left.set_ylim(y - 0.07, 0.17)
    left.set_xlabel("x [m]")
    left.set_ylabel("y [m]")
    left.set_title("seen from above")
    right.set_xlabel("wavelength [nm]")
    right.set_ylabel(f"spectral flux [{prefix.symbol}W nm⁻¹]")
    right.set_ylim(bottom=0.0)
    right.set_title("what each lamp sends")
    right.legend()
    return figure


@styled
def superposition_figure(result: Superposition) -> Figure:
    """Figure 10: each lamp alone, both together, and the sum of the two."""
    prefix = prefix_of(result.together)
    figure = new_figure(6.2, 3.6)
    axes = place(figure, 0.75, 0.6, 5.2, 2.65)
    spectra = {
        "filament lamp": result.first,
        "LED globe, ratio 0.297": result.second,
        "sum of the two": result.first + result.second,
    }
    for number, (name, values) in enumerate(spectra.items()):
        axes.plot(
            result.centers_nm,
            values * prefix.factor,
            color=OKABE_ITO[number],
            marker=MARKERS[number],
            linestyle=DASHES[number],
            label=name,
        )
    axes.plot(
        result.centers_nm,
        result.together * prefix.factor,
        color=INK,
        marker="s",
        markersize=8,
        markerfacecolor="none",
        linestyle="none",
        label="both, traced together",
    )
    _spectral_axes(axes, prefix.symbol)
    axes.legend()
    return figure


@styled
def cloths_figure(result: Cloths) -> Figure:
    """Figure 11: what cloths of several colours send to a sensor behind the lamp; lines are the integral."""
    prefix = prefix_of(result.irradiance)
    figure = new_figure(6.2, 3.6)
    axes = place(figure, 0.75, 0.6, 5.2, 2.65)
    for number, name in enumerate(result.names):
        look: dict[str, Any] = {"color": OKABE_ITO[number]}
        axes.plot(result.centers_nm, result.expected[number] * prefix.factor, linestyle=DASHES[number], **look)
        axes.plot(
            result.centers_nm,
            result.irradiance[number] * prefix.factor,
            marker=MARKERS[number],
            linestyle="none",
            label=name,
            **look,
        )
    _spectral_axes(axes, prefix.symbol)
    axes.set_title("marks: traced; lines: integral over the cloth")
    axes.legend()
    return figure


@styled
def accuracy_figure(errors: Sequence[MapDeviation]) -> Figure:
    """Error over the number of reflections, with and without estimated materials, one line a scene."""
    figure = new_figure(PAGE_WIDTH_IN, 3.7)
    boxes: dict[str, tuple[float, Callable[[MapDeviation], float]]] = {
        "NRMSE, absolute [1]": (0.75, lambda error: error.absolute.nrmse_mean),
        "median error, absolute [%]": (4.0, lambda error: error.absolute.mape_median),
        "MAPE after 0-1 normalisation [%]": (7.2, lambda error: error.normalised.mape_mean),
    }
    groups = sorted({(error.materials, error.scene) for error in errors}, key=lambda key: (key[0] != "estimated", key))
    scenes = sorted({scene for _, scene in groups})
    lines: list[Any] = []
    for label, (left, value) in boxes.items():
        axes = place(figure, left, 0.95, 2.55, 2.5)
        lines = []
        for materials, scene in groups:
            chosen = [error for error in errors if (error.materials, error.scene) == (materials, scene)]
            chosen.sort(key=lambda error: BOUNCES[error.accuracy])  # type: ignore[index]
            number, is_estimated = scenes.index(scene), materials == "estimated"
            lines += axes.plot(
                [BOUNCES[error.accuracy] for error in chosen],  # type: ignore[index]
                [value(error) for error in chosen],
                color=OKABE_ITO[number],
                marker=MARKERS[number],
                markerfacecolor=OKABE_ITO[number] if is_estimated else "white",
                linestyle="-" if is_estimated else "--",
                label=f"{scene}, {materials}",
            )
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_xticks(list(BOUNCES.values()))
        axes.set_xlabel("most reflections [1]")
        axes.set_ylabel(label)
        axes.grid(axis="y", which="both")
    figure.legend(handles=lines, loc="lower center", ncols=3)
    return figure


@styled
def tornado_figure(influences: Sequence[Influence], base_percent: float, scene: str) -> Figure:
    """Median error when one input is off and all others are as they were, the worst on top."""
    ordered = sorted(influences, key=lambda influence: influence.worst_percent)
    height = 0.34 * len(ordered)
    figure = new_figure(PAGE_WIDTH_IN, height + 1.25)
    axes = place(figure, 3.3, 0.6, 6.3, height)
    for row, influence in enumerate(ordered):
        for change in influence.changes:
            start, length = base_percent, change.error.absolute.mape_median - base_percent
            axes.barh(row, length, left=start, height=0.62, color=OKABE_ITO[0] if length > 0 else OKABE_ITO[4])
            axes.plot(start + length, row, marker="|", color=INK, markersize=9)
        worst = max(influence.changes, key=lambda change: change.error.absolute.mape_median)
        words = f"{worst.words}: {influence.worst_percent:.3g} %"
        axes.annotate(
            words, (max(influence.worst_percent, base_percent), row), (6, 0), textcoords="offset points", va="center",
            fontsize=8.0,
        )  # fmt: skip
    axes.axvline(base_percent, color=INK, linewidth=1.2)
    axes.set_yticks(range(len(ordered)), [influence.words for influence in ordered])
    axes.set_ylim(-0.6, len(ordered) - 0.4)
    axes.set_xscale("log")
    ends = [change.error.absolute.mape_median for influence in ordered for change in influence.changes]
    axes.set_xlim(left=0.8 * min(base_percent, *ends), right=4.0 * max(base_percent, *ends))  # room for the words
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("median absolute error over points and channels [%]")
    axes.grid(axis="x")
    axes.set_title(f"{scene}: nothing changed gives {base_percent:.2f} %", loc="left")
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.spines["left"].set_color(MUTED)
    return figure


def _spectral_axes(axes: Axes, symbol: str) -> None:
    axes.set_xlabel("wavelength [nm]")
    axes.set_ylabel(f"spectral irradiance [{symbol}W m⁻² nm⁻¹]")
    axes.set_ylim(bottom=0.0)


def _floored(value: float) -> str:
    """R² with five digits, never rounded up to a one that it is not."""
    return f"{np.floor(value * 1e5) / 1e5:.5f}"
