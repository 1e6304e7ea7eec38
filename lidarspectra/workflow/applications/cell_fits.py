"""A cell fitted beside a sensor: from a log to a file, renewed, and used on other logs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LidarSpectraError, ReadingError
from lidarspectra.hardware.sensor.as7265x import SensorSettings
from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
from lidarspectra.hardware.sensor.calibration import Calibration
from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
from lidarspectra.hardware.sensor.photocell import CellCircuit
from lidarspectra.hardware.sensor.readings import best_signal
from lidarspectra.io.csv_text import csv_text
from lidarspectra.io.files import write_whole, writing
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.photovoltaics.cell_fit import EXTRAS, OUTSIDE_FACTOR, fit_cell, renewed
from lidarspectra.mapping.photovoltaics.cell_fit_files import FitSignal, SavedFit, load_fit, save_fit
from lidarspectra.mapping.photovoltaics.cells import Cell, find_cell
from lidarspectra.mapping.photovoltaics.fit_ahead import AheadOfTime, predict_ahead, require_readings, usable
from lidarspectra.mapping.photovoltaics.node_day import DAY_H, DAY_S, NodeDay, light_hours
from lidarspectra.words import were

SAID_OUTSIDE = 0.05  # [1] of the readings under light that was not fitted, above which it is said
SAID_OFFSET = 0.2  # [1] of the mean count, above which the fit's offset is said to be in the current
BY_DATA_SHEET = "data sheet"
BY_LOG = "that of the log's irradiances"
MAX_RELATIVE_ERROR = 0.5  # [1] of a current, above which the hours of light it takes are hardly known


@dataclass(frozen=True, kw_only=True)
class LogChoice:
    """Which part of a log, and how it is read.

    Parameters
    ----------
    path : Path
        Of any layout that `read_sensor_log` knows.
    sensor : str or None
        Which of several.
    columns : dict or None
        What the user calls columns.
    calibration : Calibration or None
        Of the sensor.
    settings : SensorSettings or None
        Gain and integration time of a log that does not state them.
    """

    path: Path
    sensor: str | None = None
    columns: dict[str, str] | None = None
    calibration: Calibration | None = None
    settings: SensorSettings | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class BesideCell:
    """What a log says beside a cell.

    Parameters
    ----------
    light : (reading, channel) float
        In the unit of `signal`.
    signal : 'irradiance' or 'module values'
    calibration : str
        Whose irradiances they are.
    counts : (reading, cell) float
        Of all cells; none where the log has none. [count]
    unix_s : (reading,) float
        [s]
    wavelengths_nm : (channel,) float
        [nm]
    extras : mapping of str to (reading,) float
        Cell temperature and angle, where given throughout.
    notes : tuple of str
        What was left out of the log.
    """

    light: FloatArray
    signal: FitSignal
    calibration: str
    counts: FloatArray
    unix_s: FloatArray
    wavelengths_nm: FloatArray
    extras: Mapping[str, FloatArray]
    notes: tuple[str, ...]


def beside_cell(choice: LogChoice, wanted: FitSignal | None = None) -> BesideCell:
    """Read a log beside a cell.

    Parameters
    ----------
    choice : LogChoice
    wanted : 'irradiance' or 'module values', optional
        Irradiances wherever the log has gain and time, or states them itself, by default.

    Raises
    ------
    ReadingError
        If it cannot be read, or does not have the wanted signal.
    """
    readings = readings_from_csv(choice.path, columns=choice.columns, sensor=choice.sensor, settings=choice.settings)
    stated = readings["irradiance"].to_numpy() if "irradiance" in readings else None
    has_settings = stated is not None or best_signal(readings) != "module values"
    signal = wanted or ("irradiance" if has_settings or choice.calibration is not None else "module values")
    said_by = BY_DATA_SHEET if choice.calibration is None else choice.calibration.label
    if signal == "module values":
        light = readings["module_value"].to_numpy()
    elif stated is not None and choice.calibration is None:
        light, said_by = stated, BY_LOG
    else:
        light = spectral_irradiance(readings, choice.calibration)["irradiance"].to_numpy()
    given = {name: readings[name].to_numpy() for name in EXTRAS if name in readings}
    return BesideCell(
        light=np.asarray(light, dtype=np.float64),
        signal=signal,
        calibration=said_by,
        counts=readings["adc"].to_numpy() if "adc" in readings else np.zeros((readings.sizes["reading"], 0)),
        unix_s=readings["unix_s"].to_numpy(),
        wavelengths_nm=np.asarray(readings["wavelength_nm"].to_numpy(), dtype=np.float64),
        extras={name: values for name, values in given.items() if np.isfinite(values).all()},
        notes=(*str(readings.attrs.get("notes", "")).splitlines(), *_gap_notes(given)),
    )


def _gap_notes(extras: Mapping[str, FloatArray]) -> tuple[str, ...]:
    """What is said of temperatures or angles that some readings lack."""
    gaps = {name: int((~np.isfinite(values)).sum()) for name, values in extras.items()}
    return tuple(
        f"The column {name} is not used: {were(number, 'reading', ('is', 'are'))} without a number in it."
        for name, number in gaps.items()
        if 0 < number < extras[name].size
    )


def _counts_of(beside: BesideCell, column: int, log: Path) -> FloatArray:
    if beside.counts.shape[1] < column:
        cells = beside.counts.shape[1]
        raise ReadingError(
            expected=f"a log with counts of cell {column}",
            found=f"{cells} cell{'s' if cells > 1 else ''}" if cells else "a log without cells",
            where=str(log),
            todo=f"Give --column 1 to {cells}."
            if cells
            else "Their columns are called cell_1, cell_2 ...; say it with --columns 'NAME=cell_1' where they are not.",
        )
    return np.asarray(beside.counts[:, column - 1], dtype=np.float64)


def ahead_in_log(log: Path | LogChoice, column: int, *, cell: Cell | None, share: float) -> AheadOfTime:
    """Fit a cell of a log on its earlier part (see `predict_ahead`).

    Parameters
    ----------
    log : Path or LogChoice
    column : int
        Which of the log's cells, from 1.
    cell : Cell or None
        Known curve; a flat one if None.
    share : float
        Of the readings that are the earlier part. [1]

    Raises
    ------
    ReadingError
        If the log has no such cell, or is too short.
    """
    choice = log if isinstance(log, LogChoice) else LogChoice(path=log)
    beside = beside_cell(choice)
    counts = _counts_of(beside, column, choice.path)
    known = _known_curve(cell, beside.wavelengths_nm)
    light, wavelengths, known = _lit(beside, known)
    try:
        return predict_ahead(light, counts, wavelengths, known, share=share, extras=beside.extras)
    except LidarSpectraError as error:
        raise _in_log(error, choice.path) from error


def _known_curve(cell: Cell | None, wavelengths_nm: FloatArray) -> FloatArray:
    if cell is None:
        return np.ones(wavelengths_nm.size)
    return cell.efficiency.at(wavelengths_nm, outside="zero")


def _lit(beside: BesideCell, known: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Light, wavelengths and known curve of the channels that the log has at all."""
    has = np.atleast_1d(np.isfinite(beside.light).any(axis=0))
    return beside.light[:, has], beside.wavelengths_nm[has], known[has]


