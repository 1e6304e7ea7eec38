"""The plan of a room: what is truly there, written down by hand, for rooms whose every surface is known.

A plan is a TOML text: air as boxes, parts that stand in it, materials, lamps and sensors. It is the truth that a
virtual phone scans (`research.virtual_rooms.phone`) and that estimates are compared with. Lamps and sensors
are written as in a run file, and go into it unchanged.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lidarspectra.config import (
    Fraction,
    LampSection,
    Positive,
    SensorsSection,
    Vector,
)
from lidarspectra.errors import PlanError
from lidarspectra.io.toml_sections import Section, parse_sections
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import read_table

Side = Literal["west", "east", "south", "north"]
Curve = Literal["lifted", "filmic"]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class MaterialSection(Section):
    """`[[materials]]`: what a surface is made of."""

    name: Name
    reflectance: Name
    """ID of its spectrum in the plan's table of reflectances."""
    specularity: Fraction = 0.0
    roughness: Fraction = 0.0
    grain: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Relative standard deviation of its visible pattern; the mean stays the reflectance. [1]"""
    grain_size: tuple[Positive, Positive, Positive] = (0.02, 0.02, 0.02)
    """Wavelength of that pattern along x, y and z. [m]"""


class RoomSection(Section):
    """`[[rooms]]`: a box of air, and the materials of the walls around it. Boxes that touch or overlap are one air."""

    name: Name
    low: Vector
    high: Vector
    floor: Name
    ceiling: Name
    walls: Name
    accents: dict[Side, Name] = Field(default_factory=dict)
    """Walls of another material: west (low x), east, south (low y), north."""

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        _check_order(self.low, self.high)
        return self


class PartSection(Section):
    """What all parts have; parts may be sunk into walls, floor or one another, and the part listed last is seen."""

    name: Name
    material: Name
    lamp: Name | None = None
    """The lamp whose lit face this part is: the phone sees it saturated."""


class BoxSection(PartSection):
    """A box between two corners, turned about its own upright axis."""

    shape: Literal["box"]
    low: Vector
    high: Vector
    yaw_deg: float = 0.0

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        _check_order(self.low, self.high)
        return self


class CylinderSection(PartSection):
    """An upright cylinder on the centre of its foot."""

    shape: Literal["cylinder"]
    foot: Vector
    radius: Positive
    height: Positive


class TableSection(PartSection):
    """A table top on four square legs."""

    shape: Literal["table"]
    center: tuple[float, float]
    size: tuple[Positive, Positive]
    height: Positive = 0.74
    thickness: Positive = 0.03
    leg: Positive = 0.045
    leg_material: Name
    yaw_deg: float = 0.0


class ChairSection(PartSection):
    """A chair: seat, back and four legs; at yaw 0 its sitter looks along +y."""

    shape: Literal["chair"]
    center: tuple[float, float]
    width: Positive = 0.44
    seat_height: Positive = 0.45
    height: Positive = 0.85
    leg: Positive = 0.035
    leg_material: Name
    yaw_deg: float = 0.0


Part = Annotated[BoxSection | CylinderSection | TableSection | ChairSection, Field(discriminator="shape")]


class PhoneSection(Section):
    """`[phone]`: how the virtual phone takes the room's shape."""

    voxel_m: Positive = 0.025
    """Edge of its grid of signed distances; things thinner than this suffer. [m]"""
    edge_m: Positive = 0.05
    """Wanted length of triangle edges. [m]"""
    noise_m: NotNegative = 0.0015
    """Standard deviation of each vertex along its normal. [m]"""
    drift_m: NotNegative = 0.003
    """Root mean square of the slow error of position, which neighbours share. [m]"""
    drift_wavelength_m: Positive = 0.9
    """Shortest wavelength of that drift; the longest is three times as long. [m]"""
    hole_share: Annotated[float, Field(ge=0, le=0.3)] = 0.008
    """Share of the area that is missing. [1]"""
    hole_radius_m: tuple[Positive, Positive] = (0.04, 0.10)
    """Smallest and largest radius of a hole. [m]"""


class CameraSection(Section):
    """`[camera]`: how the virtual phone renders colour."""

    texture_px: Annotated[int, Field(ge=64, le=8192)] = 2048
    """Edge of the square texture. [px]"""
    jpeg_quality: Annotated[int, Field(ge=1, le=95)] = 85
    light_spacing_m: Positive = 0.09
    """How far apart the points are at which the room's light is asked for. [m]"""
    white_balance: Fraction = 0.85
    """How far the colour of the light is taken out; 1 is wholly. [1]"""
    bright_share: Annotated[float, Field(gt=0, lt=1)] = 0.03
    """Share of the surface that may come out brighter than `bright_level`. [1]"""
    bright_level: Positive = 0.9
    """Before the tone curve, white being 1. [1]"""
    tone: NotNegative = 0.6
    """Strength k of the tone curve (1 + k)x / (1 + kx), which lifts shadows and presses highlights. [1]"""
    curve: Curve = "lifted"
    """That curve, or a filmic one with a toe, whatever `tone` is."""
    exposure_spread: Annotated[float, Field(ge=0, le=0.5)] = 0.04
    """Relative standard deviation of exposure over the texture, as it comes from several frames. [1]"""
    noise: Annotated[float, Field(ge=0, le=0.5)] = 0.004
    """Standard deviation of a pixel before the tone curve, white being 1. [1]"""


