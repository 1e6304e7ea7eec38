"""Points spread over a scan's faces, each standing for an equal part of its face."""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.textures import subdivision_barycentrics


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceSamples:
    """Points spread over the scan, by which coverage is counted and colour is read.

    Parameters
    ----------
    positions, normals : (sample, 3) float
        [m], [1]
    face : (sample,) int
    barycentric : (sample, 3) float
        Where on the face. [1]
    area : (sample,) float
        That a sample stands for. [m²]
    """

    positions: FloatArray
    normals: FloatArray
    face: IntArray
    barycentric: FloatArray
    area: FloatArray

    def some(self, chosen: IntArray) -> "SurfaceSamples":
        """Some of the samples."""
        return SurfaceSamples(
            positions=self.positions[chosen],
            normals=self.normals[chosen],
            face=self.face[chosen],
            barycentric=self.barycentric[chosen],
            area=self.area[chosen],
        )


def surface_samples(scan: Scan, *, spacing_m: float) -> SurfaceSamples:
    """Spread points over every face: the centres of equal parts of it, no farther apart than about the spacing.

    Parameters
    ----------
    scan : Scan
    spacing_m : float
        [m]

    Returns
    -------
    samples : SurfaceSamples
        Faces without area have none.
    """
    corners, areas, normals = scan.corners, scan.areas, scan.normals
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(longest / spacing_m), 1, 64).astype(np.int64)
    positions, face, barycentric, area = [], [], [], []
    for count in np.unique(parts[areas > 0]):
        these = np.flatnonzero((parts == count) & (areas > 0))
        weights = subdivision_barycentrics(int(count))
        positions.append(np.einsum("sc,fcd->fsd", weights, corners[these]).reshape(-1, 3))
        face.append(np.repeat(these, len(weights)))
        barycentric.append(np.tile(weights, (len(these), 1)))
        area.append(np.repeat(areas[these] / len(weights), len(weights)))
    faces = np.concatenate(face)
    return SurfaceSamples(
        positions=np.concatenate(positions),
        normals=normals[faces],
        face=faces,
        barycentric=np.concatenate(barycentric),
        area=np.concatenate(area),
    )


def coarse_cells(samples: SurfaceSamples, spacing_m: float) -> tuple[IntArray, IntArray]:
    """Sort samples into cubes, apart by the axis that their surfaces face most: the cells of a coarse mesh.

    Parameters
    ----------
    samples : SurfaceSamples
    spacing_m : float
        Edge of the cubes. [m]

    Returns
    -------
    cell : (sample,) int
        Which cell each is of.
    first : (cell,) int
        A sample of each.
    """
    own = np.arange(samples.area.size)
    axis = np.abs(samples.normals).argmax(axis=1)
    side = 2 * axis + (samples.normals[own, axis] > 0)
    cube = np.floor(samples.positions / spacing_m).astype(np.int64)
    cube -= cube.min(axis=0, initial=0)
    extent = cube.max(axis=0, initial=0) + 1
    key = ((side * extent[0] + cube[:, 0]) * extent[1] + cube[:, 1]) * extent[2] + cube[:, 2]
    _, first, cell = np.unique(key, return_index=True, return_inverse=True)
    return cell.reshape(-1), first
