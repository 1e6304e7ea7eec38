"""Estimate the materials of a scan: MS, DM and RPP of the paper's Algorithm 1, on the chosen views.

Each face has a colour; primary colours are found among all faces, and every face takes one of them, by its own colour
and by what its neighbours take. Each face also gets a material class, from a network's votes in all views and from
its place in the room. Faces of one primary colour and one class are a segment, and each segment becomes a material
by matching its colour to the reflectance databases, with a preference for surfaces of its class.

The colour that a phone's texture shows is reflectance times light: nothing here removes the light. All steps work
on a (face, 3) array of linear colours, so that de-lit colours can be given in place of the texture's.
"""

from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import get_args

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arguments import instance_of, one_of, path_of
from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import DatabaseError, MaterialError
from lidarspectra.geometry.appearance import CLOSED_KINDS
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.assignments import database_material
from lidarspectra.material.colors import color_words, mean_color, primary_colors, saturated, surface_colors
from lidarspectra.material.matching import Match, MatchMethod, match_color
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.material.part_materials import named_prior, typical_materials
from lidarspectra.material.segmentation.color_priors import color_likelihood
from lidarspectra.material.segmentation.face_groups import (
    Adjacency,
    agreement,
    face_adjacency,
    smooth_labels,
)
from lidarspectra.material.segmentation.fusion import FaceClasses, fuse, split_by_class, view_votes
from lidarspectra.material.segmentation.place_priors import class_prior, find_places
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL, Classifier
from lidarspectra.material.segmentation.surface_classes import favored_surfaces
from lidarspectra.material.unseen_faces import unseen_faces
from lidarspectra.material.views.views import ViewSet
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import LEVEL_COSINE, LEVEL_HALF_WIDTH_M, SHOWN_M2
from lidarspectra.spectra.colorimetry import linear_srgb_to_lab, linear_srgb_to_xyz
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.spectra.reflectance_library import ReflectanceLibrary
from lidarspectra.words import counted

CountVotes = Callable[[Progress], FaceClasses]
"""Gives what the views show on every face, and tells its progress."""

SEED = 20241104  # of K-means; materials of one scan are the same on every run
UNSEEN_EVIDENCE = 0.1  # [1] weight of the colour of a face that no view saw, relative to one seen whole
MIN_SHARE = 2e-4  # [1] of the area; smaller groups of faces join the material nearest in colour
CONFIDENT_DIFFERENCE = 10.0  # [1] CIEDE2000 to the nearest surface at which confidence has fallen to 1/e
DEFAULT_MATERIAL = "white-plastic"  # ID of a built-in reflectance
UNKNOWN = "unknown"  # class of a material where none was estimated
SHARES = (0.08, 0.88, 0.04)  # of the time: grouping by colour, classes, matching
CLASS_SHARES = (0.97, 0.03)  # of the time of the classes: the views', the faces'
VISIBLE_BANDS_NM = (400.0, 770.0)  # [nm] range of the sensor's first 14 channels


def estimate_materials(
    scan: Scan,
    views: ViewSet,
    *,
    room: Room | None = None,
    face_color: FloatArray | None = None,
    library: ReflectanceLibrary | None = None,
    default: str = DEFAULT_MATERIAL,
    matching: MatchMethod = "wiener",
    model: str | PathLike[str] | None = SHIPPED_MODEL,
    colors: int = 24,
    progress: Progress = silent,
) -> MaterialMap:
    """Give every face of a scan a reflectance spectrum.

    Parameters
    ----------
    scan : Scan
    views : ViewSet
        Of this scan; a face that no view saw takes the material of its neighbours.
    room : Room, optional
        In the scan; without it the classes come from the pictures alone.
    face_color : (face, 3) float, optional
        Linear sRGB to use in place of the texture's, for instance de-lit. [0-1]
    library : ReflectanceLibrary, optional
        Reflectances that colours are matched to (`load_reflectances`); the built-in ones by default.
    default : str
        ID of the material of faces without colour and without name, and of those that show a lamp. Faces without
        colour whose kind the scan names (a wall, a closed ceiling) get the typical reflectance of such things.
    matching : str
        From a colour to a spectrum: 'wiener', estimated over the nearest colours, or 'nearest', as in the paper.
    model : str, path or None
        Network that tells material classes, an ONNX file with its card beside it; None does without classes.
    colors : int
        Largest number of primary colours for K-means, 1 to 200.
    progress : callable
        Receives the share that is done.

    Returns
    -------
    materials : MaterialMap
        By descending area. `assignments.assign` gives some of them other reflectances.

    Raises
    ------
    ArgumentError
        If scan or views have the wrong type, or the matching is unknown.
    MaterialError
        If colours and views do not belong to the scan, or the model cannot be read.
    DatabaseError
        If the default material is not there.
    """
    instance_of(scan, Scan, name="scan", todo="Make it with read_scan(...) and repair_scan(...).")
    instance_of(views, ViewSet, name="views", todo="render_views makes them.")
    one_of(matching, get_args(MatchMethod), name="matching")
    known = load_reflectances() if library is None else library
    fallback = default_material(default, known)
    votes = votes_of(None if model is None else path_of(model, name="model"), scan, views)
    return estimate_from_votes(
        scan, views, votes, room=room, face_color=face_color, library=known, fallback=fallback, matching=matching,
        colors=colors, progress=progress,
    )  # fmt: skip


