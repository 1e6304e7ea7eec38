"""A grid of places where lamps might hang."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.room.plan_cells import edge_distance, within_polygon


def candidate_grid(outline: FloatArray, angle_deg: float, *, spacing: float, margin: float) -> FloatArray:
    """Square grid within a room's outline, along its walls, centred between them.

    Parameters
    ----------
    outline : (corner, 2) float
        [m]
    angle_deg : float
        Turn of the walls from the x axis. [deg]
    spacing : float
        Of neighbours, above 0. [m]
    margin : float
        Least distance from the outline. [m]

    Returns
    -------
    places : (place, 2) float
        [m]

    Raises
    ------
    MapError
        If none fits.
    """
    turn = np.radians(angle_deg)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])  # rows: along and across the walls
    corners = outline @ along.T
    low, high = corners.min(axis=0) + margin, corners.max(axis=0) - margin
    counts = np.maximum(np.floor((high - low) / spacing + 1e-9).astype(int) + 1, 1)
    middle = (low + high) / 2
    axes = [middle[axis] + spacing * (np.arange(counts[axis]) - (counts[axis] - 1) / 2) for axis in (0, 1)]
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inside = within_polygon(places, corners)
    kept = places[inside & (edge_distance(places, corners) >= margin - 1e-9)]
    if len(kept) == 0:
        raise MapError(
            expected=f"places {margin:g} m or more from the walls",
            found="none in this room",
            where="candidates",
            todo="Give a smaller margin, or centers.",
        )
    return np.asarray(kept @ along, dtype=np.float64)
