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
from lidarspectra.material.delighting.light_exchange import cosine_directions

LINK_M = 0.15  # [m] clipped faces nearer to one another are one source
MIN_AREA_M2 = 0.06  # [m²] of a source; smaller ones are highlights
MAX_SOURCES = 6  # largest first; each has five unknowns
PLACES = 64  # on a source, from which its light is gathered
NEAREST_M = 0.05  # [m] closer, a place's light is taken as from there
OFF_M = 0.02  # [m] off the mesh, clear of its noise
STEEP = 0.4  # [1] sine of the height above which light falls steeply
LOBES = 3
OPEN_SHARE = 0.01  # [1] of all directions that leave the scan, from which what lies beyond is a source
OPEN_RAYS = 256  # from a point
PANE_M2 = 0.25  # [m²] of an upright source from which it is taken for a window's pane
PANE_DEVIATION = 1.0  # [1] of its logarithm: a blind may be drawn when the map's light burns
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
    open_share : float
        Of what lies beyond the scan: mean share of directions that leave it; 0 for a place on its surface. [0-1]
    """

    faces: IntArray
    center: FloatArray
    normal: FloatArray
    area_m2: float
    open_share: float = 0.0

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


def beyond_scan(open_share: float) -> UnknownSource:
    """What lies beyond the scan, as one source."""
    nothing = np.zeros(3)
    return UnknownSource(
        faces=np.zeros(0, dtype=np.int64), center=nothing, normal=nothing, area_m2=0.0, open_share=open_share
    )


def opening_patterns(
    caster: RayCaster, positions: FloatArray, normals: FloatArray, generator: np.random.Generator
) -> FloatArray:
    """Irradiance from each lobe of what lies beyond the scan, of radiance 1/π: through holes where windows were, say.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    positions, normals : (point, 3) float
        [m, 1]
    generator : numpy.random.Generator
        Turns the directions.

    Returns
    -------
    patterns : (lobe, point) float
        Share of cosine-weighted directions that meet nothing, by lobe. [0-1]
    """
    ways = cosine_directions(normals, OPEN_RAYS, generator)
    met = caster.blocked(np.repeat(positions, OPEN_RAYS, axis=0), ways.reshape(-1, 3)).reshape(len(positions), -1)
    lobe = _lobe(ways[..., 2])
    return np.stack([(~met & (lobe == number)).mean(axis=1) for number in range(LOBES)])


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
        blocked = caster.blocked(positions[some], way[some], max_distance=1.0 - 1e-4)
        factor[some[blocked]] = 0.0
        np.add.at(patterns, (_lobe(toward[:, 2]), np.arange(len(positions))), factor)
    return patterns


def _lobe(height: FloatArray) -> IntArray:
    """Lobe of light that comes from directions of this sine of elevation."""
    return np.where(height > STEEP, 0, np.where(height > 0, 1, 2)).astype(np.int64)
