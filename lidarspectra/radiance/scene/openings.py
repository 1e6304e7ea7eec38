"""The mesh with holes at the windows, for the sun to shine through."""

from dataclasses import replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import Opening
from lidarspectra.radiance.scene.daylight import openings_of

REVEAL_M = 0.5  # [m] outside a window's plane in which the mesh is taken out of the sun's way: pane, frame, reveal
CURTAIN_M = 0.1  # [m] the same inside
CUT_EDGE_M = 0.05  # [m] triangles at a window's rim are cut to such edges before any is taken out
PRISM_LOW = np.array([-0.5, -0.5, -REVEAL_M])
PRISM_HIGH = np.array([0.5, 0.5, CURTAIN_M])


def open_windows(scan: Scan, face_material: IntArray, sun: Lamp) -> tuple[Scan, IntArray]:
    """Take the mesh out of the sun's way through the windows.

    Near a window's plane, the sunbeam through its rectangle is a slanted prism. Triangles that reach into it are cut in
    four until their edges are 5 cm, and those whose centre lies within it go.

    Parameters
    ----------
    scan : Scan
    face_material : (face,) int
    sun : Lamp
        With its openings.

    Returns
    -------
    scan : Scan
        Without colour.
    face_material : (face,) int
    """
    corners = scan.corners
    material = np.asarray(face_material)
    for opening in openings_of(sun):
        while True:
            edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
            coarse = (edges > CUT_EDGE_M) & _reaches(corners, opening, sun.normal)
            if not coarse.any():
                break
            corners = np.concatenate([corners[~coarse], _quarters(corners[coarse])])
            material = np.concatenate([material[~coarse], np.repeat(material[coarse], 4)])
        local = _local(corners.mean(axis=1), opening, sun.normal)
        inside = ((local > PRISM_LOW) & (local < PRISM_HIGH)).all(axis=1)
        corners, material = corners[~inside], material[~inside]
    opened = bare_scan(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return replace(opened, record=scan.record), np.asarray(material, dtype=np.int64)


def _local(points: FloatArray, opening: Opening, beam: FloatArray) -> FloatArray:
    """(..., 3) where the sunbeam through each point meets the opening's plane, and how far away.

    The first two are along its length and width, in units of them from its middle; the third is along the inward
    normal [m].
    """
    length, width = opening.corners[1] - opening.corners[0], opening.corners[3] - opening.corners[0]
    offsets = points - opening.corners.mean(axis=0)
    depth = offsets @ opening.inward
    met = offsets - (depth / (beam @ opening.inward))[..., None] * beam
    return np.stack([met @ length / (length @ length), met @ width / (width @ width), depth], axis=-1)


def _reaches(corners: FloatArray, opening: Opening, beam: FloatArray) -> BoolArray:
    """(face,) whether the box around a face, in the opening's slanted axes, meets the prism."""
    local = _local(corners, opening, beam)
    return np.asarray(((local.min(axis=1) < PRISM_HIGH) & (local.max(axis=1) > PRISM_LOW)).all(axis=1))


def _quarters(corners: FloatArray) -> FloatArray:
    """(4 face, 3, 3) the four triangles between corners and edge middles."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3, 3)
