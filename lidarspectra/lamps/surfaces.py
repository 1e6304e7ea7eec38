"""Surfaces that lamps shine from, in their place in the room: rectangle, circle, sphere.

Every lamp's shape is made of these (`shapes`). A surface knows its area, its corners, how far away it is, and how to be
sampled; whoever draws, traces or exports a lamp asks its surfaces and need not know which lamp it is.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import LampError

ALONG_X = 0.999  # [1] x component of a normal from which the length is taken from the y axis
RIM = 0.98  # [1] of the way to the rim, where a surface is tried for what stands before it
ROUND_CORNERS = 24  # corners of the polygon that stands for a circle in drawings


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """Where a flat thing is and how it is turned.

    Parameters
    ----------
    center : (3,) float
        [m]
    length, width, normal : (3,) float
        Unit vectors; length x width = normal.
    """

    center: FloatArray
    length: FloatArray
    width: FloatArray
    normal: FloatArray

    @classmethod
    def facing(cls, center: FloatArray, normal: FloatArray, rotation_deg: float = 0.0) -> "Place":
        """Place of something that faces a direction.

        The length lies along the x axis as far as the normal allows (along y where the normal is along x), turned by
        `rotation_deg` about the normal.

        Parameters
        ----------
        center : (3,) float
            [m]
        normal : (3,) float
            Unit vector.
        rotation_deg : float
            [deg]

        Raises
        ------
        LampError
            If the normal has no length.
        """
        if not normal.any():
            raise LampError(expected="a direction", found="a normal of length zero", where="place of a surface")
        reference = np.array([1.0, 0.0, 0.0])
        if abs(normal[0]) > ALONG_X:
            reference = np.array([0.0, 1.0, 0.0])
        length = reference - (reference @ normal) * normal
        length /= np.linalg.norm(length)
        width = np.cross(normal, length)
        angle = math.radians(rotation_deg)
        turned = math.cos(angle) * length + math.sin(angle) * width
        return cls(center=center, length=turned, width=np.cross(normal, turned), normal=normal)

    def moved(self, along_normal: float) -> "Place":
        """The same, farther along the normal by some metres."""
        return Place(
            center=self.center + along_normal * self.normal, length=self.length, width=self.width, normal=self.normal
        )

    def turned_over(self) -> "Place":
        """The same, facing the other way."""
        return Place(center=self.center, length=self.length, width=-self.width, normal=-self.normal)

    def points(self, along: FloatArray, across: FloatArray) -> FloatArray:
        """(n, 3) points in the plane, from distances along length and width [m]."""
        return np.asarray(self.center + along[:, None] * self.length + across[:, None] * self.width)


class Surface(Protocol):
    """What all surfaces know."""

    @property
    def area(self) -> float:
        """Area of the side that shines [m²]."""

    @property
    def normal(self) -> FloatArray | None:
        """(3,) direction that it faces; None where it faces all."""

    def outline(self, corners: int = ROUND_CORNERS) -> FloatArray:
        """(corner, 3) polygon that shows where it is and how large [m]; of a sphere its level great circle."""

    def marks(self) -> FloatArray:
        """(mark, 3) its middle, then points all over it towards the rim [m]."""

    def distance(self, places: FloatArray) -> FloatArray:
        """(n,) distance of (n, 3) places from it [m]; 0 within a sphere."""

    def sample(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) points spread evenly over it [m], and its (n, 3) unit normals there, from (n,) pairs in [0, 1)."""


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A rectangle that shines along its normal.

    Parameters
    ----------
    place : Place
    length, width : float
        [m]
    """

    place: Place
    length: float
    width: float

    @property
    def area(self) -> float:
        """Length times width [m²]."""
        return self.length * self.width

    @property
    def normal(self) -> FloatArray:
        """(3,) direction that it faces."""
        return self.place.normal

    def corners(self) -> FloatArray:
        """(4, 3) [m], counter-clockwise seen from where it shines."""
        along, across = 0.5 * self.length * self.place.length, 0.5 * self.width * self.place.width
        return np.asarray(
            self.place.center + np.stack([-along - across, along - across, along + across, across - along])
        )

    def outline(self, corners: int = ROUND_CORNERS) -> FloatArray:
        """(4, 3) its corners [m], however many are asked for."""
        return self.corners()

    def marks(self) -> FloatArray:
        """(11, 3) middle, sides, corners, and half-way along [m]."""
        sides = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1), (0.5, 0), (-0.5, 0)]
        along, across = RIM * 0.5 * np.array([self.length, self.width])[:, None] * np.array(sides).T
        return self.place.points(along, across)

    def distance(self, places: FloatArray) -> FloatArray:
        """(n,) distance of (n, 3) places [m]."""
        away = places - self.place.center
        in_plane = np.abs(away @ np.stack([self.place.length, self.place.width], axis=1))
        beside = np.linalg.norm(np.maximum(in_plane - 0.5 * np.array([self.length, self.width]), 0.0), axis=1)
        return np.asarray(np.hypot(away @ self.normal, beside))

    def holds(self, places: FloatArray) -> BoolArray:
        """(...) whether (..., 3) places in its plane lie on it [m]."""
        away = places - self.place.center
        along, across = np.abs(away @ self.place.length), np.abs(away @ self.place.width)
        return np.asarray((along <= 0.5 * self.length) & (across <= 0.5 * self.width), dtype=np.bool_)

    def sample(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) points [m] and normals, see `Surface`."""
        places = self.place.points((u - 0.5) * self.length, (v - 0.5) * self.width)
        return places, np.broadcast_to(self.normal, places.shape)


