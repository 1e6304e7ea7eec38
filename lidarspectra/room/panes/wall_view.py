"""A wall as the room sees it, square by square: how deep what is seen lies behind the wall's plane, and its colour."""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.appearance import CLOSED_KINDS
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.panes.pane import Pane, PaneKind
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import Wall

CELL_M = 0.05  # [m] of a wall; a phone's triangles are about as wide
START_M = 0.3  # [m] before the wall from which it is looked at: over what hangs flat on it, before most furniture
COVERED_M = 1.0  # [m] before a wall within which furniture hides it, and its scan may lack it
SIDE = 2  # place in `CLOSED_KINDS`
EDGE_M = 0.1  # [m] of floor, ceiling and the walls beside it: rounded in scans, and seen as holes of the wall


@dataclass(frozen=True, kw_only=True, eq=False)
class WallView:
    """A wall as the room sees it; rows go up, columns along `along`.

    Parameters
    ----------
    wall : Wall
    origin : (3,) float
        Middle of the first square. [m]
    along : (3,) float
        Unit vector from column to column. [1]
    depth : (row, column) float
        How far behind the wall's plane what is seen lies; infinite where nothing is. [m]
    face : (row, column) int
        Of the scan; -1 where nothing is seen.
    color : (row, column, 3) float
        Linear sRGB; 0 where nothing is seen. [0-1]
    back : (row, column) bool
        Whether what is seen is the back of a face: of another room's wall.
    covered : (row, column) bool
        Whether furniture stands before it, so that the scan may lack the wall there.
    inside : (row, column) bool
        Whether what is seen there belongs to the room's plan: another of its rooms, through a passage.
    """

    wall: Wall
    origin: FloatArray
    along: FloatArray
    depth: FloatArray
    face: IntArray
    color: FloatArray
    back: BoolArray
    covered: BoolArray
    inside: BoolArray

    def pane(self, mask: BoolArray, kind: PaneKind, why: str) -> Pane:
        """The rectangle around squares, (row, column) bool, as a pane in the wall's plane."""
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        middle = self.origin + 0.5 * CELL_M * (
            (columns[0] + columns[-1]) * self.along + (rows[0] + rows[-1]) * np.array([0.0, 0.0, 1.0])
        )
        size = (CELL_M * (columns[-1] - columns[0] + 1), CELL_M * (rows[-1] - rows[0] + 1))
        return Pane(kind=kind, center=middle, size_m=size, normal=self.wall.normal, why=why)


def wall_view(scan: Scan, room: Room, wall: Wall, caster: RayCaster) -> WallView:
    """Look at a wall square on, from just before it.

    Parameters
    ----------
    scan : Scan
    room : Room
        In it.
    wall : Wall
        Of the room.
    caster : RayCaster
        Of the scan.

    Returns
    -------
    view : WallView
        Without the outermost `EDGE_M` of the wall.
    """
    along = np.array([-wall.normal[1], wall.normal[0], 0.0])
    ends = np.sort([wall.start @ along[:2], wall.end @ along[:2]])
    across = np.arange(ends[0] + EDGE_M + 0.5 * CELL_M, ends[1] - EDGE_M, CELL_M)
    before = 0.5 * (wall.start + wall.end) + START_M * wall.normal[:2]
    floor_z = float(room.floor_at(before[None])[0])
    up = np.arange(floor_z + EDGE_M + 0.5 * CELL_M, room.ceiling_z - EDGE_M, CELL_M)
    shape = (len(up), len(across))
    in_plane = (
        wall.offset_m * wall.normal + across[None, :, None] * along + up[:, None, None] * np.array([0.0, 0.0, 1.0])
    )
    places = in_plane.reshape(-1, 3)
    hits = caster.nearest(places + START_M * wall.normal, -wall.normal)
    met = hits.met & ~scan.appearance.of_kind(CLOSED_KINDS[SIDE])[hits.face]  # what closes a scan shows no glass
    color = np.zeros((len(places), 3))
    color[met] = scan.appearance.sample(hits.face[met], hits.barycentric[met])
    back = met & (caster.normals[hits.face] @ wall.normal < 0.0)
    covered = caster.blocked(places + START_M * wall.normal, wall.normal, max_distance=COVERED_M - START_M)
    behind = np.where(met, hits.distance - START_M, np.inf)
    beyond = places - (0.9 * np.clip(behind, 0.0, 1e3)[:, None] * wall.normal)  # just before what is seen there
    return WallView(
        wall=wall,
        origin=np.asarray(places[0], dtype=np.float64) if len(places) else np.zeros(3),
        along=along,
        depth=behind.reshape(shape),
        face=np.where(met, hits.face, -1).reshape(shape),
        color=color.reshape(*shape, 3),
        back=back.reshape(shape),
        covered=covered.reshape(shape),
        inside=(room.in_plan(beyond) & met).reshape(shape),
    )
