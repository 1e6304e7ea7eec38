"""Figures of solar cells: maps of current and energy, the cells' curves, predicted against measured."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.figure_style import (
    DASHES,
    INK,
    MARKERS,
    MUTED,
    OKABE_ITO,
    new_figure,
    place,
    plain,
    prefix_of,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.photometry.figures import point_maps
from lidarspectra.mapping.photovoltaics.cells import Cell

MAPPED = {
    "current_density_A_m2": ("current density", "A m⁻²"),
    "power_W": ("power", "W"),
    "charge_mAh_day": ("charge per day", "mAh"),
    "energy_mWh_day": ("energy per day", "mWh"),
}


@styled
def currents_figure(currents: xr.Dataset, plan: FloorPlan) -> Figure:
    """Maps of current density and, where they are known, of power, charge and energy of a day.

    Parameters
    ----------
    currents : xarray.Dataset
        Of `current_map`.
    plan : FloorPlan
    """
    shown, scaled = {}, {}
    for name, (words, unit) in MAPPED.items():
        if name in currents:
            prefix = prefix_of(currents[name].to_numpy())
            symbol, factor = ("", 1.0) if unit.startswith("m") else (prefix.symbol, prefix.factor)
            scaled[name] = currents[name] * factor
            shown[name] = f"{words} [{symbol}{unit}]"
    return point_maps(currents.assign(scaled), plan, shown)


@styled
def curves_figure(cells: Sequence[Cell]) -> Figure:
    """Quantum efficiency, or absorption, of cells over the wavelength (paper, Figure 18)."""
    figure = new_figure(6.6, 3.6)
    axes = place(figure, 0.6, 0.55, 3.9, 2.8)
    for number, cell in enumerate(cells):
        axes.plot(
            cell.efficiency.wavelengths_nm,
            cell.efficiency.values,
            color=OKABE_ITO[number % len(OKABE_ITO)],
            linestyle=DASHES[number % len(DASHES)],
            label=plain(cell.name) + (" (relative)" if cell.quantity == "relative" else ""),
        )
    axes.set_xlabel("wavelength [nm]")
    axes.set_ylabel("quantum efficiency or absorption [1]")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure


@styled
def agreement_figure(pairs: Mapping[str, tuple[FloatArray, FloatArray]], unit: str) -> Figure:
    """Currents by location, predicted and measured (paper, Figure 17), and one against the other.

    Parameters
    ----------
    pairs : mapping of str to ((location,) float, (location,) float)
        Predicted and measured currents of each cell, by its name.
    unit : str
        Of the currents.
    """
    figure = new_figure(10.0, 0.2 + 2.4 * len(pairs))
    for row, (name, (predicted, measured)) in enumerate(reversed(list(pairs.items()))):
        bottom, color = 0.55 + 2.4 * row, OKABE_ITO[len(pairs) - 1 - row]
        axes = place(figure, 0.65, bottom, 6.1, 1.65)
        number = np.arange(1, predicted.size + 1)
        axes.plot(number, measured, color=INK, linewidth=1.0, label="measured")
        axes.plot(
            number,
            predicted,
            color=color,
            linewidth=0.0,
            marker=MARKERS[0],
            markersize=2.5,
            label="predicted by the map",
        )
        axes.set_title(plain(name), loc="left", pad=4.0)
        axes.set_ylabel(f"current [{unit}]")
        axes.set_ylim(bottom=0.0)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.2)
        beside = place(figure, 7.6, bottom, 1.9, 1.65)
        top = 1.05 * float(max(predicted.max(), measured.max()))
        beside.plot([0.0, top], [0.0, top], color=MUTED, linewidth=0.8)
        beside.plot(measured, predicted, linewidth=0.0, marker=MARKERS[0], markersize=2.5, color=color)
        beside.set_xlim(0.0, top)
        beside.set_ylim(0.0, top)
        beside.set_ylabel(f"predicted [{unit}]")
        if row == 0:
            axes.set_xlabel("location [1]")
            beside.set_xlabel(f"measured [{unit}]")
    return figure
