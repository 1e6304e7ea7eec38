"""Files that hold spectra: our own tables (one spectrum a row), and a user's two-column file.

A table is a CSV in UTF-8 whose first columns say what a spectrum is and whose other columns are headed by a
wavelength [nm]. An empty cell was not measured; a spectrum's range is that of its own cells.

    id,name,category,provenance,400,410,420
    cc-orange,ColorChecker orange,painted,measured,0.051,0.052,
"""

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import DatabaseError
from lidarspectra.io.files import write_whole
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.tm27_files import is_tm27, read_tm27

ID_COLUMN = "id"
WORD_COLUMNS = ("id", "name", "category")  # what every table starts with
SHORTEST_NM, LONGEST_NM = 100.0, 20000.0  # [nm] a wavelength outside is another unit, or a slip
NOISE_BELOW_ZERO = 0.01  # share of the peak: dark noise of a spectrometer; a more negative value is an error
LARGEST_NUMBER = 1e30  # largest number accepted, in any unit; beyond it sums and squares overflow
MAX_FILE_BYTES = 50_000_000  # a spectrum or table larger than this is something else

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NUMBERS = re.compile(rf"{_NUMBER.pattern}(,{_NUMBER.pattern})*")
_FLUX_DENSITY = re.compile(r"(?P<prefix>[mkuµμ]?)W(?:\s*/\s*|\s*[·*.]?\s*)nm(?:\^?-1|⁻¹)?(?![\w²])", re.ASCII)
_PHOTONS = re.compile(r"mol\b|ppfd|photons?\s*(/|per\b|flux)|quanta\b", re.IGNORECASE)  # no cell's efficiency
_OTHER_WAVELENGTH = re.compile(
    r"wave ?number|1\s*/\s*cm|cm\s*(\^?-|⁻)\s*[1¹]|Å|Å|[aå]ngstr|[\[(]A[\])]|(?<![a-z])[uµμ]m(?![a-z])|micro(n|m)",
    re.IGNORECASE,
)
_OTHER_UNIT = re.compile(
    r"W\s*[/·*. ]\s*(m|cm|sr)|(?<![a-z])([mc]?m\s*\^?[-⁻]?\s*[2²]|sr|sqm)(?![a-z])|(ir)?radiance|lm|cd|lx|%|percent",
    re.IGNORECASE,
)  # per area or solid angle, in any order, or no power at all
_PREFIX_SCALE = {"": 1.0, "k": 1e3, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6}


@dataclass(frozen=True, kw_only=True, eq=False)
class TableRow:
    """One spectrum of a table.

    Parameters
    ----------
    id, name, category : str
        Its key, words for a reader, and class.
    spectrum : Spectrum
        Over its own cells only.
    properties : dict of str to str
        The table's other columns; empty cells are left out.
    """

    id: str
    name: str
    category: str
    spectrum: Spectrum
    properties: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectrumFile:
    """What a user's two-column file held.

    Parameters
    ----------
    spectrum : Spectrum
        In W/nm where `absolute`.
    absolute : bool
        True where the header names W/nm (or mW/nm, µW/nm, which are converted).
    unit : str
        'W/nm', or what the header says, or 'relative'.
    notes : tuple of str
        What was changed in reading.
    """

    spectrum: Spectrum
    absolute: bool
    unit: str
    notes: tuple[str, ...] = ()


