"""A solar cell's current, and its charge and energy per day, at every point of a map."""

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.maps.point_values import places_of
from lidarspectra.mapping.photometry.point_light import PointLight, light_of_lamps
from lidarspectra.mapping.photometry.schedule import Shift, day_parts, gathered
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.mapping.photovoltaics.currents import (
    DARK_PER_M2,
    cell_current_density,
    cut_lamps,
    far_share,
    highest_volt,
    maximum_power,
    power_held,
    response_beyond,
)
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.words import counted, two_digits

FAR_SHARE = 0.05  # [1] of a current by light beyond the channels that draws a note
COULOMB_PER_MAH = 3.6  # [C/mAh]
JOULE_PER_MWH = 3.6  # [J/mWh]


def current_map(
    transport: xr.Dataset,
    fluxes: Mapping[str, Spectrum],
    cell: Cell,
    *,
    area_m2: float | None = None,
    scale: float = 1.0,
    shifts: Sequence[Shift] = (),
    daylight: Collection[str] = (),
    volt: float | None = None,
) -> xr.Dataset:
    """Current of a cell at every point and, with a schedule, charge and energy per day.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients.
    fluxes : mapping of str to Spectrum
        Spectral flux of every lamp. [W/nm]
    cell : Cell
    area_m2 : float, optional
        The cell's own if left out. [m²]
    scale : float
        Factor on the cell's curve, from a calibration. [1]
    shifts : sequence of Shift
        When each lamp is lit; without any there is no charge and energy.
    daylight : collection of str
        Lamps that are windows or the sun. Their light is that of one moment: a day's charge and energy have it only for
        the hours of shifts that name them.
    volt : float, optional
        Fixed operating voltage, set by the converter, instead of the maximum power point; without a circuit the current
        there is taken as the short-circuit current. [V]

    Returns
    -------
    map : xarray.Dataset
        Dim point: current_density_A_m2 and its _se, current_A, power_W; with shifts charge_mAh_day and energy_mWh_day.
        Power and energy are there where the cell has a circuit, or a voltage is given. Attribute `notes`: caveats for
        the user, one per line.

    Raises
    ------
    MapError
        If there is no area, or a shift names an unknown lamp.
    """
    area = area_of(cell, area_m2)
    light = light_of_lamps(transport, fluxes)
    density, error = (scale * part for part in cell_current_density(light, cell))
    variables = {
        "current_density_A_m2": (density, "current density", "A/m²"),
        "current_density_A_m2_se": (error, "standard error of the current density", "A/m²"),
        "current_A": (area * density, "current", "A"),
    }

    notes = [*current_notes(cell, scale, fluxes), *_far_notes(light, cell), *_daylight_notes(shifts, daylight)]
    power = _power_of(cell, volt)
    if power is not None:
        variables["power_W"] = (area * power(density), "power", "W")
    notes += _power_notes(cell, volt, density, None if power is None else power(density))
    if shifts:
        names = [str(name) for name in transport["lamp"].to_numpy()]
        alone = {
            name: scale * lamp.weigh(light.centers_nm, cell.responsivity).sum(axis=1)
            for name, lamp in zip(names, light.lamps, strict=True)
        }

        def under(dims: Mapping[str, float]) -> FloatArray:
            return np.asarray(np.sum([dims[name] * alone[name] for name in names], axis=0), dtype=np.float64)

        charge, energy = gathered(day_parts(shifts, names, daylight=daylight), under, power)
        variables["charge_mAh_day"] = (area * charge / COULOMB_PER_MAH, "charge of a day", "mAh")
        if energy is not None:
            variables["energy_mWh_day"] = (area * energy / JOULE_PER_MWH, "energy of a day", "mWh")
    return xr.Dataset(
        {
            name: ("point", values, {"units": unit, "long_name": words})
            for name, (values, words, unit) in variables.items()
        },
        places_of(transport),
        {
            "cell": cell.name,
            "area_m2": area,
            "scale": scale,
            "notes": "\n".join(notes),
        },
    )


def area_of(cell: Cell, area_m2: float | None) -> float:
    """The area given, or the cell's own [m²]; raises MapError if there is neither, or it is not positive."""
    area = area_m2 if area_m2 is not None else cell.area_m2
    if area is None or not 0 < area < np.inf:
        raise MapError(
            expected="the area of the cell",
            found="none" if area is None else f"{area:g} m²",
            where=f"cell '{cell.name}'",
            todo="Give --area CM2, or area_cm2 in the run file.",
        )
    return area


