"""The user's assignments of materials: a CSV that gives groups of faces, or single faces, a reflectance by its ID.

The `materials.csv` that a run writes is such a file: change the cell `reflectance` of a group to the ID of a database
('builtin:white-wall', '00042') or to a spectrum file (.csv, beside the assignments), delete the rows that shall stay as
estimated, and name the file in the run file:

    group,reflectance
    0,builtin:white-wall
    3,carpet.csv

`group` may be '*' for all groups that have no row of their own, panes of the run file apart. With a column `face` in
place of `group`, rows are single faces of the scan after repair; those in panes keep the pane's.

A row that is left as a run wrote it stays as estimated. Groups are numbered by their area, so that other light or
another scan may give other surfaces their numbers: a row that has the cell `color` of the run must still be of a group
of that colour.
"""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast, get_args

import numpy as np

from lidarspectra.errors import DatabaseError, MaterialError
from lidarspectra.io.csv_cells import numbered_rows
from lidarspectra.material.colors import color_difference
from lidarspectra.material.matching import FAR_COLOR
from lidarspectra.material.material_map import Material, MaterialMap, Provenance, SurfaceKind
from lidarspectra.material.pane_materials import OF_PANE
from lidarspectra.material.part_materials import SOURCE
from lidarspectra.spectra.colorimetry import decode_srgb, hex_color, linear_srgb_to_lab
from lidarspectra.spectra.reflectance_library import (
    MAX_REFLECTANCE,
    VISIBLE_NM,
    Reflectance,
    ReflectanceLibrary,
)
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import finite_number, read_spectrum_file, read_text

ALL_GROUPS = "*"
# a reflectance that starts so, or an empty one, leaves the group as it was estimated: runs write them
AS_ESTIMATED = ("recovered", f"{SOURCE}:", OF_PANE)
OF_PERCENT = re.compile(r"%|percent", re.IGNORECASE)  # in the heading of a spectrum file
PERCENT = 100.0
_FACE_COUNT = re.compile(r"#\s*of (\d+) faces\b")
WRITTEN = 1e-5  # [1] relative, of numbers that a run writes in six digits
_COLOR = re.compile(r"#[0-9a-fA-F]{6}")
SURFACE_COLUMNS = ("specularity", "roughness", "transmittance")


@dataclass(frozen=True, kw_only=True)
class Assignment:
    """One row of the file.

    Parameters
    ----------
    target : str
        Group number, '*', or face number.
    reflectance : str
        Database ID or spectrum file; empty to keep the estimate.
    surface : dict of str to str
        The cells of kind, specularity, roughness and transmittance that are not empty.
    line : int
        In the file, for errors.
    name, provenance, color : str
        The cells that a run wrote of the group; empty where there are none.
    """

    target: str
    reflectance: str
    surface: Mapping[str, str]
    line: int
    name: str = ""
    provenance: str = ""
    color: str = ""


@dataclass(frozen=True, kw_only=True)
class Assignments:
    """A file of assignments.

    Parameters
    ----------
    by : 'group' or 'face'
    rows : tuple of Assignment
        Each target once.
    face_count : int or None
        Of the scan whose faces they name, where the file says so in a line before its table: '# of 9000 faces'.
    """

    by: Literal["group", "face"]
    rows: tuple[Assignment, ...]
    face_count: int | None = None

    @property
    def give_all(self) -> bool:
        """Whether all groups get one reflectance, whichever groups there are: nothing is left to estimate."""
        return len(self.rows) == 1 and self.rows[0].target == ALL_GROUPS and _is_given(self.rows[0].reflectance)