def read_text(path: Path) -> str:
    """Text of a data file in UTF-8, with or without a byte-order mark; raises DatabaseError where it is none."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise DatabaseError(
                expected=f"a file of at most {MAX_FILE_BYTES // 1_000_000} MB",
                found=f"{path.stat().st_size // 1_000_000} MB",
                where=str(path),
            )
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as cause:
        raise DatabaseError(expected="a readable text file in UTF-8", found=str(cause), where=str(path)) from cause


def read_table(path: Path) -> tuple[TableRow, ...]:
    """Read a table of spectra.

    Parameters
    ----------
    path : Path
        See the module's text for the form.

    Returns
    -------
    rows : tuple of TableRow
        In the file's order; IDs are unique.

    Raises
    ------
    DatabaseError
        If it is no such table; row and column are named.
    """
    lines = csv.reader(io.StringIO(read_text(path)))
    header = next(lines, [])
    words = [name.strip() for name in header if not _is_number(name)]
    if tuple(words[:3]) != WORD_COLUMNS or header[: len(words)] != words:
        raise DatabaseError(
            expected=f"a header that starts with {','.join(WORD_COLUMNS)} and ends with wavelengths in nm",
            found=",".join(header[:5]) or "nothing",
            where=str(path),
        )
    wavelengths = np.array([float(name) for name in header[len(words) :]])
    if wavelengths.size < 2 or np.any(np.diff(wavelengths) <= 0):
        raise DatabaseError(
            expected="two or more wavelength columns in ascending order",
            found=f"{wavelengths.size} columns" if wavelengths.size < 2 else "columns out of order",
            where=str(path),
        )
    rows: dict[str, TableRow] = {}
    for number, cells in enumerate(lines, start=2):
        if not any(cells):
            continue
        row = _table_row(cells, words=words, wavelengths=wavelengths, where=f"{path}, row {number}")
        if row.id in rows:
            raise DatabaseError(expected="each id once", found=f"'{row.id}' again", where=f"{path}, row {number}")
        rows[row.id] = row
    return tuple(rows.values())


def _table_row(cells: list[str], *, words: list[str], wavelengths: FloatArray, where: str) -> TableRow:
    if len(cells) != len(words) + wavelengths.size:
        raise DatabaseError(expected=f"{len(words) + wavelengths.size} cells", found=f"{len(cells)}", where=where)
    texts = dict(zip(words, (cell.strip() for cell in cells), strict=False))
    values = cells[len(words) :]
    filled = np.array([bool(value) for value in values])
    numbers = _finite_numbers([value for value in values if value], wavelengths[filled], where=where)
    if not texts[ID_COLUMN] or len(numbers) < 2:
        raise DatabaseError(
            expected="an id and two or more values",
            found=f"id '{texts[ID_COLUMN]}', {len(numbers)} values",
            where=where,
        )
    return TableRow(
        id=texts["id"],
        name=texts["name"] or texts["id"],
        category=texts["category"] or "unknown",
        spectrum=Spectrum(
            wavelengths_nm=wavelengths[filled], values=np.array(numbers), name=texts["name"] or texts["id"]
        ),
        properties={name: texts[name] for name in words[3:] if texts[name]},
    )


def _finite_numbers(values: list[str], wavelengths: FloatArray, *, where: str) -> list[float]:
    """Numbers from the cells of a row; raises DatabaseError that names the column as `finite_number` does."""
    row = ",".join(values)
    if row.count(",") == len(values) - 1 and _NUMBERS.fullmatch(row):  # at once: tables have tens of thousands of cells
        numbers = [float(value) for value in values]
        if all(abs(number) <= LARGEST_NUMBER for number in numbers):
            return numbers
    return [
        finite_number(value, where=f"{where}, column {wavelength:g}")
        for value, wavelength in zip(values, wavelengths, strict=True)
    ]


def write_table(path: Path, rows: Sequence[TableRow]) -> None:
    """Write a table that `read_table` reads; its columns are the union of the rows' wavelengths and properties.

    Parameters
    ----------
    path : Path
        Written whole or not at all; its folder must be there.
    rows : sequence of TableRow
        Their values are written with six significant digits, their wavelengths with ten.
    """
    extra = list(dict.fromkeys(name for row in rows for name in row.properties))
    # By their text: 380.3 and the 380.30000000000001 of another row are one column.
    labels = [[f"{wavelength:.10g}" for wavelength in row.spectrum.wavelengths_nm.tolist()] for row in rows]
    grid = sorted({label for each in labels for label in each}, key=float)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*WORD_COLUMNS, *extra, *grid])
    for row, own in zip(rows, labels, strict=True):
        values = dict(zip(own, row.spectrum.values.tolist(), strict=True))
        numbers = (f"{values[label]:.6g}" if label in values else "" for label in grid)
        writer.writerow([row.id, row.name, row.category, *(row.properties.get(name, "") for name in extra), *numbers])
    write_whole(path, text.getvalue())


def write_spectrum_file(path: Path, spectrum: Spectrum) -> Path:
    """Write a lamp's spectral flux as `read_spectrum_file` reads it.

    Parameters
    ----------
    path : Path
        Written whole or not at all; its folder must be there.
    spectrum : Spectrum
        [W/nm]

    Returns
    -------
    path : Path
    """
    write_whole(path, spectrum_text(spectrum))
    return path


def spectrum_text(spectrum: Spectrum) -> str:
    """A lamp's spectral flux [W/nm] as the text of a file."""
    pairs = zip(spectrum.wavelengths_nm.tolist(), spectrum.values.tolist(), strict=True)
    lines = ["wavelength [nm],flux [W/nm]", *(f"{wavelength:.10g},{value:.9g}" for wavelength, value in pairs)]
    return "\n".join(lines) + "\n"


