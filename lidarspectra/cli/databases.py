"""`lidarspectra databases list | show | import`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from lidarspectra.cli.terminal import console, print_note, say

if TYPE_CHECKING:
    from lidarspectra.spectra.databases import ImportSummary

app = typer.Typer(no_args_is_help=True, help="Spectra of surfaces and lamps: list, show, and import more.")


@app.command("list")
def list_command(
    words: Annotated[
        list[str] | None, typer.Argument(help="Show the spectra whose name or category contains these words.")
    ] = None,
) -> None:
    """List the databases, and every spectrum whose name or category contains all words given."""
    from lidarspectra.spectra.databases import list_databases, list_lamps, load_reflectances

    databases = list_databases()
    table = Table("database", "kind", "spectra", "what it is", box=None, header_style="bold")
    for file in databases:
        table.add_row(*map(Text, (file.database, file.kind, str(file.count), file.title)))
    console.print(table)
    if not words:
        console.print("\nGive a word to list spectra, for example: lidarspectra databases list LED")
        return
    names = tuple(dict.fromkeys(file.database for file in databases if file.kind == "reflectance"))
    spectra = [("lamp", lamp.name, lamp.category, lamp.spectrum.range_nm) for lamp in list_lamps()]
    spectra += [
        ("surface", row.key, f"{row.name} ({row.category})", row.range_nm) for row in load_reflectances(names).rows
    ]
    found = [row for row in spectra if all(word.casefold() in " ".join(row[1:3]).casefold() for word in words)]
    table = Table("kind", "name", "what it is", "range", box=None, header_style="bold")
    for kind, name, what, (first, last) in found:
        table.add_row(*map(Text, (kind, name, what, f"{first:.0f}-{last:.0f} nm")))
    console.print()
    console.print(table if found else Text(f"No spectrum's name or category contains all of: {' '.join(words)}"))


@app.command()
def show(name: Annotated[str, typer.Argument(help="Name as 'databases list' shows it.", show_default=False)]) -> None:
    """Print one spectrum as two columns, with its source."""
    from lidarspectra.spectra.databases import show_spectrum

    entry = show_spectrum(name)
    say(f"# {entry.name}; {entry.category}; {entry.provenance}")
    console.print("wavelength_nm,value")
    for wavelength, value in zip(entry.spectrum.wavelengths_nm, entry.spectrum.values, strict=True):
        console.print(f"{wavelength:g},{value:.6g}")


import_app = typer.Typer(
    no_args_is_help=True, help="Import the databases that the paper used, from files that you downloaded."
)
app.add_typer(import_app, name="import")


@import_app.command()
def spectraldb(
    file: Annotated[Path, typer.Argument(help="The table from spectraldb.com, as CSV.", show_default=False)],
) -> None:
    """Import reflectances. To use them, write databases = ["builtin", "spectraldb"] in the run file."""
    from lidarspectra.spectra.databases import import_spectraldb

    _show_import(import_spectraldb(file))


@import_app.command()
def lspdd(
    files: Annotated[list[Path], typer.Argument(help="Lamps from LSPDD, as JSON.", show_default=False)],
) -> None:
    """Import lamp spectra. To use one, write for example spectrum = "lspdd:2469" in the run file."""
    from lidarspectra.spectra.databases import import_lspdd

    _show_import(import_lspdd(files))


def _show_import(summary: "ImportSummary") -> None:
    say(f"{summary.count} spectra imported as '{summary.database}' ({summary.path})")
    for note in summary.notes:
        print_note(note)
