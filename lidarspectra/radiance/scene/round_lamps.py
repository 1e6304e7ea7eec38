"""Round lamps of a scene, whose direct light close by is integrated apart from the engine (`sampling.near_lamps`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import CosinePower, Lambertian
from lidarspectra.lamps.surfaces import Circle, Sphere


@dataclass(frozen=True, kw_only=True, eq=False)
class RoundLamp:
    """A disc or a sphere of radiance L(θ)/Φ = (n + 1)/(2πA) cosⁿ⁻¹θ; a sphere has n = 1.

    Parameters
    ----------
    lamp : int
        Index of the scene's lamp.
    center : (3,) float
        [m]
    normal : (3,) float or None
        Direction that a disc faces; None for a sphere.
    radius_m : float
        [m]
    exponent : float
        n. [1]
    """

    lamp: int
    center: FloatArray
    normal: FloatArray | None
    radius_m: float
    exponent: float = 1.0

    @property
    def area(self) -> float:
        """Of all that shines [m²]."""
        return (4.0 if self.normal is None else 1.0) * np.pi * self.radius_m**2

    def radiance(self, cosine: FloatArray) -> FloatArray:
        """L/Φ towards directions whose angle to the surface's normal has some cosine; 0 behind [1/(m² sr)]."""
        on_axis = (self.exponent + 1.0) / (2.0 * np.pi * self.area)
        return np.where(cosine > 0, on_axis * np.maximum(cosine, 1e-12) ** (self.exponent - 1.0), 0.0)

    def record(self) -> dict[str, Any]:
        """For the scene's record; `RoundLamp.of_record` reads it."""
        return {
            "lamp": self.lamp,
            "center": self.center.tolist(),
            "normal": None if self.normal is None else self.normal.tolist(),
            "radius_m": self.radius_m,
            "exponent": self.exponent,
        }

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> "RoundLamp":
        """See `record`."""
        normal = None if record["normal"] is None else np.array(record["normal"])
        return cls(**{**record, "center": np.array(record["center"]), "normal": normal})


def find_round_lamps(lamps: Sequence[Lamp]) -> tuple[RoundLamp, ...]:
    """Those of the lamps that are one disc or sphere whose radiance has a formula: not luminaires with a table."""
    found = []
    for number, lamp in enumerate(lamps):
        pattern = lamp.shape.pattern
        if len(lamp.surfaces) != 1 or not isinstance(pattern, Lambertian | CosinePower):
            continue
        exponent = pattern.exponent if isinstance(pattern, CosinePower) else 1.0
        match lamp.surfaces[0]:
            case Circle(place=place) as circle:
                found.append(
                    RoundLamp(
                        lamp=number,
                        center=place.center,
                        normal=place.normal,
                        radius_m=circle.radius,
                        exponent=exponent,
                    )
                )
            case Sphere(center=center) as sphere:
                found.append(RoundLamp(lamp=number, center=center, normal=None, radius_m=sphere.radius))
            case _:
                pass
    return tuple(found)
