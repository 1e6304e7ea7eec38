"""What shapes lamps have: one record for each word of the run file's `shape`.

    panel, strip, window   Lambertian rectangle
    disc                   Lambertian disc
    bulb, point            Lambertian sphere
    spot                   disc whose intensity falls as a power of the cosine
    ies                    flat opening with a candela table, on both sides where it shines up too
    sun                    parallel light through windows; no part of the room

A record says which surfaces shine (`surfaces`) and how their light spreads (`patterns`). All else, from distances and
drawings to the Radiance text, follows from these two, so that a new shape made of them is one record here.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LampError
from lidarspectra.lamps.ies import CandelaTable, read_ies
from lidarspectra.lamps.patterns import (
    CandelaPattern,
    CosinePower,
    Lambertian,
    Opening,
    Pattern,
    SkyLight,
    SunBeam,
    beam_exponent,
)
from lidarspectra.lamps.surfaces import Circle, Place, Rectangle, Sphere, Surface

TWO_FACES_APART_M = 0.002  # [m] between the lower and upper face of a luminaire that shines both ways
MIN_SHARE = 1e-4  # share of the flux below which one way is not worth a face
SUN_MARKER_M = 0.05  # [m] diameter of the sun on plans, where its windows are
_ANYWHERE = Place.facing(np.zeros(3), np.array([0.0, 0.0, -1.0]))  # for what does not depend on the place


class Shape(ABC):
    """Shape of a lamp: a frozen dataclass of its sizes [m] and of what else the run file says."""

    word: ClassVar[str]
    """The run file's."""
    size_names: ClassVar[tuple[str, ...]]
    """Its fields that are sizes, in the run file's order."""
    is_assumed_matt: ClassVar[bool] = False
    """Whether it counts as Lambertian only because nobody has measured it."""

    def __post_init__(self) -> None:
        if not all(math.isfinite(size) and size > 0 for size in self.size):
            raise LampError(
                expected=f"{len(self.size_names)} positive size(s) in metres for a {self.word}",
                found=f"{self.size}",
                where=f"shape '{self.word}'",
            )

    @property
    def size(self) -> tuple[float, ...]:
        """Length and width, or diameter [m]."""
        return tuple(float(getattr(self, name)) for name in self.size_names)

    @property
    def options(self) -> dict[str, object]:
        """All fields but the sizes, by name."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.name not in self.size_names}  # type: ignore[arg-type]

    @classmethod
    def of_size(cls, size: tuple[float, ...] | None, options: Mapping[str, object]) -> Self:
        """The shape from a list of sizes, or with its usual ones.

        Parameters
        ----------
        size : tuple of float or None
            In the order of `size_names`. [m]
        options : mapping
            Its other fields by name.

        Raises
        ------
        LampError
            If there are too few or too many sizes.
        """
        if size is None and all(each.default is MISSING for each in fields(cls) if each.name in cls.size_names):  # type: ignore[arg-type]
            raise LampError(
                expected=f"'size' in metres for a {cls.word}",
                found="none",
                where=f"shape '{cls.word}'",
                todo="Measure the lamp.",
            )
        if size is not None and len(size) != len(cls.size_names):
            raise LampError(
                expected=f"{len(cls.size_names)} positive size(s) in metres for a {cls.word}",
                found=f"{size}",
                where=f"shape '{cls.word}'",
            )
        return cls(**dict(zip(cls.size_names, size or (), strict=False)), **options)

    @abstractmethod
    def surfaces(self, place: Place) -> tuple[Surface, ...]:
        """What shines, for a lamp in its place; nothing for light that comes from outside the room."""

    @property
    def pattern(self) -> Pattern:
        """How the light of each surface spreads."""
        return Lambertian()

    @property
    def area(self) -> float:
        """Area of all surfaces that shine [m²]."""
        return sum(surface.area for surface in self.surfaces(_ANYWHERE))

    @property
    def has_axis(self) -> bool:
        """Whether its normal matters: not for what shines alike to all sides."""
        surfaces = self.surfaces(_ANYWHERE)
        return not surfaces or any(surface.normal is not None for surface in surfaces)

    def outline(self, place: Place) -> FloatArray:
        """(corner, 3) polygon that shows where the lamp is and how large [m]: its first surface's."""
        return self.surfaces(place)[0].outline()


