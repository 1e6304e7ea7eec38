"""`lidarspectra fingerprints ROOM.toml`: simulated sensor readings with a person at each of many positions."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lidarspectra.cli.options import ClusterOption, OutOption, RunFileArgument, WorkersOption
from lidarspectra.cli.progress import progress_bar
from lidarspectra.cli.terminal import console, print_note, say
from lidarspectra.words import counted


class PostureName(StrEnum):
    """A value of `--posture`."""

    STANDING = "standing"
    WALKING = "walking"
    READING = "reading"
    SITTING = "sitting"


def fingerprints(
    run_file: RunFileArgument,
    positions: Annotated[
        Path | None,
        typer.Option("--positions", metavar="FILE.csv", help="Columns name, x, y and optionally z (m)."),
    ] = None,
    grid: Annotated[
        float | None,
        typer.Option(
            "--grid", metavar="M", min=0.1, help="Or: every free position of a square grid with this spacing."
        ),
    ] = None,
    draws: Annotated[
        int, typer.Option("--draws", min=1, max=1000, help="Random people per position; fewer are a first look.")
    ] = 8,
    posture: Annotated[
        list[PostureName] | None,
        typer.Option("--posture", help="Postures to draw from; repeat for several. Default: standing."),
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
            help="Standard error of the change that a person causes (% of the reading).",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random people.")] = 0,
    out: OutOption = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
) -> None:
    """Simulate what the room's sensors read with a person at each of many positions: training data for localization.

    Missing earlier stages are run first. Give the same command again to continue an interrupted job.
    """
    if (positions is None) == (grid is None):
        raise typer.BadParameter("give --positions or --grid, one of the two")
    from lidarspectra.mapping.localization.body import POSTURES
    from lidarspectra.workflow.applications.fingerprints import FingerprintOrder, fingerprint_room

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
    with progress_bar("scan, materials, scene") as progress:
        found = fingerprint_room(run_file, order, out, workers=workers, cluster=cluster, progress=progress)
    for note in found.notes:
        print_note(note)
    table = found.table
    changes = 100.0 * abs(table["irradiance"] / table["empty"] - 1.0).where(table["empty"] > 0)
    count, sensors, bands = (table.sizes[name] for name in ("fingerprint", "sensor", "band"))
    console.print(
        f"{counted(count, 'fingerprint')} of {counted(sensors, 'sensor')} x {counted(bands, 'channel')}; a person "
        "changes a reading by "
        f"{float(changes.median()):.1f} % (median), at most {float(changes.max()):.0f} %; "
        f"standard error {100 * table.attrs['achieved_relative_se']:.2f} % of a reading, "
        f"{100 * table.attrs['achieved_relative_effect_se']:.3f} % for the change"
    )
    say(f"Table: {found.path}")
