"""`lidarspectra rules RUN`: the light against rules, each with the probability that it is kept."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from lidarspectra.cli.options import WorkersOption
from lidarspectra.cli.terminal import console, print_note, say, shown


def rules(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: RUN/rules.")] = None,
    workers: WorkersOption = None,
) -> None:
    r"""Hold the light against rules: EN 12464-1, WELL, UL DG 24480, CIE S 026, EN 17037, LM-83, plants' needs.

    Each requirement gets the probability that it is kept, from all that the run does not know: lamps' fluxes,
    reflectances, gaps of the scan, noise. Areas of work are polygons under \[rules] in the run file; give 'run' again
    after a change there. The report shows the result when it is next made.
    """
    from lidarspectra.mapping.rules.rule_figures import rules_table, whole_table
    from lidarspectra.workflow.rules.report import save_rules
    from lidarspectra.workflow.rules.rules_of_run import rules_run

    columns = (SpinnerColumn(), BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("points", total=1.0)
        found = rules_run(
            run,
            workers=workers,
            progress=lambda share, words: bar.update(task, completed=share, description=words),
        )
    record, page = save_rules(found, run, out)
    for table in (rules_table(record), whole_table(record)):
        console.print(shown(table))
    for note in found.notes:
        print_note(note)
    say(f"Page: {page}")
