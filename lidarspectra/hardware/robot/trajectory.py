"""Positions of the robot over time, and where it was in between."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ReadingError

MIN_POSES = 2
LONGEST_GAP_S = 2.0  # [s] between poses over which a place is interpolated; odometry comes 20 to 30 times a second


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Positions of the robot over time.

    Parameters
    ----------
    unix_s : (pose,) float
        Strictly increasing. [s since 1970, by the robot's clock]
    positions : (pose, 3) float
        [m]
    headings : (pose,) float
        Angle of its forward direction from the x axis, unwrapped. [rad]
    frame : str
        Name of the frame of reference.
    has_headings : bool
        Whether the headings are known; else they are 0.
    """

    unix_s: FloatArray
    positions: FloatArray
    headings: FloatArray
    frame: str
    has_headings: bool = True

    def __post_init__(self) -> None:
        times = float_array(self.unix_s, name="Trajectory.unix_s", shape=(None,))
        if times.size < MIN_POSES or not np.all(np.diff(times) > 0):
            raise ReadingError(
                expected="two poses or more, in order of time",
                found=f"{times.size}",
                where=f"trajectory in frame '{self.frame}'",
                todo="Record while the robot drives.",
            )
        object.__setattr__(self, "unix_s", times)
        shape = (times.size, 3)
        object.__setattr__(self, "positions", float_array(self.positions, name="Trajectory.positions", shape=shape))
        headings = float_array(self.headings, name="Trajectory.headings", shape=times.shape)
        object.__setattr__(self, "headings", float_array(np.unwrap(headings), name="headings", shape=times.shape))

    def __len__(self) -> int:
        return int(self.unix_s.size)

    def at(self, unix_s: ArrayLike, *, longest_gap_s: float) -> tuple[FloatArray, FloatArray]:
        """Position and heading at other times, linear between poses.

        Parameters
        ----------
        unix_s : (n,) float
            When. [s]
        longest_gap_s : float
            No position is given between poses further apart than this, nor beyond the ends. [s]

        Returns
        -------
        positions : (n, 3) float
            NaN where the position is unknown. [m]
        headings : (n,) float
            [rad]
        """
        wanted = np.asarray(unix_s, dtype=np.float64)
        known = np.nan_to_num(wanted, nan=self.unix_s[0] - 1.0)
        after = np.clip(np.searchsorted(self.unix_s, known), 1, self.unix_s.size - 1)
        gap = self.unix_s[after] - self.unix_s[after - 1]
        inside = (known >= self.unix_s[0]) & (known <= self.unix_s[-1]) & (gap <= longest_gap_s)
        position = np.stack([np.interp(known, self.unix_s, self.positions[:, i]) for i in range(3)], axis=-1)
        heading = np.interp(known, self.unix_s, self.headings)
        return np.where(inside[:, None], position, np.nan), np.where(inside, heading, np.nan)

    def moved(self, rotation: FloatArray, translation: FloatArray, *, frame: str) -> "Trajectory":
        """The same in another frame: p' = R p + t."""
        turn = math.atan2(rotation[1, 0], rotation[0, 0])
        return replace(
            self,
            positions=self.positions @ np.asarray(rotation).T + translation,
            headings=self.headings + turn,
            frame=frame,
        )
