"""Figures of spectra and pictures: light at chosen points, reflectances of materials, the views side by side."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import (
    DASHES,
    MARKERS,
    MUTED,
    OKABE_ITO,
    PAGE_WIDTH_IN,
    irradiance_unit,
    new_figure,
    place,
    plain,
    prefix_of,
    styled,
)
from lidarspectra.mapping.maps.light_unknowns import error_bars
from lidarspectra.mapping.maps.map_schema import check_map
from lidarspectra.material.material_map import Material
from lidarspectra.spectra.colorimetry import hex_color

BARS_SE = 2.0  # [1] half length of an error bar in standard errors: about 95 % of normal errors
MAX_MATERIALS = 10  # more curves in one figure are not distinguishable
VISIBLE_NM = (380.0, 780.0)  # [nm] drawn range of a reflectance unless the bands extend further


@dataclass(frozen=True, kw_only=True)
class ChosenPoint:
    """A point whose spectrum is shown, and the reason.

    Parameters
    ----------
    index : int
        Its index in the map.
    reason : str
        'lowest', 'under furniture', ...
    """

    index: int
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportView:
    """A picture of the room.

    Parameters
    ----------
    name : str
        'east', 'up', ...
    image : (height, width, 3) uint8
        sRGB, first row at the top.
    """

    name: str
    image: ByteArray

    def __post_init__(self) -> None:
        if self.image.ndim != 3 or self.image.shape[2] != 3 or self.image.dtype != np.uint8 or self.image.size == 0:
            raise MapError(
                expected="a (height, width, 3) uint8 image",
                found=f"{self.image.shape} {self.image.dtype}",
                where=f"view '{self.name}'",
            )


def choose_points(dataset: xr.Dataset, covered: BoolArray | None = None) -> tuple[ChosenPoint, ...]:
    """Representative points: the highest, the median and the lowest, under furniture and in the open.

    Points are ranked by their irradiance, summed over the bands; buried points are left out.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    covered : (point,) bool, optional
        Points that are under furniture, and not over it; none by default.

    Returns
    -------
    points : tuple of ChosenPoint
        From bright to dark, each point once; empty where all points are buried.
    """
    checked = check_map(dataset, where="map to choose points from")
    kept = np.flatnonzero(~checked["buried"].to_numpy())
    if kept.size == 0:
        return ()
    rising = kept[np.argsort(checked["irradiance"].to_numpy()[kept].sum(axis=1), kind="stable")]
    under = np.zeros(rising.size, dtype=np.bool_) if covered is None else covered[rising]
    reasons = {int(rising[-1]): "highest"}
    reasons.setdefault(int(rising[rising.size // 2]), "median")
    if under.any() and not under.all():
        reasons.setdefault(int(rising[~under][0]), "lowest in the open")
        reasons.setdefault(int(rising[under][0]), "lowest under furniture")
    reasons.setdefault(int(rising[0]), "lowest")
    rank = {int(index): number for number, index in enumerate(rising)}
    brightest_first = sorted(reasons, key=lambda index: -rank[index])
    return tuple(ChosenPoint(index=index, reason=reasons[index]) for index in brightest_first)


@styled
def spectra_figure(dataset: xr.Dataset, points: tuple[ChosenPoint, ...]) -> Figure:
    """Spectral irradiance at chosen points with bars of twice what the map states (`light_unknowns.error_bars`).

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    points : tuple of ChosenPoint
        At least one.
    """
    checked = check_map(dataset, where="map to draw")
    if not points:
        raise MapError(expected="at least one point", found="none", where="figure of spectra")
    rows = [point.index for point in points]
    irradiance = checked["irradiance"].to_numpy()[rows]
    bars, words = error_bars(checked)
    errors = BARS_SE * bars[rows]
    below = np.minimum(errors, np.maximum(irradiance, 0.0))  # no light is less than none
    prefix = prefix_of(irradiance)
    bands = checked["band"].to_numpy()
    figure = new_figure(PAGE_WIDTH_IN, 4.1)
    axes = place(figure, 0.75, 0.6, 6.4, 3.3)
    for number, point in enumerate(points):
        x, y, z = (float(checked[name][point.index]) for name in "xyz")
        axes.errorbar(
            bands,
            irradiance[number] * prefix.factor,
            yerr=np.stack([below[number], errors[number]]) * prefix.factor,
            color=OKABE_ITO[number % len(OKABE_ITO)],
            marker=MARKERS[number % len(MARKERS)],
            linestyle=DASHES[number % len(DASHES)],
            linewidth=1.2,
            capsize=2.5,
            elinewidth=1.0,
            label=f"{point.reason}\n({x:.2f}, {y:.2f}, {z:.2f}) m",
        )
    axes.set_ylim(bottom=min(0.0, float((irradiance - below).min()) * prefix.factor))
    axes.set_xlabel("wavelength [nm]")
    axes.set_ylabel(f"spectral irradiance [{irradiance_unit(prefix)}]")
    axes.grid(visible=True)
    title = f"bars: ± {BARS_SE:g} {words}"
    legend = axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.02), labelspacing=1.1, title=title, alignment="left")
    legend.get_title().set_fontsize(8.5)
    return figure


@styled
def reflectances_figure(
    materials: tuple[Material, ...], areas_m2: FloatArray, *, range_nm: tuple[float, float] = VISIBLE_NM
) -> Figure:
    """Reflectance of the materials with the largest areas, each in its colour, dashed where it is extrapolated.

    Parameters
    ----------
    materials : tuple of Material
        At least one, by the numbers of their groups in materials.csv, which stand on the curves.
    areas_m2 : (material,) float
        [m²]
    range_nm : (float, float)
        Range of the wavelength axis. [nm]
    """
    if not materials or len(materials) != areas_m2.size:
        raise MapError(
            expected="one or more materials, each with an area",
            found=f"{len(materials)} materials and {areas_m2.size} areas",
            where="figure of reflectances",
        )
    order = np.argsort(-areas_m2, kind="stable")[:MAX_MATERIALS]
    total = float(areas_m2.sum()) or 1.0
    figure = new_figure(PAGE_WIDTH_IN, 4.3)
    axes = place(figure, 0.75, 0.6, 5.7, 3.5)
    axes.set_xlim(*range_nm)
    axes.set_ylim(0.0, 1.0)
    wavelengths = np.linspace(*range_nm, 401)
    for rank, group in enumerate(order.tolist()):
        material = materials[group]
        share = float(areas_m2[group]) / total
        label = f"{group}  {plain(material.name, longest=30)}  {areas_m2[group]:.1f} m² ({share:.0%})"
        _draw_reflectance(axes, material, wavelengths, rank, str(group), label)
    axes.set_xlabel("wavelength [nm]")
    axes.set_ylabel("reflectance [1]")
    axes.grid(visible=True)
    title = "group, by area; dashed: extrapolated"
    legend = axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.02), title=title, alignment="left", handlelength=1.8)
    legend.get_title().set_fontsize(8.5)
    return figure


def _draw_reflectance(
    axes: Axes, material: Material, wavelengths: FloatArray, rank: int, number: str, label: str
) -> None:
    """A curve in its own colour with a dark edge, so that white shows on white paper, and its number on it."""
    values = material.reflectance.at(wavelengths, outside="nearest")
    low, high = material.measured_range_nm
    measured = (wavelengths >= low) & (wavelengths <= high)
    edge = [Stroke(linewidth=3.4, foreground=MUTED), Normal()]
    color = hex_color(material.color)
    handle_drawn = False
    for part, style in ((measured, "-"), (~measured, (0, (2.0, 1.6)))):
        if not part.any():
            continue
        axes.plot(
            wavelengths,
            np.where(part, values, np.nan),
            color=color,
            linestyle=style,
            linewidth=2.2,
            path_effects=edge,
            label=label if not handle_drawn else "_",
        )
        handle_drawn = True
    spot = int(
        (0.06 + 0.88 * ((rank * 0.381966) % 1.0)) * (wavelengths.size - 1)
    )  # steps of the golden ratio keep the numbers apart
    axes.annotate(
        number,
        (float(wavelengths[spot]), float(values[spot])),
        ha="center",
        va="center",
        fontsize=7.0,
        fontweight="bold",
        bbox={"boxstyle": "circle,pad=0.22", "facecolor": "white", "edgecolor": MUTED, "linewidth": 0.7},
        color="#1d2125",  # not INK, which a dark page turns light: the circle stays white there
        zorder=5,
    )
