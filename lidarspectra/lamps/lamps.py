"""Lamps: what sends light, in which shape, with which spectrum."""

from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import LampError
from lidarspectra.lamps.shapes import Shape, Sun, Window
from lidarspectra.lamps.surfaces import Place, Surface
from lidarspectra.spectra.spectrum import Spectrum

DOWN = (0.0, 0.0, -1.0)
SAME_PLACE_M = 1e-3  # [m] lamps of one shape nearer than this are one; also of unit vectors, for a size of a metre


@dataclass(frozen=True, kw_only=True, eq=False)
class Lamp:
    """A light source with an absolute spectrum.

        Lamp(name="panel 1", shape=Panel(0.6, 0.6), center=(2.0, 1.5, 2.6), flux=spectrum)

    Parameters
    ----------
    name : str
        The user's words; files get safe names.
    shape : Shape
        What shines, how large, and how its light spreads: `Panel`, `Disc`, `Bulb`, ... of `lamps.shapes`.
    center : (3,) float
        [m]
    flux : Spectrum
        Spectral radiant flux. [W/nm]
    normal : (3,) float
        Direction it shines in, down if left out; made a unit vector. Unused by shapes that shine alike to all sides.
    rotation_deg : float
        Turn of the length (of a luminaire's 0 degree plane) about the normal, from the x axis (from y where the normal
        is along x). [deg]
    """

    name: str
    shape: Shape
    center: FloatArray
    flux: Spectrum
    normal: FloatArray = field(default_factory=lambda: np.array(DOWN))
    rotation_deg: float = 0.0

    def __post_init__(self) -> None:
        where = f"lamp '{self.name}'"
        if not isinstance(self.shape, Shape):
            raise LampError(
                expected="a shape such as Panel(0.6, 0.6)",
                found=repr(self.shape),
                where=where,
                todo="The shapes are in lidarspectra.lamps.shapes; make_lamp takes the word.",
            )
        center = float_array(self.center, name=f"{where} center", shape=(3,))
        normal = float_array(self.normal, name=f"{where} normal", shape=(3,))
        length = float(np.linalg.norm(normal))
        if length == 0:
            raise LampError(expected="a direction", found="a normal of length zero", where=where)
        if self.flux.values.min() < 0 or self.flux.values.max() <= 0:
            raise LampError(
                expected="a spectrum that is nowhere negative and somewhere positive",
                found=f"values from {self.flux.values.min():g} to {self.flux.values.max():g}",
                where=where,
            )
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "normal", float_array(normal / length, name="normal", shape=(3,)))

    def __repr__(self) -> str:
        place = ", ".join(f"{value:.2f}" for value in self.center)
        return f"<Lamp '{self.name}': {self.shape.word} at ({place}) m, {self.flux.integral():.3g} W>"

    @property
    def size(self) -> tuple[float, ...]:
        """Length and width, or diameter [m]."""
        return self.shape.size

    @property
    def place(self) -> Place:
        """Its centre, and the directions of its length, width and normal."""
        return Place.facing(self.center, self.normal, self.rotation_deg)

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """What shines, where it stands; nothing for the sun."""
        return self.shape.surfaces(self.place)

    @property
    def is_in_room(self) -> bool:
        """Whether it hangs in the room; the sun does not."""
        return bool(self.surfaces)

    def outline(self) -> FloatArray:
        """(corner, 3) polygon that shows where it is and how large [m]."""
        return self.shape.outline(self.place)

    def distance(self, places: FloatArray) -> FloatArray:
        """Distance of places from the nearest surface that shines.

        Parameters
        ----------
        places : (n, 3) float
            [m]

        Returns
        -------
        distance : (n,) float
            0 within a sphere, infinite from the sun. [m]
        """
        distances = [surface.distance(places) for surface in self.surfaces]
        return np.min(distances, axis=0) if distances else np.full(len(places), np.inf)

    def sample(self, generator: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
        """Draw points spread evenly over the surfaces that shine.

        Parameters
        ----------
        generator : numpy.random.Generator
        count : int
            Above 0.

        Returns
        -------
        places : (n, 3) float
            [m]
        normals : (n, 3) float
            Unit vectors, outward.

        Raises
        ------
        LampError
            If it is the sun, which has none.
        """
        if not self.is_in_room:
            raise LampError(expected="a lamp in the room", found="the sun", where=f"lamp '{self.name}'")
        areas = np.array([surface.area for surface in self.surfaces])
        chosen = generator.choice(len(areas), size=count, p=areas / areas.sum())
        parts = [
            surface.sample(*generator.random((2, int((chosen == index).sum()))))
            for index, surface in enumerate(self.surfaces)
        ]
        return np.concatenate([places for places, _ in parts]), np.concatenate([normals for _, normals in parts])


def is_daylight(lamp: Lamp) -> bool:
    """Whether a lamp stands for daylight: a window with what comes through it, or the sun."""
    return isinstance(lamp.shape, Window | Sun)


def are_one_shape(lamp: Lamp, other: Lamp) -> bool:
    """Whether two lamps in the room have equal shapes in one place, as the warm and the cold light of one luminaire.

    Windows with daylight and the sun never are.
    """
    if is_daylight(lamp) or lamp.shape != other.shape:
        return False
    here, there = lamp.place, other.place
    turned = max(float(np.abs(here.normal - there.normal).max()), float(np.abs(here.length - there.length).max()))
    near = float(np.abs(lamp.center - other.center).max()) < SAME_PLACE_M
    return near and (turned < SAME_PLACE_M or not lamp.shape.has_axis)
