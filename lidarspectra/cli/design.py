"""`lidarspectra design RUN --target FILE.toml`: from targets of light to the lamps that give it."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from lidarspectra.cli.options import WorkersOption
from lidarspectra.cli.progress import progress_bar
from lidarspectra.cli.terminal import console, print_note, say, shown
from lidarspectra.words import digits


def design(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    target: Annotated[
        Path, typer.Option("--target", metavar="FILE.toml", help="What the light shall be.", show_default=False)
    ],
    check: Annotated[bool, typer.Option("--check", help="Trace the design anew, and compare.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a designed run file.")] = False,
    workers: WorkersOption = None,
) -> None:
    """Find the dimming, spectra or places of lamps that give the light that is wanted, with the least power.

    Exit status 1 where the targets cannot all be met; the least violated design is written all the same.
    """
    from lidarspectra.mapping.figures.tables import save_table
    from lidarspectra.workflow.calibration.light import require_no_run_file_beside
    from lidarspectra.workflow.design.designed_run_file import SUFFIX
    from lidarspectra.workflow.design.designing import check_design, design_lighting, save_design

    if not force:
        require_no_run_file_beside(run, SUFFIX)

    with progress_bar("light of the lamps") as progress:
        found = design_lighting(run, target, workers=workers, progress=progress)
    for table in (found.targets, found.lamps):
        console.print(shown(table))
        console.print()
    for note in found.notes:
        print_note(note)
    say(f"Power: {digits(found.power_W, '.4g')} W, before {digits(found.power_before_W, '.4g')} W.")
    run_file, folder = save_design(found, run, force=force)
    if check:
        with progress_bar("tracing the design anew") as progress:
            checked = check_design(found, workers=workers, progress=progress)
        save_table(checked, folder)
        console.print()
        console.print(shown(checked))
        console.print()
    say(f"Tables and figure: {folder}")
    say(f"Designed run file: {run_file}")
    say(f"Its maps and report: lidarspectra run {shlex.quote(str(run_file))}")
    if not found.is_met:
        raise typer.Exit(1)
