"""What a camera sees of the screens of a virtual room that are on: their light by the angle, and by the moment.

A screen sends most of its light straight ahead: its radiance falls with a power of the cosine, of about a half for a
panel with wide angles (IPS) and up to two for others (TN, VA). A moving picture has another level and another place
of its bright half in each frame. The front throws back a little of the room as glass does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.room.panes.pane import Pane
from research.virtual_rooms.pane_light import LIFT_M, NONE, Sees, ShownPanes

FRONT_REFLECTANCE = 0.04  # [1] of a polished front, of refractive index 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownScreen:
    """A screen as a camera sees it.

    Parameters
    ----------
    pane : Pane
    white : float
        Radiance of its white straight ahead, on the texture's scale.
    fall : float
        Power of the cosine by which it falls. [1]
    moves : bool
        Whether its picture is another in every frame.
    is_polished : bool
        Whether its front throws back an image.
    """

    pane: Pane
    white: float
    fall: float = 0.5
    moves: bool = False
    is_polished: bool = False

    def pictured(self, places: FloatArray, moment: IntArray | int) -> FloatArray:
        """(n,) what it shows of its white at (n, 3) places: a page with lines beside a dark window, or a film [0-1]."""
        away = places - self.pane.center
        across = (away @ self.pane.along) / self.pane.size_m[0]
        if not self.moves:
            lines = (np.sin(90.0 * places[:, 2]) > 0.3) & (across > 0.05)
            return np.where((across > -0.2) & ~lines, 1.0, 0.15)
        scene = np.random.default_rng(977 + int(moment) // 3)  # a cut every 1.5 s
        level, edge = scene.uniform(0.1, 0.9), scene.uniform(-0.3, 0.3)
        return np.where(across > edge, level, 1.0 - level)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownScreens(ShownPanes):
    """All screens of a room; the moment goes on by one with every picture that is taken.

    Parameters
    ----------
    screens : sequence of ShownScreen
        Their numbers are those of `number`'s texels.
    """

    screens: Sequence[ShownScreen] = ()
    _taken: list[int] = field(default_factory=lambda: [0])

    def seen(
        self, start: FloatArray, ways: FloatArray, sees: Sees, bounces: int = 1
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """What rays show; the LiDAR sees screens as they are. Parameters as of `ShownPanes.seen`."""
        moment = self._taken[0]
        self._taken[0] += 1
        light, distance, texel, front = sees(start, ways)
        met = np.full(len(ways), NONE, dtype=np.int64)
        met[front] = self.number[texel[:, 0], texel[:, 1]]
        for number, screen in enumerate(self.screens):
            rays = np.flatnonzero(met == number)
            slope = ways[rays] @ screen.pane.normal
            rays, slope = rays[slope < 0], slope[slope < 0]
            cosine = -slope / np.linalg.norm(ways[rays], axis=1)
            place = start[rays] + distance[rays, None] * ways[rays]
            light[rays] += (screen.white * screen.pictured(place, moment) * cosine**screen.fall)[:, None]
            if screen.is_polished:
                turned = ways[rays] - 2.0 * slope[:, None] * screen.pane.normal
                light[rays] += FRONT_REFLECTANCE * sees(place + LIFT_M * screen.pane.normal, turned)[0]
        return light, np.zeros(len(ways)), np.full(len(ways), NONE, dtype=np.int64)
