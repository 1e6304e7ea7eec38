"""Light in the picture that nobody named: windows, screens, other lamps.

Where a picture is cut at white and no known lamp is near, something shines there: by day a window. How strongly cannot
be read off a clipped picture, but its light on the other surfaces has a pattern that follows from geometry alone. So
such a place is a source of unknown strength and colour in the fit (`albedo`), with three lobes that are free of one
another: the high sky (a ceiling's light through a door), the low sky (the facade opposite) and the ground outside. Seen
towards a direction of elevation h, their radiance is

    sin h,    1 - sin h    (h > 0)    and    1    (h < 0),                                                        (1)

so that every sky whose radiance is linear in sin h is in their span: an even one, and Moon and Spencer's overcast one,
1 + 2 sin h, whose low lobe is a third of the high one.

References
----------
CIE S 011/E:2003, Spatial distribution of daylight (how the radiance of skies depends on height). Moon, Spencer (1942)
Illumination from a non-uniform sky, Illum. Eng. 37, 707.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, linked
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_exchange import cosine_directions

LINK_M = 0.15  # [m] clipped faces nearer to one another are one source
MIN_AREA_M2 = 0.06  # [m²] of a source; smaller ones are highlights
MAX_SOURCES = 6  # largest first; each has five unknowns
PLACES = 256  # on a source, from which its light is gathered
NEAREST_M = 0.05  # [m] closer, a place's light is taken as from there
OFF_M = 0.02  # [m] off the mesh, clear of its noise
LOBES = 3
OPEN_SHARE = 0.01  # [1] of all directions that leave the scan, from which what lies beyond is a source
OPEN_RAYS = 256  # from a point
PANE_M2 = 0.25  # [m²] of an upright source from which it is taken for a window's pane
PANE_DEVIATION = 1.0  # [1] of its logarithm: a blind may be drawn when the map's light burns
PANE_REFLECTANCE = 0.1  # [1] of a window as the room sees it at night: two panes reflect .15, the dark outside nothing
VERTICAL = 0.5  # [1] of a normal's height, below which a source is upright, as windows are
MUCH_LARGER = 2.0  # [1] of areas: the two panes of a window round a corner are alike
# [1] of the light that falls on a source: paint sends less, and 2 leaves room for what fits miss. It must send more
# even when its strength lies so many deviations lower: that of a white door that is cut at white is hardly known.
SHINES, SURE_DEVIATIONS = 2.0, 2.0
FLAT = 0.8  # [1] of a pane's normals, the least length of their mean: a rough mesh has .9, two sides of a shade .7
ONE_WAY = 0.5  # [1] cosine between normals, above which two clipped faces may shine as one: a pane's mesh is rough


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
    flatness : float
        How far it looks one way: length of the mean of its normals. [0-1]
    open_share : float
        Of what lies beyond the scan: mean share of directions that leave it; 0 for a place on its surface. [0-1]
    is_beside : bool
        Whether it touches a much larger source and looks another way: a reveal, a desk, a wall that this one lights.
    """

    faces: IntArray
    center: FloatArray
    normal: FloatArray
    area_m2: float
    flatness: float = 1.0
    open_share: float = 0.0
    is_beside: bool = False

    @property
    def is_upright(self) -> bool:
        """Whether it stands, as windows do."""
        return bool(abs(self.normal[2]) < VERTICAL)

    @property
    def may_be_window(self) -> bool:
        """Whether it may be a window in a wall, which looks one way, as the sides of a lamp's shade do not."""
        return self.is_upright and not self.is_beside and self.flatness > FLAT

    @property
    def is_pane(self) -> bool:
        """Whether it is taken for the pane of a window."""
        return self.may_be_window and self.area_m2 >= PANE_M2


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
        Largest first, at most `MAX_SOURCES`. A desk that is cut at white below a window is a source of its own: it
        sends its light elsewhere.
    """
    faces = np.flatnonzero(clipped)
    if not faces.size:
        return ()
    label, together = _shining_parts(scan, faces)
    area = np.bincount(label, weights=scan.areas[faces])
    found = []
    for number in np.argsort(-area)[:MAX_SOURCES]:
        if area[number] < MIN_AREA_M2:
            break
        member = label == number
        own, beside = faces[member], np.unique(label[together == together[member.argmax()]])
        weights = scan.areas[own]
        normal = weights @ scan.normals[own]
        length = float(np.linalg.norm(normal))
        found.append(
            UnknownSource(
                faces=own,
                center=np.average(scan.centers[own], axis=0, weights=weights),
                normal=normal / max(length, 1e-12),
                area_m2=float(area[number]),
                flatness=length / float(weights.sum()),
                is_beside=bool(area[beside].max() > MUCH_LARGER * area[number]),
            )
        )
    return tuple(found)


def _shining_parts(scan: Scan, faces: IntArray) -> tuple[IntArray, IntArray]:
    """(face,) source that each of some faces belongs to, near one another and looking one way; and which hang together.

    So do faces that lie behind one another's planes, as sides of a lamp's shade do; a desk lies before a window's.
    What is too small for a source of its own, as the rough parts of a pane are, belongs to the largest one it hangs
    together with.
    """
    pairs = cKDTree(scan.centers[faces]).query_pairs(LINK_M, output_type="ndarray")
    first, second = faces[pairs[:, 0]], faces[pairs[:, 1]]
    way, normals, level = (
        scan.centers[second] - scan.centers[first],
        scan.normals,
        np.abs(scan.normals[:, 2]) > VERTICAL,
    )
    alike = np.einsum("pc,pc->p", normals[first], normals[second]) > ONE_WAY
    alike &= level[first] == level[second]
    behind = np.einsum("pc,pc->p", way, normals[first]) < -OFF_M
    alike |= behind & (np.einsum("pc,pc->p", -way, normals[second]) < -OFF_M)
    together, part = linked(pairs, faces.size), linked(pairs[alike], faces.size)
    area = np.bincount(part, weights=scan.areas[faces])
    group = np.zeros(area.size, dtype=np.int64)
    group[part] = together
    largest = np.zeros(int(together.max()) + 1, dtype=np.int64)
    ascending = np.argsort(area, kind="stable")
    largest[group[ascending]] = ascending  # the last one written stays
    return np.where(area >= MIN_AREA_M2, np.arange(area.size), largest[group])[part], together


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
        Share of cosine-weighted directions that meet nothing, weighed by the lobes. [0-1]
    """
    ways = cosine_directions(normals, OPEN_RAYS, generator)
    met = caster.blocked(np.repeat(positions, OPEN_RAYS, axis=0), ways.reshape(-1, 3)).reshape(len(positions), -1)
    return np.asarray((~met * lobes_towards(ways[..., 2])).mean(axis=2), dtype=np.float64)


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
        From the high sky, the low sky, the ground. [1]
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
        patterns += factor * lobes_towards(toward[:, 2])
    return patterns


def lobes_towards(height: FloatArray) -> FloatArray:
    """(lobe, ...) radiance of each lobe towards directions of this sine of elevation, of any shape (Eq. 1) [1]."""
    sky = height > 0.0
    high = np.where(sky, height, 0.0)
    return np.stack([high, np.where(sky, 1.0 - high, 0.0), np.where(sky, 0.0, 1.0)])


def surely_shine(radiosity: FloatArray, log_deviation: FloatArray, irradiance: FloatArray) -> BoolArray:
    """Which sources are no paint: what is cut at white may be white paint in much light.

    Parameters
    ----------
    radiosity : (source, 3) float
        What each sends, as it was fitted. [any one unit]
    log_deviation : (source, 3) float
        Standard deviations of its logarithms. [1]
    irradiance : (source, 3) float
        That falls on each, in the same unit.

    Returns
    -------
    shine : (source,) bool
        Where one of the cones gets surely more than any paint would send.
    """
    least = radiosity * np.exp(-SURE_DEVIATIONS * log_deviation)
    return np.asarray((least > SHINES * irradiance).any(axis=1), dtype=np.bool_)
