"""What measuring itself costs: virtual sensors and cells in the true light, set beside that light.

Whoever measures a room to check a map checks it with an instrument that is itself off. The true spectra fall on a
sensor with whole counts, noise, limits, dies that disagree and drift; its counts become irradiance as a user's do, by
factors from a lamp of known spectrum; and the table says how far that is from the truth. A map can be told to be better
than these lines by a better sensor only.
"""

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import SATURATED_COUNT, basic_counts, nominal_responsivity
from lidarspectra.hardware.sensor.photocell import PAPER_CELL_AREA_CM2, CellCircuit, cell_current
from lidarspectra.hardware.virtual.solar_cell import cell_counts, cell_current_in, draw_cell
from lidarspectra.hardware.virtual.spectral_sensor import (
    VirtualSensor,
    basic_counts_of,
    best_settings,
    counts_of,
    draw_sensor,
)
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM, Spectrum, gaussian_bands
from research.experiments.true_light_file import StoredLight

READINGS = 10  # averaged at every point: ten seconds of the robot's 1 Hz
HOURS = 3.0  # [h] a session; the sensor was calibrated before it
LAMP_READINGS = 30  # averaged under the reference lamp
SEED = 3  # of sensors, cells and noise
CIRCUITS = {
    "a shunt alone": CellCircuit(reference_volt=1.1, shunt_ohm=100.0, area_cm2=PAPER_CELL_AREA_CM2),
    "a shunt and an amplifier of 10": CellCircuit(
        reference_volt=1.1, shunt_ohm=100.0, area_cm2=PAPER_CELL_AREA_CM2, amplification=10.0
    ),
}


def calibration_lamp() -> Spectrum:
    """A reference lamp's irradiance on the sensor: a halogen lamp's slope, 0.5 to 4 mW/m²/nm."""
    wavelengths = np.arange(350.0, 1001.0, 5.0)
    values = 4e-3 * np.clip((wavelengths - 330.0) / 650.0, 0.1, 1.0)
    return Spectrum(wavelengths_nm=wavelengths, values=values, name="reference lamp")


def calibration_factors(sensor: VirtualSensor, generator: np.random.Generator) -> FloatArray:
    """(18,) irradiance a basic count, from readings under the reference lamp [W/m²/nm per 1/ms]."""
    lamp = calibration_lamp()
    basic = basic_counts_of(sensor, lamp.wavelengths_nm, lamp.values[None, :], np.zeros(1))
    settings = best_settings(sensor, basic)
    counts = counts_of(sensor, np.repeat(basic, LAMP_READINGS, axis=0), generator, settings).mean(axis=0)
    nominal = gaussian_bands("as7265x-18", AS7265X_CENTERS_NM, AS7265X_FWHM_NM).band_values(lamp, outside="zero")
    return np.asarray(nominal * settings.gain * settings.integration_ms / counts, dtype=np.float64)


def measured_irradiance(
    light: StoredLight, sensor: VirtualSensor, factors: FloatArray, generator: np.random.Generator
) -> FloatArray:
    """Irradiance as a sensor measures it at every point, in the channels of the true light.

    Parameters
    ----------
    light : StoredLight
    sensor : VirtualSensor
    factors : (18,) float
        From basic counts. [W/m²/nm per 1/ms]
    generator : Generator
        Of the noise.

    Returns
    -------
    irradiance : (point, band) float
        NaN where saturated. [W/m²/nm]
    """
    hours = np.linspace(0.0, HOURS, len(light.irradiance))
    basic = basic_counts_of(sensor, light.wavelengths_nm, light.irradiance, hours)
    settings = best_settings(sensor, basic)
    readings = np.array([counts_of(sensor, basic, generator, settings) for _ in range(READINGS)], dtype=np.float64)
    readings[readings >= SATURATED_COUNT] = np.nan
    count = len(basic)
    found = basic_counts(readings.mean(axis=0), np.full(count, settings.gain), np.full(count, settings.integration_ms))
    chosen = [int(np.abs(np.array(AS7265X_CENTERS_NM) - center).argmin()) for center in light.channel_nm]
    return np.asarray((found * factors)[:, chosen], dtype=np.float64)


def sensor_table(light: StoredLight, scene: str) -> Table:
    """Sensors of growing honesty: the error of measuring, in the measures of Table 1."""
    nominal = np.full(len(AS7265X_CENTERS_NM), 1.0 / nominal_responsivity()[0])
    rows = []
    for words, calibrated, noisy, by_lamp in (
        ("whole counts only", True, False, False),
        ("and 0.4 % noise and dark counts", True, True, False),
        ("and its own dies, centres and drift, by the data sheet", False, True, False),
        ("the same, calibrated under a lamp", False, True, True),
    ):
        generator = np.random.default_rng(SEED)
        sensor = draw_sensor(SEED, calibrated=calibrated, noisy=noisy)
        factors = calibration_factors(sensor, generator) if by_lamp else nominal
        measured = measured_irradiance(light, sensor, factors, generator)
        kept = ~light.buried & np.isfinite(measured).all(axis=1)
        absolute = compare_maps(measured[kept], light.channel_irradiance[kept])
        scaled = compare_maps(measured[kept], light.channel_irradiance[kept], normalisation="band")
        rows.append(
            (words, absolute.nrmse_mean, absolute.mape_mean, absolute.mape_median, scaled.mape_mean, scaled.mape_median,
             absolute.angle_median_deg)
        )  # fmt: skip
    frame = pd.DataFrame(
        rows,
        columns=[
            "sensor", "abs NRMSE mean [1]", "abs MAPE mean [%]", "abs median error [%]", "0-1 MAPE mean [%]",
            "0-1 median error [%]", "angle median [deg]",
        ],
    )  # fmt: skip
    formats = {str(name): ".3f" if "[1]" in str(name) else ".2f" for name in frame.columns if "[" in str(name)}
    caption = f"What a virtual AS7265x makes of the true light, {scene}: ten readings a point over three hours."
    return Table(name=f"instrument-sensor-{scene}", caption=caption, frame=frame, formats=formats)


def cell_table(light: StoredLight, cells: dict[str, Spectrum], scene: str) -> Table:
    """Cells in the true light over a converter of 10 bits: the error of the current, by wiring."""
    rows = []
    free = ~light.buried
    for number, (name, responsivity) in enumerate(cells.items()):
        for words, circuit in CIRCUITS.items():
            generator = np.random.default_rng(SEED + number)
            cell = draw_cell(responsivity, circuit, SEED + number)
            true = cell_current_in(cell, light.wavelengths_nm, light.irradiance[free])
            counts = np.mean([cell_counts(cell, true, generator) for _ in range(READINGS)], axis=0)
            found, _ = cell_current(counts, circuit)
            error = 100.0 * np.abs(found / true - 1.0)
            rows.append((name, words, 1e6 * float(np.median(true)), float(np.nanmedian(counts)),
                         float(np.nanmean(error)), float(np.nanmedian(error))))  # fmt: skip
    frame = pd.DataFrame(
        rows,
        columns=["cell", "wiring", "median current [µA]", "median count [1]", "mean error [%]", "median error [%]"],
    )
    formats = dict.fromkeys(("median current [µA]", "median count [1]", "mean error [%]", "median error [%]"), ".1f")
    caption = f"What a converter of 10 bits makes of virtual solar cells of 36 cm² in the true light, {scene}."
    return Table(name=f"instrument-cells-{scene}", caption=caption, frame=frame, formats=formats)