@dataclass(frozen=True, eq=False)
class Circle:
    """A flat disc that shines along its normal.

    Parameters
    ----------
    place : Place
    diameter : float
        [m]
    """

    place: Place
    diameter: float

    @property
    def radius(self) -> float:
        """Half the diameter [m]."""
        return 0.5 * self.diameter

    @property
    def area(self) -> float:
        """Area πr² [m²]."""
        return math.pi * self.radius**2

    @property
    def normal(self) -> FloatArray:
        """(3,) direction that it faces."""
        return self.place.normal

    def outline(self, corners: int = ROUND_CORNERS) -> FloatArray:
        """(corner, 3) polygon on the circle [m], counter-clockwise seen from where it shines."""
        turn = 2.0 * np.pi * np.arange(corners) / corners
        return self.place.points(self.radius * np.cos(turn), self.radius * np.sin(turn))

    def marks(self) -> FloatArray:
        """(5, 3) middle and four places at the rim [m]."""
        along, across = RIM * self.radius * np.array([[0, 1, -1, 0, 0], [0, 0, 0, 1, -1]])
        return self.place.points(along, across)

    def distance(self, places: FloatArray) -> FloatArray:
        """(n,) distance of (n, 3) places [m]."""
        away = places - self.place.center
        height = away @ self.normal
        beside = np.maximum(np.linalg.norm(away - height[:, None] * self.normal, axis=1) - self.radius, 0.0)
        return np.asarray(np.hypot(height, beside))

    def holds(self, places: FloatArray) -> BoolArray:
        """(...) whether (..., 3) places in its plane lie on it [m]."""
        return np.asarray(np.linalg.norm(places - self.place.center, axis=-1) <= self.radius, dtype=np.bool_)

    def sample(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) points [m] and normals, see `Surface`."""
        radius = self.radius * np.sqrt(u)
        places = self.place.points(radius * np.cos(2.0 * np.pi * v), radius * np.sin(2.0 * np.pi * v))
        return places, np.broadcast_to(self.normal, places.shape)


@dataclass(frozen=True, eq=False)
class Sphere:
    """A sphere that shines from its outside.

    Parameters
    ----------
    center : (3,) float
        [m]
    diameter : float
        [m]
    """

    center: FloatArray
    diameter: float

    @property
    def normal(self) -> None:
        """None: it faces all directions."""
        return None

    @property
    def radius(self) -> float:
        """Half the diameter [m]."""
        return 0.5 * self.diameter

    @property
    def area(self) -> float:
        """Area 4πr² [m²]."""
        return 4.0 * math.pi * self.radius**2

    def outline(self, corners: int = ROUND_CORNERS) -> FloatArray:
        """(corner, 3) polygon on the level great circle [m]."""
        turn = 2.0 * np.pi * np.arange(corners) / corners
        circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(corners)], axis=1)
        return np.asarray(self.center + self.radius * circle)

    def marks(self) -> FloatArray:
        """(7, 3) middle, and where the axes leave it [m]."""
        return np.asarray(self.center + RIM * self.radius * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)]))

    def distance(self, places: FloatArray) -> FloatArray:
        """(n,) distance of (n, 3) places, 0 within [m]."""
        return np.asarray(np.maximum(np.linalg.norm(places - self.center, axis=1) - self.radius, 0.0))

    def sample(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) points [m] and normals, see `Surface`."""
        height, turn = 2.0 * u - 1.0, 2.0 * np.pi * v
        wide = np.sqrt(1.0 - height**2)
        outward = np.stack([wide * np.cos(turn), wide * np.sin(turn), height], axis=1)
        return self.center + self.radius * outward, outward
