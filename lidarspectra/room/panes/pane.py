"""A pane: an upright rectangle of glass, a mirror or a screen."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import ArrayError

PaneKind = Literal["glass", "mirror", "screen"]
REACH_M = 0.12  # [m] before and behind a pane, within which the mesh is the pane's: a phone's walls are as rough
UPRIGHT = 0.2  # [1] largest vertical part of a pane's normal


@dataclass(frozen=True, kw_only=True, eq=False)
class Pane:
    """An upright rectangle of glass, a mirror or a screen.

    Parameters
    ----------
    kind : 'glass', 'mirror' or 'screen'
    center : (3,) float
        [m]
    size_m : (float, float)
        Width and height. [m]
    normal : (3,) float
        Into the room; made a unit vector, and level. [1]
    why : str
        What in the scan speaks for it, as the rest of a sentence; empty for panes that the user gives.
    transmittance : float or None
        Of glass, where frames tell it. [0-1]
    reflectance : float or None
        Of a mirror, where frames tell it. [0-1]
    """

    kind: PaneKind
    center: FloatArray
    size_m: tuple[float, float]
    normal: FloatArray
    why: str = ""
    transmittance: float | None = None
    reflectance: float | None = None

    def __post_init__(self) -> None:
        normal = float_array(self.normal, name="Pane.normal", shape=(3,))
        length = float(np.linalg.norm(normal))
        if not length > 0 or abs(normal[2]) > UPRIGHT * length:
            raise ArrayError(
                expected="the normal of an upright pane, without vertical part",
                found=f"({', '.join(f'{value:g}' for value in normal)})",
                where="Pane.normal",
                todo="Give the direction from the pane into the room, for instance [1, 0, 0].",
            )
        level = np.array([normal[0], normal[1], 0.0])
        object.__setattr__(self, "normal", level / np.linalg.norm(level))
        object.__setattr__(self, "center", float_array(self.center, name="Pane.center", shape=(3,)))

    @property
    def area_m2(self) -> float:
        """[m²]."""
        return self.size_m[0] * self.size_m[1]

    @property
    def along(self) -> FloatArray:
        """(3,) unit vector of its width, to the right as seen from the room [1]."""
        return np.array([-self.normal[1], self.normal[0], 0.0])

    @property
    def corners(self) -> FloatArray:
        """(4, 3) corners, counter-clockwise as seen from the room [m]."""
        half_width, half_height = 0.5 * self.size_m[0] * self.along, np.array([0.0, 0.0, 0.5 * self.size_m[1]])
        return np.array(
            [self.center + a * half_width + b * half_height for a, b in ((1, -1), (-1, -1), (-1, 1), (1, 1))]
        )[::-1]

    def heights(self, places: FloatArray) -> FloatArray:
        """(place,) distance of (place, 3) places before its plane, negative behind it [m]."""
        return np.asarray((places - self.center) @ self.normal, dtype=np.float64)

    def covers(self, places: FloatArray, *, margin_m: float = 0.0) -> BoolArray:
        """(place,) whether (place, 3) places lie before or behind its rectangle, drawn outwards by a margin [m]."""
        away = places - self.center
        across = np.abs(away @ self.along) <= 0.5 * self.size_m[0] + margin_m
        return np.asarray(across & (np.abs(away[:, 2]) <= 0.5 * self.size_m[1] + margin_m), dtype=np.bool_)

    def nearest(self, places: FloatArray) -> FloatArray:
        """(place, 3) points of its rectangle that are nearest to (place, 3) places [m]."""
        away = places - self.center
        half_width, half_height = 0.5 * self.size_m[0], 0.5 * self.size_m[1]
        across = np.clip(away @ self.along, -half_width, half_width)
        up = np.clip(away[:, 2], -half_height, half_height)
        return np.asarray(
            self.center + across[:, None] * self.along + up[:, None] * np.array([0.0, 0.0, 1.0]), dtype=np.float64
        )

    def members(self, places: FloatArray) -> BoolArray:
        """(place,) which (place, 3) places lie in it, within the roughness of a scan [m]."""
        return np.asarray(self.covers(places) & (np.abs(self.heights(places)) <= REACH_M), dtype=np.bool_)

    def overlaps(self, other: "Pane") -> bool:
        """Whether another pane has its middle in this one, or this one in it, about the same plane."""
        return bool(
            abs(self.normal @ other.normal) > 0.9 and (_holds(self, other.center) or _holds(other, self.center))
        )

    def in_words(self) -> str:
        """'glass of 1.2 m x 2.0 m at (3.1, 0.4, 1.2) m'."""
        place = ", ".join(f"{value + 0.0:.1f}" for value in self.center)
        return f"{NAMES[self.kind]} of {self.size_m[0]:.1f} m x {self.size_m[1]:.1f} m at ({place}) m"


NAMES: dict[PaneKind, str] = {"glass": "glass", "mirror": "a mirror", "screen": "a screen"}


def _holds(pane: Pane, place: FloatArray) -> bool:
    near = abs(float(pane.heights(place[None])[0])) <= 3.0 * REACH_M
    return near and bool(pane.covers(place[None])[0])
