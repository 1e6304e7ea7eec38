"""`lidarspectra photometry RUN`: the light for people and plants."""

from pathlib import Path
from typing import Annotated

import typer

from lidarspectra.cli.terminal import console, print_note, say, shown

NO_COLOR_RENDERING_NOTE = (
    "Colour rendering is left out, because the readings of these channels alone do not determine it."
    ' Run with device = "full-spectrum" in [sensors], or give each lamp\'s spectrum.'
)


def photometry(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    measured: Annotated[
        Path | None,
        typer.Option(
            "--measured", metavar="FILE.csv", help="Use measured points (x, y, z, E_410 ...) instead of the map."
        ),
    ] = None,
    dim: Annotated[
        list[str] | None, typer.Option("--dim", metavar="LAMP=FACTOR", help="Dim a lamp; repeat for several.")
    ] = None,
    name: Annotated[
        str | None,
        typer.Option("--name", metavar="NAME", help="With --dim: name of this light, for RUN/people-and-plants/NAME."),
    ] = None,
    week: Annotated[
        Path | None,
        typer.Option("--week", metavar="WEEK.csv", help="lamp,from,to[,dim][,days]: doses of a week by the hour."),
    ] = None,
    daylight: Annotated[
        str | None,
        typer.Option("--daylight", metavar="MM-DD", help="With --week: add seven days of 'annual', from this one."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: RUN/people-and-plants.")] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite another light's results there.")] = False,
) -> None:
    """Map the light for people and plants: lx, CCT, CRI, TM-30, melanopic and other α-opic quantities, PPFD, YPFD.

    With --dim the table says what each quantity was as traced, and how it changes; results then go to a folder of their
    own, of that --name or scenario-1, scenario-2 and so on.

    Each quantity states how well the run's channels determine it. For colour rendering without the lamps' spectra, and
    for the best accuracy of all others, run with device = "full-spectrum".
    """
    from lidarspectra.mapping.figures.figure_style import save_figure
    from lidarspectra.mapping.figures.tables import save_table
    from lidarspectra.mapping.maps.point_values import save_points
    from lidarspectra.mapping.photometry.figures import quantities_figure
    from lidarspectra.mapping.photometry.people_and_plants import light_at_points, summary_table
    from lidarspectra.workflow.run_folder.assumed import assumptions_of_run, notes_of_light, result_notes
    from lidarspectra.workflow.run_folder.light_of_run import light_of_run, light_of_table
    from lidarspectra.workflow.run_folder.workspace import made_folder
    from lidarspectra.workflow.scenarios.scenarios import new_scenario
    from lidarspectra.workflow.trace_notes import receptor_notes

    if measured is not None and dim:
        raise typer.BadParameter("a lamp cannot be dimmed in what was measured: give --measured or --dim, not both")
    if name is not None and not dim:
        raise typer.BadParameter("--name is for changed lamps: give --dim LAMP=FACTOR with it")
    if week is not None:
        if measured is not None or dim:
            raise typer.BadParameter("--week says itself when lamps are dimmed: give it without --measured and --dim")
        _week(run, week, daylight, out or run / "people-and-plants")
        return
    if daylight is not None:
        raise typer.BadParameter("--daylight is the first day of a week by the hour: give --week WEEK.csv with it")
    found = light_of_run(run, parse_factors(dim or []))
    readings = None if measured is None else light_of_table(measured, found.bands)
    light, places = (found.light, found.places) if readings is None else (readings.light, readings.places)
    of_run = result_notes(assumptions_of_run(run)) if dim else notes_of_light(run)  # known as it was traced
    notes = readings.notes if readings else (*receptor_notes(found.places.attrs), *of_run)
    quantities = light_at_points(light, places, found.bands)
    table = summary_table(quantities, before=light_of_run(run).light if dim else None)
    folder = run / "people-and-plants"
    if dim:
        words = [part for word in dim for part in ("--dim", word)]
        folder = new_scenario(folder, words, name=name, out=out, replace=replace).folder
    else:
        folder = made_folder(out or folder)
    save_points(quantities, folder)
    save_table(table, folder)
    save_figure(quantities_figure(quantities, found.plan), folder, "maps")
    console.print(shown(table))
    if not light.is_full_spectrum:
        notes = (*notes, NO_COLOR_RENDERING_NOTE)
    for note in notes:
        print_note(note)
    say(f"Points, table and maps: {folder}")


def _week(run: Path, schedule: Path, daylight: str | None, out: Path) -> None:
    """Write and print a week of light."""
    from lidarspectra.mapping.figures.figure_style import save_figure
    from lidarspectra.mapping.figures.tables import save_table
    from lidarspectra.mapping.photometry.week import week_figure, week_table
    from lidarspectra.workflow.applications.week_of_run import week_of_run
    from lidarspectra.workflow.run_folder.workspace import made_folder

    found = week_of_run(run, schedule, daylight_from=daylight)
    table = week_table(found.week, found.kept)
    folder = made_folder(out)
    save_table(table, folder)
    save_figure(week_figure(found.week, found.kept), folder, "week")
    console.print(shown(table))
    for note in found.notes:
        print_note(note)
    say(f"Table and figure of the week: {folder}")


def parse_factors(words: list[str]) -> dict[str, float]:
    """Read NAME=FACTOR words.

    Raises
    ------
    typer.BadParameter
        If it is none, or the factor no number from 0 to 1.
    """
    factors = {}
    for word in words:
        name, _, text = word.rpartition("=")
        try:
            factor = float(text)
        except ValueError:
            factor = -1.0
        if not name or not 0.0 <= factor <= 1.0:
            raise typer.BadParameter(f"'{word}' is not LAMP=FACTOR with a factor from 0 to 1")
        factors[name] = factor
    return factors
