"""The scan of a room with its panes in place: flat rectangles where a scanner saw bulges, holes or images.

Screens stay as they were scanned: they are surfaces like others.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarspectra.arrays import BoolArray
from lidarspectra.geometry.appearance import NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.panes.mirrors import images_behind
from lidarspectra.room.panes.pane import REACH_M, Pane

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
        Without the mesh in and closely behind glass, and without the images behind mirrors. The new faces have no
        colour of their own, but for those that shine: they are white, as the picture shows them.
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
    kept = np.flatnonzero(~cut)
    count = len(scan.vertices)
    faces = np.concatenate([scan.faces[kept], count + np.array([[0, 1, 2], [0, 2, 3]])])
    vertices = np.concatenate([scan.vertices, pane.corners])
    appearance = scan.appearance.select(kept).with_more(_appearance(_shines(scan, in_pane)))
    used, renamed = np.unique(faces, return_inverse=True)
    changed = replace(scan, vertices=vertices[used], faces=renamed.reshape(-1, 3), appearance=appearance)
    record = replace(scan.record, faces_kept=len(changed.faces), area_m2=float(changed.areas.sum()))
    return replace(changed, record=record)


def _bulge(scan: Scan, pane: Pane) -> BoolArray:
    """(face,) which lie closely behind a pane."""
    height = pane.heights(scan.centers)
    close = (height < 0.0) & (height > -BULGE_M)
    return np.asarray(close & pane.covers(scan.centers, margin_m=REACH_M), dtype=np.bool_)


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