@dataclass(frozen=True)
class _Rectangular(Shape):
    length: float
    width: float

    size_names = ("length", "width")

    def surfaces(self, place: Place) -> tuple[Rectangle]:
        """One rectangle."""
        return (Rectangle(place, self.length, self.width),)


@dataclass(frozen=True)
class _Flat(Shape):
    diameter: float

    size_names = ("diameter",)

    def surfaces(self, place: Place) -> tuple[Circle]:
        """One circle."""
        return (Circle(place, self.diameter),)


@dataclass(frozen=True)
class _Round(Shape):
    diameter: float

    size_names = ("diameter",)

    def surfaces(self, place: Place) -> tuple[Sphere]:
        """One sphere, however the lamp is turned."""
        return (Sphere(place.center, self.diameter),)


@dataclass(frozen=True)
class Panel(_Rectangular):
    """Matt rectangle.

    Parameters
    ----------
    length, width : float
        [m]
    """

    word = "panel"
    is_assumed_matt = True

    @classmethod
    def of_size(cls, size: tuple[float, ...] | None, options: Mapping[str, object]) -> Self:
        """As `Shape.of_size`; one size is a square's side."""
        return super().of_size(size * 2 if size is not None and len(size) == 1 else size, options)


@dataclass(frozen=True)
class Strip(_Rectangular):
    """Long matt rectangle.

    Parameters
    ----------
    length, width : float
        [m]
    """

    word = "strip"
    is_assumed_matt = True


@dataclass(frozen=True, eq=False)
class Window(_Rectangular):
    """Rectangle through which daylight comes.

    Parameters
    ----------
    length, width : float
        [m]
    incoming : (azimuth, altitude, wavelength) float or None
        Radiance of what lies behind its pane times the transmittance at normal incidence, on `radiance.scene.sky`'s
        grid; a Lambertian window without it. [W/m²/sr/nm]
    """

    incoming: FloatArray | None = None

    word = "window"

    @property
    def pattern(self) -> Lambertian | SkyLight:
        """By direction of the sky, where that is known."""
        return Lambertian() if self.incoming is None else SkyLight(self.incoming)


@dataclass(frozen=True)
class Disc(_Flat):
    """Matt disc.

    Parameters
    ----------
    diameter : float
        [m]
    """

    word = "disc"
    is_assumed_matt = True


@dataclass(frozen=True)
class Spot(_Flat):
    """Disc with a beam, I(θ) = I₀ cosⁿθ.

    Parameters
    ----------
    diameter : float
        A common downlight's, 8 cm, if left out. [m]
    beam_angle_deg : float
        Full angle at half the peak intensity, above 0 and at most 120. [deg]
    """

    diameter: float = 0.08
    beam_angle_deg: float = field(kw_only=True)

    word = "spot"

    def __post_init__(self) -> None:
        super().__post_init__()
        beam_exponent(self.beam_angle_deg)  # refuses what no flat lamp has

    @property
    def pattern(self) -> CosinePower:
        """The power that halves the intensity at half the beam angle."""
        return CosinePower(beam_exponent(self.beam_angle_deg))


@dataclass(frozen=True)
class Bulb(_Round):
    """Matt sphere.

    Parameters
    ----------
    diameter : float
        An A60 bulb's, 6 cm, if left out. [m]
    """

    diameter: float = 0.06

    word = "bulb"


@dataclass(frozen=True)
class Point(_Round):
    """Next to nothing, that shines alike to all sides.

    Parameters
    ----------
    diameter : float
        1 cm if left out. [m]
    """

    diameter: float = 0.01

    word = "point"


