"""A cell fitted beside a sensor, first half to second half: virtual logs, and a real one, beside NNLS and ridge.

    python -m research.benchmarks.cell_fits [--log LOG] [--logs 60]

A virtual log has 500 readings of a virtual AS7265x (die and channel factors, whole counts, 0.4 % of noise) beside an
organic or a silicon cell (3 % off its data sheet, a converter of whole counts, 2 counts of noise, an offset of 20 to
100 counts, 1 % of drift). Its light is a mixture of two or three of the databases' spectra; their levels walk and
jump; in a third of the logs one of them is lit in the second half alone. Beside the fit: NNLS with an offset, and a
ridge of standardised channels with its penalty chosen over blocks, which are what the literature would take. Further
logs have an offset of -140 to -60 counts, as of a converter that swallows the first light.

Another day has a gain of 0.85 to 1.15 and another offset: fitted on the first, renewed with 0, 1 and 5 of its readings.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import nnls

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import DIE_INDEX
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.photometry.indoor_spectra import IndoorSpectra, indoor_spectra
from lidarspectra.mapping.photovoltaics.cell_fit import fit_cell, renewed
from lidarspectra.mapping.photovoltaics.cells import find_cell
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, sensor_bands
from lidarspectra.workflow.applications.cell_fits import LogChoice, beside_cell

READINGS = 500  # of a virtual log
CELLS = ("organic-green", "organic-blue", "silicon")
OFFSET = 60.0  # [count] mean offset of a virtual converter
BELOW_ZERO = -100.0  # [count] one that swallows the first light
BLOCKS = 4  # of the ridge to compare with
ALPHAS = np.logspace(-2, 4, 13)  # [1] of that ridge
SEED = 21
WAVELENGTHS = np.array(AS7265X_CENTERS_NM)
Pair = tuple[FloatArray, FloatArray]


def levels(generator: np.random.Generator, count: int) -> FloatArray:
    """(reading, source) levels that walk and jump [1]."""
    walk = np.exp(np.cumsum(0.01 * generator.standard_normal((READINGS, count)), axis=0))
    jumps = np.ones((READINGS, count))
    for source in range(count):
        for start in generator.integers(0, READINGS, 6):
            jumps[start : start + generator.integers(10, 80), source] = generator.uniform(0.3, 1.0)
    found = walk * jumps * generator.uniform(0.3, 1.0, count)
    if generator.random() < 1.0 / 3.0:
        found[: READINGS // 2, -1] = 0.0
    return np.asarray(found, dtype=np.float64)


def virtual_log(ensemble: IndoorSpectra, cell_name: str, seed: int, *, base: float = OFFSET) -> tuple[Pair, Pair]:
    """Readings and counts of a day, and of another, with a mean offset [count]."""
    generator = np.random.default_rng(seed)
    cell = find_cell(cell_name)
    chosen = generator.choice(len(ensemble.lamp), generator.integers(2, 4), replace=False)
    bands = ensemble.band_values(sensor_bands("as7265x-18"))[chosen]
    current = ensemble.weigh(cell.responsivity)[chosen]
    off = 1.0 + 0.03 * generator.standard_normal()
    die = np.exp(0.4 * generator.standard_normal(3))[DIE_INDEX] * np.exp(0.1 * generator.standard_normal(18))
    days = []
    gain, offset = 1.0, generator.uniform(-40.0, 40.0)
    scale = 0.0
    for _ in range(2):
        level = levels(generator, chosen.size)
        light, true = (level @ bands) * die, (level @ current) * off
        light_scale = 20_000.0 / (bands * die).max()
        counts = np.rint(light * light_scale * (1.0 + 0.004 * generator.standard_normal(light.shape)))
        scale = scale or 250.0 / true.mean()
        drift = 1.0 + 0.01 * np.linspace(0.0, 1.0, READINGS) * generator.standard_normal()
        adc = gain * scale * true * drift + offset + base + 2.0 * generator.standard_normal(READINGS)
        days.append((counts, np.maximum(np.rint(adc), 1.0)))
        gain, offset = generator.uniform(0.85, 1.15), generator.uniform(-40.0, 40.0)
    return days[0], days[1]


def by_nnls(light: FloatArray, counts: FloatArray, later: FloatArray) -> FloatArray:
    """Counts by non-negative least squares with a free offset."""
    size = np.maximum(light.mean(axis=0), 1e-9)
    ones = np.ones((len(counts), 1))
    found, _ = nnls(np.hstack([light / size, ones, -ones]), counts)
    return np.asarray(later / size @ found[:-2] + found[-2] - found[-1], dtype=np.float64)


def by_ridge(light: FloatArray, counts: FloatArray, later: FloatArray) -> FloatArray:
    """Counts by a ridge of standardised channels, its penalty chosen over blocks of time."""
    blocks = np.arange(len(counts)) * BLOCKS // len(counts)

    def told(x: FloatArray, y: FloatArray, z: FloatArray, alpha: float) -> FloatArray:
        mean, spread = x.mean(axis=0), x.std(axis=0) + 1e-9
        a = (x - mean) / spread
        weights = np.linalg.solve(a.T @ a + alpha * np.eye(a.shape[1]), a.T @ (y - y.mean()))
        return np.asarray((z - mean) / spread @ weights + y.mean(), dtype=np.float64)

    losses = [
        sum(float(np.sum((told(light[blocks != b], counts[blocks != b], light[blocks == b], alpha)
                          - counts[blocks == b]) ** 2)) for b in range(BLOCKS))
        for alpha in ALPHAS
    ]  # fmt: skip
    return told(light, counts, later, float(ALPHAS[int(np.argmin(losses))]))


def mape(told: FloatArray, counts: FloatArray) -> float:
    """Mean absolute error relative to the counts [%]."""
    return 100.0 * float(np.mean(np.abs(told - counts) / counts))


def halves(light: FloatArray, counts: FloatArray) -> tuple[float, ...]:
    """MAPE of NNLS, ridge and our fit, what the fit states, how much lies within one and two of it, and outside [%]."""
    half = len(counts) // 2
    first, second, earlier, later = light[:half], light[half:], counts[:half], counts[half:]
    fit = fit_cell(first, earlier, WAVELENGTHS, np.ones(18))
    told, error = fit.counts(second)
    within = [100.0 * float(np.mean(np.abs(told - later) <= times * error)) for times in (1.0, 2.0)]
    stated = 100.0 * float(np.mean(error / later))
    others = (mape(by_nnls(first, earlier, second), later), mape(by_ridge(first, earlier, second), later))
    return *others, mape(told, later), stated, *within, 100.0 * float(fit.outside(second).mean())


def virtual_tables(count: int) -> list[Table]:
    """Over all virtual logs: first half to second, and another day."""
    ensemble = indoor_spectra(surfaces=4)
    rows, days = [], []
    for number in range(count):
        name = CELLS[number % len(CELLS)]
        (light, counts), (later_light, later) = virtual_log(ensemble, name, SEED + number)
        rows.append(halves(light, counts))
        fit = fit_cell(light, counts, WAVELENGTHS, np.ones(18))
        generator = np.random.default_rng(number)
        each = []
        for used in (0, 1, 5):
            chosen = generator.choice(READINGS // 4, used, replace=False)
            fresh = renewed(fit, later_light[chosen], later[chosen]) if used else fit
            told, error = fresh.counts(later_light[READINGS // 4 :])
            truth = later[READINGS // 4 :]
            each += [mape(told, truth), 100.0 * float(np.mean(np.abs(told - truth) <= 2.0 * error))]
        days.append(each)
    table = np.array(rows)
    jump = table[:, 6] > 5.0
    kept = [("all", table), ("light as before", table[~jump]), ("outside what was fitted", table[jump])]
    kept.append(
        (
            "offset below 0",
            np.array(
                [
                    halves(*virtual_log(ensemble, CELLS[number % len(CELLS)], SEED + 1000 + number, base=BELOW_ZERO)[0])
                    for number in range(count // 2)
                ]
            ),
        )
    )
    first = [
        (words, len(part), *np.median(part[:, :4], axis=0), *part[:, 4:6].mean(axis=0),
         100.0 * float(np.mean(part[:, 2] <= np.minimum(part[:, 0], part[:, 1]) + 0.1)))
        for words, part in kept if len(part)
    ]  # fmt: skip
    second = np.array(days)
    rows_of_days = [
        (used, np.median(second[:, 2 * i]), np.percentile(second[:, 2 * i], 90), second[:, 2 * i + 1].mean())
        for i, used in enumerate((0, 1, 5))
    ]
    headings = ["logs", "count", "NNLS [%]", "ridge [%]", "fit [%]", "stated [%]", "within one [%]", "within two [%]",
                "no worse than the better by .1 [%]"]  # fmt: skip
    return [
        _table("virtual-logs", "Virtual logs, first half to second: median MAPE.", first, headings),
        _table("another-day", "Another day, gain and offset renewed: MAPE over the logs.", rows_of_days,
               ["readings", "median [%]", "90th percentile [%]", "within two [%]"]),
    ]  # fmt: skip


def real_table(log: Path) -> Table:
    """A real log's cells, first half to second."""
    beside = beside_cell(LogChoice(path=log))
    rows = []
    for cell in range(beside.counts.shape[1]):
        counts = beside.counts[:, cell]
        good = np.isfinite(beside.light).all(axis=1) & (counts > 0)
        rows.append((cell + 1, int(good.sum()), *halves(beside.light[good], counts[good])))
    headings = ["cell", "readings", "NNLS [%]", "ridge [%]", "fit [%]", "stated [%]", "within one [%]",
                "within two [%]", "outside [%]"]  # fmt: skip
    return _table("real-log", f"{log.name}, first half to second: MAPE.", rows, headings)


def _table(name: str, caption: str, rows: Sequence[tuple[object, ...]], headings: list[str]) -> Table:
    frame = pd.DataFrame(rows, columns=headings)
    formats = {heading: ".2f" if heading.count("[%]") else ".0f" for heading in headings}
    formats |= dict.fromkeys(("within one [%]", "within two [%]", "outside [%]", headings[-1]), ".0f")
    return Table(name=name, caption=caption, frame=frame, formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--log", type=Path, help="a log with 18 channels and cells")
    parser.add_argument("--logs", type=int, default=60, help="virtual logs")
    arguments = parser.parse_args()
    tables = virtual_tables(arguments.logs)
    if arguments.log is not None:
        tables.append(real_table(arguments.log))
    for table in tables:
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
