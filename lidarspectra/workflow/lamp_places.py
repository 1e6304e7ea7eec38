"""Check that lamps and windows lie within the scan: one outside lights nothing, and the map would be dark."""

from collections.abc import Iterable

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import RunFile
from lidarspectra.errors import LampError

OUTSIDE_M = 0.05  # [m] tolerance of a lamp's centre beyond the scan's bounds, for the roughness of the mesh


def check_lamp_places(room: RunFile, bounds: FloatArray) -> None:
    """Refuse lamps and windows whose centre lies outside the scan.

    Parameters
    ----------
    room : RunFile
    bounds : (2, 3) float
        Lowest and highest corner of the scan's box. [m]

    Raises
    ------
    LampError
        Naming each such lamp, its centre, and the scan's bounds.
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
