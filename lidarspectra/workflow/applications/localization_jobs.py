"""Localization from files to files: what the commands of `lidarspectra localize` do."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import REPEATABILITY
from lidarspectra.hardware.sensor.recorder import RecordOptions
from lidarspectra.hardware.sensor.serial_link import SerialPort
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.mapping.localization.features import reference_of, require_same_sensors
from lidarspectra.mapping.localization.fingerprint_files import EMPTY_LABEL, read_empty_room, read_fingerprints
from lidarspectra.mapping.localization.frames import (
    Frame,
    Stop,
    frames_of_lines,
    frames_of_ports,
    replay_logs,
    replay_table,
)
from lidarspectra.mapping.localization.live import Fix, LiveLocator, LiveSettings
from lidarspectra.mapping.localization.location_errors import LocationErrors, error_table, place_table
from lidarspectra.mapping.localization.location_figures import (
    error_curves_figure,
    error_map_figure,
    gain_curve_figure,
)
from lidarspectra.mapping.localization.location_model import (
    Against,
    LocationModel,
    TrainingSettings,
    train_locator,
)
from lidarspectra.mapping.localization.location_model_files import load_locator, save_locator
from lidarspectra.mapping.localization.locators import METHODS
from lidarspectra.mapping.localization.people_scores import people_of, people_table
from lidarspectra.mapping.localization.places import places_of_table
from lidarspectra.mapping.localization.scoring import (
    NightScore,
    errors_of,
    score_across,
    score_within,
    times_in_order,
)
from lidarspectra.mapping.localization.sensor_places import (
    ChosenSensors,
    choose_to_locate,
    choose_to_rebuild,
    map_covariance,
    place_changes,
)
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.workflow.run_folder.light_of_run import plan_of_run, transport_of_run
from lidarspectra.workflow.run_folder.workspace import made_folder, require_writable

USUAL_SENSORS = 8  # that are chosen where no number is given, or all if there are fewer
RECORDING_SUFFIXES = (".csv", ".gz", ".txt", ".log", ".dat", ".nc")  # of what is no port
STRETCHES_NOTE = (
    "Each place was visited only once, so that the first half of a visit is tested against its second half. Since the "
    "person stood there all the while, this shows that the places are distinguishable, not how well they will be found "
    "on another day. Record every place at least twice for that."
)
NO_METRES_NOTE = (
    "The places have no coordinates, so that errors cannot be given in metres. Give their coordinates with --positions "
    "FILE."
)
NO_EMPTY_ROOM_NOTE = (
    "{files} tell no empty room, so that the median of each sensor over all places is what readings are compared with. "
    "That is as good where a person changes a reading at few of the places; else record readings with the label "
    f"'{EMPTY_LABEL}', with nobody there."
)
WITH_MEMORY, EACH_ALONE = "each reading with what those before it told", "each reading by itself"
TRACK_COLUMNS = ("time_s", "label", "probability", "x", "y", "spread_m", "sensors", "nobody", "two_people")


@dataclass(frozen=True, kw_only=True, eq=False)
class LocationReport:
    """Result of a test of a locator.

    Parameters
    ----------
    tables : tuple of Table
        The first is for the screen.
    notes : tuple of str
        Caveats on the numbers, as full sentences.
    folder : Path
        Where they and the figures were written.
    """

    tables: tuple[Table, ...]
    notes: tuple[str, ...]
    folder: Path


@dataclass(frozen=True, kw_only=True)
class MapDoubts:
    """Uncertainty of a simulated map, and noise of a sensor; see `sensor_places.map_covariance`.

    Parameters
    ----------
    lamp_spread, error : float
        Relative standard deviations. [1]
    length_m : float
        [m]
    noise : float
        Relative standard deviation of a sensor's reading. [1]
    """

    lamp_spread: float = 0.1
    error: float = 0.1
    length_m: float = 1.0
    noise: float = 0.02


def train_from_files(
    files: Sequence[Path],
    out: Path,
    *,
    positions: Path | None = None,
    settings: TrainingSettings | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> tuple[LocationModel, tuple[str, ...]]:
    """Train a locator on files of fingerprints, and keep it in a folder; see `train_locator` and `save_locator`.

    Returns
    -------
    model : LocationModel
    notes : tuple of str
        What the files lack.

    Raises
    ------
    MapError
        If the files cannot be read, or do not go together.
    """
    tables = [read_fingerprints(path, positions) for path in files]
    require_writable(out)
    model = train_locator(tables, settings, seed=seed, progress=progress)
    save_locator(model, out)
    notes = _notes_without_empty_room(files, tables)
    return model, notes if model.places.has_positions else (*notes, NO_METRES_NOTE)


def _notes_without_empty_room(files: Sequence[Path], tables: Sequence[xr.Dataset]) -> tuple[str, ...]:
    lacking = [path.name for path, table in zip(files, tables, strict=True) if "empty" not in table]
    return (NO_EMPTY_ROOM_NOTE.format(files=", ".join(lacking)),) if lacking else ()


def errors_from_files(
    folder: Path,
    files: Sequence[Path],
    out: Path,
    *,
    positions: Path | None = None,
    against: Against = "own",
    each_alone: bool = False,
    run: Path | None = None,
) -> LocationReport:
    """Test a trained locator on files of labelled readings.

    Parameters
    ----------
    folder : Path
        Of the model.
    files : sequence of Path
        Readings in the form of fingerprints.
    out : Path
        Folder for tables and figures.
    positions : Path, optional
        Where the readings' places are.
    against : 'own', 'running' or 'trained'
        See `LocationModel.features`.
    each_alone : bool
        Whether each reading is located by itself. Else it is with what those before it told, in files with times and,
        against the running reference, in all, which then have a reading a second.
    run : Path, optional
        A run of the room, whose walls and furniture are drawn on the map of errors.

    Returns
    -------
    report : LocationReport

    Raises
    ------
    MapError
        If files cannot be read, or do not go with the model.
    """
    model = load_locator(folder)
    readings = [read_fingerprints(path, positions) for path in files]
    times = [None if each_alone else times_in_order(each, is_recording=against == "running") for each in readings]
    parts = [errors_of(model, table, against=against, times_s=own) for table, own in zip(readings, times, strict=True)]
    errors: dict[str, LocationErrors] = {
        method: LocationErrors.joined([part[method] for part in parts]) for method in METHODS
    }
    caption = f"{', '.join(path.name for path in files)}: located by a model of {model.source}"
    counted = [
        people_of(model, table, against=against, times_s=own) for table, own in zip(readings, times, strict=True)
    ]
    true_people, probabilities = (np.concatenate(each) for each in zip(*counted, strict=True))
    found = f"{caption}, {_memory_in_words(times)}"
    tables = [error_table(errors, name="errors", caption=found), people_table(true_people, probabilities)]
    made_folder(out)
    known = [path.name for path in files if path.name in model.source.split(", ")]
    notes = _notes_without_empty_room(files, readings) if against == "own" else ()
    if known:
        notes = (
            *notes,
            f"The model was trained on {', '.join(known)}, so that this test says nothing on new readings. Test it on "
            "readings that it was not trained on.",
        )
    if errors["together"].has_distances:
        tables.append(place_table(errors["together"], name="places", caption="Errors by place"))
        save_figure(error_curves_figure({caption: errors}), out, "errors")
        plan = plan_of_run(run) if run is not None else None
        save_figure(error_map_figure(errors["together"], plan), out, "error-map")
    else:
        notes = (*notes, NO_METRES_NOTE)
    for table in tables:
        save_table(table, out)
    return LocationReport(tables=tuple(tables), notes=notes, folder=out)


def _memory_in_words(times: Sequence[FloatArray | None]) -> str:
    """How the readings of files are located, of which those with times are with memory."""
    remembered = [each is not None for each in times]
    if any(remembered) and not all(remembered):
        return f"{WITH_MEMORY} in files with times, else by itself"
    return WITH_MEMORY if all(remembered) else EACH_ALONE


def score_nights(
    files: Sequence[Path],
    out: Path,
    *,
    positions: Path | None = None,
    settings: TrainingSettings | None = None,
    each_alone: bool = False,
    progress: Progress = silent,
) -> LocationReport:
    """Score locators within each of some measured nights, and from every night to every other.

    Parameters
    ----------
    files : sequence of Path
        A night each, labelled, in order of time.
    out : Path
        Folder for the tables.
    positions, settings, progress
        As in `train_from_files`.
    each_alone : bool
        Whether each reading is located by itself, without what those before it told.

    Returns
    -------
    report : LocationReport
    """
    nights = [read_fingerprints(path, positions) for path in files]
    require_writable(out)
    jobs = len(nights) ** 2
    scores: list[NightScore] = []
    for number, night in enumerate(nights):
        share = part_of(progress, number / jobs, (number + 1) / jobs)
        scores.append(score_within(night, settings, each_alone=each_alone, progress=share))
    pairs = [(first, second) for first in nights for second in nights if first is not second]
    for number, (first, second) in enumerate(pairs, start=len(nights)):
        share = part_of(progress, number / jobs, (number + 1) / jobs)
        scores += score_across(first, second, settings, each_alone=each_alone, progress=share)
    rows = {f"{score.words}, {method}": score.errors[method] for score in scores for method in METHODS}
    caption = f"Localization on measured nights, {EACH_ALONE if each_alone else WITH_MEMORY}"
    table = error_table(rows, name="nights", caption=caption, heading="test")
    notes = [STRETCHES_NOTE] if any(score.kind == "stretches" for score in scores) else []
    if not all(errors.has_distances for errors in rows.values()):
        notes.append(NO_METRES_NOTE)
    save_table(table, made_folder(out))
    return LocationReport(tables=(table,), notes=tuple(notes), folder=out)


def live_frames(
    sources: Sequence[str],
    *,
    period_s: float,
    max_age_s: float,
    stop: Stop,
    baud: int | None = None,
    on_note: Callable[[str], None] = lambda note: None,
) -> Iterator[Frame]:
    """Frames from what the user named.

    Parameters
    ----------
    sources : sequence of str
        One FILE or PORT of wide lines; or SENSOR=LOG for each sensor, or SENSOR=PORT for each.
    period_s, max_age_s, stop, baud, on_note
        See `mapping.localization.frames`.

    Raises
    ------
    MapError
        If they do not go together.
    """
    named = dict(source.partition("=")[::2] for source in sources if "=" in source)
    if len(sources) == 1 and not named:
        path = Path(sources[0])
        if path.is_file():
            return replay_table(path, period_s=period_s)
        if path.suffix.lower() in RECORDING_SUFFIXES:
            raise MapError(expected="a recording", found="no file of that name", where=str(path))
        return frames_of_lines(SerialPort(sources[0]), baud=baud, stop=stop)
    if len(named) != len(sources):
        raise MapError(
            expected="one file or port of wide lines, or SENSOR=LOG or SENSOR=PORT once for each sensor",
            found=" ".join(sources)[:80],
            where="live localization",
        )
    are_files = {Path(place).is_file() for place in named.values()}
    if are_files == {True}:
        logs = {sensor: Path(place) for sensor, place in named.items()}
        return replay_logs(logs, period_s=period_s, max_age_s=max_age_s, on_note=on_note)
    if are_files == {False}:
        ports = {sensor: SerialPort(place) for sensor, place in named.items()}
        options = RecordOptions(baud=baud)
        return frames_of_ports(ports, period_s=period_s, max_age_s=max_age_s, stop=stop, options=options)
    raise MapError(expected="logs, or ports", found="both", where="live localization")


def follow(
    folder: Path, frames: Iterable[Frame], *, settings: LiveSettings, empty: Path | None = None
) -> Iterator[Fix]:
    """Locate frames by a model in a folder, with the empty room of a file as reference where one is given."""
    model = load_locator(folder)
    reference: FloatArray | None = None
    if empty is not None:
        reference = reference_of(require_same_sensors(read_empty_room(empty), model.space, where=str(empty)))
    locator = LiveLocator(model, settings, reference)
    for frame in frames:
        fix = locator.locate(frame)
        if fix is not None:
            yield fix


def track_row(fix: Fix) -> str:
    """A fix as a line of CSV, in the order of `TRACK_COLUMNS`."""
    buffer = io.StringIO()
    x, y = fix.position_m
    numbers = [f"{value:.3f}" if np.isfinite(value) else "" for value in (x, y, fix.spread_m)]
    csv.writer(buffer, lineterminator="\n").writerow(
        [
            f"{fix.time_s:.3f}",
            fix.label,
            f"{fix.probability:.4f}",
            *numbers,
            fix.sensors,
            f"{fix.people[0]:.4f}",
            f"{fix.people[2]:.4f}",
        ]
    )
    return buffer.getvalue()


def place_to_locate(file: Path, count: int | None, out: Path, *, positions: Path | None = None) -> LocationReport:
    """Choose sensors of a file of fingerprints to localize with, by default 8; see `sensor_places.choose_to_locate`."""
    table = read_fingerprints(file, positions)
    places = places_of_table(table)
    known = places.positions_m if places.has_positions else None
    wanted = min(USUAL_SENSORS, table.sizes["sensor"]) if count is None else count
    chosen = choose_to_locate(place_changes(table), wanted, positions_m=known)
    unit = "m" if known is not None else "1"
    return _placement_report(
        chosen,
        table["sensor"].to_numpy().astype(str).tolist(),
        _sensor_positions(table),
        out,
        label=f"error of choosing between two places [{unit}]",
    )


def place_to_rebuild(run: Path, count: int | None, out: Path, doubts: MapDoubts | None = None) -> LocationReport:
    """Choose points of a run, by default 8, that best predict its map; see `sensor_places.choose_to_rebuild`."""
    doubts = doubts or MapDoubts()
    transport = transport_of_run(run)
    free = np.flatnonzero(~transport["buried"].to_numpy().astype(np.bool_))
    light = (transport["coefficient"] * transport["flux"]).mean("band").transpose("lamp", "point").to_numpy()[:, free]
    positions = np.stack([transport[axis].to_numpy()[free] for axis in ("x", "y", "z")], axis=1)
    scale = light.sum(axis=0).mean()
    covariance = map_covariance(
        light / scale, positions, lamp_spread=doubts.lamp_spread, error=doubts.error, length_m=doubts.length_m
    )
    noise = np.hypot(doubts.noise, REPEATABILITY) * np.maximum(light.sum(axis=0) / scale, 1e-6)
    wanted = min(USUAL_SENSORS, free.size) if count is None else count
    chosen = choose_to_rebuild(covariance, wanted, noise=noise)
    names = [f"point {number}" for number in free + 1]  # as the report's room in 3D and `live` number them
    return _placement_report(chosen, names, positions, out, label="error of the map over its mean [1]")


def _placement_report(
    chosen: ChosenSensors, names: Sequence[str], positions: FloatArray | None, out: Path, *, label: str
) -> LocationReport:
    rows: dict[str, object] = {
        "sensors": np.arange(1, chosen.order.size + 1),
        "added": [names[index] for index in chosen.order],
    }
    if positions is not None:
        rows |= {f"{axis} [m]": positions[chosen.order, number] for number, axis in enumerate("xyz")}
    rows |= {label: chosen.loss[1:]}
    formats = {f"{axis} [m]": ".2f" for axis in "xyz"}
    table = Table(
        name="sensor-places",
        caption=f"Sensors in the order in which they were chosen; with none: {chosen.loss[0]:.3g}",
        frame=pd.DataFrame(rows),
        formats=formats,
    )
    save_table(table, made_folder(out))
    curve = {"chosen greedily": chosen.loss.tolist()}
    save_figure(gain_curve_figure(range(chosen.loss.size), curve, label), out, "sensor-places")
    return LocationReport(tables=(table,), notes=(), folder=out)


def _sensor_positions(table: xr.Dataset) -> FloatArray | None:
    return table["sensor_position_m"].to_numpy() if "sensor_position_m" in table.coords else None
