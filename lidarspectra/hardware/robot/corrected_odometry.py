"""Odometry put right by positions in a map, which come seldom: the robot's own transform from map to odometry.

A localizer as AMCL publishes where the robot is only once it has moved by a quarter of a metre or turned, so nothing
while it stands; odometry comes 20 to 30 times a second, and drifts. Each position tells how odometry's frame lies in
the map then:

    theta_i = heading_i - heading of the odometry,    p_i = R(theta_i) p of the odometry + t_i

A pose of the odometry is moved by the corrections before and after it, and the mean of both is taken, linear in time.
"""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.robot.trajectory import Trajectory


def corrected_odometry(odometry: Trajectory, fixes: Trajectory, *, longest_gap_s: float) -> Trajectory:
    """Odometry in the frame of a map.

    Parameters
    ----------
    odometry : Trajectory
        Dense.
    fixes : Trajectory
        In the map, by the same clock.
    longest_gap_s : float
        Positions in longer gaps of the odometry correct nothing. [s]

    Returns
    -------
    corrected : Trajectory
        The odometry's times, in the frame of `fixes`; `fixes` themselves where none of them lies within the odometry.
    """
    places, headings = odometry.at(fixes.unix_s, longest_gap_s=longest_gap_s)
    used = np.isfinite(headings)
    if not used.any():
        return fixes
    turns = np.unwrap(fixes.headings[used] - headings[used])
    shifts = fixes.positions[used] - _turned(places[used], turns)
    times = fixes.unix_s[used]
    after = np.searchsorted(times, odometry.unix_s)
    before, after = np.maximum(after - 1, 0), np.minimum(after, times.size - 1)
    span_s = times[after] - times[before]
    weight = np.divide(odometry.unix_s - times[before], span_s, out=np.zeros(len(odometry)), where=span_s > 0)
    moved = [_turned(odometry.positions, turns[index]) + shifts[index] for index in (before, after)]
    turned = [odometry.headings + turns[index] for index in (before, after)]
    return Trajectory(
        unix_s=odometry.unix_s,
        positions=moved[0] + weight[:, None] * (moved[1] - moved[0]),
        headings=turned[0] + weight * (turned[1] - turned[0]),
        frame=fixes.frame,
    )


def _turned(places: FloatArray, angles: FloatArray) -> FloatArray:
    """(n, 3) places, each turned by its angle about the vertical axis [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    x, y, z = places.T
    return np.stack([c * x - s * y, s * x + c * y, z], axis=1)
