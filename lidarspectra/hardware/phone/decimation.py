"""Decimation: fewer triangles for the same room, with its texture transferred.

Geometry is decimated by quadric edge collapse (pymeshlab) on merged vertices, so that texture seams neither bind nor
tear it. A new texture is then drawn for the remaining triangles, from the nearest point of the old surface.

References
----------
Garland and Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997.
"""

from dataclasses import replace
from typing import Any, TypedDict

import cv2
import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.meshlab import INSTALL_MESHLAB, load_pymeshlab
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Appearance, Scan, with_record
from lidarspectra.geometry.triangles import triangle_crosses
from lidarspectra.hardware.phone.texture_atlas import PADDING_PX, Atlas, unwrap
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.spectra.colorimetry import encode_srgb

SMALLEST_ATLAS_PX, LARGEST_ATLAS_PX = 512, 4096  # [px] edge of the new texture
REACH_M = 0.1  # [m] farthest that colour is looked for along the normal, on either side of the new surface
ROWS_AT_ONCE = 256  # texture rows drawn at once, a million points
SHARES = (0.6, 0.4)  # of the time: collapsing edges, transferring the texture
# Every parameter is given: what is left out keeps the value of the process's last call. A planar weight of 1e-3
# (pymeshlab's default) makes thin parts fall before flat ones: a door of 4 cm lost all its area.
COLLAPSE = {
    "qualitythr": 0.3,
    "preserveboundary": True,
    "boundaryweight": 1.0,
    "preservenormal": True,
    "preservetopology": False,
    "optimalplacement": True,
    "planarquadric": True,
    "planarweight": 1e-5,
    "qualityweight": False,
    "autoclean": True,
}
_CORNER_INSET = 0.02  # barycentric distance inside the face at which a corner's colour is read, away from neighbours


def decimate(scan: Scan, max_faces: int, *, progress: Progress = silent) -> Scan:
    """Reduce a scan to at most `max_faces` triangles.

    Parameters
    ----------
    scan : Scan
        Vertices merged by position.
    max_faces : int
        Largest number of triangles kept.
    progress : callable
        Called with the fraction done and what is being done.

    Returns
    -------
    scan : Scan
        With one new texture in place of all (or corner colours, if there were no textures); its record's
        `decimated_from` and `faces_kept` are set.

    Raises
    ------
    ScanError
        If no triangle is left.
    """
    count = scan.faces.shape[0]
    if count <= max_faces:
        return scan
    collapsing, carrying = shares(progress, SHARES)
    collapsing(0.0, f"decimating {count} triangles")
    vertices, faces = _collapsed(scan, max_faces)
    carrying(0.0, "transferring the texture")
    appearance, note = _carried(scan, vertices, faces, carrying)
    notes = scan.record.notes + (note,)
    if faces.shape[0] > max_faces:
        notes += (
            f"Decimation stopped at {faces.shape[0]} triangles, more than max_faces = {max_faces}, because removing"
            " more would change the shape of the room. The results are valid; the later stages only take longer.",
        )
    record = replace(scan.record, faces_kept=faces.shape[0], decimated_from=count, notes=notes)
    small = Scan(vertices=vertices, faces=faces, appearance=appearance, record=record)
    progress(1.0, f"{faces.shape[0]} triangles left")
    return with_record(small, replace(record, area_m2=float(small.areas.sum())))


def load_decimation() -> Any:
    """The library that decimates, pymeshlab; it takes long to load.

    Raises
    ------
    ScanError
        If it is not installed.
    """
    try:
        return load_pymeshlab()
    except ImportError as cause:
        raise ScanError(
            expected="pymeshlab, which decimation needs",
            found=str(cause),
            where="[scan] max_faces",
            todo=f"{INSTALL_MESHLAB.format(extra='decimate')} Or leave max_faces out: no run needs it.",
        ) from cause


def _collapsed(scan: Scan, max_faces: int) -> tuple[FloatArray, IntArray]:
    pymeshlab = load_decimation()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=scan.vertices, face_matrix=scan.faces.astype(np.int32)))
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=max_faces, **COLLAPSE)
    mesh = meshes.current_mesh()
    vertices = np.asarray(mesh.vertex_matrix(), dtype=np.float64)
    faces = np.asarray(mesh.face_matrix(), dtype=np.int64)
    if faces.shape[0] == 0 or not np.isfinite(vertices).all():
        raise ScanError(
            expected=f"a mesh of at most {max_faces} triangles",
            found="none after decimation",
            where=scan.record.file,
            todo="Raise max_faces in [scan].",
        )
    return vertices, faces