@dataclass(frozen=True)
class Luminaire(Shape):
    """Flat opening whose light spreads as a photometric file says.

    Parameters
    ----------
    candela_text : str
        IES LM-63 text; its distribution counts, and the lamp's flux replaces its lumens.
    opening : tuple of float, optional
        (length, width), or (diameter,); the file's if left out. [m]
    """

    candela_text: str
    opening: tuple[float, ...] | None = None

    word = "ies"
    size_names = ("opening",)

    def __post_init__(self) -> None:
        if len(self.size) not in (1, 2):
            raise LampError(
                expected="1 or 2 positive size(s) in metres for an ies",
                found=f"{self.size}",
                where=f"shape '{self.word}'",
            )
        super().__post_init__()

    @property
    def size(self) -> tuple[float, ...]:
        """Length and width, or diameter, of its opening [m]."""
        return self.table.opening_m if self.opening is None else self.opening

    @classmethod
    def of_size(cls, size: tuple[float, ...] | None, options: Mapping[str, object]) -> Self:
        """As `Shape.of_size`; one size or two."""
        return cls(opening=size, **options)  # type: ignore[arg-type]

    @property
    def table(self) -> CandelaTable:
        """Its candela table."""
        return _table(self.candela_text)

    @property
    def pattern(self) -> CandelaPattern:
        """By the table."""
        return CandelaPattern(self.table)

    @property
    def area(self) -> float:
        """Of the opening [m²]; light that goes up leaves through another one, right above it."""
        return self._opening(_ANYWHERE).area

    def surfaces(self, place: Place) -> tuple[Surface, ...]:
        """A face for each way that it shines, down (along the normal) and up."""
        total = self.table.luminous_flux_lm()
        down, up = (self.table.luminous_flux_lm(upward=up) > MIN_SHARE * total for up in (False, True))
        apart = 0.5 * TWO_FACES_APART_M if down and up else 0.0
        faces = []
        if down:
            faces.append(self._opening(place.moved(apart)))
        if up:
            faces.append(self._opening(place.moved(-apart).turned_over()))
        return tuple(faces)

    def _opening(self, place: Place) -> Surface:
        return Circle(place, self.size[0]) if len(self.size) == 1 else Rectangle(place, *self.size)


@dataclass(frozen=True, eq=False)
class Sun(Shape):
    """Parallel light along the lamp's normal, through windows; the lamp's centre is where plans show it.

    Parameters
    ----------
    openings : tuple of Opening
        What it shines through.
    """

    openings: tuple[Opening, ...] = ()
    diameter: float = SUN_MARKER_M

    word = "sun"
    size_names = ("diameter",)

    def surfaces(self, place: Place) -> tuple[Surface, ...]:
        """None: it is no part of the room."""
        return ()

    @property
    def pattern(self) -> SunBeam:
        """Through its openings."""
        return SunBeam(self.openings)

    def outline(self, place: Place) -> FloatArray:
        """(corner, 3) a small level circle [m]."""
        return Sphere(place.center, self.diameter).outline()


SHAPES: dict[str, type[Shape]] = {
    shape.word: shape for shape in (Panel, Disc, Strip, Bulb, Spot, Point, Luminaire, Window, Sun)
}
"""All of them by the run file's word; `config.LampSection.shape` has the words that a user may write."""


def shape_of(word: str, size: tuple[float, ...] | None = None, *, where: str | None = None, **options: object) -> Shape:
    """The shape that the run file's word and sizes mean.

    Parameters
    ----------
    word : str
        'panel', 'disc', ...
    size : tuple of float, optional
        Length and width, or diameter; the usual ones of a bulb, spot or point if left out. [m]
    where : str, optional
        For errors: whose shape.
    **options
        The record's other fields; None stands for a field that is left out.

    Raises
    ------
    LampError
        If there is no such shape, or its sizes or options do not fit.
    """
    record = SHAPES.get(word)
    try:
        if record is None:
            raise LampError(expected=f"a shape of {', '.join(SHAPES)}", found=repr(word), where="shape")
        return record.of_size(size, {name: value for name, value in options.items() if value is not None})
    except LampError as cause:
        if where is None:
            raise
        raise LampError(expected=cause.expected, found=cause.found, where=where, todo=cause.todo) from cause
    except TypeError as cause:
        raise LampError(
            expected=f"what belongs to shape '{word}'", found=str(cause), where=where or f"shape '{word}'"
        ) from cause


@lru_cache(maxsize=64)
def _table(text: str) -> CandelaTable:
    return read_ies(text, where="candela table of a luminaire")  # asked for in every pass
