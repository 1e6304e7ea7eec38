"""The plan of a virtual room from above, as maps of it are drawn on."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from research.virtual_rooms.room_plan import BoxSection, PlanFile, TableSection

LOWEST_FURNITURE_M, FURNITURE_M = 0.1, 0.3  # [m] what stands lower than the one and is wider than the other is drawn


def true_floor_plan(plan: PlanFile) -> FloorPlan:
    """The plan from above: the box around all rooms, each room's walls, and what stands on the floor."""
    low = np.min([room.low[:2] for room in plan.rooms], axis=0)
    high = np.max([room.high[:2] for room in plan.rooms], axis=0)
    rooms = tuple(_rectangle(np.array(room.low[:2]), np.array(room.high[:2])) for room in plan.rooms)
    furniture = []
    for part in plan.parts:
        if isinstance(part, TableSection):
            half = np.array(part.size) / 2
            furniture.append(_turned(-half, half, np.array(part.center), part.yaw_deg))
        elif isinstance(part, BoxSection) and part.low[2] < LOWEST_FURNITURE_M:
            size = np.subtract(part.high, part.low)[:2]
            if size.min() > FURNITURE_M:
                center = np.add(part.low, part.high)[:2] / 2
                corners = _turned(-size / 2, size / 2, center, part.yaw_deg)
                furniture.append(np.clip(corners, low, high))
    others = rooms if len(rooms) > 1 else ()
    return FloorPlan(outline=_rectangle(low, high), furniture=tuple(furniture), other_outlines=others)


def _rectangle(low: FloatArray, high: FloatArray) -> FloatArray:
    return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])


def _turned(low: FloatArray, high: FloatArray, center: FloatArray, yaw_deg: float) -> FloatArray:
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    return np.asarray(_rectangle(low, high) @ np.array([[c, s], [-s, c]]) + center, dtype=np.float64)
