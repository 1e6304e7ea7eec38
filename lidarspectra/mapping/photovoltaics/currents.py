"""Current and power of a solar cell under a known spectrum (paper, Eq. 10 and 11)."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike
from scipy import constants

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.response_weights import REACH_NM, share_within
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photovoltaics.cells import AMPERE_PER_WATT_NM, Cell, Circuit
from lidarspectra.spectra.spectrum import Spectrum

CELL_KELVIN = 298.15  # [K] 25 °C, the standard temperature of circuit parameters, also close to that of a room
VOLT_PER_KELVIN = float(constants.k / constants.e)  # [V/K]
STILL_BRIGHT = 0.05  # [1] of its peak: a spectrum that ends above it is cut off
RESPONDS = 0.01  # [1] of its peak: a response below it is the tail of defects and of digitising
DARK_PER_M2 = 1e-9  # [A/m²] current density below which the power is taken as zero


def photocurrent_density(irradiance: ArrayLike, wavelengths_nm: ArrayLike, efficiency: ArrayLike) -> FloatArray:
    """Short-circuit current density J_sc = (q/hc) ∫ λ EQE(λ) E(λ) dλ (paper, Eq. 10).

    The paper's P_in is the incident power; the factor λ/hc converts it to photons.

    Parameters
    ----------
    irradiance : (..., wavelength) float
        Spectral irradiance. [W/m²/nm]
    wavelengths_nm : (wavelength,) float
        Ascending. [nm]
    efficiency : (wavelength,) float
        External quantum efficiency. [1]

    Returns
    -------
    density : (...,) float
        By the trapezoidal rule. [A/m²]

    Raises
    ------
    MapError
        If the last axes differ in length.
    """
    light, grid, part = (np.asarray(values, dtype=np.float64) for values in (irradiance, wavelengths_nm, efficiency))
    if light.shape[-1:] != grid.shape or part.shape != grid.shape:
        raise MapError(
            expected="one irradiance and one efficiency per wavelength",
            found=f"{light.shape[-1:]}, {part.shape} and {grid.shape}",
            where="photocurrent density",
        )
    return np.asarray(AMPERE_PER_WATT_NM * np.trapezoid(light * part * grid, grid, axis=-1), dtype=np.float64)


def photocurrent(irradiance: ArrayLike, wavelengths_nm: ArrayLike, absorption: ArrayLike, area_m2: float) -> FloatArray:
    """Photocurrent I = A (q/hc) ∫ λ a(λ) I(λ) dλ of a whole cell (paper, Eq. 11).

    Parameters
    ----------
    irradiance, wavelengths_nm
        As in `photocurrent_density`.
    absorption : (wavelength,) float
        a(λ), the share of the photons that is converted into current. [1]
    area_m2 : float
        [m²]

    Returns
    -------
    current : (...,) float
        [A]
    """
    return area_m2 * photocurrent_density(irradiance, wavelengths_nm, absorption)


def cell_current_density(light: PointLight, cell: Cell) -> tuple[FloatArray, FloatArray]:
    """Current density of a cell at every point, and its standard error.

    Parameters
    ----------
    light : PointLight
        With the lamps' spectra where they are known.
    cell : Cell

    Returns
    -------
    density, standard_error : (point,) float
        [A/m²]
    """
    return light.weigh(cell.responsivity)


def unknown_share(light: PointLight, cell: Cell) -> float:
    """Share of a cell's response outside the range of the bands [1]; 0 where the lamps' spectra are known."""
    return 0.0 if light.lamps else 1.0 - share_within(light.centers_nm, cell.responsivity)


def cut_lamps(fluxes: Mapping[str, Spectrum], cell: Cell) -> tuple[str, ...]:
    """Names of lamps whose spectrum is cut off where the cell still responds: its current is underestimated.

    Parameters
    ----------
    fluxes : mapping of str to Spectrum
        Spectral flux of every lamp. [W/nm]
    cell : Cell
    """
    _, last = cell.responsivity.range_nm
    return tuple(
        name
        for name, flux in fluxes.items()
        if flux.range_nm[1] < last and flux.values[-1] > STILL_BRIGHT * flux.values.max()
    )


def far_share(light: PointLight, cell: Cell) -> float:
    """Share of a cell's current, over all points, by light farther from the channels than `REACH_NM` [1].

    There the room is taken to reflect as in the outermost channel. 0 where only the channels are known: that light is
    then missing (`unknown_share`).
    """
    if not light.lamps:
        return 0.0
    grid, values = cell.responsivity.wavelengths_nm, cell.responsivity.values
    first, last = light.centers_nm[0] - REACH_NM, light.centers_nm[-1] + REACH_NM
    far = Spectrum(wavelengths_nm=grid, values=np.where((grid < first) | (grid > last), values, 0.0))
    whole = float(light.weigh(cell.responsivity)[0].sum())
    return float(light.weigh(far)[0].sum()) / whole if whole > 0 else 0.0


def highest_volt(cell: Cell) -> float:
    """Voltage that no cell of this response reaches: of the photons at its long-wavelength end, hc/(q λ) [V]."""
    values = cell.efficiency.values
    end_nm = cell.efficiency.wavelengths_nm[np.flatnonzero(values > RESPONDS * values.max())[-1]]
    return float(1.0 / (AMPERE_PER_WATT_NM * end_nm))


def response_beyond(cell: Cell, wavelength_nm: float) -> float:
    """Share of a cell's response, ∫ S dλ, at wavelengths longer than this [1]."""
    grid, response = cell.responsivity.wavelengths_nm, cell.responsivity.values
    whole = float(np.trapezoid(response, grid))
    return float(np.trapezoid(np.where(grid > wavelength_nm, response, 0.0), grid)) / whole