def _carried(scan: Scan, vertices: FloatArray, faces: IntArray, progress: Progress) -> tuple[Appearance, str]:
    old = scan.appearance
    finder = _ColorFinder(scan)
    corners = vertices[faces]
    crosses = triangle_crosses(corners)
    normals = crosses / np.maximum(np.linalg.norm(crosses, axis=1, keepdims=True), 1e-300)
    if not old.images:
        color = _corner_colors(finder, corners, normals)
        appearance = Appearance(
            images=(),
            face_image=np.full(faces.shape[0], -1),
            corner_uv=np.zeros((faces.shape[0], 3, 2)),
            corner_color=color,
            known=old.known,
            **finder.parts(corners, normals),
        )
        return appearance, "The colours were transferred to the corners of the decimated mesh's triangles."
    size = int(np.clip(64 * np.ceil(np.sqrt(old.pixels) / 64), SMALLEST_ATLAS_PX, LARGEST_ATLAS_PX))
    atlas = unwrap(vertices, faces, normals, size)
    image = _drawn(finder, atlas, corners, normals, progress)
    appearance = Appearance(
        images=(image,),
        face_image=np.zeros(faces.shape[0], dtype=np.int64),
        corner_uv=atlas.corner_uv,
        corner_color=np.zeros((faces.shape[0], 3, 3)),
        known=old.known,
        **finder.parts(corners, normals),
    )
    return appearance, f"A new texture of {size} x {size} pixels was drawn for the decimated mesh."


class PartFields(TypedDict):
    """The fields of an `Appearance` that say where a face's colour is from and what it is part of."""

    color_source: IntArray
    kinds: tuple[str, ...]
    face_kind: IntArray


class _ColorFinder:
    """The old surface, indexed to find the colour nearest to a point."""

    def __init__(self, scan: Scan) -> None:
        self._appearance = scan.appearance
        self._caster = RayCaster(scan)
        self._centers = cKDTree(scan.centers)

    def find(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """(n, 3) linear sRGB of the old surface straight below or above (n, 3) points, else of the nearest face."""
        return self._appearance.sample(*self._places(points, normals))

    def parts(self, corners: FloatArray, normals: FloatArray) -> PartFields:
        """What the old surface under the middle of each of (face, 3, 3) new triangles is part of."""
        face, _ = self._places(corners.mean(axis=1), normals)
        old = self._appearance
        return {"color_source": old.sources[face], "kinds": old.kinds, "face_kind": old.face_kinds[face]}

    def _places(self, points: FloatArray, normals: FloatArray) -> tuple[IntArray, FloatArray]:
        """(n,) face of the old surface under each point, and (n, 3) weights of its corners."""
        front = self._caster.nearest(points, normals, max_distance=REACH_M)
        back = self._caster.nearest(points, -normals, max_distance=REACH_M)
        use_front = front.distance < back.distance
        face = np.where(use_front, front.face, back.face)
        weights = np.where(use_front[:, np.newaxis], front.barycentric, back.barycentric)
        lost = np.flatnonzero(face < 0)
        if lost.size:
            face[lost] = self._centers.query(points[lost])[1]
            weights[lost] = 1.0 / 3.0
        return face, weights


def _corner_colors(finder: _ColorFinder, corners: FloatArray, normals: FloatArray) -> FloatArray:
    inset = corners + _CORNER_INSET * (corners.mean(axis=1, keepdims=True) - corners)
    colors = finder.find(inset.reshape(-1, 3), np.repeat(normals, 3, axis=0))
    return encode_srgb(colors).reshape(-1, 3, 3)


def _drawn(
    finder: _ColorFinder, atlas: Atlas, corners: FloatArray, normals: FloatArray, progress: Progress
) -> ByteArray:
    image = np.zeros((atlas.size_px, atlas.size_px, 3), dtype=np.uint8)
    kernel = np.ones((2 * PADDING_PX + 1, 2 * PADDING_PX + 1), dtype=np.uint8)
    wanted = cv2.dilate(atlas.covered.astype(np.uint8), kernel)  # texture lookups reach no farther beyond a chart
    for start in range(0, atlas.size_px, ROWS_AT_ONCE):
        rows, columns = np.nonzero(wanted[start : start + ROWS_AT_ONCE])
        rows += start
        face = atlas.texel_face[rows, columns]
        points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), corners[face])
        colors = finder.find(points, normals[face])
        image[rows, columns] = np.rint(255.0 * encode_srgb(colors)).astype(np.uint8)
        progress(min(1.0, (start + ROWS_AT_ONCE) / atlas.size_px), "transferring the texture")
    return image
