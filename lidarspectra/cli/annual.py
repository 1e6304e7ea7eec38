"""`lidarspectra annual ROOM.toml`: a year of daylight, hour by hour, and what it is judged by."""

from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from lidarspectra.cli.options import ClusterOption, OutOption, RunFileArgument, WorkersOption
from lidarspectra.cli.terminal import console, print_note, say


def annual(
    run_file: RunFileArgument,
    maps: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="'MM-DD HH:MM'",
            help="Also write the spectral map of this hour, local standard time; repeat for several.",
        ),
    ] = None,
    out: OutOption = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
) -> None:
    r"""Compute a year of daylight: hourly light, sDA, ASE, UDI and melanopic hours.

    The run file's \[daylight] names the windows, and as weather an EPW file or "synthetic". Missing stages up to the
    materials are run first. Electric lamps are not part of the result.
    """
    from lidarspectra.workflow.applications.annual import annual_daylight

    columns = (
        SpinnerColumn(), BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("scan, views, materials", total=1.0)
        found = annual_daylight(
            run_file,
            out,
            maps=maps or (),
            workers=workers,
            cluster=cluster,
            progress=lambda fraction, words: bar.update(task, completed=fraction, description=words),
        )
    for note in found.notes:
        print_note(note)
    for row in found.room.itertuples():
        console.print(
            f"{row.metric:<18}{row.value:7.1f} {row.unit:<3} {row.low:.1f} to {row.high:.1f} within the noise"
        )
    say(f"Page: {found.page}")