def maximum_power(density: ArrayLike, circuit: Circuit) -> FloatArray:
    """Power at the maximum power point of a single-diode cell, by pvlib.

    Parameters
    ----------
    density : (...,) float
        Photocurrent density. [A/m²]
    circuit : Circuit
        Its shunt resistance is `shunt_volt` over the photocurrent (De Soto 2006, Eq. 12).

    Returns
    -------
    power : (...,) float
        [W/m²]
    """
    import pvlib  # here, since it takes over a second

    return _of_lit(density, lambda lit: pvlib.pvsystem.singlediode(lit, *_diode(circuit, lit))["p_mp"])


def power_held(density: ArrayLike, circuit: Circuit, volt: float) -> FloatArray:
    """Power P = V I(V) of a single-diode cell at a fixed voltage.

    Parameters
    ----------
    density, circuit
        As in `maximum_power`.
    volt : float
        [V]

    Returns
    -------
    power : (...,) float
        0 where the voltage is above the open-circuit voltage: the converter does not feed the cell. [W/m²]
    """
    import pvlib

    return _of_lit(
        density, lambda lit: volt * np.maximum(pvlib.pvsystem.i_from_v(volt, lit, *_diode(circuit, lit)), 0.0)
    )


def _diode(circuit: Circuit, density: FloatArray) -> tuple[float, float, FloatArray, float]:
    """Saturation current, series and shunt resistance, n k T / q, in pvlib's order."""
    thermal = circuit.ideality * VOLT_PER_KELVIN * CELL_KELVIN
    return circuit.saturation_current_A_m2, circuit.series_ohm_m2, circuit.shunt_volt / density, thermal


def _of_lit(density: ArrayLike, power: Callable[[FloatArray], ArrayLike]) -> FloatArray:
    """Powers of the densities above `DARK_PER_M2`, 0 for all others [W/m²]."""
    given = np.asarray(density, dtype=np.float64)
    found = np.zeros(given.shape)
    lit = given > DARK_PER_M2
    if lit.any():
        found[lit] = np.asarray(power(given[lit]), dtype=np.float64)
    return found
