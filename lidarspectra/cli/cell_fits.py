"""`lidarspectra cells fit | node`: a cell fitted beside a sensor, and what a sensor node can do on a cell."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarspectra.cli.sensor_options import (
    CalibrationOption,
    ColumnsOption,
    GainOption,
    IntegrationOption,
    SensorOption,
)
from lidarspectra.cli.terminal import console, print_note, say, shown
from lidarspectra.words import counted

if TYPE_CHECKING:
    from lidarspectra.hardware.sensor.photocell import CellCircuit
    from lidarspectra.workflow.applications.cell_fits import LogChoice

app = typer.Typer()


@app.command("fit")
def fit_command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log with sensor channels and cell counts.")],
    column: Annotated[int, typer.Option("--column", min=1, help="Number of the cell in the log: 1, 2, ...")],
    cell: Annotated[
        str | None,
        typer.Option(
            "--cell", metavar="NAME|FILE", help="A known response, as the prior of the fit and to compare with."
        ),
    ] = None,
    share: Annotated[
        float, typer.Option("--train", min=0.05, max=0.95, help="Share of the log, from its start, to fit on.")
    ] = 0.5,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FIT.json", help="Write a fit on the whole log.", show_default=False)
    ] = None,
    renew: Annotated[
        Path | None,
        typer.Option("--renew", metavar="FIT.json", help="Renew its gain and offset by the log.", show_default=False),
    ] = None,
    count: Annotated[int | None, typer.Option("--count", min=1, help="Readings to renew with. Default: all.")] = None,
    reference: Annotated[float | None, typer.Option(help="Reference voltage of the A/D converter (V).")] = None,
    shunt: Annotated[float | None, typer.Option(help="Resistor across the cell (ohm).")] = None,
    area: Annotated[float, typer.Option(help="Area of the cell (cm²).")] = 36.0,
    amplification: Annotated[float, typer.Option(help="Of an amplifier before the converter.")] = 1.0,
    bits: int = 10,
    dark: Annotated[float, typer.Option(help="Count with the cell covered.")] = 0.0,
    calibration: CalibrationOption = None,
    columns: ColumnsOption = None,
    sensor: SensorOption = None,
    gain: GainOption = None,
    integration: IntegrationOption = None,
) -> None:
    """Fit a cell's counts to the sensor's channels beside it; test on the log's later part, write, renew."""
    from lidarspectra.workflow.applications.cell_fits import fit_log, renew_fit, save_fit_of_log

    choice = log_choice(log, calibration, columns, sensor, gain, integration)
    circuit = _circuit(reference, shunt, area, amplification, bits, dark)
    if circuit is not None and (renew is not None or out is None):
        raise typer.BadParameter("--reference and --shunt are written into a new fit: they go with --out, not --renew")
    if count is not None and renew is None:
        raise typer.BadParameter("--count goes with --renew")
    if renew is not None:
        target = out or renew
        saved, used, notes = renew_fit(renew, choice, column, count=count, out=target)
        say(
            f"Renewed with {counted(used, 'reading')}: gain {saved.fit.gain:.3f}, offset {saved.fit.shift:+.1f} counts."
        )
        for note in notes:
            print_note(note)
        say(f"Fit: {target}")
        return
    table, curve, notes = fit_log(choice, column, cell=cell, share=share, base=Path.cwd())
    console.print(shown(table))
    console.print(shown(curve))
    for note in notes:
        print_note(note)
    if out is None:
        return
    saved = save_fit_of_log(choice, column, cell=cell, circuit=circuit, base=Path.cwd(), out=out)
    if saved.circuit is None:
        print_note("The fit predicts counts: give --reference and --shunt to have currents.")
    say(f"Fit on {counted(saved.fit.readings, 'reading')} of {saved.signal}: {out}")


def log_choice(
    log: Path,
    calibration: str | None,
    columns: str | None,
    sensor: str | None,
    gain: float | None,
    integration: float | None,
) -> "LogChoice":
    """How a log is to be read."""
    from lidarspectra.cli.sensor_options import calibration_named, columns_given, settings_given
    from lidarspectra.workflow.applications.cell_fits import LogChoice

    return LogChoice(
        path=log,
        sensor=sensor,
        columns=columns_given(columns),
        calibration=calibration_named(calibration),
        settings=settings_given(gain, integration),
    )


def _circuit(
    reference: float | None, shunt: float | None, area: float, amplification: float, bits: int, dark: float
) -> "CellCircuit | None":
    from lidarspectra.hardware.sensor.photocell import CellCircuit

    if reference is None and shunt is None:
        return None
    if reference is None or shunt is None:
        raise typer.BadParameter("--reference and --shunt go together")
    return CellCircuit(
        reference_volt=reference, shunt_ohm=shunt, area_cm2=area, amplification=amplification, bits=bits,
        dark_count=dark,
    )  # fmt: skip


@app.command("node")
def node_command(
    currents: Annotated[
        Path | None,
        typer.Argument(metavar="[CURRENTS.csv]", help="As 'cells predict' writes it.", show_default=False),
    ] = None,
    current: Annotated[float | None, typer.Option("--current", metavar="µA", help="In place of a file.")] = None,
    error: Annotated[float, typer.Option("--error", metavar="PERCENT", help="Its standard uncertainty.")] = 10.0,
    volt: Annotated[float, typer.Option("--volt", metavar="V", help="At which the cell is held.")] = 1.0,
    sleep: Annotated[float, typer.Option("--sleep", metavar="µA", help="The node asleep.")] = 2.0,
    wake: Annotated[tuple[float, float], typer.Option("--wake", metavar="mA ms", help="To measure.")] = (5.0, 400.0),
    send: Annotated[tuple[float, float], typer.Option("--send", metavar="mA ms", help="To send.")] = (12.0, 20.0),
    every: Annotated[float, typer.Option("--every", metavar="S", help="Time between readings.")] = 60.0,
    node_volt: Annotated[float, typer.Option("--node-volt", metavar="V", help="Of the node.")] = 3.0,
    node_error: Annotated[float, typer.Option("--node-error", metavar="PERCENT", help="Of its charge.")] = 10.0,
    efficiency: Annotated[
        tuple[float, float], typer.Option("--efficiency", metavar="PERCENT PERCENT", help="Converter and store, and ±.")
    ] = (70.0, 7.0),
    lit: Annotated[float, typer.Option("--lit", metavar="H", min=0.0, max=24.0, help="Hours of light a day.")] = 9.0,
) -> None:
    """Hours of light a day that a sensor node on a cell needs to sleep, wake and send, with their uncertainty."""
    from lidarspectra.mapping.photovoltaics.node_day import NodeDay
    from lidarspectra.workflow.applications.cell_fits import NodeCell, node_table

    if (currents is None) == (current is None):
        raise typer.BadParameter("give a file of currents, or --current")
    node = NodeDay(
        sleep_ampere=1e-6 * sleep,
        wake_ampere=1e-3 * wake[0],
        wake_s=1e-3 * wake[1],
        send_ampere=1e-3 * send[0],
        send_s=1e-3 * send[1],
        period_s=every,
        volt=node_volt,
        relative_error=node_error / 100.0,
    )
    cell = NodeCell(
        file=currents,
        ampere=None if current is None else 1e-6 * current,
        relative_error=error / 100.0,
        volt=volt,
        efficiency=efficiency[0] / 100.0,
        efficiency_error=efficiency[1] / 100.0,
        lit_h=lit,
    )
    table, notes = node_table(node, cell)
    console.print(shown(table))
    for note in notes:
        print_note(note)