def read_assignments(path: Path) -> Assignments:
    """Read a file of assignments.

    Raises
    ------
    MaterialError
        If it is no such file; the line is named.
    """
    try:
        text = read_text(path)
        said = _FACE_COUNT.match(text)
        (_, names), *lines = list(numbered_rows(text)) or [(1, [])]
        columns = [name.lower() for name in names]
        by: Literal["group", "face"] = "face" if "face" in columns else "group"
        if by not in columns or "reflectance" not in columns:
            raise _fault(path, 1, expected="columns 'group' (or 'face') and 'reflectance'", found=", ".join(columns))
        rows: dict[str, Assignment] = {}
        for line, cells in lines:
            texts = dict.fromkeys(columns, "") | dict(zip(columns, cells, strict=False))
            target = texts[by]
            if not target.isdecimal() and not (by == "group" and target == ALL_GROUPS):
                raise _fault(path, line, expected=f"the number of a {by}", found=f"'{target}'")
            target = target if target == ALL_GROUPS else str(int(target))
            if target in rows:
                raise _fault(path, line, expected=f"each {by} once", found=f"{target} again")
            surface = {name: texts[name] for name in ("kind", *SURFACE_COLUMNS) if texts.get(name)}
            rows[target] = Assignment(
                target=target,
                reflectance=texts["reflectance"],
                surface=surface,
                line=line,
                name=texts.get("name", ""),
                provenance=texts.get("provenance", ""),
                color=texts.get("color", ""),
            )
    except (DatabaseError, csv.Error) as cause:
        raise MaterialError(
            expected="a readable CSV of assignments", found=str(cause), where=str(path), todo="See docs/run-file.md."
        ) from cause
    return Assignments(by=by, rows=tuple(rows.values()), face_count=int(said[1]) if said else None)


def spectrum_files(path: Path) -> tuple[str, ...]:
    """Names of the spectrum files that a file of assignments points to; none where it cannot be read.

    Parameters
    ----------
    path : Path
        Of the assignments; the names start at its folder.

    Returns
    -------
    names : tuple of str
    """
    try:
        rows = read_assignments(path).rows
    except MaterialError:
        return ()  # refused, in words, where the assignments are wanted
    return tuple(row.reflectance for row in rows if _is_file(row.reflectance))


def give_all(path: Path) -> bool:
    """Whether a file of assignments gives all surfaces one reflectance; not where it cannot be read."""
    try:
        return read_assignments(path).give_all
    except MaterialError:
        return False  # refused, in words, where the assignments are wanted


def _is_given(reflectance: str) -> bool:
    """Whether a cell names a reflectance, rather than leave the estimated one."""
    return bool(reflectance) and not reflectance.lower().startswith(AS_ESTIMATED)


def _is_as_written(row: Assignment, before: Material, library: ReflectanceLibrary) -> bool:
    """Whether a row says of a group what a run wrote: the nearest surface's name, say, whose spectrum was scaled.

    By another light another surface may be the nearest now, or the number another group's; the row's own name then
    tells that a run wrote it.
    """
    if not _is_given(row.reflectance):
        return True
    if row.provenance not in get_args(Provenance):
        return False
    if row.provenance == before.provenance and row.reflectance == before.source:
        return True
    named = [each.name for each in library.rows if row.reflectance == each.key]
    if not named or sum(each.name == named[0] for each in library.rows) > 1:
        return False
    before_it = {"measured": ".*, as ", "default": ""}.get(row.provenance)  # in the name that a run gives
    return before_it is not None and bool(re.fullmatch(rf"{before_it}{re.escape(named[0])}( \d+)?", row.name))


def _is_pane(material: Material) -> bool:
    return material.source.startswith(OF_PANE)


def _is_of_another_pane(row: Assignment, before: Material) -> bool:
    """Whether a row was left as a run wrote it of a pane, and its number is no pane's now, or the other way round.

    Its cells would make a wall a mirror.
    """
    is_left = bool(row.reflectance) and not _is_given(row.reflectance)
    return is_left and row.reflectance.startswith(OF_PANE) != _is_pane(before)


def _changes_surface(row: Assignment, before: Material) -> bool:
    """Whether the cells of a row say that a group scatters otherwise than it is known to."""
    if row.surface.get("kind", before.kind) != before.kind:
        return True
    try:
        numbers = {
            name: finite_number(row.surface[name], where=name) for name in SURFACE_COLUMNS if name in row.surface
        }
    except DatabaseError:
        return False  # refused where it is read
    return any(abs(number - float(getattr(before, name))) > WRITTEN * number for name, number in numbers.items())