def _in_log(error: LidarSpectraError, log: Path) -> ReadingError:
    return ReadingError(expected=error.expected, found=error.found, where=f"{log}, {error.where}", todo=error.todo)


def fit_log(
    log: LogChoice, column: int, *, cell: str | None, share: float, base: Path
) -> tuple[Table, Table, tuple[str, ...]]:
    """Fit a cell of a log: a table of how well the later part is predicted, the curve, and notes."""
    known = None if cell is None else find_cell(cell, base)
    result = ahead_in_log(log, column, cell=known, share=share)
    rows = [
        ("fitted on the earlier part", result.fitted_percent),
        (f"'{known.name}', scaled on it" if known else "flat a(λ), scaled on it", result.known_percent),
        ("mean of the earlier part, whatever the light", result.constant_percent),
    ]
    caption = (
        f"Cell {column}: fitted on {result.earlier} readings ({result.fit.estimator}), predicted for the "
        f"{result.later} after them. {result.within_percent:.0f} % of these lie within two of the stated standard "
        f"errors, {result.stated_percent:.1f} % on average. The fitted offset is {result.fit.offset:.1f} counts."
    )
    score = Table(
        name="cell-fit", caption=caption, frame=pd.DataFrame(rows, columns=["curve", "MAPE [%]"]),
        formats={"MAPE [%]": ".2f"},
    )  # fmt: skip
    response = result.fit.response
    curve = pd.DataFrame({"wavelength [nm]": response.wavelengths_nm, "a (relative)": response.absorption})
    words = (
        "Fitted a(λ) times the sensor's responsivity. Under one kind of lamp it is not identifiable: many curves fit "
        "equally well."
    )
    table = Table(name="cell-curve", caption=words, frame=curve, formats={"a (relative)": ".2f"})
    beside = beside_cell(log)
    notes = (
        *beside.notes,
        *_left_out_notes(beside, _counts_of(beside, column, log.path)),
        *_outside_notes(result.outside_percent / 100.0, "the later part"),
    )
    return score, table, notes


