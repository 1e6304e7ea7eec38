"""Import the paper's own databases from the user's copies: spectraldb (surfaces) and LSPDD (lamps).

Neither may come with this package (spectraldb states no licence, LSPDD is CC BY-NC-ND); the user brings the files, and
they are written as tables into the user's data folder, with the source's SHA-256 in its manifest.
"""

import csv
import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.errors import DatabaseError
from lidarspectra.io.files import hash_file, writing
from lidarspectra.spectra.database_files import DatabaseFile, list_databases, user_folder, write_manifest
from lidarspectra.spectra.reflectance_library import MAX_REFLECTANCE
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, finite_number, read_table, read_text, write_table

SPECTRALDB_COLUMNS = (
    "ID",
    "Name",
    "ObjectType",
    "RadianceType",
    "Specularity",
    "Roughness",
    "SCIMeasures",
    "SCEMeasures",
)
PERCENT = 100.0  # spectraldb's values are in percent
_PAIRS = re.compile(r"\{\s*(.*?)\s*\}", re.DOTALL)


@dataclass(frozen=True, kw_only=True)
class ImportSummary:
    """The result of an import, for the command line.

    Parameters
    ----------
    database : str
        Name by which a run file asks for it.
    path : Path
        The table that was written.
    count : int
        Spectra in it.
    notes : tuple of str
        What was changed or excluded, in which rows, as full sentences.
    """

    database: str
    path: Path
    count: int
    notes: tuple[str, ...] = ()