def _refuse_another(row: Assignment, before: Material, library: ReflectanceLibrary, where: Path) -> None:
    """Refuse what a row says of a group that is plainly of another colour than the one the row was written of."""
    if row.target == ALL_GROUPS or not _COLOR.fullmatch(row.color):
        return
    if _is_as_written(row, before, library) and not _changes_surface(row, before):
        return
    wanted = decode_srgb([int(row.color[first : first + 2], 16) / 255 for first in (1, 3, 5)])
    if float(color_difference(linear_srgb_to_lab(wanted), linear_srgb_to_lab(before.color))) > FAR_COLOR:
        raise MaterialError(
            expected=f"the group of color {row.color} that this row was written of",
            found=f"group {row.target} is '{before.name}' of {hex_color(before.color)}",
            where=f"{where}, line {row.line}",
            todo="The groups are others now. Copy the materials.csv of a run without this file once more, or delete "
            "the column color where the numbers are right.",
        )


def _is_file(reflectance: str) -> bool:
    return reflectance.lower().endswith(".csv")


def assign(
    estimated: MaterialMap, assignments: Assignments, library: ReflectanceLibrary, *, where: Path
) -> MaterialMap:
    """Apply the user's assignments to the estimated materials.

    Parameters
    ----------
    estimated : MaterialMap
    assignments : Assignments
    library : ReflectanceLibrary
        Where IDs are looked up.
    where : Path
        The file, for errors and as the folder of spectrum files.

    Returns
    -------
    materials : MaterialMap
        With provenance 'assigned' where the file speaks.

    Raises
    ------
    MaterialError
        If a group, face, ID or value is not there or does not fit.
    """
    if assignments.by == "face":
        return _assign_faces(estimated, assignments, library, where)
    materials = list(estimated.materials)
    named = {row.target for row in assignments.rows}
    for row in assignments.rows:
        if row.target == ALL_GROUPS:
            groups = [n for n, each in enumerate(materials) if str(n) not in named and not _is_pane(each)]
        else:
            groups = [int(row.target)]
        for group in groups:
            if group >= len(materials):
                raise _fault(where, row.line, expected=f"a group from 0 to {len(materials) - 1}", found=str(group))
            if _is_of_another_pane(row, materials[group]):
                continue
            _refuse_another(row, materials[group], library, where)
            materials[group] = _assigned(row, materials[group], library, where)
    return replace(estimated, materials=tuple(materials))


def check_assignments(assignments: Assignments, library: ReflectanceLibrary, *, where: Path) -> None:
    """Look every reflectance and value of a file of assignments up, before there are materials to assign them to.

    Parameters
    ----------
    assignments, library, where
        As in `assign`.

    Raises
    ------
    MaterialError
        If an ID or value is not there or does not fit.
    """
    stand_in = database_material(library.rows[0], library, provenance="default", confidence=0.0)
    for row in assignments.rows:
        _assigned(row, stand_in, library, where)


def _assign_faces(
    estimated: MaterialMap, assignments: Assignments, library: ReflectanceLibrary, where: Path
) -> MaterialMap:
    """Give single faces their materials; faces of one group and of equal rows share one."""
    materials = list(estimated.materials)
    face_material = estimated.face_material.copy()
    if assignments.face_count not in (None, face_material.size):
        raise MaterialError(
            expected=f"the numbers of the {face_material.size} faces that the scan has after repair",
            found=f"those of {assignments.face_count}",
            where=str(where),
            todo="The scan, a pane or a key under [scan] was changed since, so that other faces have these numbers. "
            "Give the materials anew in Blender, or by groups.",
        )
    made: dict[tuple[int, tuple[str, ...]], int] = {}
    for row in assignments.rows:
        face = int(row.target)
        if face >= face_material.size:
            raise _fault(where, row.line, expected=f"a face from 0 to {face_material.size - 1}", found=str(face))
        group = int(estimated.face_material[face])
        before = estimated.materials[group]
        if _is_pane(before):
            continue
        key = (group, (row.reflectance, *(f"{name}={value}" for name, value in row.surface.items())))
        if key not in made:
            made[key] = len(materials)
            materials.append(_assigned(row, before, library, where))
        face_material[face] = made[key]
    used, renamed = np.unique(face_material, return_inverse=True)
    return replace(estimated, materials=tuple(materials[n] for n in used), face_material=renamed)


