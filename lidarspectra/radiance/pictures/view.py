"""A view: where the eye is, where it looks, and the ray and solid angle of every pixel.

Two projections of Radiance (`rpict` -vt): 'perspective' (v), in which straight edges stay straight, and 'fisheye' (a),
in which the distance from the middle is the angle from the line of sight, as `evalglare` wants it.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from lidarspectra.arguments import one_of
from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import SceneError

Projection = Literal["perspective", "fisheye"]
PROJECTIONS: tuple[Projection, ...] = ("perspective", "fisheye")
RADIANCE_LETTER: dict[Projection, str] = {"perspective": "v", "fisheye": "a"}  # -vtv, -vta of rpict
WIDEST_DEG: dict[Projection, float] = {"perspective": 150.0, "fisheye": 360.0}
MAX_PIXELS = 4096  # of a side


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What a picture shows.

    Parameters
    ----------
    eye : (3,) float
        [m]
    direction : (3,) float
        Line of sight; made a unit vector.
    projection : 'perspective' or 'fisheye'
    angle_deg : float
        Seen from the left edge to the right. [deg]
    pixels : (int, int)
        Width and height; a fisheye is as high as wide.
    up : (3,) float
        What is up in the picture; z by default.

    Raises
    ------
    SceneError
        If there is no such view.
    """

    eye: FloatArray
    direction: FloatArray
    projection: Projection = "perspective"
    angle_deg: float = 70.0
    pixels: tuple[int, int] = (800, 600)
    up: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))

    def __post_init__(self) -> None:
        one_of(self.projection, PROJECTIONS, name="projection")
        object.__setattr__(self, "eye", float_array(self.eye, name="View.eye", shape=(3,)))
        direction, up = (
            float_array(getattr(self, name), name=f"View.{name}", shape=(3,)) for name in ("direction", "up")
        )
        length = float(np.linalg.norm(direction))
        across = float(np.linalg.norm(np.cross(direction, up)))
        if length == 0 or across < 1e-6 * length * float(np.linalg.norm(up)):
            raise SceneError(
                expected="a line of sight that is not along what is up in the picture",
                found=f"direction {direction.tolist()}, up {up.tolist()}",
                where="view",
                todo="Look at another point than the eye's; to look straight up or down give another up.",
            )
        width, height = self.pixels
        square = self.projection == "perspective" or width == height
        if not (1 <= width <= MAX_PIXELS and 1 <= height <= MAX_PIXELS and square):
            raise SceneError(
                expected=f"1 to {MAX_PIXELS} pixels a side, and a fisheye as high as wide",
                found=f"{width} x {height}",
                where="view",
            )
        if not 0 < self.angle_deg <= WIDEST_DEG[self.projection]:
            raise SceneError(
                expected=f"an angle above 0 and up to {WIDEST_DEG[self.projection]:g} degrees",
                found=f"{self.angle_deg:g}",
                where=f"view, {self.projection}",
            )
        object.__setattr__(self, "direction", float_array(direction / length, name="View.direction", shape=(3,)))

    @property
    def height_deg(self) -> float:
        """Seen from the lower edge to the upper [deg]."""
        if self.projection == "fisheye":
            return self.angle_deg
        half = np.tan(np.radians(self.angle_deg) / 2.0) * self.pixels[1] / self.pixels[0]
        return float(2.0 * np.degrees(np.arctan(half)))

    @property
    def axes(self) -> tuple[FloatArray, FloatArray]:
        """Unit vectors to the right and up in the picture."""
        right = np.cross(self.direction, self.up)
        right = right / np.linalg.norm(right)
        return right, np.cross(right, self.direction)

    def directions(self, offset: tuple[float, float] = (0.5, 0.5)) -> tuple[FloatArray, BoolArray]:
        """Direction of every pixel, from the upper left corner, row by row.

        Parameters
        ----------
        offset : (float, float)
            Where in its pixel a ray goes through, from the left and from the upper edge. [pixel]

        Returns
        -------
        directions : (row, column, 3) float
            Unit vectors; the line of sight outside the circle of a fisheye.
        inside : (row, column) bool
            False outside that circle.
        """
        width, height = self.pixels
        x = (np.arange(width) + offset[0]) / width - 0.5
        y = 0.5 - (np.arange(height) + offset[1]) / height
        across, upward = np.meshgrid(x, y)
        right, up = self.axes
        if self.projection == "perspective":
            across = across * 2.0 * np.tan(np.radians(self.angle_deg) / 2.0)
            upward = upward * 2.0 * np.tan(np.radians(self.height_deg) / 2.0)
            found = self.direction + across[..., None] * right + upward[..., None] * up
            return found / np.linalg.norm(found, axis=-1, keepdims=True), np.ones(across.shape, dtype=np.bool_)
        radius = np.hypot(across, upward)
        inside = radius <= 0.5
        angle = np.where(inside, radius * np.radians(self.angle_deg), 0.0)
        # sin(angle) / radius, whose limit in the middle is the angle per unit of radius
        slope = np.where(radius > 0, np.sin(angle) / np.where(radius > 0, radius, 1.0), np.radians(self.angle_deg))
        slope = np.where(inside, slope, 0.0)
        found = np.cos(angle)[..., None] * self.direction
        found = found + (slope * across)[..., None] * right + (slope * upward)[..., None] * up
        return found, inside

    def solid_angles(self) -> FloatArray:
        """(row, column) solid angle of every pixel, 0 outside a fisheye's circle [sr]."""
        width = self.pixels[0]
        directions, inside = self.directions()
        if self.projection == "perspective":
            side = 2.0 * np.tan(np.radians(self.angle_deg) / 2.0) / width
            return np.asarray(side**2 * (directions @ self.direction) ** 3, dtype=np.float64)
        step = np.radians(self.angle_deg) / width
        angle = np.arccos(np.clip(directions @ self.direction, -1.0, 1.0))
        return np.where(inside, step**2 * np.sinc(angle / np.pi), 0.0)

    def radiance_words(self) -> tuple[str, ...]:
        """The view as options of `rpict`, for the header of an HDR file."""
        vectors = (("-vp", self.eye), ("-vd", self.direction), ("-vu", self.up))
        words = [f"-vt{RADIANCE_LETTER[self.projection]}"]
        for name, vector in vectors:
            words += [name, *(f"{value:.6g}" for value in vector)]
        return (*words, "-vh", f"{self.angle_deg:.6g}", "-vv", f"{self.height_deg:.6g}")
