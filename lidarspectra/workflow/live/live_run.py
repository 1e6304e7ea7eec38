"""A run kept live from its first reading to its page: what `lidarspectra live` does, and its core for Python."""

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import all_of, path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import load_scan
from lidarspectra.hardware.incoming.arrival_log import ArrivalLog
from lidarspectra.hardware.incoming.arrivals import Arrival, Notice, Stop
from lidarspectra.hardware.incoming.growing_log import GrowingLog
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.present_light.now import LitRoom, PresentAnswer, PresentLight
from lidarspectra.mapping.present_light.watch import PATIENCE
from lidarspectra.mapping.report.live_page import LiveView, trend_json
from lidarspectra.mapping.report.room_view import RoomSurfaces, room_view_data, shown_points
from lidarspectra.progress import Progress, silent
from lidarspectra.room.partitions import Partitions
from lidarspectra.room.room import load_room
from lidarspectra.workflow.live.board import Board
from lidarspectra.workflow.live.cells_beside import CellsBeside
from lidarspectra.workflow.live.room_of_run import lit_room
from lidarspectra.workflow.live.sensors_file import SensorsFile, read_sensors
from lidarspectra.workflow.live.server import LiveServer
from lidarspectra.workflow.live.session import LiveSession, replay
from lidarspectra.workflow.live.sources import sources_of
from lidarspectra.workflow.run_folder.calibration_of_run import materials_of_run
from lidarspectra.workflow.run_folder.light_of_run import present_lamps_of_run, scene_of_run, transport_of_run
from lidarspectra.workflow.run_folder.workspace import require_stage, writing_run

READINGS = "live"  # folder in the run
LOOK_S = 0.2  # [s] how often is looked whether to stop
SHOW_EVERY_S = 0.25  # [s] between messages of a recording, which is gone through faster than pages draw
TREND_EVERY_S = 10.0  # [s] between renewals of the trend that pages ask for


def present_light(
    run: str | PathLike[str],
    sources: Sequence[str],
    *,
    workers: int | None = None,
    progress: Progress = silent,
) -> PresentLight:
    """The light of now in a finished run, updated with the readings of its fixed sensors.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace; one that was calibrated knows its lamps better.
    sources : sequence of str
        A file of sensors, or NAME@POINT=SOURCE for each, as `lidarspectra live` takes them. Nothing is read from them:
        `take` takes readings from wherever they come.
    workers : int, optional
        Processes, where sensors stand at places that are traced first; one a core by default.
    progress : callable
        See `lidarspectra.progress`.

    Returns
    -------
    present : PresentLight
        `take` a reading, then `answer` for a moment.

    Raises
    ------
    WorkspaceError
        If the run has no finished trace.
    MapError, ReadingError
        If a sensor stands nowhere in the run, or a source cannot be understood.
    """
    sensors, _ = read_sensors(list(all_of(sources, str, name="sources", todo="Write ['desk@12=log.csv'].")))
    room = lit_room(path_of(run, name="run"), sensors, workers=workers, progress=progress)
    return PresentLight(room, max_age_s=sensors.max_age_s)


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """How to keep a run live.

    Parameters
    ----------
    host : str
        Address to serve the page at.
    port : int
        0 for any that is free.
    replay : bool
        Go through logs from their start to their end, in place of waiting for readings.
    patience : int
        Answers in a row that do not fit before there is an alarm.
    workers : int, optional
        Of the trace of sensors that stand at no point of the run.
    cells : tuple of str
        FIT.json@SENSOR each: a fitted cell beside a sensor; see `cells_beside`.
    """

    host: str = "127.0.0.1"
    port: int = 0
    replay: bool = False
    patience: int = PATIENCE
    workers: int | None = None
    cells: tuple[str, ...] = ()


