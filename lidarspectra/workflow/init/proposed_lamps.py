"""Lamps that `init` proposes where none is lit in the scan: a grid of square panels under the ceiling."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.plan_cells import edge_distance, within_polygon
from lidarspectra.room.room import Room

CLEARANCE_M = 0.055  # [m] below the mesh, whose noise would shade nearer panels
PITCH_M = 2.4  # [m] from panel to panel in offices: four ceiling tiles of 0.6 m
PANEL_M = 0.6  # [m] side of a panel
PANEL_LM = 3600.0  # [lm] of such a panel; one for each 5.8 m² of floor gives offices some 300 lx
MAX_PANELS = 24  # a larger room gets a wider pitch, and brighter panels
WIDEST_PITCH_M = 20.0  # [m] beyond it a panel would send 250,000 lm: no lamp does, and no run file may say so
WALL_M = 0.2  # [m] least distance of a panel's edge from the walls
SHIFTS = tuple(product((0.0, 0.25, -0.25, 0.5), repeat=2))  # [1] of a grid in steps; the even one first
PLACES = 100  # along each side of a room's box, among which its deepest place is looked for
LOOK_UP_M = 0.5  # [m] below the room's top: from here up the ceiling is looked for


@dataclass(frozen=True, kw_only=True, eq=False)
class ProposedPanels:
    """A grid of panels.

    Parameters
    ----------
    centers : (panel, 3) float
        Below the ceiling, clear of its noise. [m]
    rotation_deg : float
        Of their length about the direction down, along the walls. [deg]
    luminous_flux_lm : float
        Of each. [lm]
    """

    centers: FloatArray
    rotation_deg: float
    luminous_flux_lm: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centers", float_array(self.centers, name="ProposedPanels.centers", shape=(None, 3)))

    def __len__(self) -> int:
        return int(self.centers.shape[0])


def propose_panels(room: Room, free: FreeSpace) -> ProposedPanels:
    """Square panels in rows along the walls, below whatever ceiling is over them.

    Parameters
    ----------
    room : Room
    free : FreeSpace
        Of its scan.

    Returns
    -------
    panels : ProposedPanels
        One or more. The flux is that of an office of 3600 lm for each 2.4 m x 2.4 m: as a start, not as what hangs
        there.
    """
    pitch = PITCH_M
    plans = _plans(room, pitch)
    while len(plans) > MAX_PANELS and pitch < WIDEST_PITCH_M:
        pitch = min(1.1 * pitch, WIDEST_PITCH_M)
        plans = _plans(room, pitch)
    if not len(plans):  # a narrow room
        plans = _deepest_place(room)[None]
    centers = _below_the_ceiling(plans, room, free)
    if not len(centers):
        centers = np.array([[*_deepest_place(room), room.ceiling_z - CLEARANCE_M]])
    return ProposedPanels(
        centers=centers, rotation_deg=-room.wall_angle_deg + 0.0, luminous_flux_lm=PANEL_LM * (pitch / PITCH_M) ** 2
    )


def _plans(room: Room, pitch_m: float) -> FloatArray:
    """(place, 2) places of a grid in every room of the scan, clear of its walls [m]."""
    return np.concatenate([np.zeros((0, 2)), *_grids(room, pitch_m)])


def _grids(room: Room, pitch_m: float) -> Iterator[FloatArray]:
    along = np.radians(room.wall_angle_deg)
    axes = np.array([[np.cos(along), np.sin(along)], [-np.sin(along), np.cos(along)]])  # rows: along, across the walls
    reach = PANEL_M / 2 + WALL_M
    corners = np.array([[x, y] for x in (-reach, reach) for y in (-reach, reach)])
    for outline in room.outlines:
        turned = outline @ axes.T
        low, high = turned.min(axis=0), turned.max(axis=0)
        counts = np.maximum(np.round((high - low) / pitch_m), 1)
        step = (high - low) / counts
        best = np.zeros((0, 2))
        for shift in SHIFTS:  # of a room that is no rectangle the grid's edge may miss much
            sides = [low[k] + (np.arange(-1, counts[k] + 1) + 0.5 + shift[k]) * step[k] for k in (0, 1)]
            places = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
            within = room.in_plan(((places[:, None] + corners) @ axes).reshape(-1, 2)).reshape(len(places), -1)
            chosen = places[within.all(axis=1)]
            best = chosen if len(chosen) > len(best) else best
        yield best @ axes


def _deepest_place(room: Room) -> FloatArray:
    """(2,) place of the largest room that is farthest from its outline [m]."""
    low, high = room.outline.min(axis=0), room.outline.max(axis=0)
    sides = [np.linspace(low[k], high[k], PLACES) for k in (0, 1)]
    places = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    places = places[within_polygon(places, room.outline)]
    return np.asarray(places[edge_distance(places, room.outline).argmax()], dtype=np.float64)


def _below_the_ceiling(plans: FloatArray, room: Room, free: FreeSpace) -> FloatArray:
    """(panel, 3) centres below the lowest part of the ceiling over each panel; places without air are left out [m]."""
    middle_z = 0.5 * (room.floor_z + room.ceiling_z)
    starts = np.column_stack([plans, np.full(len(plans), max(room.ceiling_z - LOOK_UP_M, middle_z))])
    starts[~free.inside(starts), 2] = middle_z  # below a slope
    starts = starts[free.inside(starts)]
    if not len(starts):
        return starts
    half = PANEL_M / 2
    reach = np.array([[x, y, 0.0] for x in (-half, 0.0, half) for y in (-half, 0.0, half)])
    rays = (starts[:, None] + reach).reshape(-1, 3)
    ceiling = np.repeat(room.ceiling_z - starts[:, 2], len(reach))  # where none was scanned
    up = free.caster.nearest(rays, (0.0, 0.0, 1.0), max_distance=room.height_m).distance
    up = np.where(up < ceiling + LOOK_UP_M, up, ceiling)
    lowest = up.reshape(len(starts), -1).min(axis=1)
    starts[:, 2] += lowest - CLEARANCE_M
    clear: FloatArray = starts[lowest > 2.0 * CLEARANCE_M]
    return clear
