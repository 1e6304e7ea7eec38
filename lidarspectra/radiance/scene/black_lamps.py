"""What is lost where lamps reflect nothing: their surfaces are sources to Radiance, and black to other light."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp, are_one_shape
from lidarspectra.lamps.shapes import Window
from lidarspectra.material.material_map import MaterialMap

REAL_REFLECTANCE = 0.7  # [1] of opal covers and white housings behind them, in truth; our judgement
GREEN_NM = 555.0  # [nm] where the room's reflectance is taken
MIN_LOSS = 0.02  # [1] of a room's light, from which the user is told


def black_lamps_loss(lamps: Sequence[Lamp], scan: Scan, materials: MaterialMap) -> float:
    """Share of a room's light that lamps take which reflect nothing.

    With the mean reflectance r of the room and the share s of the lamps in its surface, light that was reflected before
    is r of all, and of what falls on lamps `REAL_REFLECTANCE` R would come back and be reflected on (integrating
    sphere):

        s R r / (1 - r).                                                                                          (1)

    Parameters
    ----------
    lamps : sequence of Lamp
        Windows, which reflect little, are none of them.
    scan : Scan
    materials : MaterialMap
        Of it.

    Returns
    -------
    loss : float
        [1]
    """
    hanging = [lamp for lamp in lamps if lamp.is_in_room and not isinstance(lamp.shape, Window)]
    shapes = [lamp for n, lamp in enumerate(hanging) if not any(are_one_shape(lamp, other) for other in hanging[:n])]
    share = sum(surface.area for lamp in shapes for surface in lamp.surfaces) / float(scan.areas.sum())
    levels = np.array([each.reflectance.at(np.array([GREEN_NM]), outside="nearest")[0] for each in materials.materials])
    mean = min(float(np.average(levels[materials.face_material], weights=scan.areas)), 0.95)
    return float(share * REAL_REFLECTANCE * mean / (1.0 - mean))


def black_lamps_note(lamps: Sequence[Lamp], scan: Scan, materials: MaterialMap) -> tuple[str, ...]:
    """A note where that is much, as below a luminous ceiling; parameters as of `black_lamps_loss`."""
    loss = black_lamps_loss(lamps, scan, materials)
    if loss < MIN_LOSS:
        return ()
    return (
        f"The lamps' own surfaces are large, and the simulation has them reflect nothing of the light of others. Where "
        f"theirs are white or opal, as most are, the map is too dark by some {100 * loss:.0f} %, which no stated "
        "uncertainty counts. Readings of a lux meter mend it ('lidarspectra calibrate').",
    )
