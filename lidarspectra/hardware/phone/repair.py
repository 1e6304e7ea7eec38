"""Repair of a scan's mesh: merge vertices, turn normals, close holes, leave out hidden layers, flatten planes.

Colour belongs to faces and their corners here, so that vertices can be merged and faces dropped without a texture's
seams getting in the way. Everything done is counted in the scan's record.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, distinct_rows, linked
from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Appearance, Scan, some_faces, with_record
from lidarspectra.geometry.triangles import triangle_areas
from lidarspectra.hardware.phone.decimation import decimate
from lidarspectra.hardware.phone.facing import connected_pieces, faces_to_turn
from lidarspectra.hardware.phone.flattening import flatten_scan
from lidarspectra.hardware.phone.holes import (
    NO_AREA_M2,
    SHEET_SHARE,
    Loop,
    find_loops,
    longest_extent,
    triangulate_loop,
)
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.room.hidden_layers import hidden_faces
from lidarspectra.spectra.colorimetry import encode_srgb

MERGE_DISTANCE_M = 1e-5  # [m] a hundredth of the scanner's noise; above the rounding of 32-bit files
MIN_FACE_AREA_M2 = 1e-10  # [m²] 0.01 mm x 0.01 mm; Radiance drops smaller triangles
MIN_HIDDEN_M2 = 0.5  # [m²] of hidden layers, below which they stay: the floor under a cabinet is none
SHARES = (
    0.05,
    0.05,
    0.15,
    0.25,
    0.1,
    0.4,
)  # of the time: merging, dropping, turning, closing, hidden layers, flattening
DECIMATING_SHARE = 1.0  # of the same; only where it is asked for


def repair_scan(
    scan: Scan,
    *,
    close_holes: bool = True,
    max_hole_m: float = 1.0,
    flatten: bool = False,
    max_faces: int | None = None,
    progress: Progress = silent,
) -> Scan:
    """Repair a scan.

    Parameters
    ----------
    scan : Scan
        As read.
    close_holes : bool
        Whether holes are closed, coloured as their rims.
    max_hole_m : float
        Longest extent of a hole that is closed. [m]
    flatten : bool
        Whether walls, table tops and other flat surfaces are made plane, and their edges straight.
    max_faces : int, optional
        Decimate to at most this many triangles.
    progress : callable
        Called with the fraction done and what is being done.

    Returns
    -------
    scan : Scan
        With the counts of all repairs in its record.

    Raises
    ------
    ScanError
        If no face is left.
    """
    decimating_share = 0.0 if max_faces is None else DECIMATING_SHARE
    merging, dropping, turning, closing, hiding, flattening, decimating = shares(progress, (*SHARES, decimating_share))
    merging(0.0, "merging vertices")
    scan = _merged(scan)
    dropping(0.0, "removing duplicate and degenerate triangles")
    scan = _without_bad_faces(scan)
    turning(0.0, "turning normals towards the room")
    scan = _turned(scan)
    closing(0.0, "closing holes")
    loops, loose_edges = find_loops(scan.faces)
    scan = _closed(scan, loops, loose_edges, max_hole_m if close_holes else 0.0, closing)
    hiding(0.0, "looking for hidden layers")
    if not scan.appearance.is_drawn:  # a model has no drift: its walls' backs, and 3 mm between two planes, are meant
        scan = _without_hidden_layers(scan)
        if flatten:
            scan = flatten_scan(scan, progress=flattening)
    if max_faces is not None:
        scan = decimate(scan, max_faces, progress=decimating)
    record = replace(scan.record, faces_kept=scan.faces.shape[0], area_m2=float(scan.areas.sum()))
    progress(1.0, "scan repaired")
    return with_record(scan, record)


def merged_numbers(vertices: FloatArray, distance: float = MERGE_DISTANCE_M) -> IntArray:
    """Number vertices so that those that coincide have the same number.

    Parameters
    ----------
    vertices : (vertex, 3) float
        [m]
    distance : float
        Vertices no further apart coincide. [m]

    Returns
    -------
    number : (vertex,) int
        From 0.
    """
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    pairs = cKDTree(unique).query_pairs(distance, output_type="ndarray")
    if not len(pairs):
        return inverse.ravel().astype(np.int64)
    return linked(pairs, len(unique))[inverse.ravel()]


def _merged(scan: Scan) -> Scan:
    number = merged_numbers(scan.vertices)
    _, first = np.unique(number, return_index=True)
    merged = scan.vertices.shape[0] - first.size
    record = replace(scan.record, merged_vertices=scan.record.merged_vertices + merged)
    return replace(scan, vertices=scan.vertices[first], faces=number[scan.faces], record=record)


def _without_bad_faces(scan: Scan) -> Scan:
    corners = np.sort(scan.faces, axis=1)
    repeated = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2])
    degenerate = repeated | (scan.areas < MIN_FACE_AREA_M2)
    double = np.ones(corners.shape[0], dtype=np.bool_)
    double[np.unique(distinct_rows(corners)[1], return_index=True)[1]] = False
    double &= ~degenerate
    kept = np.flatnonzero(~degenerate & ~double)
    if kept.size == 0:
        raise ScanError(
            expected="triangles that have an area",
            found=f"{corners.shape[0]} that have none",
            where=scan.record.file,
            todo="Check the unit in [scan], or export the scan again.",
        )
    record = replace(
        scan.record,
        duplicate_faces=scan.record.duplicate_faces + int(double.sum()),
        degenerate_faces=scan.record.degenerate_faces + int(degenerate.sum()),
    )
    return some_faces(scan, kept, record=record)


def _turned(scan: Scan) -> Scan:
    turn = faces_to_turn(scan)
    if not turn.any():
        return scan
    record = replace(scan.record, flipped_faces=scan.record.flipped_faces + int(turn.sum()))
    return replace(
        scan,
        faces=np.where(turn[:, np.newaxis], scan.faces[:, ::-1], scan.faces),
        appearance=replace(
            scan.appearance,
            corner_uv=_reversed_where(turn, scan.appearance.corner_uv),
            corner_color=_reversed_where(turn, scan.appearance.corner_color),
        ),
        record=record,
    )


def _reversed_where(turn: BoolArray, corners: FloatArray) -> FloatArray:
    return np.where(turn[:, np.newaxis, np.newaxis], corners[:, ::-1], corners)


def _closed(scan: Scan, loops: Sequence[Loop], loose_edges: int, max_hole_m: float, progress: Progress) -> Scan:
    """Close the loops of at most `max_hole_m` extent, and count the others."""
    piece, _ = connected_pieces(scan.faces)
    piece_area = np.bincount(piece, weights=scan.areas)
    rim_colors = _rim_colors(scan, loops)
    fills: list[IntArray] = []
    colors: list[FloatArray] = []
    beside: list[IntArray] = []
    closed_area = longest_open = 0.0
    closed = left_open = 0
    for done, (loop, rim_color) in enumerate(zip(loops, rim_colors, strict=True)):
        if done % 100 == 0:
            progress(done / len(loops), f"closing holes, {done} of {len(loops)}")
        points = scan.vertices[loop.vertices]
        extent = longest_extent(points)
        triangles = _fill(points) if 0.0 < extent <= max_hole_m else None
        area = 0.0 if triangles is None else float(triangle_areas(points[triangles]).sum())
        if triangles is not None and area < NO_AREA_M2:
            continue
        if triangles is None or area > SHEET_SHARE * piece_area[piece[loop.faces[0]]]:
            left_open += 1
            longest_open = max(longest_open, extent)
            continue
        closed += 1
        closed_area += area
        fills.append(loop.vertices[triangles])
        colors.append(rim_color[triangles])
        beside.append(np.full(len(triangles), loop.faces[0]))
    notes = scan.record.notes
    if loose_edges:
        notes += (
            f"{loose_edges} edges of the mesh belong to no closed rim and could not be closed. Light may leak there;"
            " mend the mesh in a mesh editor if they lie in a wall.",
        )
    if left_open:
        notes += (
            f"{left_open} openings of the mesh stay open, the longest {longest_open:.2f} m; light that reaches them is"
            " lost. Scan the room again there, or raise max_hole_m in [scan] if they are holes in a surface.",
        )
    record = replace(
        scan.record,
        holes_closed=scan.record.holes_closed + closed,
        hole_area_m2=scan.record.hole_area_m2 + closed_area,
        holes_open=left_open,
        longest_open_hole_m=longest_open,
        notes=notes,
    )
    if not fills:
        return with_record(scan, record)
    return _with_faces(
        replace(scan, record=record), np.concatenate(fills), np.concatenate(colors), np.concatenate(beside)
    )


def _without_hidden_layers(scan: Scan) -> Scan:
    """Leave out the faces that nobody in the room can see; before flattening, which would draw two layers together."""
    hidden = hidden_faces(scan)
    area = float(scan.areas[hidden].sum())
    if area < MIN_HIDDEN_M2:
        return scan
    kept = np.flatnonzero(~hidden)
    note = (
        f"{area:.1f} m² of the scan ({100 * area / float(scan.areas.sum()):.0f} % of its area) lie hidden behind other "
        "surfaces, where nobody in the room can see them, as where drift made two walls of one: they were left out of "
        "the room. Nothing needs to be done unless a room is missing; then scan it with its door open."
    )
    record = replace(
        scan.record,
        hidden_faces=scan.record.hidden_faces + int(hidden.sum()),
        hidden_area_m2=scan.record.hidden_area_m2 + area,
        notes=(*scan.record.notes, note),
    )
    return some_faces(scan, kept, record=record)


def _fill(points: FloatArray) -> IntArray | None:
    return triangulate_loop(points) if len(points) >= 3 else None


def _rim_colors(scan: Scan, loops: Sequence[Loop]) -> list[FloatArray]:
    """(n, 3) sRGB-encoded colours at each rim's vertices: of the two faces beside each, the mean in linear light."""
    if not loops:
        return []
    colors = scan.appearance.colors_of(np.concatenate([loop.faces for loop in loops]))
    of_loops = np.split(colors, np.cumsum([loop.faces.size for loop in loops])[:-1])
    return [encode_srgb(0.5 * (beside + np.roll(beside, 1, axis=0))) for beside in of_loops]


def _with_faces(scan: Scan, faces: IntArray, corner_color: FloatArray, beside: IntArray) -> Scan:
    """A scan with faces that close holes; each is part of what the face beside it is part of."""
    count = faces.shape[0]
    added = Appearance(
        images=(),
        face_image=np.full(count, -1),
        corner_uv=np.zeros((count, 3, 2)),
        corner_color=corner_color,
        known=scan.appearance.known,
        color_source=scan.appearance.sources[beside],
        kinds=scan.appearance.kinds,
        face_kind=scan.appearance.face_kinds[beside],
    )
    return replace(scan, faces=np.concatenate([scan.faces, faces]), appearance=scan.appearance.with_more(added))