def estimate_from_votes(
    scan: Scan,
    views: ViewSet,
    votes: CountVotes | None,
    *,
    room: Room | None,
    face_color: FloatArray | None,
    library: ReflectanceLibrary,
    fallback: Material,
    matching: MatchMethod,
    colors: int,
    progress: Progress = silent,
) -> MaterialMap:
    """As `estimate_materials`, with what counts the views' votes, which may have begun beside other work.

    Parameters
    ----------
    scan, views, room, face_color, library, matching, colors, progress
        As in `estimate_materials`.
    votes : callable, optional
        Gives the material classes that the views show on every face, and is told whom to tell its progress. None does
        without classes.
    fallback : Material
        Of faces without colour and without name.

    Returns
    -------
    materials : MaterialMap
    """
    grouping, looking, finding = shares(progress, SHARES)
    grouping(0.0, "reading colours")
    shown, usable = _shown_colors(scan) if face_color is None else _given_colors(scan, face_color)
    if views.face_seen.size != len(scan.faces):
        raise MaterialError(
            expected=f"views of this scan ({len(scan.faces)} faces)",
            found=f"views of one with {views.face_seen.size}",
            where="views",
            todo="Run the views stage again.",
        )
    adjacency = face_adjacency(scan)
    neighbors = agreement(adjacency, linear_srgb_to_lab(shown), scan.normals)
    label, count = find_groups(scan, shown, usable, views.face_seen, neighbors, most=colors)
    names = (UNKNOWN,) * count
    if count and votes is not None:
        classes = material_classes(
            scan, votes, room=room, colors=shown, adjacency=adjacency, neighbors=neighbors, progress=looking
        )
        label, count, names = split_by_class(label, classes, scan.areas, most=colors)
    finding(0.0, f"{count} segments")
    materials = [
        _material(group, names[group], shown, label, scan.areas, views.face_seen, library, matching)
        for group in range(count)
    ]
    label = _with_rest_of_ceiling(scan, label)
    typical, kind = typical_materials(scan.appearance, label < 0)
    materials += typical
    label = np.where(kind >= 0, count + kind, label)
    count += len(typical)
    if (label < 0).any():
        label = np.where(label < 0, count, label)
        materials.append(fallback)
    materials = _distinct_names(materials)
    progress(1.0, counted(len(materials), "material"))
    return MaterialMap(materials=tuple(materials), face_material=label, face_color=shown, face_seen=views.face_seen)


def _with_rest_of_ceiling(scan: Scan, label: IntArray) -> IntArray:
    """(face,) groups, -1 for none, where what closes a ceiling is of what was scanned of it, if anything."""
    closing = scan.appearance.of_kind(CLOSED_KINDS[0]) & (label < 0)
    if not closing.any():
        return label
    height = float(np.median(scan.centers[closing, 2]))
    ceiling = (label >= 0) & (scan.normals[:, 2] < -LEVEL_COSINE)
    ceiling &= np.abs(scan.centers[:, 2] - height) < LEVEL_HALF_WIDTH_M
    areas = np.bincount(label[ceiling], weights=scan.areas[ceiling])
    if areas.sum() < SHOWN_M2:
        return label
    return np.where(closing, int(areas.argmax()), label)


