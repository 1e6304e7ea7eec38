"""Virtual solar cells on a virtual converter: what an Arduino would read of cells in known light.

    J = ∫ E(λ) S(λ) dλ  (paper, Eq. 10),   I = (1 + e) J A,   N = round(g R I 2^bits / U_ref + dark + noise)

The log has three columns, time and two cells, as the paper's robot wrote it. A cell's own error e is drawn once from
its seed, the noise of every reading from the generator.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.photocell import ADC_ERROR_LSB, M2_PER_CM2, CellCircuit
from lidarspectra.spectra.spectrum import Spectrum

CELL_SPREAD = 0.03  # standard deviation of a cell's response to its data sheet
COUNT_NOISE = ADC_ERROR_LSB / np.sqrt(3.0)  # [count] limits of the converter's data sheet as a standard deviation


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualCell:
    """A cell with its wiring.

    Parameters
    ----------
    responsivity : Spectrum
        S(λ), zero beyond its ends. [A/W]
    circuit : CellCircuit
        Area, shunt and converter.
    factor : float
        Its own response over that of the data sheet. [1]
    """

    responsivity: Spectrum
    circuit: CellCircuit
    factor: float = 1.0

    def __post_init__(self) -> None:
        least = float(self.responsivity.values.min())
        if least < 0 or not self.factor > 0:
            raise ReadingError(
                expected="a responsivity of 0 or more, and a factor above 0",
                found=f"{least:g}, factor {self.factor:g}",
                where="virtual cell",
            )


def draw_cell(responsivity: Spectrum, circuit: CellCircuit, seed: int) -> VirtualCell:
    """A cell whose response is off its data sheet by what the seed draws."""
    factor = float(np.exp(CELL_SPREAD * np.random.default_rng(seed).standard_normal()))
    return VirtualCell(responsivity=responsivity, circuit=circuit, factor=factor)


def cell_current_in(cell: VirtualCell, wavelengths_nm: FloatArray, irradiance: FloatArray) -> FloatArray:
    """Short-circuit current of a cell under spectra (paper, Eq. 10).

    Parameters
    ----------
    cell : VirtualCell
    wavelengths_nm : (wavelength,) float
        [nm]
    irradiance : (reading, wavelength) float
        [W/m²/nm]

    Returns
    -------
    current : (reading,) float
        [A]
    """
    spectra = float_array(irradiance, name="irradiance", shape=(None, wavelengths_nm.size))
    response = cell.responsivity.at(wavelengths_nm, outside="zero")
    density = np.trapezoid(spectra * response, wavelengths_nm, axis=1)
    return np.asarray(cell.factor * density * cell.circuit.area_cm2 * M2_PER_CM2, dtype=np.float64)


def cell_counts(cell: VirtualCell, current: FloatArray, generator: np.random.Generator) -> IntArray:
    """Counts of the converter for currents (reading,) [A]; whole numbers up to its full scale."""
    clean = np.asarray(current, dtype=np.float64) / cell.circuit.ampere_per_count + cell.circuit.dark_count
    noisy = clean + COUNT_NOISE * generator.standard_normal(clean.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, cell.circuit.full_scale), dtype=np.int64)
