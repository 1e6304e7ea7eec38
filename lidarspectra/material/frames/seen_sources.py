"""What frames tell of sources that nobody named: the radiance of windows from where they were seen, or its lower bound.

A window's radiance depends on the direction: a frame taken inside looks out near the horizon, where an overcast sky has
a third of the zenith's radiance, and down at the ground. So a sighting says which lobes of the source (`unknown_light`)
it saw, and by how much: upward and downward views apart, since the two differ most.

Frames that show some of it just below white tell its radiance. Without one there is a lower bound, the highest white of
the frames. A window may send a hundred times as much; white paper in a frame that is exposed for dark surroundings,
hardly more.
"""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_evidence import SourceSightings
from lidarspectra.material.delighting.unknown_light import UnknownSource, lobes_towards
from lidarspectra.material.frames.records import FrameRecords

MIN_ROWS = 12  # views of places, fewer tell nothing of a source
MIN_BELOW = 0.1  # [1] of a source, that a frame shows below white where it is exposed for it
NEAR_WHITE = 0.5  # [1] of white, that this share reaches: what is darker is another thing
MAX_CUT = 0.2  # [1] of a face, cut at white in all frames: its hue is not told
LOOK_M = 0.02  # [m] off the mesh, from where the face at a place is looked up
TOLD_DEVIATION = 0.3  # [1] of the log of a source's light about what frames show: no sky is just three lobes
BEYOND_BOUND, BOUND_DEVIATION = 3.0, 1.5  # [1] of what all frames cut at white, over its bound; of its log


def sightings_of_sources(
    records: FrameRecords, scan: Scan, caster: RayCaster, sources: Sequence[UnknownSource]
) -> SourceSightings | None:
    """What frames show of some sources.

    Parameters
    ----------
    records : FrameRecords
    scan : Scan
        With the frames' radiance as its colours.
    caster : RayCaster
        Of the scan.
    sources : sequence of UnknownSource

    Returns
    -------
    sightings : SourceSightings or None
        None where no frame shows any of them.
    """
    hits = caster.nearest(records.points + LOOK_M * records.normals, -records.normals, max_distance=2.0 * LOOK_M)
    way = records.points[records.place] - records.camera[records.frame]
    height = way[:, 2] / np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    rows: list[tuple[int, FloatArray, FloatArray, float]] = []
    for number, source in enumerate(sources):
        of_source = np.isin(hits.face, source.faces) & hits.met
        hue = _hue(scan, source)
        for upward in (True, False):
            seen = np.flatnonzero(of_source[records.place] & ((height > 0.0) == upward))
            told = seen[_exposed_for(records, seen)]
            if told.size >= MIN_ROWS:
                lobes = lobes_towards(height[told]).mean(axis=1)
                level = float(np.median(records.light[told]))
                rows.append((number, lobes, level * hue, TOLD_DEVIATION))
            elif (cut := seen[records.clipped[seen]]).size >= MIN_ROWS:
                lobes = lobes_towards(height[cut]).mean(axis=1)
                level = BEYOND_BOUND * _lower_bound(records, cut)
                rows.append((number, lobes, np.full(3, level), BOUND_DEVIATION))
    if not rows:
        return None
    which, lobes_of, light, deviation = zip(*rows, strict=True)
    return SourceSightings(
        source=np.array(which), lobes=np.array(lobes_of), light=np.array(light), log_deviation=np.array(deviation)
    )


def _exposed_for(records: FrameRecords, rows: IntArray) -> BoolArray:
    """(n,) which of some (n,) rows are of a frame that is exposed for what they show, be some of it cut at white.

    What is not cut in a frame of a longer exposure is a dark part: a bar, an edge that a wrong pose lays there.
    """
    frame, cut, light = records.frame[rows], records.clipped[rows], records.light[rows]
    kept = np.zeros(rows.size, dtype=np.bool_)
    for number in np.unique(frame):
        of_frame = frame == number
        below = light[of_frame & ~cut]
        if below.size >= MIN_BELOW * of_frame.sum():
            white = np.median(light[of_frame & cut]) if (of_frame & cut).any() else 0.0
            kept[of_frame] = np.median(below) > NEAR_WHITE * white
    return kept


def _lower_bound(records: FrameRecords, rows: IntArray) -> float:
    """Median over the places of some (n,) clipped rows of the highest radiance that one of them must pass."""
    highest = np.zeros(len(records.points))
    np.maximum.at(highest, records.place[rows], records.light[rows])
    return float(np.median(highest[np.unique(records.place[rows])]))


def _hue(scan: Scan, source: UnknownSource) -> FloatArray:
    """(3,) linear sRGB of a source over its mean, where frames show it below white; white otherwise."""
    linear = scan.appearance.linear
    told: BoolArray = np.zeros(source.faces.size, dtype=np.bool_)
    if linear is not None:
        told = linear.face_cut[source.faces] < MAX_CUT
    if not told.any():
        return np.ones(3)
    faces = source.faces[told]
    color = np.average(scan.face_colors()[faces], axis=0, weights=scan.areas[faces])
    return np.asarray(color / max(float(color.mean()), 1e-9), dtype=np.float64)
