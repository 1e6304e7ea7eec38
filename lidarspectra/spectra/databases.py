"""Find, read and list spectra: reflectances of surfaces, spectra of lamps; built in, imported, or the user's files.

Built-in data lie in databases/ of a checkout, and inside the package of an installed one. What the user imports goes
into the user's data folder (or the folder that $LIDARSPECTRA_DATA names). Both have a MANIFEST.toml that says of each
file where it comes from, under which licence, and its SHA-256.
"""

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import all_of, path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import DatabaseError
from lidarspectra.io.files import hash_file
from lidarspectra.spectra.colorimetry import tristimulus_weights
from lidarspectra.spectra.database_files import (
    BUILTIN,
    DATA_VARIABLE,
    DatabaseFile,
    data_folder,
    list_databases,
    scenes_folder,
    table,
    user_folder,
)
from lidarspectra.spectra.database_import import ImportSummary, import_lspdd, import_spectraldb
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM, VISIBLE_NM, Reflectance, ReflectanceLibrary
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, finite_number, read_spectrum_file

__all__ = [
    "BUILTIN",
    "DATA_VARIABLE",
    "DatabaseFile",
    "ImportSummary",
    "LampSpectrum",
    "color_matching_functions",
    "data_folder",
    "import_lspdd",
    "import_spectraldb",
    "lamp_spectrum",
    "list_databases",
    "list_lamps",
    "load_reflectances",
    "scenes_folder",
    "show_spectrum",
    "tristimulus_table",
    "user_folder",
]

FILE_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".spd", ".spdx")  # a lamp's name with one of these is a file


@dataclass(frozen=True, kw_only=True, eq=False)
class LampSpectrum:
    """A lamp's spectrum from a database or a file.

    Parameters
    ----------
    name : str
        Database name ('LED-B3', 'lspdd:2469') or the file's name.
    spectrum : Spectrum
        [W/nm] where `absolute`, else relative.
    absolute : bool
        True where the values are spectral flux in W/nm.
    unit : str
        'W/nm', 'relative', or what the file's header says.
    category : str
        'led', 'fluorescent', ...; 'unknown' for files.
    source : str
        Database and file.
    provenance : str
        'measured', 'modelled' or 'assigned' (the user's file).
    notes : tuple of str
        What was changed in reading.
    """

    name: str
    spectrum: Spectrum
    absolute: bool
    unit: str
    category: str
    source: str
    provenance: str
    notes: tuple[str, ...] = ()


def lamp_spectrum(name_or_file: str | PathLike[str], base_folder: str | PathLike[str] | None = None) -> LampSpectrum:
    """Spectrum of a lamp, by its database name or from a file.

    Database names come first: built-in ones as they are ('LED-B3', 'FL11', 'A'; capitals do not matter), imported ones
    with their database before them ('lspdd:2469'). What ends in .csv, .txt, .tsv, .dat, .spd or .spdx is a file.

    Parameters
    ----------
    name_or_file : str or path
        What the run file says.
    base_folder : str or path, optional
        Where relative file names start; the run file's folder.

    Returns
    -------
    lamp : LampSpectrum

    Raises
    ------
    DatabaseError
        If there is neither such a name nor such a file, or the file is malformed.
    """
    wanted = str(path_of(name_or_file, name="name_or_file", meaning="a spectrum's name, or the name of a file")).strip()
    for name, database, row in _lamp_rows():
        if wanted.casefold() == name.casefold():
            return _database_lamp(name, database, row)
    if Path(wanted).suffix.lower() in FILE_SUFFIXES:
        path = Path(base_folder or "", wanted)
        read = read_spectrum_file(path)
        return LampSpectrum(
            name=path.name,
            spectrum=read.spectrum,
            absolute=read.absolute,
            unit=read.unit,
            category="unknown",
            source=str(path),
            provenance="assigned",
            notes=read.notes,
        )
    raise _unknown(wanted, [name for name, _, _ in _lamp_rows()], what="a lamp spectrum of the databases, or a file")


def list_lamps() -> tuple[LampSpectrum, ...]:
    """Every lamp spectrum of the databases, built in and imported."""
    return tuple(_database_lamp(name, database, row) for name, database, row in _lamp_rows())


def _lamp_rows() -> Iterator[tuple[str, DatabaseFile, TableRow]]:
    """Full name, file and row of every lamp."""
    for database in list_databases():
        if database.kind == "lamps":
            prefix = "" if database.database == BUILTIN else f"{database.database}:"
            for row in table(database.path):
                yield prefix + row.id, database, row


def _database_lamp(name: str, database: DatabaseFile, row: TableRow) -> LampSpectrum:
    unit = row.properties.get("unit", "relative")
    return LampSpectrum(
        name=name,
        spectrum=row.spectrum,
        absolute=unit == "W/nm",
        unit=unit,
        category=row.category,
        source=f"{database.database}: {database.path.name}",
        provenance=row.properties.get("provenance", database.provenance),
    )