def one_material(
    scan: Scan,
    material: str | Material = DEFAULT_MATERIAL,
    *,
    library: ReflectanceLibrary | None = None,
    views: ViewSet | None = None,
) -> MaterialMap:
    """Give all faces of a scan one material, as a baseline for an estimate.

    Parameters
    ----------
    scan : Scan
    material : str or Material
        ID of a reflectance, or a material.
    library : ReflectanceLibrary, optional
        That has the ID; the built-in one by default.
    views : ViewSet, optional
        Of the scan, for what of it was seen.

    Returns
    -------
    materials : MaterialMap

    Raises
    ------
    DatabaseError
        If there is no such reflectance.
    """
    if not isinstance(material, Material):
        material = default_material(material, load_reflectances() if library is None else library)
    colors, _ = surface_colors(scan)
    count = len(scan.faces)
    return MaterialMap(
        materials=(material,),
        face_material=np.zeros(count, dtype=np.int64),
        face_color=colors,
        face_seen=np.zeros(count) if views is None else views.face_seen,
    )


def default_material(name: str, library: ReflectanceLibrary) -> Material:
    """Material of what no view shows: of the library or, where colours are matched elsewhere, a built-in one.

    Parameters
    ----------
    name : str
        ID or key of a reflectance.
    library : ReflectanceLibrary
        That colours are matched in.

    Returns
    -------
    material : Material

    Raises
    ------
    DatabaseError
        If neither has it.
    """
    try:
        surface = library.find(name)
    except DatabaseError:
        library = load_reflectances()
        surface = library.find(name)
    return database_material(surface, library, provenance="default", confidence=0.0)


def votes_of(model: Path | None, scan: Scan, views: ViewSet) -> CountVotes | None:
    """What counts the votes of a scan's views by a network, on all cores; None without a network."""
    if model is None:
        return None
    return lambda progress: view_votes(Classifier(model), scan, views, progress)


def material_classes(
    scan: Scan,
    votes: CountVotes,
    *,
    room: Room | None,
    colors: FloatArray,
    adjacency: Adjacency,
    neighbors: csr_array,
    progress: Progress = silent,
) -> FaceClasses:
    """Material class of every face: the views' votes, the room's geometry, the colour, and the neighbours.

    Parameters
    ----------
    scan : Scan
    votes : callable
        Gives what the views show on every face, see `fusion.view_votes`; is told whom to tell its progress.
    room : Room or None
        In the scan; None leaves the geometry out.
    colors : (face, 3) float
        Linear sRGB, which excludes some classes. [0-1]
    adjacency : Adjacency
        Of the scan's faces.
    neighbors : (face, face) sparse float
        See `face_groups.agreement`.
    progress : callable

    Returns
    -------
    classes : FaceClasses
    """
    looking, fusing = shares(progress, CLASS_SHARES)
    seen = votes(looking)
    fusing(0.0, "material classes of faces")
    prior = color_likelihood(linear_srgb_to_lab(colors), seen.classes)
    if room is not None:
        by_place = class_prior(find_places(scan, room, adjacency), seen.classes)
        prior = prior * named_prior(scan.appearance, seen.classes, by_place)
    return fuse(seen, neighbors, prior)


