"""How a lamp's light spreads over directions: the radiance of its surfaces for a flux Φ.

Lambertian     L = Φ/(πA)                           A: area of all its surfaces; M = πL = Φ/A
CosinePower    L(θ) = (n + 1)Φ/(2πA) cosⁿ⁻¹θ        I = I₀ cosⁿθ, whose flux is 2πI₀ ∫cosⁿθ sinθ dθ = 2πI₀/(n + 1)
CandelaPattern L(θ, φ) = (I(θ, φ)/Φ_v) Φ/(A cosθ)   I: candela table of luminous flux Φ_v; A: opening
SkyLight       what comes in through a window, by direction
SunBeam        parallel light through windows
"""

import math
from dataclasses import dataclass

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LampError
from lidarspectra.lamps.ies import CandelaTable

WIDEST_BEAM_DEG = 120.0  # [deg] a Lambertian disc's own beam, n = 1; wider needs infinite radiance at the edge


@dataclass(frozen=True)
class Lambertian:
    """The same radiance in all directions."""

    def radiance_per_flux(self, area: float) -> float:
        """L/Φ of a surface of some area [m²]: 1/(πA) [1/(m² sr)]."""
        return 1.0 / (math.pi * area)


@dataclass(frozen=True)
class CosinePower:
    """Intensity I₀ cosⁿθ about a flat surface's normal.

    Parameters
    ----------
    exponent : float
        n >= 1; 1 is Lambertian.
    """

    exponent: float

    def radiance_per_flux(self, area: float) -> float:
        """L/Φ on the axis of a surface of some area [m²]: (n + 1)/(2πA) [1/(m² sr)]."""
        return (self.exponent + 1.0) / (2.0 * math.pi * area)


@dataclass(frozen=True, eq=False)
class CandelaPattern:
    """Intensity by a table; θ from the lamp's normal, φ from its length.

    Parameters
    ----------
    table : CandelaTable
    """

    table: CandelaTable


@dataclass(frozen=True, eq=False)
class SkyLight:
    """Daylight through a window.

    Parameters
    ----------
    incoming : (azimuth, altitude, wavelength) float
        See `shapes.Window`. [W/m²/sr/nm]
    """

    incoming: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """A hole in the room's shell, for the sun.

    Parameters
    ----------
    corners : (4, 3) float
        Its rectangle. [m]
    inward : (3,) float
        Unit normal, into the room.
    transmittance : float
        Of its pane for the sun's direction. [0-1]
    """

    corners: FloatArray
    inward: FloatArray
    transmittance: float


@dataclass(frozen=True, eq=False)
class SunBeam:
    """Parallel light along the lamp's normal.

    Parameters
    ----------
    openings : tuple of Opening
        Where it comes in.
    """

    openings: tuple[Opening, ...]


Pattern = Lambertian | CosinePower | CandelaPattern | SkyLight | SunBeam


def beam_exponent(beam_angle_deg: float) -> float:
    """Exponent n of I(θ) = I₀ cosⁿθ that halves the intensity at half the beam angle, n = ln ½ / ln cos(beam/2).

    Parameters
    ----------
    beam_angle_deg : float
        Full angle at half the peak intensity, above 0 and at most 120. [deg]

    Returns
    -------
    exponent : float
        n >= 1.

    Raises
    ------
    LampError
        If the beam is wider than a flat lamp's can be.
    """
    if not 0.0 < beam_angle_deg <= WIDEST_BEAM_DEG + 1e-9:
        raise LampError(
            expected=f"a beam angle above 0 and at most {WIDEST_BEAM_DEG:g} degrees, a flat diffuse lamp's own",
            found=f"{beam_angle_deg:g}",
            where="spot lamp",
            todo="Use shape 'disc' for 120 degrees, 'bulb' for light to all sides, or an IES file.",
        )
    return max(1.0, math.log(0.5) / math.log(math.cos(math.radians(0.5 * beam_angle_deg))))
