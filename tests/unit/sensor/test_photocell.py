"""Currents of solar cells from counts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
from lidarspectra.hardware.sensor.photocell import CellCircuit, cell_current, cell_current_density, loading

CIRCUIT = CellCircuit(reference_volt=5.0, shunt_ohm=100.0, area_cm2=36.0)


def test_half_of_the_range_is_half_of_the_voltage_over_the_shunt() -> None:
    # half of the range: 512 / 1024 x 5 V = 2.5 V over 100 ohm
    current, _ = cell_current(512, CIRCUIT)
    assert float(current) == pytest.approx(0.025)
    density, _ = cell_current_density(512, CIRCUIT)
    assert float(density) == pytest.approx(0.025 / 0.0036)


def test_an_amplifier_and_a_dark_count_are_taken_out() -> None:
    circuit = replace(CIRCUIT, amplification=10.0, dark_count=12.0)
    assert float(cell_current(112, circuit)[0]) == pytest.approx(100 * 5 / 1024 / 10 / 100)


def test_the_uncertainty_is_the_converters_for_few_counts_and_the_tolerances_for_many() -> None:
    few, many = cell_current([2, 900], CIRCUIT)[1] / CIRCUIT.ampere_per_count
    assert few == pytest.approx(np.hypot(1 / np.sqrt(12), 2 / np.sqrt(3)), rel=0.01)
    assert many == pytest.approx(900 * np.hypot(0.05, 0.01) / np.sqrt(3), rel=0.01)


def test_a_current_of_fitted_counts_is_as_uncertain_as_the_circuit_too() -> None:
    current, uncertainty = CIRCUIT.currents([900.0], [0.0])
    assert current == pytest.approx(900 * CIRCUIT.ampere_per_count)
    assert uncertainty / current == pytest.approx(np.hypot(0.05, 0.01) / np.sqrt(3))


def test_a_converter_at_its_end_is_masked() -> None:
    assert np.isnan(cell_current(1023, CIRCUIT)[0])


@pytest.mark.parametrize("counts", [[-1.0], [1024.0], [5.0, 4000.0]])
def test_counts_of_another_converter_are_refused(counts: list[float]) -> None:
    with pytest.raises(ReadingError, match="bits"):
        cell_current(counts, CIRCUIT)


@pytest.mark.parametrize(
    "change",
    [{"shunt_ohm": 0.0}, {"reference_volt": -1.0}, {"area_cm2": np.nan}, {"bits": 1}, {"dark_count": 1023.0},
     {"dark_count": -1.0}, {"dark_count": np.nan}],
)  # fmt: skip
def test_a_circuit_that_cannot_be_is_refused(change: dict[str, float]) -> None:
    with pytest.raises(ReadingError):
        replace(CIRCUIT, **change)


def test_loading_tells_how_far_a_cell_is_from_short_circuit() -> None:
    assert loading([100, 205], replace(CIRCUIT, open_circuit_volt=2.0)) == pytest.approx(205 * 5 / 1024 / 2)
    assert loading([100], CIRCUIT) is None


def test_the_real_robots_three_cells_are_read(shared: Path) -> None:
    readings = readings_from_csv(shared / "sensor-logs" / "office-robot" / "solar-2023-04-20.csv")
    current, error = cell_current(readings["adc"].to_numpy(), CIRCUIT)
    assert current.shape == (530, 3)
    assert np.isfinite(current).all()
    # the two organic cells see the same light: their currents go together along the drive
    assert np.corrcoef(current[:, 0], current[:, 1])[0, 1] > 0.9
    assert (error > 0).all()
