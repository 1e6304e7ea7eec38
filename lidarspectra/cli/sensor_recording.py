"""`lidarspectra sensor ports | check | record | emulate | firmware`."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from lidarspectra.cli.interruption import until_interrupted
from lidarspectra.cli.sensor_options import (
    BaudOption,
    GainOption,
    HeaderOption,
    IntegrationOption,
    PortArgument,
    wishes_given,
)
from lidarspectra.cli.terminal import console, print_note, say
from lidarspectra.io.files import writing
from lidarspectra.words import counted

if TYPE_CHECKING:
    from lidarspectra.hardware.sensor.reading_log import Entry
    from lidarspectra.hardware.virtual.emulator import Device

app = typer.Typer()


@app.command()
def ports() -> None:
    """List the serial ports of this computer."""
    from serial.tools.list_ports import comports

    found = sorted(comports())
    for port in found:
        say(f"{port.device:<20} {port.description}")
    if not found:
        say("No serial port was found. Plug the device in; on Linux, your user must be in the group 'dialout'.")


@app.command()
def check(
    port: PortArgument,
    baud: BaudOption = None,
    header: HeaderOption = None,
    gain: GainOption = None,
    integration: IntegrationOption = None,
) -> None:
    """Identify the device at a port, and take three readings."""
    import tempfile

    from lidarspectra.hardware.sensor.reading_log import LogWriter
    from lidarspectra.hardware.sensor.recorder import RecordOptions, record
    from lidarspectra.hardware.sensor.sensor_records import CellReading, Note, Reading
    from lidarspectra.hardware.sensor.serial_link import SerialPort

    heard: list[Entry] = []

    def enough() -> bool:
        seen = sum(isinstance(entry, Reading | CellReading) for entry in heard)
        return seen >= 3 or stopped()

    options = RecordOptions(wishes=wishes_given(1.0, header, gain, integration), baud=baud, duration_s=40.0)
    with (
        tempfile.TemporaryDirectory() as folder,
        until_interrupted() as stopped,
        LogWriter(Path(folder) / "check.csv") as log,
    ):
        summary = record(SerialPort(port), log, options=options, stop=enough, on_entry=heard.append)
    say(f"{port}: {summary.protocol}")
    for entry in heard:
        if isinstance(entry, Note):
            say(f"  {entry.text}")
    readings = [entry for entry in heard if isinstance(entry, Reading)]
    cells = [entry for entry in heard if isinstance(entry, CellReading)]
    if readings:
        _show_reading(readings[-1])
    if cells:
        say("cells: " + ", ".join(f"{count:g}" for count in cells[-1].counts) + " counts")
    for reason, count in summary.troubles.items():
        print_note(f"{count} times while reading: {reason}.")
    if not readings and not cells:
        from lidarspectra.errors import DeviceError

        raise DeviceError(
            expected="readings within 40 s",
            found="; ".join(f"{reason} {count} times" for reason, count in summary.troubles.items()) or "none",
            where=port,
            todo="The device is recognised but sends no whole reading: check cable and power.",
        )


def _show_reading(reading: "Entry") -> None:
    from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, CHANNEL_LABELS, FLAG_NAMES
    from lidarspectra.hardware.sensor.sensor_records import Reading

    assert isinstance(reading, Reading)  # the caller passes readings only
    table = Table("channel", "nm", "count", "module value", "", box=None, header_style="bold")
    for c, (letter, label) in enumerate(zip(ASCENDING_LETTERS, CHANNEL_LABELS, strict=True)):
        flags = ", ".join(word for bit, word in FLAG_NAMES.items() if reading.flags[c] & bit)
        values = (_number(reading.counts[c]), _number(reading.module_values[c]))
        table.add_row(letter, label, *values, flags)
    console.print(table)
    known = [f"{degrees:g}" for degrees in reading.temperatures_c if math.isfinite(degrees)]
    temperatures = f"{', '.join(known)} °C" if known else "unknown"
    say(
        f"gain {_number(reading.gain) or 'unknown'}, integration time {_with_unit(reading.integration_ms)},"
        f" temperatures {temperatures}"
    )


def _with_unit(milliseconds: float) -> str:
    return f"{milliseconds:g} ms" if math.isfinite(milliseconds) else "unknown"


def _number(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else ""


@app.command()
def record(
    port: PortArgument,
    out: Annotated[Path, typer.Option("--out", metavar="LOG.csv", help="The log.", show_default=False)],
    rate: Annotated[float, typer.Option(min=1e-4, max=20.0, help="Readings per second.")] = 1.0,
    gain: GainOption = None,
    integration: IntegrationOption = None,
    auto_gain: Annotated[
        bool, typer.Option("--auto-gain", help="Adapt gain and integration time to the light.")
    ] = False,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Stop after this time.")] = None,
    readings: Annotated[int | None, typer.Option(metavar="N", help="Stop after this many readings.")] = None,
    give_up: Annotated[float, typer.Option(metavar="S", help="Stop after this time without a reading.")] = 600.0,
    append: Annotated[bool, typer.Option("--append", help="Continue an existing log.")] = False,
    baud: BaudOption = None,
    header: HeaderOption = None,
    poses: Annotated[
        Path | None, typer.Option("--poses", help="Poses of the robot, joined when the recording ends; see 'join'.")
    ] = None,
) -> None:
    """Record until Ctrl-C. The log on disk is always complete, and states what is missing and why."""
    from lidarspectra.errors import DeviceError
    from lidarspectra.hardware.sensor.reading_log import LogWriter
    from lidarspectra.hardware.sensor.recorder import RecordOptions
    from lidarspectra.hardware.sensor.recorder import record as run_recorder
    from lidarspectra.hardware.sensor.serial_link import SerialPort

    options = RecordOptions(
        wishes=wishes_given(rate, header, gain, integration),
        baud=baud,
        duration_s=duration if duration is not None else math.inf,
        readings=readings,
        auto_gain=auto_gain,
        give_up_s=give_up,
    )
    with until_interrupted() as stopped, LogWriter(out, append=append) as log:
        summary = run_recorder(SerialPort(port), log, options=options, stop=stopped, on_entry=_show_entry)
    taken = counted(summary.readings, "reading") + (
        f", {summary.cell_readings} of cells" if summary.cell_readings else ""
    )
    say(
        f"{out}: {taken}, {counted(summary.gaps, 'gap')}, {counted(summary.lost, 'reading')} known to be lost "
        f"({summary.protocol})"
    )
    if summary.gave_up:
        raise DeviceError(
            expected=f"a reading within {give_up:g} s",
            found="none",
            where=port,
            todo="Earlier readings are in the log. Check the device, and continue with --append.",
        )
    if poses is not None:
        from lidarspectra.cli.sensor_logs import join

        join(out, poses, out.with_suffix(".placed.csv"))


@app.command()
def nodes(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE...",
            help="A file of sensors (TOML, as for 'live'); or NAME=PORT or NAME=LOG.csv for each sensor.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the recording.", show_default=False)],
    duration: Annotated[float | None, typer.Option(metavar="S", help="Stop after this time.")] = None,
) -> None:
    """Record many sensors, at ports or over MQTT, as one recording under one clock, until Ctrl-C.

    A folder that was recorded into is continued. At the end it says how each node and its clock did.
    """
    from lidarspectra.cli.terminal import shown
    from lidarspectra.workflow.live.recording import record_nodes

    end = time.monotonic() + (duration if duration is not None else math.inf)
    say(f"Recording into {out}")
    with until_interrupted() as stopped:
        table, notes = record_nodes(
            sources,
            out,
            stop=lambda: stopped() or time.monotonic() >= end,
            on_notice=lambda notice: print_note(f"{notice.source}: {notice.text}"),
        )
    console.print(shown(table))
    for note in notes:
        print_note(note)


def _show_entry(entry: "Entry") -> None:
    """Print a gap that ended, and what the automatic gain chose."""
    from lidarspectra.hardware.sensor.gaps import Gap
    from lidarspectra.hardware.sensor.recorder import AUTOMATIC_GAIN
    from lidarspectra.hardware.sensor.sensor_records import Note

    if isinstance(entry, Gap) and not entry.is_open:
        lasted = entry.until.monotonic_s - entry.since.monotonic_s
        say(f"{_clock_time(entry.until.unix_s)} gap of {lasted:.1f} s: {entry.detail}")
    if isinstance(entry, Note) and entry.text.startswith(AUTOMATIC_GAIN):
        say(f"{_clock_time(entry.moment.unix_s)} {entry.text}")


def _clock_time(unix_s: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(unix_s))


@app.command()
def emulate(
    kind: Annotated[str, typer.Argument(help="module (AT firmware), sketch (ours), cells, or sparkfun.")] = "sketch",
    terminal: Annotated[
        str | None,
        typer.Option(metavar="LINK", help="Open a pseudo-terminal with this link to it, instead of a socket."),
    ] = None,
    faults: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of the messages that get a fault.")] = 0.0,
    seed: int = 0,
    duration: Annotated[float | None, typer.Option(metavar="S")] = None,
) -> None:
    """Emulate a sensor, to try the commands without one. Prints the port to use, and runs until Ctrl-C."""
    from lidarspectra.hardware.virtual.emulator import AtModule, SketchBoard, SparkfunBoard
    from lidarspectra.hardware.virtual.emulator_ports import EmulatorServer
    from lidarspectra.hardware.virtual.faults import FaultPlan, FaultyWire

    makers: dict[str, Callable[[], Device]] = {
        "module": lambda: AtModule(seed=seed),
        "sketch": lambda: SketchBoard(seed=seed, shortest_ms=500),  # as our sketches on a real board
        "cells": lambda: SketchBoard(cells=lambda now_s: (110, 99, 8), spectrum=False, shortest_ms=200),
        "sparkfun": lambda: SparkfunBoard(seed=seed),
    }
    if kind not in makers:
        raise typer.BadParameter(f"'{kind}' is not one of {', '.join(makers)}")
    wire = FaultyWire(makers[kind](), FaultPlan(rate=faults, seed=seed) if faults else None)
    server = EmulatorServer(wire, terminal=terminal)
    end = time.monotonic() + (duration if duration is not None else math.inf)
    say(server.address)
    with until_interrupted() as stopped:
        server.serve(lambda: stopped() or time.monotonic() >= end)


@app.command()
def firmware(folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the sketches.")]) -> None:
    """Write the Arduino sketches to a folder, to be opened in the Arduino IDE."""
    from importlib import resources

    from lidarspectra.errors import DeviceError

    source = resources.files("lidarspectra.hardware").joinpath("firmware")
    with writing(folder, error=DeviceError):
        for part in source.iterdir():
            files = [part] if part.is_file() else list(part.iterdir())
            target = folder if part.is_file() else folder / part.name
            target.mkdir(parents=True, exist_ok=True)
            for file in files:
                (target / file.name).write_bytes(file.read_bytes())
    for sketch in sorted(folder.glob("*/*.ino")):
        say(str(sketch))
