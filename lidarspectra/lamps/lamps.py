"""Lamps: what sends light, in which shape, with which spectrum."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import LampError
from lidarspectra.spectra.spectrum import Spectrum

LampShape = Literal["panel", "disc", "strip", "bulb", "spot", "point", "ies", "window", "sun"]


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Lamp:
    """A light source with an absolute spectrum.

    Parameters
    ----------
    name : str
        The user's words; files get safe names.
    shape : str
        'panel' and 'strip' are Lambertian rectangles, 'disc' and 'spot' round, 'bulb' and 'point' spheres.
    center : (3,) float
        [m]
    normal : (3,) float
        Direction it shines in; made a unit vector. Unused by bulb and point.
    size : tuple of float
        Panel, strip, window: (length, width). Disc, spot, bulb, point: (diameter,). Ies: either. [m]
    rotation_deg : float
        Turn of the length (of a luminaire's 0 degree plane) about the normal, from the x axis (from y where the normal
        is along x). [deg]
    beam_angle_deg : float or None
        Spot: full angle at half the peak intensity. [deg]
    flux : Spectrum
        Spectral radiant flux. [W/nm]
    incoming : (azimuth, altitude, wavelength) float or None
        Window with daylight: radiance that its pane lets in, on `sky`'s grid; a plain Lambertian window without it.
        [W/m²/sr/nm]
    openings : tuple of Opening
        Sun: what it shines through. Its normal is the way its light goes; centre and size are a marker's, for plans.
    candela_file : str or None
        IES LM-63 text (the text itself) for 'ies'; its distribution is used, its flux replaced by `flux`.
    """

    name: str
    shape: LampShape
    center: FloatArray
    size: tuple[float, ...]
    flux: Spectrum
    normal: FloatArray
    rotation_deg: float = 0.0
    beam_angle_deg: float | None = None
    candela_file: str | None = None
    incoming: FloatArray | None = None
    openings: tuple[Opening, ...] = ()

    def __post_init__(self) -> None:
        center = float_array(self.center, name=f"lamp '{self.name}' center", shape=(3,))
        normal = float_array(self.normal, name=f"lamp '{self.name}' normal", shape=(3,))
        length = float(np.linalg.norm(normal))
        if length == 0:
            raise LampError(expected="a direction", found="a normal of length zero", where=f"lamp '{self.name}'")
        wanted = (2,) if self.shape in ("panel", "strip", "window") else (1, 2) if self.shape == "ies" else (1,)
        if len(self.size) not in wanted or min(self.size) <= 0:
            raise LampError(
                expected=f"{' or '.join(map(str, wanted))} positive size(s) in metres for a {self.shape}",
                found=f"{self.size}",
                where=f"lamp '{self.name}'",
            )
        if self.flux.values.min() < 0 or self.flux.values.max() <= 0:
            raise LampError(
                expected="a spectrum that is nowhere negative and somewhere positive",
                found=f"values from {self.flux.values.min():g} to {self.flux.values.max():g}",
                where=f"lamp '{self.name}'",
            )
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "normal", float_array(normal / length, name="normal", shape=(3,)))
