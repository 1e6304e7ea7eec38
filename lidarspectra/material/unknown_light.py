"""Light in the picture that nobody named: windows, screens, other lamps.

Where a picture is cut at white and no known lamp is near, something shines there: by day a window. How strongly cannot
be read off a clipped picture, but its light on the other surfaces has a pattern that follows from geometry alone. So
such a place is a source of unknown strength and colour in the fit (`albedo`), with three lobes that are free of one
another: light that falls steeply (the high sky, a ceiling's light through a door), light that falls at a low angle (the
low sky, the facade opposite) and light that rises (the ground outside).

References
----------
CIE S 011/E:2003, Spatial distribution of daylight (how the radiance of skies depends on height).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan

LINK_M = 0.15  # [m] clipped faces nearer to one another are one source
MIN_AREA_M2 = 0.06  # [m²] of a source; smaller ones are highlights
MAX_SOURCES = 6  # largest first; each has five unknowns
PLACES = 64  # on a source, from which its light is gathered
NEAREST_M = 0.05  # [m] closer, a place's light is taken as from there
OFF_M = 0.02  # [m] off the mesh, clear of its noise
STEEP = 0.4  # [1] sine of the height above which light falls steeply
LOBES = 3
PANE_M2 = 0.25  # [m²] of an upright source from which it is taken for a window's pane
PANE_REFLECTANCE = 0.1  # [1] of a window as the room sees it at night: two panes reflect .15, the dark outside nothing
VERTICAL = 0.5  # [1] of a normal's height, below which a source is upright, as windows are


@dataclass(frozen=True, kw_only=True, eq=False)
class UnknownSource:
    """A place that shines.

    Parameters
    ----------
    faces : (face,) int
        Of the scan.
    center, normal : (3,) float
        Means over its area. [m, 1]
    area_m2 : float
    """

    faces: IntArray
    center: FloatArray
    normal: FloatArray
    area_m2: float

    @property
    def is_upright(self) -> bool:
        """Whether it may be a window in a wall."""
        return bool(abs(self.normal[2]) < VERTICAL)

    @property
    def is_pane(self) -> bool:
        """Whether it is taken for the pane of a window."""
        return self.is_upright and self.area_m2 >= PANE_M2


def find_unknown_sources(scan: Scan, clipped: BoolArray) -> tuple[UnknownSource, ...]:
    """Find what shines.

    Parameters
    ----------
    scan : Scan
    clipped : (face,) bool
        Faces that are cut at white, without those of known lamps.

    Returns
    -------
    sources : tuple of UnknownSource
        Largest first, at most `MAX_SOURCES`.
    """
    faces = np.flatnonzero(clipped)
    if not faces.size:
        return ()
    centers = scan.centers[faces]
    pairs = cKDTree(centers).query_pairs(LINK_M, output_type="ndarray")
    ones = np.ones(len(pairs))
    links = coo_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(faces.size, faces.size))
    _, label = connected_components(links, directed=False)
    area = np.bincount(label, weights=scan.areas[faces])
    found = []
    for number in np.argsort(-area)[:MAX_SOURCES]:
        if area[number] < MIN_AREA_M2:
            break
        own = faces[label == number]
        weights = scan.areas[own]
        normal = weights @ scan.normals[own]
        found.append(
            UnknownSource(
                faces=own,
                center=np.average(scan.centers[own], axis=0, weights=weights),
                normal=normal / max(float(np.linalg.norm(normal)), 1e-12),
                area_m2=float(area[number]),
            )
        )
    return tuple(found)


def source_patterns(
    scan: Scan,
    caster: RayCaster,
    source: UnknownSource,
    positions: FloatArray,
    normals: FloatArray,
    generator: np.random.Generator,
) -> FloatArray:
    """Irradiance from each lobe of a source of radiance 1/π, without reflections.

    Parameters
    ----------
    scan : Scan
    caster : RayCaster
        Of it.
    source : UnknownSource
    positions, normals : (point, 3) float
        [m, 1]
    generator : numpy.random.Generator
        Chooses places on the source.

    Returns
    -------
    patterns : (lobe, point) float
        Steeply falling, flatly falling, rising light. [1]
    """
    weights = scan.areas[source.faces]
    share = np.cumsum(weights) / weights.sum()
    chosen = source.faces[
        np.searchsorted(share, (np.arange(PLACES) + generator.random(PLACES)) / PLACES).clip(0, len(weights) - 1)
    ]
    patterns = np.zeros((LOBES, len(positions)))
    for face in chosen:
        # A window's mesh is rough; as a whole it looks one way.
        normal = source.normal if source.is_upright else scan.normals[face]
        way = scan.centers[face] + OFF_M * normal - positions
        distance = np.linalg.norm(way, axis=1)
        toward = way / np.maximum(distance, 1e-9)[:, None]
        here = np.einsum("nc,nc->n", toward, normals)
        there = -toward @ normal
        factor = np.maximum(here, 0.0) * np.maximum(there, 0.0) / np.maximum(distance, NEAREST_M) ** 2
        factor *= source.area_m2 / (np.pi * PLACES)
        some = np.flatnonzero(factor > 0)
        blocked = caster.nearest(positions[some], way[some], max_distance=1.0 - 1e-4).met
        factor[some[blocked]] = 0.0
        height = toward[:, 2]
        lobe = np.where(height > STEEP, 0, np.where(height > 0, 1, 2))
        np.add.at(patterns, (lobe, np.arange(len(positions))), factor)
    return patterns