def find_groups(
    scan: Scan, colors: FloatArray, usable: BoolArray, seen: FloatArray, neighbors: csr_array, *, most: int
) -> tuple[IntArray, int]:
    """Group faces by primary colour, with a smoothness term for neighbours of similar colour.

    Parameters
    ----------
    scan : Scan
    colors : (face, 3) float
        Linear sRGB. [0-1]
    usable : (face,) bool
        Whose colour shows a surface.
    seen : (face,) float
        Share of each face that some view saw. [0-1]
    neighbors : (face, face) sparse float
        See `face_groups.agreement`.
    most : int
        Largest number of groups.

    Returns
    -------
    label : (face,) int
        -1 for faces that are not usable.
    count : int
        Number of groups; each has faces.
    """
    areas = scan.areas
    label = np.full(len(colors), -1, dtype=np.int64)
    evidence = UNSEEN_EVIDENCE + (1.0 - UNSEEN_EVIDENCE) * seen
    weight = areas * evidence * usable
    if not weight.sum() > 0:
        return label, 0
    lab = linear_srgb_to_lab(colors)
    found = primary_colors(lab[usable], weight[usable], most=most, random=np.random.default_rng(SEED))
    centers = found.lab
    label = smooth_labels(lab, centers, evidence * usable, neighbors)
    share = np.bincount(label[usable], weights=areas[usable], minlength=len(centers)) / areas[usable].sum()
    large = np.flatnonzero(share >= min(MIN_SHARE, float(share.max())))
    if large.size < len(centers):
        label = large[np.linalg.norm(centers[label][:, None] - centers[large][None], axis=2).argmin(axis=1)]
    label[~usable] = -1
    kept = np.unique(label[label >= 0])
    by_area = kept[np.argsort(-share[kept], kind="stable")]
    renamed = np.full(len(centers) + 1, -1, dtype=np.int64)
    renamed[by_area] = np.arange(by_area.size)
    return renamed[label], int(by_area.size)


def _shown_colors(scan: Scan) -> tuple[FloatArray, BoolArray]:
    """Linear colours of a scan, what no picture shows as what it is taken for, and which of them show a surface."""
    shown, usable = surface_colors(scan)
    unseen = unseen_faces(scan, usable)
    usable[unseen.faces] = True
    return unseen.filled(shown), usable


def _given_colors(scan: Scan, given: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Linear colours that the caller gives, and which of them show a surface."""
    colors = np.clip(float_array(given, name="face_color", shape=(len(scan.faces), 3)), 0.0, 1.0)
    return colors, ~saturated(colors)


def _material(
    group: int,
    name: str,
    colors: FloatArray,
    label: IntArray,
    areas: FloatArray,
    seen: FloatArray,
    library: ReflectanceLibrary,
    matching: MatchMethod,
) -> Material:
    """Material of a segment: its inliers' mean colour, matched."""
    member = label == group
    color = mean_color(colors[member], areas[member])
    favored = None if name == UNKNOWN else favored_surfaces(library, name)
    match = match_color(linear_srgb_to_xyz(color), library, method=matching, favored=favored)
    words = color_words(linear_srgb_to_lab(color)) + ("" if name == UNKNOWN else f" {name}")
    measured = match.provenance == "measured"
    return Material(
        name=f"{words}, as {match.nearest.name}" if measured else words,
        category=match.nearest.category if name == UNKNOWN and measured else name,
        reflectance=match.spectrum,
        source=match.nearest.key if measured else f"recovered ({match.method}), near {match.nearest.key}",
        provenance=match.provenance,
        confidence=_confidence(match, float(np.average(seen[member], weights=np.maximum(areas[member], 1e-12)))),
        measured_range_nm=match.measured_range_nm,
        color=(float(color[0]), float(color[1]), float(color[2])),
        uncertainty=match.uncertainty,
    )


def _confidence(match: Match, seen: float) -> float:
    """Confidence from 0 to 1 (a score, not a probability): colour match, seen share, measured range.

    exp(-difference / 10) x (1 + seen) / 2 x share of 400 to 770 nm that was measured.
    """
    low = max(match.measured_range_nm[0], VISIBLE_BANDS_NM[0])
    high = min(match.measured_range_nm[1], VISIBLE_BANDS_NM[1])
    measured = max(0.0, high - low) / (VISIBLE_BANDS_NM[1] - VISIBLE_BANDS_NM[0])
    difference = max(match.difference, match.color_error)
    return float(np.exp(-difference / CONFIDENT_DIFFERENCE) * 0.5 * (1.0 + seen) * measured)


def _distinct_names(materials: list[Material]) -> list[Material]:
    """Append numbers to repeated names."""
    named, count = [], dict.fromkeys((material.name for material in materials), 0)
    names = [material.name for material in materials]
    for material in materials:
        count[material.name] += 1
        number = f" {count[material.name]}" if names.count(material.name) > 1 else ""
        named.append(replace(material, name=material.name + number))
    return named
