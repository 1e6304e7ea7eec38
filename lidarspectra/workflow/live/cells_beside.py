"""Fitted cells beside the sensors of a run kept live: their counts and currents of now, in a file that grows."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

import numpy as np

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.arrivals import Arrival, Notice
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.io.files import writing
from lidarspectra.mapping.photovoltaics.cell_fit_files import SavedFit, load_fit

CELLS_FILE = "cells.csv"
REPLAY_FILE = "cells-replay.csv"
COLUMNS = ("unix_s", "sensor", "cell", "count", "SE_count", "current_A", "SE_current_A", "outside")


class CellsBeside:
    """Keeps the current of fitted cells, reading by reading.

    Parameters
    ----------
    cells : sequence of str
        FIT.json@SENSOR each.
    sensors : sequence of str
        Names of the run's sensors.
    folder : Path
        Where `CELLS_FILE` is kept, if there is a cell; it is made if absent, and the file is continued.
    is_recording : bool
        Whether readings come from a recording: their currents go to `REPLAY_FILE`, begun anew.

    Raises
    ------
    ReadingError
        If a fit cannot be read, is not one of irradiances, or names no sensor.
    """

    def __init__(
        self, cells: Sequence[str], sensors: Sequence[str], folder: Path, *, is_recording: bool = False
    ) -> None:
        self._path = folder / (REPLAY_FILE if is_recording else CELLS_FILE)
        self._is_recording = is_recording
        self._file: IO[str] | None = None
        self._fits: dict[str, list[SavedFit]] = {}
        self._reported: set[str] = set()
        for words in cells:
            name, _, sensor = words.rpartition("@")
            if sensor not in sensors or not name:
                raise ReadingError(
                    expected=f"FIT.json@SENSOR with one of the sensors {', '.join(sensors)}",
                    found=words,
                    where="--cell",
                )
            saved = load_fit(Path(name))
            if saved.signal != "irradiance":
                raise ReadingError(
                    expected="a fit of irradiances, as readings come here",
                    found=f"a fit of {saved.signal}",
                    where=name,
                    todo="Fit a log with gain and integration time, or give the sensor's --calibration.",
                )
            self._fits.setdefault(sensor, []).append(saved)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that have a cell beside them."""
        return tuple(self._fits)

    def notes(self) -> tuple[str, ...]:
        """What the currents do not know, as full sentences."""
        return tuple(
            f"The fit of '{saved.name}' knows {' and '.join(saved.fit.extras)}, which no reading brings here: its mean "
            "is taken, and the error does not cover that."
            for fits in self._fits.values()
            for saved in fits
            if saved.fit.extras
        )

    def take(self, arrival: Arrival, on_notice: Callable[[Notice], None]) -> None:
        """Keep the currents beside a reading that has all channels; one without them is told once a sensor."""
        fits = self._fits.get(arrival.sensor)
        if not fits:
            return
        missing = [label for label in CHANNEL_LABELS if label not in arrival.values]
        if missing:
            self._say_once(
                arrival.sensor,
                f"A reading has no channel {', '.join(missing)} nm: the fit of '{fits[0].name}' wants all "
                f"{len(CHANNEL_LABELS)}, and gives no current without them.",
                arrival.sensor,
                on_notice,
            )
            return
        light = np.array([[arrival.values[label] for label in CHANNEL_LABELS]])
        if not np.isfinite(light).all():
            return
        for saved in fits:
            counts, error = saved.fit.counts(light)
            count, spread, outside = float(counts[0]), float(error[0]), bool(saved.fit.outside(light)[0])
            ampere = ["", ""]
            if saved.circuit is not None:
                ampere = [f"{float(each):.6g}" for each in saved.circuit.currents(count, spread)]
            cells = [f"{arrival.unix_s:.3f}", arrival.sensor, saved.name, f"{count:.6g}", f"{spread:.6g}", *ampere]
            self._write([*cells, str(int(outside))])
            if outside:
                self._say_once(
                    f"{saved.name}@{arrival.sensor}",
                    f"The light lies outside what the fit of '{saved.name}' was made on: its current and error hold "
                    "less. Renew it with a few readings ('cells fit --renew').",
                    arrival.sensor,
                    on_notice,
                )

    def _say_once(self, about: str, text: str, sensor: str, on_notice: Callable[[Notice], None]) -> None:
        if about not in self._reported:
            self._reported.add(about)
            on_notice(Notice(source=sensor, text=text))

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def _write(self, cells: Sequence[str]) -> None:
        """Add a row; names may have commas."""
        with writing(self._path, error=ReadingError):
            if self._file is None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                before = b"" if self._is_recording or not self._path.exists() else self._path.read_bytes()[-1:]
                self._file = self._path.open("a" if before else "w", encoding="utf-8", newline="\n")
                if not before:
                    self._file.write(",".join(COLUMNS) + "\n")
                elif before != b"\n":  # what a power cut left of a row stays a broken row of its own
                    self._file.write("\n")
            csv.writer(self._file, lineterminator="\n").writerow(cells)
            self._file.flush()
