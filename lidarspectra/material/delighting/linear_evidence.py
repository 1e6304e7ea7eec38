"""What colours from frames add to the evidence for light: a known tone curve, and the radiance of what shines.

And what they lack: faces that no frame saw. An app's texture invents colours there; here such a face is taken to be of
the material of the nearest face that looks the same way, and to send what that material would in the light there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.appearance import LinearLight
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import weighted_median
from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, USUAL_TONE, TonePrior

MIN_DEVIATION = 0.02  # [1] of log g and log(1 + s): no curve has just two parameters
MAX_CUT = 0.2  # [1] of a face, cut at white in all frames
NORMAL_WEIGHT_M = 0.15  # [m] distance equivalent to a turn of one radian: a board's underside is like its top
MIN_SHOWN = 1e-3  # [1] of white, floor of what is divided by
AT_LAMP_M = 0.12  # [m] between a lamp's surface and the middle of a face that shows it, as of `near_lamps`
TOLD_POWER = 0.1  # [1] deviation of log g below which exposures were told: overlaps alone never tell a power
BRIGHT_SHARE = 0.9  # [1] of the faces at a lamp, by number, that are no brighter than what counts as its brightness
LAMP_SHARE = 0.5  # [1] of the brightest faces there, above which a face is the lamp and not its rim
FACING = 0.7  # [1] cosine between a lamp's axis and such a face
MIN_TOLD = 0.9  # [1] of a lamp's area whose radiance some frame tells


def tone_priors_of(linear: LinearLight | None) -> tuple[TonePrior, ...]:
    """Families of the curve that is left in a scan's colours: a phone's, or hardly one where frames told it."""
    if linear is None:
        return USUAL_TONE, FILMIC_TONE
    left = TonePrior(
        power_deviation=max(linear.power_deviation, MIN_DEVIATION),
        shoulder=0.0,
        shoulder_deviation=max(linear.shoulder_deviation, MIN_DEVIATION),
    )
    return (left,)


def spread_of_views(scan: Scan) -> FloatArray:
    """(face,) relative deviation of what frames show of each face; 0 in a scan without frames [1]."""
    linear = scan.appearance.linear
    return np.zeros(len(scan.faces)) if linear is None else linear.face_deviation


def shown_of_lamps(scan: Scan, lamps: Sequence[Lamp]) -> FloatArray | None:
    """Linear sRGB that frames tell of the lamps' own surfaces.

    Parameters
    ----------
    scan : Scan
    lamps : sequence of Lamp

    Returns
    -------
    shown : (lamp, 3) float or None
        Area-weighted median over the faces at a lamp; NaN where more than a few of them are cut at white in all
        frames, and of lamps that shine unlike a matt surface. None without frames, or if their exposures were not told:
        a frame that looks straight at a lamp shows hardly anything else, so that overlaps tie its gain badly. [1]
    """
    linear = scan.appearance.linear
    if linear is None or not lamps or linear.power_deviation >= TOLD_POWER:
        return None
    shown = np.full((len(lamps), 3), np.nan)
    colors, areas = scan.face_colors(), scan.areas
    for row, lamp in enumerate(lamps):
        if not lamp.shape.is_assumed_matt:
            continue
        at = np.flatnonzero((lamp.distance(scan.centers) < AT_LAMP_M) & (scan.normals @ lamp.normal > FACING))
        at = at[scan.appearance.photographed[at]]
        if not at.size:
            continue
        level = colors[at].max(axis=1)
        at = at[level >= LAMP_SHARE * float(np.quantile(level, BRIGHT_SHARE))]
        told = at[linear.face_cut[at] < MAX_CUT]
        if areas[told].sum() > MIN_TOLD * areas[at].sum():
            shown[row] = weighted_median(colors[told], areas[told])
    return shown


@dataclass(frozen=True, kw_only=True, eq=False)
class UnseenFaces:
    """Faces without a colour, and those whose material they are taken to have.

    Parameters
    ----------
    faces, like : (unseen,) int
        Of the scan.
    """

    faces: IntArray
    like: IntArray

    def filled(self, values: FloatArray) -> FloatArray:
        """(face, 3) values, those of unseen faces being the ones of the faces that they are like."""
        result = values.copy()
        result[self.faces] = values[self.like]
        return result

    def excess(self, excess: FloatArray, shown: FloatArray, reflectance: FloatArray, light: FloatArray) -> FloatArray:
        """(face, 3) factors on what faces show, so that unseen ones send their reflectance times the light there."""
        result = excess.copy()
        result[self.faces] = reflectance[self.like] * light[self.faces] / np.maximum(shown[self.faces], MIN_SHOWN)
        return result


def unseen_faces(scan: Scan, known: BoolArray) -> UnseenFaces:
    """Faces that no frame saw, or that an app left black; none of those that have a name.

    Parameters
    ----------
    scan : Scan
    known : (face,) bool
        Whose colour is a surface's.

    Returns
    -------
    unseen : UnseenFaces
    """
    nowhere = np.zeros(0, dtype=np.int64)
    if not known.any():
        return UnseenFaces(faces=nowhere, like=nowhere)
    appearance = scan.appearance
    unseen = appearance.unpictured if appearance.linear is None else ~appearance.photographed
    faces = np.flatnonzero(unseen & (appearance.face_kinds < 0))
    seen = np.flatnonzero(known)
    place = np.hstack([scan.centers, NORMAL_WEIGHT_M * scan.normals])
    like = seen[cKDTree(place[seen]).query(place[faces])[1]] if faces.size else nowhere
    return UnseenFaces(faces=faces, like=np.asarray(like, dtype=np.int64))
