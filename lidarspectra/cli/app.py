"""The command line: one command per stage, and run, demo, init, relight, databases, doctor.

Exit status: 0 done; 1 an error, in one paragraph; 2 a command that was not understood. Libraries that
take long to load are imported inside the commands, so that `--help` answers at once.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text
from typer.core import TyperGroup

from lidarspectra.cli import annual as annual_cli
from lidarspectra.cli import calibrate as calibrate_cli
from lidarspectra.cli import databases as databases_cli
from lidarspectra.cli import design as design_cli
from lidarspectra.cli import export as export_cli
from lidarspectra.cli import fingerprints as fingerprints_cli
from lidarspectra.cli import live as live_cli
from lidarspectra.cli import localize as localize_cli
from lidarspectra.cli import photocurrent as photocurrent_cli
from lidarspectra.cli import photometry as photometry_cli
from lidarspectra.cli import picture as picture_cli
from lidarspectra.cli import relight as relight_cli
from lidarspectra.cli import rules as rules_cli
from lidarspectra.cli import sensor as sensor_cli
from lidarspectra.cli.interruption import end_when_interrupted
from lidarspectra.cli.last_resort import bug_report
from lidarspectra.cli.options import ClusterOption, OutOption, RunFileArgument, WorkersOption
from lidarspectra.cli.terminal import console, messages, print_error, print_note, say, shown
from lidarspectra.errors import LidarSpectraError
from lidarspectra.garbage import collect_rarely
from lidarspectra.progress import remaining_words
from lidarspectra.threads import start_with_one_thread
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName

if TYPE_CHECKING:
    from lidarspectra.progress import Progress as Report
    from lidarspectra.workflow.pipeline import RunSummary
    from lidarspectra.workflow.run_folder.workspace import StageResult


class _Commands(TyperGroup):
    """The commands. Typer prints nothing when one is interrupted; this says what was kept."""

    def invoke(self, ctx: Any) -> Any:  # the type of its context differs between versions of typer
        """Run the command that was asked for."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as cause:
            runs = ctx.invoked_subcommand in ("run", "demo", "fingerprints", "annual", *STAGES)
            kept = "Finished stages are kept. Give the same command again to continue after them." if runs else ""
            messages.print(Text.assemble(("Interrupted. ", "bold red"), kept))
            raise typer.Exit(1) from cause


