"""A scan whose large triangles are split, where what a triangle shows has to be of one place."""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.scan import Scan

MOST_HALVINGS = 20  # of an edge: a kilometre becomes a millimetre
PARTS_PER_SQUARE = 8.0  # triangles that halving may make of the square of the longest edge, about
MOST_PARTS = 1_000_000  # of a whole scan, about: more would take gigabytes, as of a field of two triangles


@dataclass(frozen=True, kw_only=True, eq=False)
class SmallFaces:
    """A scan and the same surface in smaller triangles.

    Parameters
    ----------
    scan : Scan
        Of the small faces.
    parent : (small,) int
        The face of the other scan that each is a part of.
    """

    scan: Scan
    parent: IntArray

    def mean(self, values: FloatArray, weights: FloatArray) -> FloatArray:
        """(face, ...) means of (small, ...) values over each face's parts by area and by (small,) weights [1].

        Where a face's parts weigh nothing together, it is their plain mean by area.
        """
        count = int(self.parent.max()) + 1
        area = self.scan.areas
        total = np.bincount(self.parent, weights=area * weights, minlength=count)
        weights = np.where(total[self.parent] > 0, area * weights, area)
        total = np.bincount(self.parent, weights=weights, minlength=count)
        flat = values.reshape(len(values), -1)
        sums = [np.bincount(self.parent, weights=weights * column, minlength=count) for column in flat.T]
        return np.asarray((np.stack(sums, axis=1) / total[:, None]).reshape(count, *values.shape[1:]), dtype=np.float64)


def small_faces(scan: Scan, longest_m: float) -> SmallFaces:
    """Split triangles until no edge is longer; neighbours keep shared edges, and parts their place in the texture.

    Parameters
    ----------
    scan : Scan
    longest_m : float
        Longest edge; more where the surface would come to more than some `MOST_PARTS` parts, from 25,000 m² on. [m]

    Returns
    -------
    small : SmallFaces
        Of the scan itself, with its faces in their order, where none is too long.
    """
    corners = scan.corners
    longest_m = max(longest_m, float(np.sqrt(PARTS_PER_SQUARE * scan.areas.sum() / MOST_PARTS)))
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    if edges.max() <= longest_m:
        return SmallFaces(scan=scan, parent=np.arange(len(scan.faces)))
    from trimesh.remesh import subdivide_to_size  # loads slowly

    vertices, faces, parent = subdivide_to_size(  # type: ignore[no-untyped-call]
        scan.vertices, scan.faces, max_edge=longest_m, max_iter=MOST_HALVINGS, return_index=True
    )
    order = np.argsort(parent, kind="stable")  # as the faces were, so that samples of what stays whole stay too
    faces, parent = np.asarray(faces, dtype=np.int64)[order], np.asarray(parent, dtype=np.int64)[order]
    appearance = scan.appearance.split(parent, _barycentric(vertices[faces], corners[parent]))
    fine = Scan(vertices=vertices, faces=faces, appearance=appearance, record=scan.record)
    return SmallFaces(scan=fine, parent=parent)


def _barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(face, 3, 3) weights of each face's (face, 3, 3) corners that make up its (face, 3, 3) points, slivers too."""
    from trimesh.triangles import points_to_barycentric

    flat = points_to_barycentric(np.repeat(corners, 3, axis=0), points.reshape(-1, 3))  # type: ignore[no-untyped-call]
    weights = flat.reshape(-1, 3, 3)
    even = ~np.isfinite(weights).all(axis=2, keepdims=True)
    return np.clip(np.where(even, 1.0 / 3.0, weights), 0.0, 1.0)