def _left_out_notes(beside: BesideCell, counts: FloatArray) -> tuple[str, ...]:
    """What is said of readings that are not fitted."""
    light, _, _ = _lit(beside, beside.wavelengths_nm)
    gaps = ~np.isfinite(light).all(axis=1) | ~np.isfinite(counts)
    dark = ~gaps & (counts <= 0)
    notes = []
    if gaps.any():
        notes.append(f"{were(int(gaps.sum()), 'reading')} left out: a channel or the count is missing or saturated.")
    if dark.any():
        notes.append(
            f"{were(int(dark.sum()), 'reading')} left out, with counts of 0 or less: the converter's end, below which "
            "light changes nothing."
        )
    return tuple(notes)


def save_fit_of_log(
    log: LogChoice, column: int, *, cell: str | None, circuit: CellCircuit | None, base: Path, out: Path
) -> SavedFit:
    """Fit a cell to all of a log, and write the fit.

    Raises
    ------
    ReadingError
        If the log has no such cell or too few readings, or the file cannot be written.
    """
    beside = beside_cell(log)
    counts = _counts_of(beside, column, log.path)
    known = None if cell is None else find_cell(cell, base)
    curve = _known_curve(known, beside.wavelengths_nm)
    if not np.isfinite(beside.light).any(axis=0).all():
        raise ReadingError(
            expected="readings of all 18 channels, so that any other log can be predicted",
            found="a channel without",
            where=str(log.path),
        )
    good = usable(beside.light, counts, beside.extras)
    extras = {name: values[good] for name, values in beside.extras.items()}
    try:
        require_readings(int(good.sum()))
        fit = fit_cell(beside.light[good], counts[good], beside.wavelengths_nm, curve, extras=extras)
    except LidarSpectraError as error:
        raise _in_log(error, log.path) from error
    name = known.name if known is not None else f"{out.stem}"
    saved = SavedFit(fit=fit, name=name, signal=beside.signal, calibration=beside.calibration, circuit=circuit)
    save_fit(saved, out)
    return saved


def renew_fit(
    path: Path, log: LogChoice, column: int, *, count: int | None, out: Path
) -> tuple[SavedFit, int, tuple[str, ...]]:
    """Renew a fit's gain and offset from the first readings of a log, and write it.

    Parameters
    ----------
    path : Path
        Of the fit.
    log : LogChoice
    column : int
        Which of the log's cells, from 1.
    count : int or None
        How many readings; all if None.
    out : Path

    Returns
    -------
    saved, used, notes : SavedFit, int, tuple of str

    Raises
    ------
    ReadingError
        If the log has no such cell, or no reading with counts.
    """
    saved = load_fit(path)
    beside = beside_cell(log, saved.signal)
    counts = _counts_of(beside, column, log.path)
    good = np.flatnonzero(usable(beside.light, counts, beside.extras))[:count]
    extras = {name: values[good] for name, values in beside.extras.items()}
    fresh = replace(saved, fit=renewed(saved.fit, beside.light[good], counts[good], extras=extras))
    save_fit(fresh, out)
    return fresh, good.size, (*beside.notes, *_left_out_notes(beside, counts))