def read_spectrum_file(path: Path, *, black_allowed: bool = False) -> SpectrumFile:
    """Read a user's spectrum: two columns, wavelength [nm] and value, or an IES TM-27 file (.spdx).

    Delimiter (comma, semicolon, tab, spaces) and header are found out; lines that start with '#' are skipped; a
    decimal comma is understood where the delimiter is none. The value is the column after the wavelength's, before it
    where that is the last. It is absolute where its heading names W/nm; of photons (a heading with µmol or photon
    flux) it is divided by the wavelength.

    Parameters
    ----------
    path : Path
        A text file in UTF-8.
    black_allowed : bool
        Whether zero at all wavelengths is a spectrum: a black surface's reflectance is, a lamp's light is not.

    Returns
    -------
    file : SpectrumFile
        Values >= 0, wavelengths ascending.

    Raises
    ------
    DatabaseError
        If it is no such file; the line is named.
    """
    text = read_text(path)
    if is_tm27(text):
        heading, cells_of = read_tm27(text, path)
        where = f"{path}, SpectralData"
        numbers = [(finite_number(nm, where=where), finite_number(value, where=where)) for nm, value in cells_of]
        rows = [(nm, value, number) for number, (nm, value) in enumerate(numbers, start=1)]
        return _checked(rows, heading=heading, path=path, black_allowed=black_allowed)
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    split = _splitter(line for _, line in lines)
    table = [(number, split(line)) for number, line in lines]
    header: list[str] = []
    if table and not any(_is_number(cell) for cell in table[0][1][:2]):
        header = table.pop(0)[1]
    if len(table) < 2:
        raise DatabaseError(
            expected="two or more lines of wavelength and value",
            found=f"{len(table)}",
            where=str(path),
            todo="Write a header 'wavelength_nm,value' and a line for each wavelength.",
        )
    x, y = _columns(header)
    if header and (unit := _OTHER_WAVELENGTH.search(header[x])):
        raise DatabaseError(
            expected="wavelengths in nm",
            found=f"'{unit[0].strip()}' in the heading '{header[x].strip()[:40]}'",
            where=str(path),
            todo="Convert them: 1 nm is 10 ångström and 0.001 micrometres, and 10,000,000 over a wavenumber in 1/cm.",
        )
    points = []
    for number, cells in table:
        where = f"{path}, line {number}"
        if split.delimiter == "," and _has_decimal_commas(cells, header):
            raise DatabaseError(
                expected="decimal points, or semicolons between cells",
                found=f"{len(cells)} cells, as decimal commas between commas make them",
                where=where,
                todo="Save the table with semicolons or tabs between its cells, or with decimal points.",
            )
        if len(cells) <= max(x, y):
            raise DatabaseError(expected="a wavelength and a value", found=f"{len(cells)} cell(s)", where=where)
        points.append((finite_number(cells[x], where=where), finite_number(cells[y], where=where), number))
    found = _checked(points, heading=header[y] if len(header) > y else "", path=path, black_allowed=black_allowed)
    others = [name.strip() for k, name in enumerate(header) if k > y and _is_column(k, table)]
    if not others:
        return found
    note = (
        f"Of several columns of numbers '{header[y].strip()[:40]}' was taken, not "
        f"{', '.join(repr(name[:40]) for name in others[:3])}: delete it if another one is meant."
    )
    return replace(found, notes=(*found.notes, note))


def _is_column(number: int, table: Sequence[tuple[int, list[str]]]) -> bool:
    """Whether the cells of a column, by its number from 0, are numbers."""
    return all(len(cells) > number and _is_number(cells[number]) for _, cells in table)


