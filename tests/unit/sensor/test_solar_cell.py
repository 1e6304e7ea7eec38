"""Virtual cells give the current of Eq. 10, and the converter's counts lead back to it."""

import numpy as np
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.photocell import CellCircuit, cell_current
from lidarspectra.hardware.virtual.solar_cell import VirtualCell, cell_counts, cell_current_in, draw_cell
from lidarspectra.spectra.spectrum import Spectrum

CIRCUIT = CellCircuit(reference_volt=1.1, shunt_ohm=100.0, area_cm2=36.0)
FLAT = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.array([0.2, 0.2]))
WAVELENGTHS = np.arange(400.0, 701.0, 5.0)


def test_the_current_is_the_integral_of_light_times_responsivity_times_area() -> None:
    cell = VirtualCell(responsivity=FLAT, circuit=CIRCUIT)
    light = np.full((2, WAVELENGTHS.size), [[1e-3], [2e-3]])
    # 1 mW/m²/nm over 300 nm is 0.3 W/m²; times 0.2 A/W and 36 cm².
    assert cell_current_in(cell, WAVELENGTHS, light) == pytest.approx([0.3 * 0.2 * 36e-4, 0.6 * 0.2 * 36e-4])


def test_counts_lead_back_to_the_current_within_the_converter_s_limits() -> None:
    cell = VirtualCell(responsivity=FLAT, circuit=CIRCUIT)
    current = np.linspace(1e-4, 9e-3, 200)
    found, _ = cell_current(cell_counts(cell, current, np.random.default_rng(1)).astype(float), CIRCUIT)
    # Noise of 1.2 counts and rounding: of 200 readings none is off by 8 counts.
    assert np.abs(found - current).max() < 8 * CIRCUIT.ampere_per_count


def test_a_converter_ends_at_its_full_scale_and_a_log_has_three_columns() -> None:
    cell = draw_cell(FLAT, CIRCUIT, 1)
    counts = cell_counts(cell, np.array([0.0, 1.0]), np.random.default_rng(1))
    assert counts[1] == CIRCUIT.full_scale


def test_a_negative_responsivity_is_refused() -> None:
    with pytest.raises(ReadingError, match="responsivity"):
        VirtualCell(responsivity=FLAT.scaled(-1.0), circuit=CIRCUIT)
