"""What a camera and a LiDAR see at the mirrors and panes of a virtual room: the room reflected, or what lies behind.

A pane of clear glass has two surfaces that reflect by Fresnel's equations, back and forth between them; a mirror
reflects one share at every angle. Both scatter a little, as dust and fingerprints do, by the texture of their own
texels. The LiDAR measures the surface here and there, by dust, and else the way to what is seen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.room.panes.pane import Pane

NONE = -1  # number of the pane of a texel that belongs to none
LIFT_M = 0.02  # [m] reflected rays start so far off a pane
INDEX = 1.52  # [1] of refraction of window glass
ABSORBED = 0.03  # [1] by a pane at normal incidence: 4 to 6 mm of float glass
BOUNCES = 3  # panes met one after another
BLOCK_PX = 24  # [px] of the picture, of patches in which the LiDAR measures the same of a pane
SIDE_M = 0.12  # [m] off its plane, within which a texel in its rectangle is the pane's

Light = tuple[FloatArray, FloatArray, IntArray, IntArray]
"""(n, 3) light, (n,) distance over the ways' lengths, (m, 2) texels, and the (m,) ways that meet a front."""
Sees = Callable[[FloatArray, FloatArray], Light]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownPane:
    """A mirror or a pane of glass as a camera and a LiDAR see it.

    Parameters
    ----------
    pane : Pane
    thickness_m : float
        Along its normal from its surface to the other side, of wall and glass. [m]
    mirror_reflectance : float
        Of a mirror. [0-1]
    surface_share : float
        Of the LiDAR's values that are the pane's own surface. [0-1]
    """

    pane: Pane
    thickness_m: float = 0.0
    mirror_reflectance: float = 0.85
    surface_share: float = 0.4

    def shares(self, cosine: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) reflectance and transmittance at cosines to its normal [1]."""
        if self.pane.kind == "mirror":
            return np.full(len(cosine), self.mirror_reflectance), np.zeros(len(cosine))
        inside = np.sqrt(1.0 - (1.0 - cosine**2) / INDEX**2)
        across = ((cosine - INDEX * inside) / (cosine + INDEX * inside)) ** 2
        along = ((inside - INDEX * cosine) / (inside + INDEX * cosine)) ** 2
        passed = (1.0 - ABSORBED) ** (1.0 / inside)
        once = np.stack([across, along])
        through = (1.0 - once) ** 2 * passed / (1.0 - (once * passed) ** 2)
        return (once * (1.0 + passed * through)).mean(axis=0), through.mean(axis=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownPanes:
    """All panes of a room.

    Parameters
    ----------
    panes : sequence of ShownPane
    number : (size, size) int8
        Of each texel's pane; `NONE` for none.
    """

    panes: Sequence[ShownPane]
    number: "np.ndarray[tuple[int, ...], np.dtype[np.int8]]"

    def seen(
        self, start: FloatArray, ways: FloatArray, sees: Sees, bounces: int = BOUNCES
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """What rays show.

        Parameters
        ----------
        start, ways : (n, 3) float
            [m], [1]
        sees : callable
            What they meet if all is matt.
        bounces : int
            Panes that are followed.

        Returns
        -------
        light : (n, 3) float
        beyond : (n,) float
            Distance over the ways' lengths to what a LiDAR sees in a pane or through it; 0 of rays that meet none. [1]
        met : (n,) int
            Pane that each ray meets first; `NONE` for none.
        """
        light, distance, texel, front = sees(start, ways)
        met, beyond = np.full(len(ways), NONE, dtype=np.int64), np.zeros(len(ways))
        met[front] = self.number[texel[:, 0], texel[:, 1]]
        for number, shown in enumerate(self.panes if bounces else ()):
            rays = np.flatnonzero(met == number)
            normal, way = shown.pane.normal, ways[rays]
            slope = way @ normal
            rays, way, slope = rays[slope < 0], way[slope < 0], slope[slope < 0]
            if not rays.size:
                continue
            # On the true plane: the scan's noise must not bend what a flat pane shows.
            place = start[rays] + (shown.pane.heights(start[rays]) / -slope)[:, None] * way
            reflectance, transmittance = shown.shares(-slope / np.linalg.norm(way, axis=1))
            turned = way - 2.0 * slope[:, None] * normal
            image, image_at, _ = self._at(place + LIFT_M * normal, turned, sees, bounces)
            light[rays] += reflectance[:, None] * image
            beyond[rays] = distance[rays] + image_at
            if shown.pane.kind == "glass":
                past = (shown.thickness_m + LIFT_M) / -slope
                behind, behind_at, _ = self._at(place + past[:, None] * way, way, sees, bounces)
                light[rays] += transmittance[:, None] * behind
                beyond[rays] = distance[rays] + past + behind_at
        return light, beyond, met

    def _at(
        self, start: FloatArray, ways: FloatArray, sees: Sees, bounces: int
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        light, beyond, met = self.seen(start, ways, sees, bounces - 1)
        return light, np.where(met == NONE, sees(start, ways)[1], beyond), met

    def lidar(self, depth: FloatArray, beyond: FloatArray, met: IntArray, generator: np.random.Generator) -> FloatArray:
        """What the LiDAR measures where a picture's (row, column) depth is a pane's, in patches: it, or beyond it."""
        blocks = tuple(-(-side // BLOCK_PX) for side in depth.shape)
        chance = ndimage.zoom(generator.random(blocks), BLOCK_PX, order=0)[: depth.shape[0], : depth.shape[1]]
        share = np.array([*(shown.surface_share for shown in self.panes), 1.0])[met]  # the last is that of NONE
        return np.where((chance >= share) & (beyond > 0), beyond, depth)