def current_notes(cell: Cell, scale: float, fluxes: Mapping[str, Spectrum]) -> list[str]:
    """Caveats on currents of a cell under lamps of these spectra, by name, as full sentences."""
    notes = list(cell.notes(scale))
    cut = cut_lamps(fluxes, cell)
    if cut:
        missed = 100.0 * max(response_beyond(cell, fluxes[name].range_nm[1]) for name in cut)
        notes.append(
            f"The spectrum of {', '.join(cut)} ends where it is still bright and '{cell.name}' still responds, so that "
            f"the current is underestimated: {two_digits(missed)} % of the cell's response lies beyond. Give a "
            "spectrum that covers the cell's whole range."
        )
    return notes


def _far_notes(light: PointLight, cell: Cell) -> tuple[str, ...]:
    """A note where much of the current is by light that the room was not traced for."""
    share, centers = far_share(light, cell), light.centers_nm
    if share < FAR_SHARE:
        return ()
    return (
        f"{two_digits(100 * share)} % of the current of '{cell.name}' is by light beyond the channels, "
        f"{centers[0]:g} to {centers[-1]:g} nm, where the room is taken to reflect as in the outermost one: many "
        "paints and cloths reflect more in the infrared. Channels that reach farther ([sensors] device) tell better.",
    )


def _power_notes(cell: Cell, volt: float | None, density: FloatArray, power: FloatArray | None) -> tuple[str, ...]:
    """A note where there is no power for want of a voltage, or because the voltage is more than a cell has."""
    if power is None:
        return (
            f"There is no power and energy, since the voltage of '{cell.name}' is not known. Give the voltage at which "
            "it is operated with --volt, or as volt in the run file.",
        )
    if cell.circuit is None and volt is not None and volt >= (highest := highest_volt(cell)):
        return (
            f"No single cell of this response reaches {volt:g} V: its photons of least energy have {highest:.2g} eV. "
            "Power and energy are too high by the number of cells in series: give their voltage over their number.",
        )
    lit = density > DARK_PER_M2
    unfed = int((lit & (power <= 0)).sum())
    if not unfed:
        return ()
    return (
        f"At {unfed} of {counted(int(lit.sum()), 'point')} in light '{cell.name}' does not reach the {volt:g} V at "
        "which it is held, and gives no power there. The voltage is that of one cell: of cells in series give their "
        "voltage over their number.",
    )


def _daylight_notes(shifts: Sequence[Shift], daylight: Collection[str]) -> tuple[str, ...]:
    """A note on windows and the sun that no shift names."""
    left_out = [name for name in daylight if name not in {shift.lamp for shift in shifts}]
    if not shifts or not left_out:
        return ()
    return (
        f"Charge and energy of a day are without {', '.join(left_out)}, whose light is that of the run's one moment, "
        "not of all these hours; current and power have it. To count it, name it in a schedule (photocurrent "
        "--schedule), with the hours, and the dim, for which that moment shall stand.",
    )


def _power_of(cell: Cell, volt: float | None) -> Callable[[FloatArray], FloatArray] | None:
    """Power for a current density [W/m²]; None if the cell's voltage is not known."""
    circuit = cell.circuit
    if volt is not None:
        return lambda current: volt * current if circuit is None else power_held(current, circuit, volt)
    return None if circuit is None else lambda current: maximum_power(current, circuit)


def currents_table(currents: xr.Dataset) -> Table:
    """Mean and range over the points that are not buried."""
    kept = kept_points(currents)
    rows = []
    for name in map(str, currents.data_vars):
        if not name.endswith("_se"):
            values = currents[name].to_numpy()[kept]
            about = currents[name].attrs
            rows.append((about["long_name"], about["units"], values.mean(), values.min(), values.max()))
    frame = pd.DataFrame(rows, columns=["quantity", "unit", "mean", "lowest", "highest"])
    caption = (
        f"Cell '{currents.attrs['cell']}' of {1e4 * currents.attrs['area_m2']:g} cm² at {counted(kept.size, 'point')}."
    )
    return Table(name="photocurrent", caption=caption, frame=frame)
