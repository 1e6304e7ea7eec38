"""`lidarspectra relight RUN --lamp NAME [--spectrum S] [--dim D] [--lumens L] --lamp ...`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarspectra.cli.terminal import console, print_note, say, shown

if TYPE_CHECKING:
    import xarray as xr

    from lidarspectra.workflow.scenarios.relighting import LampOrder

FIELDS = {"--spectrum": "spectrum", "--lumens": "luminous_flux_lm", "--dim": "dim"}


def relight(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Name of this light: results go to RUN/relit/NAME.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Another folder for the results.")] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite another light's results there.")] = False,
) -> None:
    r"""New maps for other lamp spectra, lumens or dimming, without tracing again.

    For each lamp to change:
    --lamp NAME [--spectrum NAME|FILE] [--lumens LM] [--dim FACTOR]; "panel *" is every lamp whose name fits.

    A new spectrum keeps the lamp's lumens, unless --lumens says otherwise or its file is in W/nm. Lamps that are not
    named stay as they are. Without --name the results go to RUN/relit/scenario-1, scenario-2 and so on.
    """
    orders = parse_orders(context.args)
    from lidarspectra.mapping.figures.tables import save_table
    from lidarspectra.workflow.scenarios.relighting import draw_relit, relit_run, save_relit
    from lidarspectra.workflow.scenarios.relit_answer import answer_table, channels_table, lamps_table
    from lidarspectra.workflow.scenarios.scenarios import new_scenario

    relit = relit_run(run, orders, base=Path.cwd())
    light = relit.light_map
    scenario = new_scenario(run / "relit", order_words(orders), name=name, out=out, replace=replace)
    answer = answer_table(relit.before, relit.after, light)
    for table in (lamps_table(relit.lamps, relit.lamps_now), channels_table(relit.before, relit.after, light), answer):
        console.print(shown(table))
    for note in relit.notes:
        print_note(note)
    _print_notes(light)
    for path in (*save_relit(light, scenario.folder), *save_table(answer, scenario.folder)):
        say(str(path))
    for path in draw_relit(light, scenario.folder, run):  # after the answer: it takes longer
        say(str(path))


def _print_notes(light: "xr.Dataset") -> None:
    """Notes on a relit map."""
    from lidarspectra.mapping.maps.spectral_map import SPECTRUM_ERROR
    from lidarspectra.radiance.sampling.folding import MAX_SPECTRUM_ERROR
    from lidarspectra.workflow.run_folder.assumed import notes_of_light
    from lidarspectra.workflow.trace_notes import receptor_notes

    predicted = float(light.attrs[SPECTRUM_ERROR])
    if predicted > MAX_SPECTRUM_ERROR:
        print_note(
            f"With this spectrum the reflected light of one channel may be off by {100 * predicted:.1f} %: within that "
            "channel the lamp's light lies elsewhere than that of the spectrum that was traced, and the room's colours "
            "change there. For the exact map give the lamp this spectrum in the run file; or, if it had another one "
            "during the scan, dim = 0, and a lamp beside it with this spectrum and dim_in_scan = 0. Then run it again."
        )
    for note in (*receptor_notes(light.attrs), *notes_of_light(light)):
        print_note(note)


def order_words(orders: "Sequence[LampOrder]") -> tuple[str, ...]:
    """The options that say these orders, as `parse_orders` reads them; numbers without needless digits."""
    words: list[str] = []
    for order in orders:
        words += ["--lamp", order.lamp]
        if order.spectrum is not None:
            words += ["--spectrum", order.spectrum]
        if order.luminous_flux_lm is not None:
            words += ["--lumens", f"{order.luminous_flux_lm:.10g}"]
        if order.dim != 1.0:
            words += ["--dim", f"{order.dim:.10g}"]
    return tuple(words)


def parse_orders(words: Sequence[str], *, needed: bool = True) -> "tuple[LampOrder, ...]":
    """Read `--lamp NAME --dim 0.4 --lamp NAME --spectrum FL11`: options belong to the lamp before them.

    Parameters
    ----------
    words : sequence of str
    needed : bool
        Whether no lamp at all is a mistake.

    Raises
    ------
    typer.BadParameter
        If an option is unknown, lacks its value, or stands before any lamp.
    """
    from lidarspectra.workflow.scenarios.relighting import LampOrder

    groups: list[dict[str, object]] = []
    rest = iter(words)
    for word in rest:
        option, equals, value = word.partition("=")
        if option not in ("--lamp", *FIELDS):
            raise typer.BadParameter(f"'{word}' is not one of --lamp, {', '.join(FIELDS)}")
        value = value if equals else next(rest, "")
        if not value:
            raise typer.BadParameter(f"{option} needs a value")
        if option == "--lamp":
            groups.append({"lamp": value})
        elif not groups:
            raise typer.BadParameter(f"{option} must come after the --lamp that it is for")
        elif FIELDS[option] in groups[-1]:
            raise typer.BadParameter(f"{option} is given twice for lamp '{groups[-1]['lamp']}'")
        else:
            groups[-1][FIELDS[option]] = value if option == "--spectrum" else _number(option, value)
    if needed and not groups:
        raise typer.BadParameter("name at least one lamp: --lamp NAME --dim 0.5")
    return tuple(LampOrder(**group) for group in groups)  # type: ignore[arg-type]


def _number(option: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < float("inf"):
        wanted = "a fraction from 0 to 1" if option == "--dim" else "a number of 0 or more"
        raise typer.BadParameter(f"{option} needs {wanted}, not '{text}'")
    if option == "--dim" and value > 1:
        raise typer.BadParameter(
            f"--dim needs a fraction from 0 to 1, as in the run file, not '{text}': 0.4 dims to 40 %. "
            "For more light than was traced give --lumens"
        )
    return value
