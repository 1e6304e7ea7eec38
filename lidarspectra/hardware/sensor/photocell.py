"""Solar cells read over an analog-digital converter: current from counts.

The cell feeds a shunt resistor R, across which the converter reads the voltage U = N U_ref / 2^bits. The current is
I = U / R, and the current density J = I / A. This is the short-circuit current only while U stays far below the cell's
open-circuit voltage; the voltage across the shunt takes the cell off short circuit, and the reading is then low.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError

M2_PER_CM2 = 1e-4  # [m² per cm²]
PAPER_CELL_AREA_CM2 = 36.0  # [cm²] each of the two organic cells (paper, section 3.5)
AVR_ADC_BITS = 10  # of the ATmega328P in an Arduino Uno (its data sheet)
ADC_ERROR_LSB = 2.0  # [count] ± absolute accuracy of that converter (its data sheet, table of ADC characteristics)


@dataclass(frozen=True, kw_only=True)
class CellCircuit:
    """How a cell is wired.

    Parameters
    ----------
    reference_volt : float
        Reference voltage of the converter. [V]
    shunt_ohm : float
        Resistor across the cell. [Ω]
    area_cm2 : float
        Of the cell. [cm²]
    bits : int
        Of the converter.
    amplification : float
        Of an amplifier between shunt and converter. [1]
    dark_count : float
        Count with the cell covered. [count]
    open_circuit_volt : float or None
        Of the cell, for the check that it is near short circuit. [V]
    reference_tolerance, shunt_tolerance, area_tolerance : float
        ± limits, relative. [1]
    """

    reference_volt: float
    shunt_ohm: float
    area_cm2: float
    bits: int = AVR_ADC_BITS
    amplification: float = 1.0
    dark_count: float = 0.0
    open_circuit_volt: float | None = None
    reference_tolerance: float = 0.05
    shunt_tolerance: float = 0.01
    area_tolerance: float = 0.01

    def __post_init__(self) -> None:
        positive = (self.reference_volt, self.shunt_ohm, self.area_cm2, self.amplification)
        if not (min(positive) > 0 and np.isfinite(positive).all() and 6 <= self.bits <= 24):
            raise ReadingError(
                expected="a positive reference voltage, shunt, area and amplification, and 6 to 24 bits",
                found=f"{self.reference_volt:g} V, {self.shunt_ohm:g} ohm, {self.area_cm2:g} cm², {self.bits} bits",
                where="cell circuit",
                todo="See the wiring table of docs/howto-sensor.md.",
            )
        if not 0.0 <= self.dark_count < self.full_scale:
            raise ReadingError(
                expected=f"a count with the cell covered from 0 to below {self.full_scale}, the converter's largest",
                found=f"{self.dark_count:g}",
                where="cell circuit",
                todo="Cover the cell and read its count (--dark).",
            )

    @property
    def full_scale(self) -> int:
        """Largest count."""
        return int(2**self.bits - 1)

    @property
    def ampere_per_count(self) -> float:
        """Current of one count [A]."""
        return self.reference_volt / float(2**self.bits) / self.amplification / self.shunt_ohm

    def currents(self, counts: ArrayLike, uncertainty: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Currents of counts that are known with an uncertainty, as those of a fit are.

        Parameters
        ----------
        counts, uncertainty : (...,) float
            [count]

        Returns
        -------
        current, uncertainty : (...,) float
            The uncertainty includes the tolerances of reference and shunt, as rectangular distributions. [A]
        """
        current = (np.asarray(counts, dtype=np.float64) - self.dark_count) * self.ampere_per_count
        relative = np.hypot(self.reference_tolerance, self.shunt_tolerance) / np.sqrt(3.0)
        counted = np.asarray(uncertainty, dtype=np.float64) * self.ampere_per_count
        return np.asarray(current), np.asarray(np.hypot(counted, relative * np.abs(current)))


def cell_voltage(counts: ArrayLike, circuit: CellCircuit) -> FloatArray:
    """Voltage across the cell and its shunt; NaN where the converter is at full scale.

    Parameters
    ----------
    counts : (...,) float
        [count]
    circuit : CellCircuit
        Its wiring.

    Returns
    -------
    voltage : (...,) float
        [V]

    Raises
    ------
    ReadingError
        If a count is negative or beyond the converter's range: it is of another one.
    """
    given = np.asarray(counts, dtype=np.float64)
    known = given[np.isfinite(given)]
    if known.size and (known.min() < 0 or known.max() > circuit.full_scale):
        raise ReadingError(
            expected=f"counts from 0 to {circuit.full_scale} of a converter of {circuit.bits} bits",
            found=f"{known.min():g} to {known.max():g}",
            where="cell counts",
            todo="Give the right number of bits.",
        )
    net = np.where(given >= circuit.full_scale, np.nan, given - circuit.dark_count)
    return np.asarray(net * circuit.ampere_per_count * circuit.shunt_ohm)


def cell_current(counts: ArrayLike, circuit: CellCircuit) -> tuple[FloatArray, FloatArray]:
    """Current of a cell, I = (N - N_dark) U_ref / (2^bits g R), and its standard uncertainty.

    Parameters
    ----------
    counts : (...,) float
        Counts of the converter. [count]
    circuit : CellCircuit
        Its wiring.

    Returns
    -------
    current, uncertainty : (...,) float
        NaN where the converter is at full scale. The uncertainty includes rounding, the converter's accuracy and the
        tolerances of reference and shunt, as rectangular distributions. [A]

    Raises
    ------
    ReadingError
        See `cell_voltage`.
    """
    known = np.where(np.isfinite(cell_voltage(counts, circuit)), np.asarray(counts, dtype=np.float64), np.nan)
    return circuit.currents(known, np.hypot(1.0 / np.sqrt(12.0), ADC_ERROR_LSB / np.sqrt(3.0)))


def cell_current_density(counts: ArrayLike, circuit: CellCircuit) -> tuple[FloatArray, FloatArray]:
    """Current density J = I / A and its standard uncertainty.

    Parameters
    ----------
    counts : (...,) float
        [count]
    circuit : CellCircuit
        Its wiring.

    Returns
    -------
    density, uncertainty : (...,) float
        [A/m²]
    """
    area_m2 = circuit.area_cm2 * M2_PER_CM2
    current, uncertainty = cell_current(counts, circuit)
    area = circuit.area_tolerance / np.sqrt(3.0)
    return current / area_m2, np.asarray(np.hypot(uncertainty, area * np.abs(current)) / area_m2)


def loading(counts: ArrayLike, circuit: CellCircuit) -> float | None:
    """Largest voltage across the cell over its open-circuit voltage [1]; None where the latter is not known.

    Up to about 0.5 the current of a good cell is its short-circuit current within a few percent; a larger value needs
    a smaller shunt, and an amplifier.
    """
    if circuit.open_circuit_volt is None:
        return None
    voltage = cell_voltage(counts, circuit)
    return float(np.nanmax(voltage) / circuit.open_circuit_volt) if np.isfinite(voltage).any() else 0.0
