"""Materials as `[materials]` of the run file requests them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import MaterialsSection
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.assignments import assign, give_all, read_assignments
from lidarspectra.material.estimate import (
    CountVotes,
    default_material,
    estimate_from_votes,
    one_material,
    votes_of,
)
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL
from lidarspectra.material.views.views import ViewSet
from lidarspectra.progress import Progress, silent
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import load_reflectances


def materials_of_run(
    scan: Scan,
    views: ViewSet,
    section: MaterialsSection,
    *,
    folder: Path,
    room: Room | None = None,
    face_color: FloatArray | None = None,
    votes: CountVotes | None = None,
    progress: Progress = silent,
) -> MaterialMap:
    """Estimate the materials, or give all faces one.

    Nothing is estimated where a file gives all surfaces one reflectance: only the colour in pictures is the scan's.

    Parameters
    ----------
    scan, views, room, face_color, progress
        As in `estimate_materials`.
    section : MaterialsSection
        `[materials]` of the run file.
    folder : Path
        Where relative file names start; the run file's folder.
    votes : callable, optional
        Gives the material classes that the views show, where their counting has begun (`votes_ahead`); they are counted
        here if left out.

    Returns
    -------
    materials : MaterialMap

    Raises
    ------
    MaterialError, DatabaseError
        As `estimate_materials`, and if a database is missing.
    """
    library = load_reflectances(section.databases, folder)
    if section.method == "default":
        return one_material(scan, section.default, library=library, views=views)
    if all_given(section, folder):
        return _in_mean_color(one_material(scan, section.default, library=library, views=views), scan)
    return estimate_from_votes(
        scan,
        views,
        votes or votes_of(model_of_run(section.model, folder), scan, views),
        room=room,
        face_color=face_color,
        library=library,
        fallback=default_material(section.default, library),
        matching=section.matching,
        colors=section.colors,
        progress=progress,
    )


def with_assignments_of_run(materials: MaterialMap, section: MaterialsSection, *, folder: Path) -> MaterialMap:
    """Materials with what the run's file of assignments says; the same where it has none.

    Parameters
    ----------
    materials : MaterialMap
        As they are written but for the file, with gloss and panes: so are the groups numbered that the file names.
    section : MaterialsSection
        `[materials]` of the run file.
    folder : Path
        Where relative file names start; the run file's folder.

    Returns
    -------
    materials : MaterialMap

    Raises
    ------
    MaterialError, DatabaseError
        If the file of assignments is invalid, or a database is missing.
    """
    if section.file is None:
        return materials
    path = folder / section.file
    return assign(materials, read_assignments(path), load_reflectances(section.databases, folder), where=path)


def all_given(section: MaterialsSection, folder: Path) -> bool:
    """Whether `[materials]` gives all surfaces one reflectance: nobody then asks what they look like.

    Parameters
    ----------
    section : MaterialsSection
    folder : Path
        Where relative file names start; the run file's folder.

    Returns
    -------
    given : bool
    """
    return section.method == "default" or (section.file is not None and give_all(folder / section.file))


def _in_mean_color(materials: MaterialMap, scan: Scan) -> MaterialMap:
    """A map of one material, drawn in the mean colour of the scan."""
    mean = np.average(materials.face_color, axis=0, weights=scan.areas)
    (material,) = materials.materials
    color = (float(mean[0]), float(mean[1]), float(mean[2]))
    return replace(materials, materials=(replace(material, color=color),))


def model_of_run(name: str, folder: Path) -> Path | None:
    """The network that `model` of the run file names, None for none."""
    if name == "none":
        return None
    return SHIPPED_MODEL if name == "builtin" else folder / name
