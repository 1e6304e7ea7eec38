"""Rays against a scan, by Embree: which face is met first, how far away and where on it; or whether any is met."""

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import ArrayLike, NDArray

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import ArrayError
from lidarspectra.geometry.scan import Mesh, Scan, mesh_of

RAYS_AT_ONCE = 1_000_000  # bounds the memory that one call takes to about 100 MB
NOTHING = -1  # Embree's number of a geometry where a ray met none


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """What rays met first.

    Parameters
    ----------
    face : (ray,) int
        Index of the face; -1 where the ray met nothing.
    distance : (ray,) float
        In units of the direction's length; infinite where the ray met nothing.
    barycentric : (ray, 3) float
        Weights of the face's corners at the point met; zeros where the ray met nothing. [1]
    """

    face: IntArray
    distance: FloatArray
    barycentric: FloatArray

    @property
    def met(self) -> BoolArray:
        """(ray,) whether the ray met a face."""
        return self.face >= 0


class RayCaster:
    """A scan's triangles, loaded for ray casting.

    Parameters
    ----------
    scan : Scan
        Its coordinates are moved to its own centre before they become single precision, so that a scan in map
        coordinates (thousands of metres from the origin) keeps its tenth of a millimetre.

    Attributes
    ----------
    normals : (face, 3) float
        Unit normals of the scan's faces, to tell fronts from backs.
    """

    def __init__(self, scan: Scan) -> None:
        self.normals = scan.normals
        self._center = scan.bounds.mean(axis=0)
        # The robust mode costs a few per cent and lets no ray slip between two triangles that share an edge.
        self._scene = rtcore_scene.EmbreeScene(robust=True)
        # Shared vertices are a third of the corners, which embreex copies one number at a time.
        TriangleMesh(self._scene, (scan.vertices - self._center).astype(np.float32), scan.faces.astype(np.int32))

    def nearest(self, origins: ArrayLike, directions: ArrayLike, *, max_distance: float | None = None) -> Hits:
        """First face that each ray meets, on either side.

        Parameters
        ----------
        origins : (ray, 3) float
            [m]
        directions : (ray, 3) or (3,) float
            Need not be unit vectors; one direction serves all rays.
        max_distance : float or None
            Faces farther away are not met, in units of the direction's length.

        Returns
        -------
        hits : Hits

        Raises
        ------
        ArrayError
            If an origin or direction is not finite or has no three coordinates.
        """
        starts, wanted = _rays(origins, directions)
        if len(starts) <= RAYS_AT_ONCE:
            return self._nearest(starts, wanted, max_distance)
        parts = [self._nearest(starts[part], wanted[part], max_distance) for part in _parts(len(starts))]
        return Hits(
            face=np.concatenate([part.face for part in parts]),
            distance=np.concatenate([part.distance for part in parts]),
            barycentric=np.concatenate([part.barycentric for part in parts]),
        )

    def blocked(self, origins: ArrayLike, directions: ArrayLike, *, max_distance: float | None = None) -> BoolArray:
        """Whether each ray meets any face, on either side: `nearest(...).met`, in about half the time.

        Parameters
        ----------
        origins, directions, max_distance
            As in `nearest`.

        Returns
        -------
        blocked : (ray,) bool

        Raises
        ------
        ArrayError
            As `nearest`.
        """
        starts, wanted = _rays(origins, directions)
        return np.concatenate([self._blocked(starts[part], wanted[part], max_distance) for part in _parts(len(starts))])

    def _blocked(self, origins: FloatArray, directions: FloatArray, max_distance: float | None) -> BoolArray:
        answer = self._scene.run(
            *self._single(origins, directions), dists=_limits(origins, max_distance), query="OCCLUDED"
        )
        return np.asarray(answer != NOTHING, dtype=np.bool_)

    def _nearest(self, origins: FloatArray, directions: FloatArray, max_distance: float | None) -> Hits:
        answer = self._scene.run(*self._single(origins, directions), dists=_limits(origins, max_distance), output=True)
        face = answer["primID"].astype(np.int64)
        met = face >= 0
        u, v = answer["u"].astype(np.float64), answer["v"].astype(np.float64)
        return Hits(
            face=face,
            distance=np.where(met, answer["tfar"].astype(np.float64), np.inf),
            barycentric=np.stack([1.0 - u - v, u, v], axis=1) * met[:, None],
        )

    def _single(self, origins: FloatArray, directions: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Both in single precision, the origins from the scan's centre."""
        return (
            np.ascontiguousarray(origins - self._center, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
        )


_CASTERS: WeakKeyDictionary[Mesh, RayCaster] = WeakKeyDictionary()


def caster_of(scan: Scan) -> RayCaster:
    """A scan's triangles, loaded for ray casting once as long as the scan, or another with the same mesh, is kept.

    Parameters
    ----------
    scan : Scan

    Returns
    -------
    caster : RayCaster
    """
    caster = _CASTERS.get(mesh_of(scan))
    if caster is None:
        caster = _CASTERS[mesh_of(scan)] = RayCaster(scan)
    return caster


def _limits(origins: FloatArray, max_distance: float | None) -> NDArray[np.float32] | None:
    return None if max_distance is None else np.full(len(origins), max_distance, dtype=np.float32)


def _parts(count: int) -> Iterator[slice]:
    """Slices of at most `RAYS_AT_ONCE` rays; one of none for none."""
    return (slice(first, first + RAYS_AT_ONCE) for first in range(0, max(count, 1), RAYS_AT_ONCE))


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    starts = _vectors(origins, name="ray origins")
    return starts, np.broadcast_to(_vectors(directions, name="ray directions"), starts.shape)


def _vectors(values: ArrayLike, *, name: str) -> FloatArray:
    vectors = np.asarray(values, dtype=np.float64)
    if vectors.ndim not in (1, 2) or vectors.shape[-1] != 3:
        raise ArrayError(expected="vectors of three coordinates", found=f"shape {vectors.shape}", where=name)
    if not np.isfinite(vectors).all():
        raise ArrayError(expected="finite numbers", found="NaN or infinite coordinates", where=name)
    return np.atleast_2d(vectors)