def predict_by_fit(fit_file: Path, log: LogChoice, out: Path) -> tuple[Table, tuple[str, ...]]:
    """Predict a fitted cell's counts and, where its circuit is known, its current beside a log's readings.

    Raises
    ------
    ReadingError
        If fit or log cannot be read, do not go together, or the file cannot be written.
    """
    saved = load_fit(fit_file)
    beside = beside_cell(log, saved.signal)
    whole = np.isfinite(beside.light).all(axis=1)
    if not whole.any():
        raise ReadingError(expected="a reading with all channels", found="none", where=str(log.path))
    light = beside.light[whole]
    counts, error = saved.fit.counts(light, {name: values[whole] for name, values in beside.extras.items()})
    outside = saved.fit.outside(light)
    frame = pd.DataFrame({"unix_s": beside.unix_s[whole], "count": counts, "SE_count": error})
    if saved.circuit is not None:
        frame["current_A"], frame["SE_current_A"] = saved.circuit.currents(counts, error)
    frame["outside"] = outside.astype(np.int64)
    with writing(out, error=ReadingError):
        write_whole(out, csv_text(frame))
    rows = [
        (name, frame[name].mean(), frame[name].min(), frame[name].max(),
         100.0 * float((frame[f"SE_{name}"] / frame[name].abs()).mean()))
        for name in ("count", "current_A") if name in frame
    ]  # fmt: skip
    summary = pd.DataFrame(rows, columns=["quantity", "mean", "lowest", "highest", "uncertainty [%]"])
    caption = f"'{saved.name}' beside {len(frame)} readings, by its fit."
    notes = list(beside.notes)
    if not whole.all():
        notes.append(f"{int((~whole).sum())} readings are left out because a channel is missing or saturated.")
    missing = [name for name in saved.fit.extras if name not in beside.extras]
    if missing:
        notes.append(
            f"The fit knows {' and '.join(missing)}, which the log does not have throughout: its mean is taken, and "
            "the error does not cover that."
        )
    if saved.signal == "irradiance" and beside.calibration != saved.calibration:
        notes.append(
            f"The fit was made with the calibration '{saved.calibration}', these readings with '{beside.calibration}': "
            "renew gain and offset ('cells fit --renew'), unless they are the same."
        )
    notes += _outside_notes(float(outside.mean()), "the readings")
    notes += _offset_notes(saved, float(counts.mean()))
    table = Table(name="predicted-current", caption=caption, frame=summary, formats={"uncertainty [%]": ".1f"})
    return table, tuple(notes)


def _outside_notes(share: float, what: str) -> tuple[str, ...]:
    if share <= SAID_OUTSIDE:
        return ()
    return (
        f"{100.0 * share:.0f} % of {what} lie outside what was fitted (more than {OUTSIDE_FACTOR:g} times as far from "
        "its mean as any fitted reading): the light there differs in colour or level, and the stated error holds less. "
        "Fit a log that covers such light, or renew gain and offset with a few readings there ('cells fit --renew').",
    )


def _offset_notes(saved: SavedFit, mean_count: float) -> tuple[str, ...]:
    """What is said of a current that no channel explains."""
    if saved.circuit is None:
        return ()
    offset = saved.fit.offset + saved.fit.shift - saved.circuit.dark_count
    share = offset / max(abs(mean_count - saved.circuit.dark_count), 1.0)
    if abs(share) <= SAID_OFFSET:
        return ()
    return (
        f"{100.0 * share:.0f} % of the current is the fit's offset ({offset:.0f} counts), which no channel explains: "
        "the converter's zero, which is no current, or light that the sensor does not see. Cover the cell once, and "
        "fit again with that count as --dark.",
    )