def import_spectraldb(file: Path) -> ImportSummary:
    """Import spectraldb.com's table of surfaces, as the paper used it.

    Total reflectance (specular component included, SCI) is taken where the row has it, else the one without (SCE), and
    the row says so. Rows are keyed by ID, as 75 names repeat. Each keeps its own wavelengths (there are five grids), so
    that what lies beyond is known to be extrapolated. Rows above 99 % are cut there and never matched to a colour:
    a surface without fluorescence cannot do that.

    Parameters
    ----------
    file : Path
        The CSV as spectraldb.com gives it; values in percent.

    Returns
    -------
    summary : ImportSummary

    Raises
    ------
    DatabaseError
        If the file is no such table; row and column are named.
    """
    reader = csv.DictReader(io.StringIO(read_text(file), newline=""))
    missing = [name for name in SPECTRALDB_COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise DatabaseError(
            expected=f"spectraldb's columns {', '.join(SPECTRALDB_COLUMNS)}",
            found=f"no {', '.join(missing)}",
            where=str(file),
        )
    rows: dict[str, TableRow] = {}
    for number, cells in enumerate(reader, start=2):
        row = _spectraldb_row(cells, where=f"{file}, row {number}")
        if row.id in rows:
            raise DatabaseError(expected="each ID once", found=f"'{row.id}' again", where=f"{file}, row {number}")
        rows[row.id] = row
    highest = max((float(row.spectrum.values.max()) for row in rows.values()), default=1.0) * PERCENT
    if highest <= 1.0:
        raise DatabaseError(
            expected="reflectances in percent, as spectraldb.com gives them",
            found=f"none above {highest:g}",
            where=str(file),
            todo="Multiply fractions by 100, or name a table of your own under databases (docs/run-file.md).",
        )
    cut = [row.id for row in rows.values() if row.properties.get("matching") == "no"]
    diffuse = sum("SCE" in row.properties.get("note", "") for row in rows.values())
    notes = (
        f"{diffuse} rows have no measurement with the specular component included (SCI), so the one without it (SCE)"
        " was used. Glossy surfaces among them reflect more than their spectrum says.",
        f"{len(cut)} rows exceed {MAX_REFLECTANCE:.0%}, which no surface without fluorescence can reflect, so they were"
        f" limited to it and are not matched to colours. They can be used by ID: {', '.join(cut) or 'none'}.",
    )
    return _store(
        tuple(rows.values()),
        sources=[file],
        entry_kind="reflectance",
        database="spectraldb",
        title="spectraldb.com: surfaces of buildings, measured by spectrophotometer",
        source="spectraldb.com, imported from the user's copy",
        licence="none stated: for the user's own use",
        notes=notes,
    )


def _spectraldb_row(cells: dict[str, Any], *, where: str) -> TableRow:
    if None in cells or None in cells.values():
        raise DatabaseError(expected="as many cells as the header has", found="more or fewer", where=where)
    column = "SCIMeasures" if cells["SCIMeasures"].strip() else "SCEMeasures"
    spectrum = _percent_pairs(cells[column], name=cells["Name"], where=f"{where}, column {column}")
    properties = {
        "provenance": "measured",
        "kind": "metal" if cells["RadianceType"] == "Metal" else "plastic",
        "specularity": cells["Specularity"].strip(),
        "roughness": cells["Roughness"].strip(),
    }
    for name in ("Specularity", "Roughness"):
        if cells[name].strip() and not 0 <= finite_number(cells[name], where=f"{where}, column {name}") <= 1:
            raise DatabaseError(expected="0 to 1", found=cells[name], where=f"{where}, column {name}")
    notes = ["specular component excluded (SCE)"] if column == "SCEMeasures" else []
    if spectrum.values.max() > MAX_REFLECTANCE:
        notes.append(f"source has {spectrum.values.max():.1%}; cut at {MAX_REFLECTANCE:.0%}")
        properties["matching"] = "no"
        spectrum = Spectrum(
            wavelengths_nm=spectrum.wavelengths_nm,
            values=np.minimum(spectrum.values, MAX_REFLECTANCE),
            name=spectrum.name,
        )
    properties["note"] = "; ".join(notes)
    identifier = cells["ID"].strip()
    if not identifier:
        raise DatabaseError(expected="an ID", found="an empty cell", where=f"{where}, column ID")
    return TableRow(
        id=identifier,
        name=cells["Name"].strip() or identifier,
        category=cells["ObjectType"].strip() or "unknown",
        spectrum=spectrum,
        properties=properties,
    )


def _percent_pairs(text: str, *, name: str, where: str) -> Spectrum:
    """Spectrum of '{360: 8.86, 370: 10.72}', percent to fraction."""
    match = _PAIRS.fullmatch(text.strip())
    if match is None:
        raise DatabaseError(expected="{wavelength: percent, ...}", found=f"'{text[:40]}'", where=where)
    pairs = {}
    for pair in match[1].split(","):
        wavelength, _, value = pair.partition(":")
        pairs[finite_number(wavelength, where=where)] = finite_number(value, where=where)
    wavelengths = np.array(sorted(pairs))
    values = np.array([pairs[wavelength] for wavelength in wavelengths]) / PERCENT
    if wavelengths.size < 2 or values.min() < 0:
        raise DatabaseError(
            expected="two or more reflectances, none negative",
            found=f"{wavelengths.size}, the lowest {values.min():.1%}",
            where=where,
        )
    return Spectrum(wavelengths_nm=wavelengths, values=values, name=name)


def import_lspdd(files: Sequence[Path]) -> ImportSummary:
    """Import lamps of the Lamp Spectral Power Distribution Database, as the paper used it.

    Parameters
    ----------
    files : sequence of Path
        JSON files, one a lamp (as lspdd.org gave them). Lamps imported before stay.

    Returns
    -------
    summary : ImportSummary

    Raises
    ------
    DatabaseError
        If a file is no such lamp; the line of its data is named.
    """
    if not files:
        raise DatabaseError(expected="one or more LSPDD files (.json)", found="none")
    kept = user_folder() / "lamps" / "lspdd.csv"
    rows = {row.id: row for row in read_table(kept)} if kept.is_file() else {}
    for file in files:
        row = _lspdd_row(file)
        rows[row.id] = row
    return _store(
        tuple(rows[key] for key in sorted(rows)),
        sources=files,
        entry_kind="lamps",
        database="lspdd",
        title="Lamp Spectral Power Distribution Database",
        source="LSPDD (Roby, Aube), imported from the user's copies",
        licence="CC BY-NC-ND 2.5 CA: for the user's own, non-commercial use",
        notes=("relative power",),
    )


def _lspdd_row(file: Path) -> TableRow:
    try:
        lamp = json.loads(read_text(file))
    except (json.JSONDecodeError, RecursionError) as cause:
        raise DatabaseError(expected="an LSPDD lamp (JSON)", found=str(cause), where=str(file)) from cause
    if not isinstance(lamp, dict) or not isinstance(lamp.get("spectraldata"), str) or "id" not in lamp:
        raise DatabaseError(
            expected="an LSPDD lamp with 'id' and 'spectraldata'", found=type(lamp).__name__, where=str(file)
        )
    words = [_word(lamp.get(key) or "") for key in ("brand", "lamptype", "category")]
    name = " ".join(word for word in words if word) or _word(lamp["id"])
    points = []
    for number, line in enumerate(lamp["spectraldata"].splitlines()[1:], start=2):
        if line.strip():
            wavelength, _, value = line.partition(",")
            where = f"{file}, spectraldata line {number}"
            points.append((finite_number(wavelength, where=where), finite_number(value, where=where)))
    table = np.array(points, dtype=np.float64).reshape(-1, 2)
    if len(table) < 2 or np.any(np.diff(table[:, 0]) <= 0) or table[:, 1].min() < 0 or table[:, 1].max() <= 0:
        raise DatabaseError(
            expected="ascending wavelengths with values that are nowhere negative and somewhere positive",
            found=f"{len(table)} lines that are not",
            where=str(file),
        )
    return TableRow(
        id=_word(lamp["id"]),
        name=f"{name} {_word(lamp['cct'])} K" if lamp.get("cct") else name,
        category=_word(lamp.get("category") or "unknown").lower(),
        spectrum=Spectrum(wavelengths_nm=table[:, 0], values=table[:, 1], name=name),
        properties={"provenance": "measured"},
    )


def _word(value: object) -> str:
    """Text of a JSON value; half of a surrogate pair, which JSON may escape and no file can hold, becomes '?'."""
    return str(value).encode("utf-8", errors="replace").decode("utf-8")


def _store(
    rows: tuple[TableRow, ...],
    *,
    sources: Sequence[Path],
    entry_kind: str,
    database: str,
    title: str,
    source: str,
    licence: str,
    notes: tuple[str, ...],
) -> ImportSummary:
    """Write an imported table and its manifest entry, in place of an earlier import of the same database."""
    folder = user_folder()
    path = folder / entry_kind / f"{database}.csv"
    with writing(
        folder,
        error=DatabaseError,
        expected="a data folder that can be written",
        todo="Set the environment variable LIDARSPECTRA_DATA to a folder of yours.",
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_table(path, rows)
        ranges = sorted({row.spectrum.range_nm for row in rows})
        entry = DatabaseFile(
            database=database,
            kind=entry_kind,
            path=path,
            title=title,
            source=source,
            licence=licence,
            grid=", ".join(f"{first:g}-{last:g}" for first, last in ranges) + " nm",
            provenance="measured",
            count=len(rows),
            sha256=hash_file(path),
            source_sha256=" ".join(hash_file(file) for file in sources),
            note="; ".join(notes),
        )
        others = [file for file in list_databases() if file.path.is_relative_to(folder) and file.path != path]
        write_manifest(folder, [*others, entry])
    return ImportSummary(database=database, path=path, count=len(rows), notes=notes)