def _checked(points: list[tuple[float, float, int]], *, heading: str, path: Path, black_allowed: bool) -> SpectrumFile:
    """Order the points, find the unit, and refuse values that no lamp or surface can have."""
    notes = []
    ordered = sorted(points)
    if ordered != points:
        notes.append(
            "The lines were not in ascending order of wavelength, so they were sorted; check that none is missing."
        )
    wavelengths = np.array([point[0] for point in ordered])
    values = np.array([point[1] for point in ordered])
    repeated = np.flatnonzero(np.diff(wavelengths) == 0)
    if repeated.size:
        again = ordered[int(repeated[0]) + 1]
        raise DatabaseError(
            expected="each wavelength once", found=f"{again[0]:g} nm again", where=f"{path}, line {again[2]}"
        )
    if wavelengths[0] < SHORTEST_NM or wavelengths[-1] > LONGEST_NM:
        raise DatabaseError(
            expected=f"wavelengths in nm, {SHORTEST_NM:g} to {LONGEST_NM:g}",
            found=f"{wavelengths[0]:g} to {wavelengths[-1]:g}",
            where=str(path),
            todo="Multiply micrometres by 1000; the first column is the wavelength.",
        )
    lowest = int(values.argmin())
    is_dark = not values.any() and not black_allowed
    if is_dark or values[lowest] < -NOISE_BELOW_ZERO * values.max():
        raise DatabaseError(
            expected="values that are nowhere negative" + ("" if black_allowed else " and somewhere positive"),
            found=f"{values[lowest]:g} to {values.max():g}",
            where=f"{path}, line {ordered[lowest][2]}",
        )
    if values[lowest] < 0:
        notes.append(
            f"{int((values < 0).sum())} values slightly below zero, within the noise of a spectrometer, were set to"
            " zero. Nothing needs to be done."
        )
        values = np.maximum(values, 0.0)
    scale, absolute, unit = _unit(heading)
    if _PHOTONS.search(heading):
        values = values / wavelengths
        notes.append("The heading says that values count photons: they were divided by the wavelength, for power.")
    return SpectrumFile(
        spectrum=Spectrum(wavelengths_nm=wavelengths, values=values * scale, name=path.stem),
        absolute=absolute,
        unit=unit,
        notes=tuple(notes),
    )


def _unit(heading: str) -> tuple[float, bool, str]:
    """Scale to W/nm, whether the values are absolute spectral flux, and the unit in words."""
    match = _FLUX_DENSITY.search(heading)
    if match and not _OTHER_UNIT.search(heading):
        return _PREFIX_SCALE[match["prefix"]], True, "W/nm"
    other = _OTHER_UNIT.search(heading)
    return 1.0, False, heading.strip() if other else "relative"


def _columns(header: list[str]) -> tuple[int, int]:
    """Which columns hold wavelength and value: by their headings, else the first two; before both may be a number."""
    for index, name in enumerate(header):
        words = name.strip().lower()
        if words.startswith(("wavelength", "lambda", "wl", "λ")) or words in ("nm", "[nm]", "(nm)"):
            return index, index - 1 if 0 < index == len(header) - 1 else index + 1
    return 0, 1


def _has_decimal_commas(cells: list[str], header: list[str]) -> bool:
    """Whether a line between commas has more cells than columns, which decimal commas make ('400,0,05')."""
    filled = [cell for cell in cells if cell]
    return len(filled) > max(2, len(header)) and (bool(header) or all(cell.isdecimal() for cell in filled))


class _Splitter:
    """Splits lines at one delimiter, and turns decimal commas into points where commas split nothing."""

    def __init__(self, delimiter: str | None) -> None:
        self.delimiter = delimiter

    def __call__(self, line: str) -> list[str]:
        if self.delimiter is None:
            return [cell.replace(",", ".") if _is_decimal_comma(cell) else cell for cell in line.split()]
        cells = [cell.strip().strip('"') for cell in line.strip().split(self.delimiter)]
        if self.delimiter == ",":
            return cells
        return [cell.replace(",", ".") if _is_decimal_comma(cell) else cell for cell in cells]


def _splitter(lines: Iterable[str]) -> _Splitter:
    """Take the delimiter that makes numbers of the first two cells of most lines."""
    sample = list(lines)[:50]
    splitters = [_Splitter(delimiter) for delimiter in ("\t", ";", ",", None)]

    def numbers(split: _Splitter) -> int:
        return sum(_is_number(cell) for line in sample for cell in split(line)[:2])

    return max(splitters, key=numbers)


def _is_decimal_comma(text: str) -> bool:
    return bool(re.fullmatch(r"[+-]?\d*,\d+([eE][+-]?\d+)?", text))


def _is_number(text: str) -> bool:
    return bool(_NUMBER.fullmatch(text.strip()))


def finite_number(text: str, *, where: str) -> float:
    """A number from a cell; raises DatabaseError that names the place for words, NaN and what no quantity can be."""
    if not _is_number(text) or abs(float(text)) > LARGEST_NUMBER:
        raise DatabaseError(expected="a number", found=f"'{text.strip()[:40]}'", where=where)
    return float(text)
