"""`lidarspectra live RUN --source ...`: the light of now, on a page."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarspectra.cli.interruption import until_interrupted
from lidarspectra.cli.options import WorkersOption
from lidarspectra.cli.progress import progress_bar
from lidarspectra.cli.terminal import print_note, say
from lidarspectra.words import counted

if TYPE_CHECKING:
    from lidarspectra.hardware.incoming.arrivals import Notice
    from lidarspectra.mapping.present_light.now import PresentAnswer


def live(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    source: Annotated[
        list[str],
        typer.Option(
            "--source",
            metavar="SOURCE",
            help="A file of sensors (TOML); or NAME@POINT=PORT or NAME@POINT=LOG.csv for each sensor.",
            show_default=False,
        ),
    ],
    host: Annotated[
        str, typer.Option("--host", help="Address to serve the page at. Beyond this machine a token is asked for.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="0: any that is free.")] = 8765,
    replay: Annotated[
        bool, typer.Option("--replay", help="Go through logs from start to end, in place of waiting for readings.")
    ] = False,
    patience: Annotated[
        int, typer.Option("--patience", min=1, help="Answers in a row that do not fit before there is an alarm.")
    ] = 5,
    duration: Annotated[float | None, typer.Option("--duration", metavar="S", help="Stop after this time.")] = None,
    cell: Annotated[
        list[str] | None,
        typer.Option("--cell", metavar="FIT.json@SENSOR", help="A fitted cell beside a sensor: its current is kept."),
    ] = None,
    workers: WorkersOption = None,
) -> None:
    """Keep a run live: lamps, daylight and map of now from fixed sensors, on a page, until Ctrl-C."""
    from lidarspectra.workflow.live.live_run import LiveOptions, LiveRun

    options = LiveOptions(
        host=host, port=port, replay=replay, patience=patience, workers=workers, cells=tuple(cell or ())
    )
    with progress_bar("light at the sensors") as progress:
        alive = LiveRun(run, source, options, progress=progress)
    say(f"Page: {alive.server.address}")
    if not replay:
        say(f"Readings are kept in {alive.readings}")
    end = time.monotonic() + (duration if duration is not None else math.inf)
    alarms = _Alarms()
    with until_interrupted() as stopped:
        taken = alive.run(stop=lambda: stopped() or time.monotonic() >= end, on_notice=_tell, on_answer=alarms.take)
    say(f"{counted(taken, 'reading')} taken.")


def _tell(notice: "Notice") -> None:
    print_note(f"{notice.source}: {notice.text}")


class _Alarms:
    """Says each alarm once, and its end."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def take(self, answer: "PresentAnswer") -> None:
        """Look at an answer."""
        since_s = None if answer.alarm is None else answer.alarm.since_s
        if since_s == self._since_s:
            return
        self._since_s = since_s
        when = time.strftime("%H:%M:%S", time.localtime(answer.time_s))
        if answer.alarm is None:
            say(f"{when} The readings fit again.")
        else:
            say(f"{when} {' '.join(answer.alarm.sentences)}")
