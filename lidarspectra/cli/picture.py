"""`lidarspectra picture RUN [--from X,Y,Z] [--to X,Y,Z] [--lamp NAME --dim D ...]`: the room as it will look."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from lidarspectra.cli.options import WorkersOption
from lidarspectra.cli.relight import order_words, parse_orders
from lidarspectra.cli.terminal import console, print_note, say
from lidarspectra.words import digits

if TYPE_CHECKING:
    from lidarspectra.radiance.pictures.view import Projection

OFF_NOTE = (
    "Lamps that are off look black: their surfaces are sources of light to Radiance, and reflect none. The light that a"
    " true one reflects is small against that of the lit lamps."
)


def picture(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    eye: Annotated[
        str | None, typer.Option("--from", metavar="X,Y,Z", help="Place of the eye in metres, in the scan's axes.")
    ] = None,
    target: Annotated[str | None, typer.Option("--to", metavar="X,Y,Z", help="Point that it looks at.")] = None,
    fisheye: Annotated[bool, typer.Option("--fisheye", help="All that the eye's hemisphere holds, as a disc.")] = False,
    angle: Annotated[
        float | None, typer.Option("--angle", metavar="DEG", help="From left to right; default 75, fisheye 180.")
    ] = None,
    size: Annotated[str | None, typer.Option("--size", metavar="WxH", help="Pixels; 800x600, fisheye 800x800.")] = None,
    fast: Annotated[bool, typer.Option("--fast", help="One ray a pixel: rough edges, a quarter of the time.")] = False,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Name of this picture: RUN/pictures/NAME.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Another folder for the results.")] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite another picture there.")] = False,
    workers: WorkersOption = None,
) -> None:
    r"""Render the room as it will look: colour, luminance in false colour, and an HDR file.

    The lamps are the run's; each can be changed as in 'relight':
    --lamp NAME [--spectrum NAME|FILE] [--lumens LM] [--dim FACTOR].

    Without --name the results go to RUN/pictures/scenario-1, scenario-2 and so on.
    """
    orders = parse_orders(context.args, needed=False)
    pixels = _pixels(size or ("800x800" if fisheye else "800x600"))
    places = [None if text is None else _numbers(option, text) for option, text in (("--from", eye), ("--to", target))]
    from lidarspectra.workflow.run_folder.assumed import assumptions_of_run, notes_of_light, result_notes
    from lidarspectra.workflow.scenarios.picture_of_run import picture_run, save_picture, view_of_run
    from lidarspectra.workflow.scenarios.scenarios import find_scenario, new_scenario

    projection: Projection = "fisheye" if fisheye else "perspective"
    view = view_of_run(run, *places, projection=projection, angle_deg=angle, pixels=pixels)
    words = (*order_words(orders), *view.radiance_words(), "--size", f"{pixels[0]}x{pixels[1]}")
    find_scenario(run / "pictures", words, name=name, out=out, replace=replace)  # before minutes of rendering
    columns = (SpinnerColumn(), BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("scene", total=1.0)
        found = picture_run(
            run,
            eye=places[0],
            target=places[1],
            orders=orders,
            projection=projection,
            angle_deg=angle,
            pixels=pixels,
            smooth=not fast,
            base=Path.cwd(),
            workers=workers,
            progress=lambda share, words: bar.update(task, completed=share, description=words),
        )
    scenario = new_scenario(run / "pictures", words, name=name, out=out, replace=replace)
    luminance = found.picture.luminance
    lit = luminance[luminance > 0]
    if lit.size:
        console.print(
            f"luminance: median {digits(sorted(lit)[lit.size // 2], '.3g')}, highest {digits(lit.max(), '.3g')} cd/m²"
        )
    if any(order.dim == 0 for order in orders):
        print_note(OFF_NOTE)
    # How well the light is known holds for the run's own; what is guessed holds for any of its lamps.
    for note in result_notes(assumptions_of_run(run)) if orders else notes_of_light(run):
        print_note(note)
    for path in save_picture(found, scenario.folder):
        say(str(path))


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != 3:
        raise typer.BadParameter(f"{option} needs x,y,z in metres, as 1.2,0.5,1.6, not '{text}'")
    return found


def _pixels(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"--size needs WIDTHxHEIGHT in pixels, as 800x600, not '{text}'")
    return int(width), int(height)