app = typer.Typer(
    cls=_Commands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Map the light spectrum in a room from a phone's LiDAR scan, with Radiance.",
)
app.add_typer(databases_cli.app, name="databases")
app.add_typer(sensor_cli.app, name="sensor")
app.command("calibrate")(calibrate_cli.calibrate)
app.command("design")(design_cli.design)
app.command("live")(live_cli.live)
app.command("relight", context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(relight_cli.relight)
app.command("picture", context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(picture_cli.picture)
app.command("rules")(rules_cli.rules)
app.command("photometry")(photometry_cli.photometry)
app.command("photocurrent")(photocurrent_cli.photocurrent)
app.add_typer(photocurrent_cli.app, name="cells")
app.command("export")(export_cli.export)
app.command("annual")(annual_cli.annual)
app.command("fingerprints")(fingerprints_cli.fingerprints)
app.add_typer(localize_cli.app, name="localize")


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        console.print(f"lidarspectra {version('lidarspectra')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Read the options that belong to no command."""


def main() -> None:
    """Run the command line; the entry point of `lidarspectra`."""
    start_with_one_thread()
    collect_rarely()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a Windows console may be in a code page without '²' or '∫'
            stream.reconfigure(errors="replace")
    end_when_interrupted()
    try:
        app()
    except LidarSpectraError as error:
        print_error(error)
        sys.exit(1)
    except Exception as error:  # noqa: BLE001 - the last resort: a user is never left with a traceback
        messages.print(Text.assemble(("Error: ", "bold red"), bug_report(error)))
        sys.exit(1)


class _ConsoleListener:
    """Draws a bar for the current stage, and a line for each finished one."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("", total=1.0, words="")

    def start(self, stage: StageName) -> "Report":
        """Begin a bar."""
        self._bar.reset(self._task, total=1.0, description=f"{STAGES.index(stage) + 1} {stage}", words="")

        begun = time.monotonic()

        def report(fraction: float, message: str) -> None:
            left = remaining_words(time.monotonic() - begun, fraction)
            self._bar.update(self._task, completed=fraction, words=f"{message}; {left}" if left else message)

        return report

    def finish(self, result: "StageResult[Any]") -> None:
        """Write the stage's line and its warnings."""
        record = result.record
        number = STAGES.index(record.stage) + 1
        took = "kept" if result.was_fresh else f"{record.seconds:.1f} s"
        self._bar.console.print(Text(f"{number} {record.stage:<10} {took:>8}   {record.summary}"))
        for warning in record.warnings:
            self._bar.console.print(Text.assemble("    ", ("note: ", "yellow"), warning))

    def note(self, words: str) -> None:
        """Write a sentence that belongs to no stage."""
        self._bar.console.print(Text.assemble(("note: ", "yellow"), words))


def _run(
    run_file: Path,
    out: Path | None,
    *,
    first: StageName | None = None,
    last: StageName = "report",
    workers: int | None = None,
    cluster: str | None = None,
    lines: bool = False,
) -> "RunSummary":
    from lidarspectra.config import read_run_file

    read_run_file(run_file)  # report a mistake in it before the libraries load, which takes seconds
    from lidarspectra.workflow.pipeline import run

    if lines:
        from lidarspectra.workflow.progress_printer import ProgressPrinter

        return run(run_file, out, first=first, last=last, workers=workers, cluster=cluster, listener=ProgressPrinter())
    columns = (
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[words]}"),
        TimeElapsedColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        return run(
            run_file,
            out,
            first=first,
            last=last,
            workers=workers,
            cluster=cluster,
            listener=_ConsoleListener(bar),
        )


def _stage_name(text: str) -> StageName:
    for stage in STAGES:
        if text == stage:
            return stage
    raise typer.BadParameter(f"'{text}' is not a stage; the stages are {', '.join(STAGES)}")


@app.command("run")
def run_command(
    run_file: RunFileArgument,
    out: OutOption = None,
    start: Annotated[
        StageName | None, typer.Option("--from", metavar="STAGE", help="Run this stage and all after it again.")
    ] = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check, print which stages would run, and run none: as 'check' does.")
    ] = False,
    lines: Annotated[
        bool,
        typer.Option(
            "--lines",
            help="Progress as lines on standard error ('42 %  trace: ...'), for programs that start this one.",
        ),
    ] = False,
) -> None:
    """Make maps and a report from a run file, by all stages that are not up to date."""
    if dry_run:
        _check(run_file, out, first=start, workers=workers, cluster=cluster)
        return
    _show_summary(_run(run_file, out, first=start, workers=workers, cluster=cluster, lines=lines))


@app.command("check")
def check_command(run_file: RunFileArgument, out: OutOption = None) -> None:
    """Check a run file and all that it names, and make nothing; status 1 if the run could not be made."""
    _check(run_file, out)


def _check(
    run_file: Path,
    out: Path | None,
    *,
    first: StageName | None = None,
    workers: int | None = None,
    cluster: str | None = None,
) -> None:
    from lidarspectra.config import read_run_file

    read_run_file(run_file)  # report a mistake in it before the libraries load, which takes seconds
    from lidarspectra.workflow.check import check

    found = check(run_file, out, first=first, workers=workers, cluster=cluster)
    for line in found.lines():
        say(line)
    for note in found.notes:
        print_note(note)
    for fault in found.faults:
        print_error(fault)
    if not found.good:
        count = "1 fault" if len(found.faults) == 1 else f"{len(found.faults)} faults"
        say(f"{count}: nothing was made. Correct {found.file}, and check it again.")
        raise typer.Exit(1)


def _show_summary(summary: "RunSummary") -> None:
    table = Table(title="Stages", title_justify="left", box=None, pad_edge=False, header_style="bold")
    table.add_column("stage")
    table.add_column("time", justify="right")
    table.add_column("memory", justify="right")
    for record in summary.records:  # each stage's result was printed when it ended
        table.add_row(record.stage, f"{record.seconds:.1f} s", f"{record.peak_memory_mib:.0f} MiB")
    seconds = sum(record.seconds for record in summary.records)
    memory = max(record.peak_memory_mib for record in summary.records)
    table.add_row("total", f"{seconds:.1f} s", f"{memory:.0f} MiB", style="bold")
    console.print()
    console.print(table)
    if "map" in summary.results:
        console.print()
        from lidarspectra.mapping.maps.assumptions import assumptions_of
        from lidarspectra.mapping.report.report_tables import bands_table
        from lidarspectra.workflow.run_folder.assumed import result_notes

        console.print(shown(bands_table(summary.map)))
        for note in result_notes(assumptions_of(summary.map)):
            print_note(note)
    if summary.report is not None:
        console.print()
        console.print(Text.assemble("Report: ", (str(summary.report), "bold")), soft_wrap=True)


def _add_stage_command(stage: StageName, text: str) -> None:
    def here(run_file: RunFileArgument, out: OutOption = None, workers: WorkersOption = None) -> None:
        _run(run_file, out, last=stage, workers=workers)

    def here_or_there(
        run_file: RunFileArgument, out: OutOption = None, workers: WorkersOption = None, cluster: ClusterOption = None
    ) -> None:
        _run(run_file, out, last=stage, workers=workers, cluster=cluster)

    # A Dask cluster traces: it has nothing to do before.
    command: Callable[..., None] = here_or_there if STAGES.index(stage) >= STAGES.index("trace") else here
    command.__doc__ = text
    app.command(stage, rich_help_panel="One stage (and those before it that are not up to date)")(command)


for _stage, _text in (
    ("scan", "1: read the scan, repair it, and find floor, walls and ceiling."),
    ("views", "2: choose camera views until they cover the scan's surfaces (the paper's Algorithm 1)."),
    ("materials", "3: estimate a reflectance spectrum for every surface."),
    ("scene", "4: write the room as a Radiance model."),
    ("trace", "5: trace each lamp's light to the sensor points."),
    ("map", "6: make the spectral map."),
    ("report", "7: make figures, tables and the report page."),
):
    _add_stage_command(_stage_name(_stage), _text)


@app.command()
def demo(
    folder: Annotated[Path, typer.Argument(metavar="[DIR]", help="Folder for the demo room and its run.")] = Path(
        "lidarspectra-demo"
    ),
) -> None:
    """Run the whole chain on a room that comes with the package: 3 m x 3 m, two panels, 176 points."""
    from lidarspectra.workflow.run_folder.inputs import copy_scene

    _show_summary(_run(copy_scene("office", folder), None))


@app.command()
def init(
    scan: Annotated[
        Path,
        typer.Argument(
            metavar="SCAN", help="GLB, glTF, OBJ, PLY, STL or USDZ; or a folder of frames.", show_default=False
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="ROOM.toml", help="The run file. Default: SCAN's name with .toml.")
    ] = None,
    unit: Annotated[
        Literal["auto", "m", "cm", "mm", "in", "ft"],
        typer.Option("--unit", help="Unit of the scan's coordinates; 'auto' detects it."),
    ] = "auto",
    up: Annotated[
        Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"],
        typer.Option("--up", help="The scan's upward axis; 'auto' detects it."),
    ] = "auto",
    as_it_leans: Annotated[
        bool, typer.Option("--as-it-leans", help="Keep the file's coordinates: a scan that leans is not set upright.")
    ] = False,
    height: Annotated[
        float, typer.Option("--height", metavar="M", min=0.0, help="Of the sensors above the floor (m).")
    ] = 0.3,
    floor: Annotated[
        float | None, typer.Option("--floor", metavar="Z", help="Height of the floor in the scan's axes (m).")
    ] = None,
    ceiling: Annotated[
        float | None, typer.Option("--ceiling", metavar="Z", help="Height of the ceiling in the scan's axes (m).")
    ] = None,
    spectrum: Annotated[
        str | None,
        typer.Option("--spectrum", metavar="NAME", help="Of all lamps: a database name or a CSV file; else assumed."),
    ] = None,
    lumens: Annotated[
        float | None, typer.Option("--lumens", metavar="LM", help="Luminous flux of each lamp; else assumed.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing run file.")] = False,
) -> None:
    """Write a run file for a scan, for you to check and edit: unit, axes, lamps and a sensor grid; and draw the plan.

    Where no room is found, it writes a run file with what to fill in, and says why.
    """
    from lidarspectra.workflow.init.choices import InitChoices
    from lidarspectra.workflow.init.init_file import run_file_of, write_init

    choices = InitChoices(
        unit=unit,
        up=up,
        level=not as_it_leans,
        height=height,
        floor=floor,
        ceiling=ceiling,
        spectrum=spectrum,
        luminous_flux_lm=lumens,
    )
    summary = write_init(scan, out or run_file_of(scan), choices=choices, force=force)
    for line in summary.lines():
        say(line)


@app.command()
def evaluate(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    measured: Annotated[
        Path,
        typer.Option("--measured", metavar="FILE.csv", help="Columns x, y, z, and E_410 ... or lux."),
    ],
    within: Annotated[
        float, typer.Option("--within", metavar="M", min=0.0, help="Largest distance of a reading from its point.")
    ] = 0.15,
    scale: Annotated[
        Literal["none", "one", "die", "channel"], typer.Option("--scale", help="Fit factors to the readings first.")
    ] = "none",
    unit: Annotated[
        Literal["W/m2/nm", "uW/cm2", "counts"], typer.Option("--unit", help="Unit of channels.")
    ] = "W/m2/nm",
) -> None:
    """Compare a run's map with measured readings, channels or lux: NRMSE and MAPE as in the paper."""
    from lidarspectra.workflow.applications.evaluation import draw_evaluation, evaluate_run, save_evaluation

    evaluation = evaluate_run(run, measured, within_m=within, scale=scale, unit=unit)
    for note in evaluation.notes:
        print_note(note)
    for table in evaluation.tables:
        console.print(shown(table))
        console.print()
    folder = save_evaluation(evaluation, run / "evaluation")
    draw_evaluation(evaluation, run, folder)
    say(f"Tables and figures: {folder}")


@app.command()
def verify(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder, even if it was moved.", show_default=False)],
    inputs: Annotated[
        Path | None, typer.Option("--inputs", metavar="DIR", help="Folder of the run file. Default: beside the run.")
    ] = None,
) -> None:
    """Compare inputs, databases, scene files and results with the hashes in a run's record; status 1 if any differs."""
    from lidarspectra.workflow.verify import verify_run

    verification = verify_run(run, inputs=inputs)
    for line in verification.lines():
        say(line)
    for finding in verification.differences:
        console.print(Text.assemble(("differs: ", "bold red"), str(finding)), soft_wrap=True)
    for note in verification.notes:
        print_note(note)
    if verification.differences:
        raise typer.Exit(1)


@app.command()
def doctor() -> None:
    """Check the Radiance programs, the light of a test room and the libraries, and say how to mend what is wrong."""
    from lidarspectra.workflow.doctor import examine

    findings = examine()
    for finding in findings:
        mark = Text("ok   ", "green") if finding.good else Text("wrong", "bold red")
        console.print(Text.assemble(mark, f" {finding.subject:<22} {finding.value}"), soft_wrap=True)
        if not finding.good:
            say(f"      {finding.todo}")
    if not all(finding.good for finding in findings):
        raise typer.Exit(1)
