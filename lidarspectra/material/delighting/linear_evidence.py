"""What colours from frames add to the evidence for light: a known tone curve, and the radiance of what shines."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.appearance import LinearLight
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import weighted_median
from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, USUAL_TONE, TonePrior

MIN_DEVIATION = 0.02  # [1] of log g and log(1 + s): no curve has just two parameters
MAX_CUT = 0.2  # [1] of a face, cut at white in all frames
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
