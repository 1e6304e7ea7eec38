"""`lidarspectra fingerprints ROOM.toml`: what the room's sensors read with somebody at each of many places."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from lidarspectra.cli.options import ClusterOption, OutOption, RunFileArgument, WorkersOption
from lidarspectra.cli.terminal import console, say, tell


class PostureName(StrEnum):
    """A word for `--posture`."""

    STANDING = "standing"
    WALKING = "walking"
    READING = "reading"
    SITTING = "sitting"


def fingerprints(
    run_file: RunFileArgument,
    positions: Annotated[
        Path | None,
        typer.Option("--positions", metavar="FILE.csv", help="name,x,y and, if need be, z of each position (m)."),
    ] = None,
    grid: Annotated[
        float | None,
        typer.Option("--grid", metavar="M", min=0.1, help="Or: wherever there is room to stand on a grid so wide."),
    ] = None,
    draws: Annotated[int, typer.Option("--draws", min=1, max=1000, help="People drawn for each position.")] = 1,
    posture: Annotated[
        list[PostureName] | None, typer.Option("--posture", help="To draw from; may stand again. Standing by default.")
    ] = None,
    error: Annotated[
        float, typer.Option("--error", metavar="PERCENT", min=0.02, max=10.0, help="Standard error of a reading (%).")
    ] = 0.3,
    effect_error: Annotated[
        float | None,
        typer.Option(
            "--effect-error",
            metavar="PERCENT",
            min=0.005,
            max=10.0,
            help="That of what a person changes (% of the reading).",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Another one draws other people.")] = 0,
    out: OutOption = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
) -> None:
    """Trace what the room's sensors read with somebody at each of many places: the map that localization learns from.

    The stages before are made where they are missing. An interrupted job goes on where it was.
    """
    if (positions is None) == (grid is None):
        raise typer.BadParameter("give either --positions or --grid")
    from lidarspectra.mapping.localization.body import POSTURES
    from lidarspectra.workflow.fingerprints import FingerprintOrder, fingerprint_room

    wanted = {name.value for name in posture or [PostureName.STANDING]}
    order = FingerprintOrder(
        positions=positions,
        grid_m=grid,
        draws=draws,
        postures=tuple(name for name in POSTURES if name in wanted),
        target=error / 100.0,
        effect_target=None if effect_error is None else effect_error / 100.0,
        seed=seed,
    )
    columns = (
        SpinnerColumn(), BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("scan, materials, scene", total=1.0)
        found = fingerprint_room(
            run_file,
            order,
            out,
            workers=workers,
            cluster=cluster,
            progress=lambda fraction, words: bar.update(task, completed=fraction, description=words),
        )
    for note in found.notes:
        tell(note)
    table = found.table
    changes = 100.0 * abs(table["irradiance"] / table["empty"] - 1.0).where(table["empty"] > 0)
    count, sensors, bands = (table.sizes[name] for name in ("fingerprint", "sensor", "band"))
    console.print(
        f"{count} fingerprints of {sensors} sensors x {bands} channels; a person changes a reading by "
        f"{float(changes.median()):.1f} % (median), {float(changes.max()):.0f} % at most; "
        f"standard error {100 * table.attrs['achieved_relative_se']:.2f} %, of the change "
        f"{100 * table.attrs['achieved_relative_effect_se']:.3f} %"
    )
    say(f"Table: {found.path}")