class PlanFile(Section):
    """The whole plan, as written.

    Parameters
    ----------
    name : str
        Of the scene.
    reflectances : str
        Table of spectra (see `lidarspectra.spectra.spectrum_files`), relative to the plan.
    scan : 'phone' or 'exact'
        Whether the scan is what a phone would see, or the true surface in its true colours.
    rooms, materials, parts, lamps, sensors, phone, camera
        Its tables. Lamps and sensors have the run file's keys.
    """

    name: Name
    reflectances: Name
    scan: Literal["phone", "exact"] = "phone"
    rooms: Annotated[tuple[RoomSection, ...], Field(min_length=1)]
    materials: Annotated[tuple[MaterialSection, ...], Field(min_length=1)]
    parts: tuple[Part, ...] = ()
    lamps: tuple[LampSection, ...] = ()
    sensors: SensorsSection
    phone: PhoneSection = PhoneSection()
    camera: CameraSection = CameraSection()

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        known = {material.name for material in self.materials}
        if len(known) < len(self.materials):
            raise ValueError("two materials have the same name")
        unknown = sorted(_materials_used(self) - known)
        if unknown:
            raise ValueError(f"no [[materials]] has the name {unknown[0]!r}")
        lamps = {lamp.name for lamp in self.lamps}
        for part in self.parts:
            if part.lamp is not None and part.lamp not in lamps:
                raise ValueError(f"part {part.name!r} is the lit face of {part.lamp!r}, which no [[lamps]] defines")
        return self


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueMaterial:
    """A material of the plan with its spectrum.

    Parameters
    ----------
    name : str
        The plan's words.
    category : str
        Material class, as the table of reflectances has it.
    reflectance : Spectrum
        [1]
    specularity, roughness : float
        As in `lidarspectra.material.material_map.Material`. [0-1]
    grain : float
        Relative standard deviation of its visible pattern. [1]
    grain_size : (float, float, float)
        Wavelength of that pattern along x, y and z. [m]
    source : str
        ID in the table, and how its spectrum came about.
    """

    name: str
    category: str
    reflectance: Spectrum
    specularity: float
    roughness: float
    grain: float
    grain_size: tuple[float, float, float]
    source: str


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomPlan:
    """A plan with its spectra.

    Parameters
    ----------
    file : PlanFile
        What was written.
    materials : tuple of TrueMaterial
        In the plan's order.
    """

    file: PlanFile
    materials: tuple[TrueMaterial, ...]

    def material_number(self, name: str) -> int:
        """Index of a material by its name."""
        return [material.name for material in self.materials].index(name)


def read_plan(path: Path) -> RoomPlan:
    """Read a plan and the spectra that it names.

    Parameters
    ----------
    path : Path
        A TOML text in UTF-8.

    Returns
    -------
    plan : RoomPlan

    Raises
    ------
    PlanError
        If the file is missing, no TOML, or has unknown keys, names or values that do not fit; all faults are named.
    DatabaseError
        If the table of reflectances is malformed.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as cause:
        raise PlanError(expected="a readable plan (TOML, UTF-8)", found=str(cause), where=str(path)) from cause
    file = parse_plan(text, where=str(path))
    return RoomPlan(file=file, materials=_with_spectra(file, path.parent / file.reflectances, where=str(path)))


def parse_plan(text: str, *, where: str) -> PlanFile:
    """Check the text of a plan; `where` names it in errors (see `read_plan`)."""
    return parse_sections(PlanFile, text, kind="plan", where=where, error=PlanError, page="scenes/README.md")


def _with_spectra(file: PlanFile, table: Path, *, where: str) -> tuple[TrueMaterial, ...]:
    rows = {row.id: row for row in read_table(table)}
    missing = sorted({material.reflectance for material in file.materials} - rows.keys())
    if missing:
        raise PlanError(
            expected=f"reflectances that {table.name} has",
            found=", ".join(missing),
            where=where,
            todo=f"It has {', '.join(rows)}.",
        )
    return tuple(
        TrueMaterial(
            name=material.name,
            category=rows[material.reflectance].category,
            reflectance=rows[material.reflectance].spectrum,
            specularity=material.specularity,
            roughness=material.roughness,
            grain=material.grain,
            grain_size=material.grain_size,
            source=f"{table.stem}:{material.reflectance}",
        )
        for material in file.materials
    )


def _materials_used(file: PlanFile) -> set[str]:
    used = {part.material for part in file.parts}
    used |= {part.leg_material for part in file.parts if isinstance(part, TableSection | ChairSection)}
    for room in file.rooms:
        used |= {room.floor, room.ceiling, room.walls, *room.accents.values()}
    return used


def _check_order(low: Vector, high: Vector) -> None:
    if not all(below < above for below, above in zip(low, high, strict=True)):
        raise ValueError("'low' must be below 'high' in x, y and z")