def _assigned(row: Assignment, before: Material, library: ReflectanceLibrary, where: Path) -> Material:
    """Material of a row, over the one that was estimated."""
    material = before
    if not _is_as_written(row, before, library):
        try:
            if _is_file(row.reflectance):
                material = _file_material(where.parent / row.reflectance, row.reflectance)
            else:
                material = database_material(
                    library.find(row.reflectance), library, provenance="assigned", confidence=1.0
                )
        except DatabaseError as cause:
            raise _fault(
                where, row.line, expected="a reflectance of the databases or a file", found=str(cause)
            ) from cause
        material = replace(material, color=before.color)
    changes: dict[str, object] = {}
    for name in SURFACE_COLUMNS:
        if name in row.surface:
            try:
                changes[name] = finite_number(row.surface[name], where=name)
            except DatabaseError as cause:
                raise _fault(where, row.line, expected=f"{name} from 0 to 1", found=row.surface[name]) from cause
            if not 0.0 <= cast(float, changes[name]) <= 1.0:
                raise _fault(where, row.line, expected=f"{name} from 0 to 1", found=row.surface[name])
    if "kind" in row.surface:
        if row.surface["kind"] not in get_args(SurfaceKind):
            raise _fault(where, row.line, expected=f"one of {get_args(SurfaceKind)}", found=row.surface["kind"])
        changes["kind"] = row.surface["kind"]
    return replace(material, **changes)  # type: ignore[arg-type]


def database_material(
    surface: Reflectance, library: ReflectanceLibrary, *, provenance: Provenance, confidence: float
) -> Material:
    """Material of a database surface as it is.

    Parameters
    ----------
    surface : Reflectance
        Of the library.
    library : ReflectanceLibrary
        For its colour.
    provenance : str
        Why it has that material: 'assigned' or 'default'.
    confidence : float
        [0-1]

    Returns
    -------
    material : Material
    """
    color = np.clip(library.linear_srgb[library.rows.index(surface)], 0.0, 1.0)
    return Material(
        name=surface.name,
        category=surface.category,
        reflectance=surface.spectrum,
        kind="metal" if surface.kind == "metal" else "plastic",
        specularity=surface.specularity,
        roughness=surface.roughness,
        source=surface.key,
        provenance=provenance,
        confidence=confidence,
        measured_range_nm=surface.range_nm,
        color=(float(color[0]), float(color[1]), float(color[2])),
    )


def _file_material(path: Path, name: str) -> Material:
    read = read_spectrum_file(path, black_allowed=True)
    spectrum = read.spectrum.scaled(1.0 / PERCENT) if OF_PERCENT.search(read.unit) else read.spectrum
    if spectrum.range_nm[0] > VISIBLE_NM[1] or spectrum.range_nm[1] < VISIBLE_NM[0]:
        raise DatabaseError(
            expected=f"a reflectance of visible light, {VISIBLE_NM[0]:g} to {VISIBLE_NM[1]:g} nm",
            found=f"{spectrum.range_nm[0]:g} to {spectrum.range_nm[1]:g} nm",
            where=str(path),
            todo="Its first column is the wavelength in nm; divide ångström by 10.",
        )
    if spectrum.values.max() > MAX_REFLECTANCE:
        raise DatabaseError(
            expected=f"a reflectance of at most {MAX_REFLECTANCE}, as a fraction",
            found=f"{spectrum.values.max():g}",
            where=str(path),
            todo="Divide percent by 100.",
        )
    return Material(
        name=path.stem,
        category="unknown",
        reflectance=Spectrum(wavelengths_nm=spectrum.wavelengths_nm, values=spectrum.values, name=path.stem),
        source=name,
        provenance="assigned",
        confidence=1.0,
        measured_range_nm=spectrum.range_nm,
        color=(0.0, 0.0, 0.0),
    )


def _fault(path: Path, line: int, *, expected: str, found: str) -> MaterialError:
    return MaterialError(expected=expected, found=found, where=f"{path}, line {line}", todo="Mend that line.")
