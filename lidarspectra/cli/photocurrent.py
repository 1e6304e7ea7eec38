"""`lidarspectra photocurrent RUN --cell NAME`, and `lidarspectra cells list | place | predict | fit | node`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from lidarspectra.cli import cell_fits
from lidarspectra.cli.sensor_options import (
    CalibrationOption,
    ColumnsOption,
    GainOption,
    IntegrationOption,
    SensorOption,
)
from lidarspectra.cli.terminal import console, print_note, say, shown

app = typer.Typer(
    no_args_is_help=True, help="Solar cells: list them, find the best place, predict from sensor readings."
)

RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)]
CellOption = Annotated[
    str,
    typer.Option("--cell", metavar="NAME|FILE", help="From 'cells list'; a CSV of λ and EQE; or a fit (.json)."),
]
AreaOption = Annotated[
    float | None, typer.Option("--area", metavar="CM2", min=1e-6, help="Area of the cell (cm²).", show_default=False)
]
ScaleOption = Annotated[
    float, typer.Option("--scale", metavar="FACTOR", min=0.0, help="Factor on the cell's response, from a calibration.")
]
LampKind = Literal["led", "fluorescent", "discharge", "incandescent", "daylight"]


def photocurrent(
    run: RunArgument,
    cell: CellOption,
    area: AreaOption = None,
    scale: ScaleOption = 1.0,
    hours: Annotated[
        str | None,
        typer.Option("--hours", metavar="8:30-17", help="Electric lamps are on at these hours, every day."),
    ] = None,
    schedule: Annotated[
        Path | None, typer.Option("--schedule", metavar="FILE.csv", help="lamp,from,to[,dim], one row per shift.")
    ] = None,
    volt: Annotated[
        float | None, typer.Option("--volt", metavar="V", min=1e-6, help="The cell is held at this voltage [V].")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: RUN/photocurrent-CELL.")] = None,
) -> None:
    """Map a solar cell's current and, with --hours or --schedule, its charge and energy per day."""
    from lidarspectra.mapping.photovoltaics.current_map import currents_table
    from lidarspectra.workflow.applications.cells_of_run import CurrentOrder, current_of_run, save_currents
    from lidarspectra.workflow.run_folder.assumed import notes_of_light

    if hours is not None and schedule is not None:
        raise typer.BadParameter("give --hours or --schedule, not both")
    order = CurrentOrder(
        cell=cell, area_cm2=area, scale=scale, hours=hours, schedule=schedule, volt=volt, base=Path.cwd()
    )
    currents, plan, found = current_of_run(run, order)
    for words in (*notes_of_light(run), *str(currents.attrs["notes"]).splitlines()):
        print_note(words)
    folder = save_currents(currents, plan, out or run / f"photocurrent-{found.name}")
    console.print(shown(currents_table(currents)))
    say(f"Points, table and maps: {folder}")


@app.command("list")
def list_command() -> None:
    """List the solar cells in the databases."""
    import pandas as pd

    from lidarspectra.mapping.figures.tables import Table
    from lidarspectra.mapping.photovoltaics.cells import list_cells

    rows = [
        (
            cell.name,
            cell.words,
            cell.provenance,
            "{:g}-{:g} nm".format(*cell.efficiency.range_nm),
            "relative" if cell.quantity == "relative" else f"{cell.efficiency.values.max():.2f}",
            "yes" if cell.circuit else "no",
        )
        for cell in list_cells()
    ]
    names = ["cell", "what it is", "provenance", "range", "highest EQE", "power known"]
    console.print(shown(Table(name="cells", caption="Solar cells", frame=pd.DataFrame(rows, columns=names))))


@app.command("place")
def place_command(
    run: RunArgument,
    cell: CellOption,
    size: Annotated[
        tuple[float, float], typer.Option("--size", metavar="CM CM", help="Width and height of the cell (cm).")
    ] = (6.0, 6.0),
    tilt: Annotated[
        list[float] | None, typer.Option("--tilt", metavar="DEG", min=0, max=180, help="0 faces up, 90 is upright.")
    ] = None,
    azimuth: Annotated[
        list[float] | None,
        typer.Option(
            "--azimuth", metavar="DEG", help="Direction it faces in plan, from x towards y. Default: eight directions."
        ),
    ] = None,
    wall: Annotated[
        list[float] | None,
        typer.Option("--wall", metavar="M", help="Try the walls too, at this height; repeat for several."),
    ] = None,
    scale: ScaleOption = 1.0,
    count: Annotated[int, typer.Option("--count", min=1, max=100, help="Number of places to list.")] = 5,
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Number of processes.")] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: RUN/cell-places.")] = None,
) -> None:
    """Find the best places for a cell of given size: the run's points in every tilt and azimuth, and the walls."""
    from lidarspectra.workflow.applications.cells_of_run import PlaceOrder, places_in_run, save_places

    order = PlaceOrder(
        cell=cell,
        size_cm=size,
        tilts_deg=tuple(tilt or (0.0, 45.0, 90.0)),
        azimuths_deg=tuple(azimuth or range(0, 360, 45)),
        wall_heights_m=tuple(wall or ()),
        scale=scale,
        count=count,
        workers=workers,
        base=Path.cwd(),
    )
    table, notes = places_in_run(run, order)
    for note in notes:
        print_note(note)
    console.print(shown(table))
    say(f"Table: {save_places(table, out or run / 'cell-places')}")


@app.command("predict")
def predict_command(
    measured: Annotated[
        Path,
        typer.Argument(metavar="FILE.csv", help="A table of 'sensor convert' or 'join'; any log, for a fit."),
    ],
    cell: CellOption,
    device: Annotated[str, typer.Option("--device", help="Channel set of the sensor.")] = "as7265x-14",
    lamps: Annotated[LampKind | None, typer.Option("--lamps", help="Kind of lamp, if known.")] = None,
    area: AreaOption = None,
    scale: ScaleOption = 1.0,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE.csv", help="Default: beside the readings.")] = None,
    calibration: CalibrationOption = None,
    columns: ColumnsOption = None,
    sensor: SensorOption = None,
    gain: GainOption = None,
    integration: IntegrationOption = None,
) -> None:
    """Predict a cell's current, with its uncertainty, from a spectral sensor's readings at the same place."""
    path = out or measured.with_name(f"{measured.stem}-current.csv")
    if Path(cell).suffix == ".json":
        from lidarspectra.workflow.applications.cell_fits import predict_by_fit

        choice = cell_fits.log_choice(measured, calibration, columns, sensor, gain, integration)
        table, notes = predict_by_fit(Path(cell), choice, path)
    else:
        from lidarspectra.workflow.applications.cells_of_run import predict_from_table

        table, notes = predict_from_table(
            measured, cell, device, lamp_kind=lamps, area_cm2=area, scale=scale, base=Path.cwd(), out=path
        )
    for note in notes:
        print_note(note)
    console.print(shown(table))
    say(f"Readings: {path}")


app.registered_commands += cell_fits.app.registered_commands
