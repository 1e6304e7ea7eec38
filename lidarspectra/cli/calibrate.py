"""`lidarspectra calibrate RUN --measured readings.csv`, or `--plan N`: a few readings make the map true."""

import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer

from lidarspectra.cli.options import WorkersOption
from lidarspectra.cli.progress import progress_bar
from lidarspectra.cli.terminal import console, print_note, say, shown
from lidarspectra.words import counted


def calibrate(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    measured: Annotated[
        Path | None,
        typer.Option("--measured", metavar="FILE.csv", help="x, y, z, nx, ny, nz, and lux, E_410 ... or current_mA."),
    ] = None,
    plan: Annotated[
        int | None, typer.Option("--plan", metavar="N", min=1, max=100, help="Where N readings tell most, instead.")
    ] = None,
    unit: Annotated[
        Literal["W/m2/nm", "uW/cm2", "counts"], typer.Option("--unit", help="Unit of channels.")
    ] = "W/m2/nm",
    scale: Annotated[
        Literal["none", "one", "die", "channel"],
        typer.Option("--scale", help="Factors of the meter that are not known: 'one' for a phone's lux app."),
    ] = "none",
    cell: Annotated[str | None, typer.Option("--cell", metavar="NAME", help="Whose current_mA was read.")] = None,
    area: Annotated[float | None, typer.Option("--area", metavar="CM2", min=0.0, help="Area of the cell.")] = None,
    despite_doubts: Annotated[
        bool, typer.Option("--despite-doubts", help="Go on with readings that contradict the room.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a calibrated run file.")] = False,
    workers: WorkersOption = None,
) -> None:
    """Fit lamp fluxes and reflectances to a few readings, and run the room again with them."""
    if (measured is None) == (plan is None):
        raise typer.BadParameter("give either --measured FILE.csv or --plan N")
    if plan is not None:
        from lidarspectra.workflow.calibration.plan import plan_readings, save_plan

        with progress_bar("where readings tell most") as progress:
            planned = plan_readings(run, plan, scale=scale, workers=workers, progress=progress)
        console.print(shown(planned.table))
        table, picture = save_plan(planned, run)
        say(f"To take along and fill in: {table}")
        say(f"On the plan: {picture}")
        return
    assert measured is not None
    from lidarspectra.workflow.calibration.calibrating import calibrate_run, save_calibration
    from lidarspectra.workflow.calibration.light import require_no_run_file_beside
    from lidarspectra.workflow.calibration.results import SUFFIX

    if not force:
        require_no_run_file_beside(run, SUFFIX)

    with progress_bar("tracing the readings' places") as progress:
        found = calibrate_run(
            run,
            measured,
            unit=unit,
            scale=scale,
            cell=cell,
            area_cm2=area,
            despite_doubts=despite_doubts,
            workers=workers,
            progress=progress,
        )
    for note in found.notes:
        print_note(note)
    for each in (found.readings, found.unknowns, found.spectra):
        if each is not None:
            console.print()
            console.print(shown(each))
    before, after = (100 * float(each.mean()) for each in (found.map_sd_before, found.map_sd_after))
    console.print()
    say(f"Deviation of the map, mean over its points: {before:.1f} % before, {after:.1f} % after the readings.")
    say(
        f"Chi-square {found.chi_square:.1f} of {counted(found.numbers, 'number')}; the model's own error at a place, "
        f"as the misfit tells it: {100 * found.local_sd:.1f} %."
    )
    run_file, tables = save_calibration(found, run, force=force)
    say(f"Tables: {tables}")
    say(f"Calibrated run file: {run_file}")
    say(f"Its maps and report: lidarspectra run {shlex.quote(str(run_file))}")