@dataclass(frozen=True, kw_only=True)
class NodeCell:
    """The cell that feeds a sensor node.

    Parameters
    ----------
    file : Path or None
        Of currents, as `cells predict` writes them; their median stands for the hours of light.
    ampere : float or None
        In place of a file. [A]
    relative_error : float
        Standard uncertainty of `ampere`. [1]
    volt : float
        At which it is held. [V]
    efficiency, efficiency_error : float
        Of converter and store together. [1]
    lit_h : float
        Hours of light a day. [h]
    """

    file: Path | None
    ampere: float | None
    relative_error: float
    volt: float
    efficiency: float
    efficiency_error: float
    lit_h: float


def node_table(node: NodeDay, cell: NodeCell) -> tuple[Table, tuple[str, ...]]:
    """A node's day on a cell: what it needs, from which current, for how many hours of light; and notes.

    Raises
    ------
    ReadingError
        If the file holds no currents.
    """
    if cell.file is None:
        assert cell.ampere is not None  # one of the two is given
        rows = [("given", cell.ampere, cell.relative_error)]
    else:
        rows = _currents_in(cell.file)
    found = light_hours(
        node,
        np.array([ampere for _, ampere, _ in rows]),
        np.array([error for _, _, error in rows]),
        cell_volt=cell.volt,
        efficiency=cell.efficiency,
        efficiency_error=cell.efficiency_error,
        lit_h=cell.lit_h,
    )
    frame = pd.DataFrame(
        {
            "current": [words for words, _, _ in rows],
            "current [µA]": [1e6 * ampere for _, ampere, _ in rows],
            "hours of light": found.hours,
            "from [h]": found.low,
            "to [h]": found.high,
            f"{cell.lit_h:g} h suffice [%]": 100.0 * found.suffices,
        }
    )
    caption = (
        f"A node of {node.charge_coulomb:.2f} C ({node.energy_joule:.2f} J) a day, {DAY_S / node.period_s:.0f} "
        "readings: hours of light that it needs. Nine of ten lie between 'from' and 'to'."
    )
    formats = dict.fromkeys(("current [µA]", "hours of light", "from [h]", "to [h]"), ".1f")
    formats[str(frame.columns[-1])] = ".0f"
    notes: tuple[str, ...] = ()
    if (worst := max(error for _, _, error in rows)) > MAX_RELATIVE_ERROR:
        notes = (
            f"A current's stated uncertainty is {100.0 * worst:.0f} %: these hours say little. Fit the cell where it "
            "is lit as there, or renew its fit with a few readings there ('cells fit --renew').",
        )
    if float(np.min(found.hours)) > DAY_H:
        notes = (
            *notes,
            "The cell cannot feed the node on any day: its day needs more than 24 hours of light. Wake it more seldom, "
            "or take a larger cell or a brighter place.",
        )
    return Table(name="node-day", caption=caption, frame=frame, formats=formats), notes


def _currents_in(path: Path) -> list[tuple[str, float, float]]:
    """The median current of a file and its quarters, each with its relative uncertainty."""
    try:
        table = pd.read_csv(path)
        current = pd.to_numeric(table["current_A"]).to_numpy(np.float64)
        error = pd.to_numeric(table["SE_current_A"]).to_numpy(np.float64)
    except (OSError, ValueError, KeyError) as cause:
        raise ReadingError(
            expected="columns current_A and SE_current_A, as 'cells predict' writes them where the area is known",
            found=str(cause),
            where=str(path),
        ) from cause
    lit = np.isfinite(current) & (current > 0)
    if not lit.any():
        raise ReadingError(expected="a current above 0", found="none", where=str(path))
    share = float(np.median(error[lit] / current[lit]))
    levels = (("darker quarter", 25.0), ("median", 50.0), ("brighter quarter", 75.0))
    return [(words, float(np.percentile(current[lit], percent)), share) for words, percent in levels]