class LiveRun:
    """A run with its sensors and its page.

    Parameters
    ----------
    run : Path
    sources : sequence of str
        See `sensors_file.read_sensors`.
    options : LiveOptions
    progress : callable
        Of a trace, where one is needed.

    Raises
    ------
    LidarSpectraError
        If the run is not finished, a source cannot be understood, or the address is taken.
    """

    def __init__(self, run: Path, sources: Sequence[str], options: LiveOptions, *, progress: Progress = silent) -> None:
        sensors, base = read_sensors(list(sources))
        self.readings = run / READINGS
        names = [sensor.name for sensor in sensors.sensors]
        self._cells = CellsBeside(options.cells, names, self.readings, is_recording=options.replay)
        if not options.replay:
            with writing_run(run):
                self.readings.mkdir(parents=True, exist_ok=True)
        self._labels = scene_of_run(run).bands.labels
        self._sources = sources_of(
            sensors,
            self._labels,
            base=base,
            logs=self.readings,
            run=run,
            replay=options.replay,
            beside_cells=self._cells.sensors,
        )
        room = lit_room(run, sensors, workers=options.workers, progress=progress)
        self.present = PresentLight(room, max_age_s=sensors.max_age_s, patience=options.patience)
        self._view = live_view(run, sensors, room, is_recording=options.replay)
        self._board = Board()
        self._trend = trend_json(self.present.trend, len(room.quantities))
        self._trend_due_s = 0.0
        self._options = options
        self._factors = {sensor.name: sensor.factor for sensor in sensors.sensors}
        page = self._view.page(_room_data(run))
        self.server = LiveServer(page, self._board, lambda: self._trend, host=options.host, port=options.port)

    def run(
        self,
        *,
        stop: Stop,
        on_notice: Callable[[Notice], None],
        on_answer: Callable[[PresentAnswer], None] = lambda answer: None,
    ) -> int:
        """Serve the page, and answer as readings come, until it is time to stop.

        Parameters
        ----------
        stop : callable
            Looked at five times a second. A recording's page stays until then, too.
        on_notice, on_answer : callable

        Returns
        -------
        readings : int
            That were taken.
        """
        for text in self._cells.notes():
            on_notice(Notice(source="cells", text=text))
        shown_s = -math.inf
        newest: PresentAnswer | None = None

        def show(answer: PresentAnswer) -> None:
            nonlocal shown_s, newest
            newest = answer
            if not self._options.replay or time.monotonic() - shown_s >= SHOW_EVERY_S:
                self._board.show(self._view.message(answer, self.present.last_s))
                shown_s = time.monotonic()
            if time.monotonic() >= self._trend_due_s:
                self._trend_due_s = time.monotonic() + TREND_EVERY_S
                self._trend = trend_json(self.present.trend, len(self.present.room.quantities))
            on_answer(answer)

        def beside(arrival: Arrival) -> None:
            self._cells.take(arrival, on_notice)

        thread = threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": LOOK_S}, daemon=True)
        thread.start()
        try:
            if not self._options.replay:
                session = LiveSession(
                    self.present,
                    self._sources,
                    log=ArrivalLog(self.readings, labels=self._labels),
                    factors=self._factors,
                    beside=beside,
                )
                session.run(stop=stop, on_answer=show, on_notice=on_notice)
                return session.readings
            logs = [source for source in self._sources if isinstance(source, GrowingLog)]
            readings = replay(
                self.present, logs, self._factors, stop=stop, on_answer=show, beside=beside, on_notice=on_notice
            )
            self._trend = trend_json(self.present.trend, len(self.present.room.quantities))
            if newest is not None:
                self._board.show(self._view.message(newest, self.present.last_s))
            while not stop():
                time.sleep(LOOK_S)
            return readings
        finally:
            self._cells.close()
            self._board.close()
            self.server.shutdown()
            self.server.server_close()
            thread.join(timeout=10.0)


def live_view(run: Path, sensors: SensorsFile, room: LitRoom, *, is_recording: bool) -> LiveView:
    """What the page of a run shows."""
    transport = transport_of_run(run)
    points = np.stack([transport[name].to_numpy() for name in ("x", "y", "z")], axis=1)
    places = [points[each.point - 1] if each.point is not None else each.position for each in sensors.sensors]
    return LiveView(
        title=run.resolve().stem,
        room=room,
        places=_places(places),
        shown=shown_points(transport.sizes["point"]),
        is_recording=is_recording,
    )


def _places(places: Sequence[object]) -> FloatArray:
    return np.array(places, dtype=np.float64).reshape(-1, 3)


def _room_data(run: Path) -> str:
    folder = require_stage(run, "scan")
    scan = load_scan(folder)
    _, materials = materials_of_run(run, scan)
    surfaces = RoomSurfaces(
        vertices=scan.vertices,
        faces=scan.faces,
        face_material=materials.face_material,
        face_color=scan.face_colors(),
    )
    light = load_map(require_stage(run, "map") / MAP_FILE)
    return room_view_data(
        light,
        surfaces,
        materials.materials,
        materials.areas(scan.areas),
        present_lamps_of_run(run),
        partitions=Partitions(scan, load_room(folder).ceiling_z),
    )
