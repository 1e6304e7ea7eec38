"""Sampling of the rays that leave the sensors."""

from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.radiance.sampling.receptors import Receptor, draw_directions

SENSOR_OFFSET_M = (
    1e-4  # [m] offset of ray origins along the normal, as in `rtrace -I`, clear of the sensor's own surface
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensors:
    """A block of sensors: positions and unit normals (point, 3) [m, 1], and their receptor."""

    positions: FloatArray
    normals: FloatArray
    receptor: Receptor = field(repr=False)

    def draw_rays(self, points: IntArray, *, sets: int, count: int, generator: np.random.Generator) -> FloatArray:
        """(point, set, count, 6) origins [m] and directions, drawn in proportion to the receptor's response."""
        normals = self.normals[points]
        rays = np.empty((len(normals), sets, count, 6))
        rays[..., :3] = (self.positions[points] + SENSOR_OFFSET_M * normals)[:, None, None]
        rays[..., 3:] = draw_directions(self.receptor, normals, sets=sets, count=count, generator=generator)
        return rays