def load_reflectances(
    names: Sequence[str] = (BUILTIN,), base_folder: str | PathLike[str] | None = None
) -> ReflectanceLibrary:
    """Read reflectance databases into one library.

    Parameters
    ----------
    names : sequence of str
        'builtin', an imported database ('spectraldb'), or a table file of the user's (.csv; see `spectrum_files`).
    base_folder : str or path, optional
        Where relative file names start; the run file's folder.

    Returns
    -------
    library : ReflectanceLibrary
        Their surfaces, in that order.

    Raises
    ------
    DatabaseError
        If a database is not there or malformed.
    """
    names = all_of(names, str, name="names of databases", todo="Write ['builtin'].")
    rows: list[Reflectance] = []
    hashes: list[str] = []
    files = [file for file in list_databases() if file.kind == "reflectance"]
    for name in dict.fromkeys(names):
        if name.lower().endswith(".csv"):
            paths = [(Path(name).stem, Path(base_folder or "", name))]
        else:
            paths = [(file.database, file.path) for file in files if file.database == name]
        if not paths:
            raise DatabaseError(
                expected=f"a reflectance database: {', '.join(sorted({file.database for file in files}))}",
                found=f"'{name}'",
                todo="Import it first ('lidarspectra databases import spectraldb FILE'), or name a .csv table.",
            )
        for database, path in paths:
            found = [_reflectance(database, row, path) for row in table(path)]
            _refuse_invisible(found, path)
            rows += found
            hashes.append(hash_file(path))
    return ReflectanceLibrary(rows=tuple(rows), weights=tristimulus_table(), sha256=tuple(hashes))


def _refuse_invisible(rows: Sequence[Reflectance], path: Path) -> None:
    """Refuse a table none of whose surfaces was measured in visible light: its wavelengths are in another unit."""
    if not rows:
        return  # refused where the library is put together
    low, high = min(row.range_nm[0] for row in rows), max(row.range_nm[1] for row in rows)
    if low > VISIBLE_NM[1] or high < VISIBLE_NM[0]:
        raise DatabaseError(
            expected=f"reflectances of visible light, {VISIBLE_NM[0]:g} to {VISIBLE_NM[1]:g} nm",
            found=f"{low:g} to {high:g}",
            where=str(path),
            todo="Wavelengths are in nm: multiply micrometres by 1000, divide ångström by 10.",
        )


def _reflectance(database: str, row: TableRow, path: Path) -> Reflectance:
    where = f"{path}, id {row.id}"

    def fraction(name: str) -> float:
        place = f"{where}, column {name}"
        number = finite_number(row.properties.get(name, "0"), where=place)
        if not 0.0 <= number <= 1.0:
            raise DatabaseError(expected="0 to 1", found=f"{number:g}", where=place)
        return number

    low, high = row.spectrum.range_nm
    kind = row.properties.get("kind", "plastic").casefold()
    if kind not in ("plastic", "metal"):
        raise DatabaseError(expected="plastic or metal", found=f"'{kind}'", where=f"{where}, column kind")
    return Reflectance(
        database=database,
        id=row.id,
        name=row.name,
        category=row.category,
        spectrum=row.spectrum,
        provenance=row.properties.get("provenance", "measured"),
        kind=kind,
        specularity=fraction("specularity"),
        roughness=fraction("roughness"),
        matchable=row.properties.get("matching", "yes").casefold() != "no"
        and low <= VISIBLE_NM[1]
        and high >= VISIBLE_NM[0],
        note=row.properties.get("note", ""),
    )


@lru_cache(maxsize=1)
def tristimulus_table() -> FloatArray:
    """(wavelength, 3) weights that turn a reflectance on `COLOR_GRID_NM` into XYZ under D65."""
    daylight = lamp_spectrum("D65").spectrum.at(COLOR_GRID_NM, outside="zero")
    return tristimulus_weights(daylight, color_matching_functions(COLOR_GRID_NM))


def color_matching_functions(wavelengths_nm: FloatArray) -> FloatArray:
    """(wavelength, 3) x, y and z of the CIE 1931 observer of 2 degrees [1], 0 beyond its table."""
    axes = {row.id: row.spectrum for row in table(data_folder() / "observers" / "cie-1931-2-degree.csv")}
    return np.stack([axes[axis].at(wavelengths_nm, outside="zero") for axis in "xyz"], axis=1)


def show_spectrum(name: str) -> LampSpectrum | Reflectance:
    """Lamp or surface of any database by its name, for `databases show`.

    Raises
    ------
    DatabaseError
        If no database has it.
    """
    for full_name, database, row in _lamp_rows():
        if name.strip().casefold() == full_name.casefold():
            return _database_lamp(full_name, database, row)
    databases = list(dict.fromkeys(file.database for file in list_databases() if file.kind == "reflectance"))
    return load_reflectances(databases).find(name)


def _unknown(wanted: str, names: Sequence[str], *, what: str) -> DatabaseError:
    """Make the error for a name that no database has, with the nearest ones."""
    by_fold = {name.casefold(): name for name in names}
    near = [by_fold[match] for match in difflib.get_close_matches(wanted.casefold(), by_fold, n=3, cutoff=0.5)]
    hint = f"Did you mean {', '.join(near)}? " if near else ""
    return DatabaseError(
        expected=what, found=f"'{wanted}'", todo=f"{hint}'lidarspectra databases list' shows every name."
    )
