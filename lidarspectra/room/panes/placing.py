"""The scan of a room with its panes in place: flat rectangles where a scanner saw bulges, holes or images.

Screens stay as they were scanned: they are surfaces like others.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, distinct_rows
from lidarspectra.geometry.appearance import NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.geometry.scan import Scan, some_faces, with_record
from lidarspectra.room.panes.mirrors import images_behind
from lidarspectra.room.panes.pane import REACH_M, Pane
from lidarspectra.spectra.colorimetry import encode_srgb

COLLAR_M = 2.0 * REACH_M  # [m] from a pane, within which the edge of the mesh around it is its frame
MIN_AREA_M2 = 1e-9  # [m²] of a face: the mesh's edge may lie on the pane's already
BULGE_M = 1.0  # [m] behind a pane of glass within which the mesh is made of few returns, and no surface
WHITE = 0.9  # [1] linear, of all channels: about where pictures are cut
SHINING = 0.5  # [1] of the area that a pane takes the place of, cut at white, from which it shines in the picture


def with_panes(scan: Scan, panes: Sequence[Pane]) -> Scan:
    """A scan with its glass and mirrors as flat panes.

    Parameters
    ----------
    scan : Scan
        Repaired.
    panes : sequence of Pane

    Returns
    -------
    scan : Scan
        Without the mesh in and closely behind glass, and without the images behind mirrors; what is left around a pane
        is joined to its rim. The panes' faces have no colour of their own, but for those that shine: they are white, as
        the picture shows them. Those between mesh and rim have the colour of the face beside them.
    """
    for pane in panes:
        if pane.kind != "screen":
            scan = _placed(scan, pane)
    return scan


def _placed(scan: Scan, pane: Pane) -> Scan:
    in_pane = pane.members(scan.centers)
    cut = in_pane | (images_behind(scan, pane) if pane.kind == "mirror" else _bulge(scan, pane))
    if cut.all():
        return scan
    shines = _shines(scan, in_pane)
    around = _joined_to_rim(some_faces(scan, np.flatnonzero(~cut)), pane)
    count = len(around.vertices)
    changed = _with_faces(
        around, pane.corners, count + np.array([[0, 1, 2], [0, 2, 3]]), around.appearance.with_more(_appearance(shines))
    )
    record = replace(
        scan.record,
        faces_kept=len(changed.faces),
        area_m2=float(changed.areas.sum()),
        cut_faces=scan.record.cut_faces + int(cut.sum()),
        cut_area_m2=scan.record.cut_area_m2 + float(scan.areas[cut].sum()),
    )
    return with_record(changed, record)


def _bulge(scan: Scan, pane: Pane) -> BoolArray:
    """(face,) which lie closely behind a pane. What lies beside it, even behind its wall, may be the room beyond."""
    height = pane.heights(scan.centers)
    return np.asarray((height < 0.0) & (height > -BULGE_M) & pane.covers(scan.centers), dtype=np.bool_)


def _joined_to_rim(scan: Scan, pane: Pane) -> Scan:
    """A scan whose edge around a pane is joined to the pane, so that no slit is left between them.

    Each end of an edge that belongs to one face only, and is close, is joined to the nearest point of the pane's
    rectangle. The nearest point of a convex set moves continuously, so that the new faces hang together.
    """
    starts, ends, beside = _open_edges(scan.faces)
    foot = pane.nearest(scan.vertices)
    close = np.linalg.norm(scan.vertices - foot, axis=1) <= COLLAR_M
    chosen = close[starts] & close[ends]
    starts, ends, beside = starts[chosen], ends[chosen], beside[chosen]
    rim = len(scan.vertices)  # a foot has the number of its vertex, behind all vertices
    # The other way round than the face beside it.
    faces = np.concatenate([np.stack([ends, starts, rim + starts], 1), np.stack([ends, rim + starts, rim + ends], 1)])
    beside = np.tile(beside, 2)
    places = np.concatenate([scan.vertices, foot])
    first, second, third = (places[faces[:, corner]] for corner in range(3))
    has_area = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1) > MIN_AREA_M2
    faces, beside = faces[has_area], beside[has_area]
    of_beside = scan.appearance.select(beside)
    count = len(faces)
    colored = replace(
        of_beside,
        images=(),
        face_image=np.full(count, -1),
        corner_uv=np.zeros((count, 3, 2)),
        corner_color=np.repeat(encode_srgb(np.clip(scan.face_colors()[beside], 0.0, 1.0))[:, None], 3, axis=1),
        linear=None,
    )
    return _with_faces(scan, foot, faces, scan.appearance.with_more(colored))


def _open_edges(faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Vertices from and to which the edges of one face only run, and these (edge,) faces."""
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys = np.stack([np.minimum(starts, ends), np.maximum(starts, ends)], axis=1)
    edge = distinct_rows(keys)[1]
    alone = np.flatnonzero(np.bincount(edge)[edge] == 1)
    return starts[alone], ends[alone], alone // 3


def _with_faces(scan: Scan, vertices: FloatArray, faces: IntArray, appearance: Appearance) -> Scan:
    """A scan with vertices and faces behind its own, without vertices of no face; the appearance is of all faces."""
    every = np.concatenate([scan.faces, faces])
    used, renamed = np.unique(every, return_inverse=True)
    return replace(
        scan,
        vertices=np.concatenate([scan.vertices, vertices])[used],
        faces=renamed.reshape(-1, 3),
        appearance=appearance,
    )


def _shines(scan: Scan, faces: BoolArray) -> bool:
    """Whether most of the area of some faces is cut at white in the picture."""
    if not (scan.appearance.known and faces.any()):
        return False
    white = scan.face_colors()[faces].min(axis=1) > WHITE
    return bool((scan.areas[faces] * white).sum() > SHINING * scan.areas[faces].sum())


def _appearance(shines: bool) -> Appearance:
    return Appearance(
        images=(),
        face_image=np.full(2, -1),
        corner_uv=np.zeros((2, 3, 2)),
        corner_color=np.full((2, 3, 3), 1.0 if shines else NEUTRAL_COLOR),
        color_source=np.full(2, PHOTOGRAPHED if shines else NO_COLOR),
    )
