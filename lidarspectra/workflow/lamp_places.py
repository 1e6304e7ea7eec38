"""Lamps and windows must lie within the scan: one outside of it lights nothing, and zeros look like an answer."""

from collections.abc import Iterable

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import RunFile
from lidarspectra.errors import LampError

OUTSIDE_M = 0.05  # [m] that a lamp's middle may lie beyond the scan's bounds: a scan's own unevenness


def check_lamp_places(room: RunFile, bounds: FloatArray) -> None:
    """Refuse lamps and windows whose middle lies outside of the scan.

    Parameters
    ----------
    room : RunFile
    bounds : (2, 3) float
        Lowest and highest corner of the scan's box. [m]

    Raises
    ------
    LampError
        With the name and place of each such lamp, and the scan's bounds.
    """
    windows: Iterable[tuple[str, tuple[float, float, float]]] = (
        [(window.name, window.center) for window in room.daylight.windows] if room.daylight else []
    )
    outside = [
        f"'{name}' at ({', '.join(f'{value:.2f}' for value in center)}) m"
        for name, center in [*((lamp.name, lamp.center) for lamp in room.lamps), *windows]
        if np.any(np.array(center) < bounds[0] - OUTSIDE_M) or np.any(np.array(center) > bounds[1] + OUTSIDE_M)
    ]
    if outside:
        box_m = np.round(bounds, 2) + 0.0  # no "-0.00"
        box = ", ".join(f"{axis} from {low:.2f} to {high:.2f} m" for axis, low, high in zip("xyz", *box_m, strict=True))
        raise LampError(
            expected=f"lamps and windows within the scan, {box}",
            found="outside of it: " + ", ".join(outside),
            where="[[lamps]] and [[daylight.windows]]",
            todo="Correct 'center' in the run file; it is in metres, in the scan's axes: see 'lidarspectra scan'.",
        )
