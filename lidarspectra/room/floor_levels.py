"""Floors at another height than the main one: a room up two steps, or down one.

A level surface that faces up may be a floor, a table or a bed. It counts as the floor of a room of its own only where
walls, or a door's lintel, part that room from the others, nothing lower is seen in it and its walls end there.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.room.room_planes import FaceGeometry, Level

LEVEL_TOLERANCE_M = 0.1  # [m] how far a ceiling or floor may lie off its plane and still be that
FLOOR_REACH_M = 0.25  # [m] rays start so far above the floor, below most table tops
MIN_FLOOR_SHARE = 0.3  # share of a patch's area that must show floor, for it to be a room, or a bulge of one
MIN_LOWER_SHARE = 0.05  # share of a patch in which something lower is seen, that tells a table or bed above a floor
MIN_OTHER_M2 = 5.0  # [m²] rooms on another floor are larger: what fills an alcove of less may be a bed
MIN_SHOWN_M2 = 2.0  # [m²] of their floor that must be seen: bed and wardrobe hide half of a bedroom's
STANDING_M = 1.9  # [m] least height above a floor: bunks and tops of cupboards have less
MAX_BELOW_SHARE = 0.05  # of a patch's upright area: a floor has less below it (a step up to it), a bed its sides
MIN_LEVEL_SHARE = 0.05  # of the largest level surface: less is edges of steps and small furniture
WALL_REACH_M = 0.05  # [m] walls stand so far around their room's plan; a neighbour's are behind a wall's thickness


def meets(caster: RayCaster, plan: FloatArray, *, start_z: float, level_z: float) -> BoolArray:
    """Whether a vertical ray from `start_z` meets something within the tolerance of `level_z`, at (place, 2) places."""
    starts = np.column_stack([plan, np.full(len(plan), start_z)])
    reach = abs(level_z - start_z)
    hits = caster.nearest(starts, [0.0, 0.0, np.sign(level_z - start_z)], max_distance=reach + LEVEL_TOLERANCE_M)
    return hits.met & (hits.distance >= reach - LEVEL_TOLERANCE_M)


@dataclass(frozen=True, kw_only=True, eq=False)
class OtherFloors:
    """What a scan has of level surfaces, to tell the floor of a patch of plan that does not show the main one.

    Parameters
    ----------
    caster : RayCaster
    levels : tuple of Level
        That face up, lowest first.
    upright : FaceGeometry
        What may be walls.
    top_z : float
        Main ceiling. [m]
    """

    caster: RayCaster
    levels: tuple[Level, ...]
    upright: FaceGeometry
    top_z: float

    @property
    def large(self) -> tuple[Level, ...]:
        """Levels that may be the floor of a room."""
        return tuple(
            level for level in self.levels if level.area_m2 >= MIN_SHOWN_M2 and self.top_z - level.z >= STANDING_M
        )

    def floor_of(self, patch: BoolArray, origin: FloatArray, cell_m: float) -> float | None:
        """Height of a patch's own floor; None where none is sure.

        Parameters
        ----------
        patch : (row, column) bool
            Cells of the plan that hang together.
        origin : (2,) float
            x and y of the first cell's centre. [m]
        cell_m : float
            [m]

        Returns
        -------
        floor_z : float or None
            [m]
        """
        if patch.sum() * cell_m**2 < MIN_OTHER_M2:
            return None
        plan = origin + cell_m * np.argwhere(patch)[:, ::-1]
        for level in self.levels:
            seen = float(meets(self.caster, plan, start_z=level.z + FLOOR_REACH_M, level_z=level.z).mean())
            if seen >= MIN_LOWER_SHARE:  # the lowest that is seen there: what lies higher stands on it
                sure = level in self.large and seen >= MIN_FLOOR_SHARE
                return level.z if sure and not self._goes_on_below(patch, origin, cell_m, level.z) else None
        return None

    def _goes_on_below(self, patch: BoolArray, origin: FloatArray, cell_m: float, z: float) -> bool:
        """Whether what is upright in a patch and around it reaches below a height, as a bed's sides do."""
        reach = 2 * int(np.ceil(WALL_REACH_M / cell_m)) + 1
        around = cv2.dilate(patch.astype(np.uint8), np.ones((reach, reach), dtype=np.uint8)).astype(bool)
        cells = np.rint((self.upright.centers[:, :2] - origin) / cell_m).astype(np.int64)
        within = np.all((cells >= 0) & (cells < [patch.shape[1], patch.shape[0]]), axis=1)
        within[within] = around[cells[within, 1], cells[within, 0]]
        upright = self.upright.some(within & (np.abs(self.upright.normals[:, 2]) < 0.5))
        below = upright.areas[upright.tops < z - LEVEL_TOLERANCE_M].sum()
        return bool(below > MAX_BELOW_SHARE * upright.areas.sum())
