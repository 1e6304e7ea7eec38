"""Scan, materials and lamps as a Mitsuba scene that carries three band slots."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import LampError, MaterialError
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import CandelaPattern, CosinePower, Lambertian
from lidarspectra.lamps.surfaces import Circle, Place, Rectangle, Sphere, Surface
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.scene.mesh_text import CREASE_DEG, corner_normals
from lidarspectra.radiance.scene.surfaces import MIN_ROUGHNESS
from research.second_opinion.plugins import Custom, make_surface, register_beam
from research.second_opinion.variants import GET_LLVM, SLOTS, Mitsuba

FACE_REFLECTANCE = "face_reflectance"  # Mitsuba's name for an attribute of faces starts so


@dataclass(frozen=True, kw_only=True, eq=False)
class Slots:
    """What a scene reflects and sends in its three slots.

    Parameters
    ----------
    diffuse, glossy : (material, 3) float
        Lambertian and glossy part of the reflectance. [1]
    roughness : (material,) float
        Slope of the glossy part. [1]
    flux : (lamp, 3) float
        Spectral flux; a lamp with none stands black. [W/nm]
    """

    diffuse: FloatArray
    glossy: FloatArray
    roughness: FloatArray
    flux: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomShape:
    """What is the same in all slots: the mesh without shared corners, and who is what.

    Parameters
    ----------
    positions, normals : (face * 3, 3) float
        [m, 1]
    face_material : (face,) int
    lamps : tuple of Lamp
    """

    positions: FloatArray
    normals: FloatArray
    face_material: IntArray
    lamps: tuple[Lamp, ...]

    @classmethod
    def of(
        cls, scan: Scan, materials: MaterialMap, lamps: Sequence[Lamp], *, crease_deg: float = CREASE_DEG
    ) -> "RoomShape":
        """Take a room's faces, without degenerate ones, with normals as `mesh_text.corner_normals` has them.

        Raises
        ------
        LampError
            If a lamp has a candela table, which has no counterpart here.
        """
        for lamp in lamps:
            if isinstance(lamp.shape.pattern, CandelaPattern):
                raise LampError(
                    expected="lamps of the package's own shapes",
                    found="a luminaire with a candela table",
                    where=f"lamp '{lamp.name}' (second opinion)",
                    todo="Compare with a spot of about its beam angle.",
                )
        kept = np.flatnonzero(scan.areas > 0)
        return cls(
            positions=scan.corners[kept].reshape(-1, 3),
            normals=corner_normals(scan, crease_deg=crease_deg)[kept].reshape(-1, 3),
            face_material=materials.face_material[kept],
            lamps=tuple(lamps),
        )


def split_reflectance(material: Material, reflectance: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Lambertian part, glossy part and roughness of a material, as the Radiance scene has them.

    Parameters
    ----------
    material : Material
        Plastic, metal or mirror.
    reflectance : (slot,) float
        Total reflectance in all slots of the pass. [1]

    Returns
    -------
    diffuse, glossy : (slot,) float
        Their sum is the reflectance.
    roughness : float

    Raises
    ------
    MaterialError
        If light passes through the material.
    """
    roughness = max(material.roughness, MIN_ROUGHNESS)
    match material.kind:
        case "plastic":
            glossy = np.full(reflectance.shape, min(material.specularity, float(reflectance.min())))
        case "metal":
            glossy = reflectance * material.specularity
        case "mirror":
            glossy = reflectance
        case _:
            raise MaterialError(
                expected="surfaces that let no light through",
                found=material.kind,
                where=f"material '{material.name}' (second opinion)",
                todo="Give it kind 'plastic' for the comparison.",
            )
    return reflectance - glossy, glossy, roughness


def build_scene(mitsuba: Mitsuba, room: RoomShape, slots: Slots, *, custom: Custom = "radiance") -> Any:
    """Build the Mitsuba scene of a room.

    Parameters
    ----------
    mitsuba : Mitsuba
    room : RoomShape
    slots : Slots
    custom : 'textbook' or 'radiance'
        What corner normals mean, see `plugins`; the plain variant knows the first only, and takes it.

    Returns
    -------
    scene : mitsuba.Scene

    Raises
    ------
    MaterialError, LampError
        If the plain variant is given gloss or a beam.
    """
    parts: dict[str, Any] = {"type": "scene", "room": _mesh(mitsuba, room, slots, custom)}
    register_beam(mitsuba)
    for number, (lamp, flux) in enumerate(zip(room.lamps, slots.flux, strict=True)):
        for part, surface in enumerate(lamp.surfaces):
            parts[f"lamp{number}_{part}"] = _lamp(mitsuba, lamp, surface, flux)
    # Unoptimised: equal lamps would be given one emitter, which cannot belong to two shapes.
    return mitsuba.mi.load_dict(parts, optimize=False)


def _mesh(mitsuba: Mitsuba, room: RoomShape, slots: Slots, custom: Custom) -> Any:
    mi = mitsuba.mi
    count = len(room.face_material)
    settings = mi.Properties()
    settings["surface"] = _surface(mitsuba, room, slots, custom)
    mesh = mi.Mesh("room", 3 * count, count, props=settings, has_vertex_normals=True)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = _buffer(mitsuba, room.positions.ravel().astype(np.float32))
    parameters["vertex_normals"] = _buffer(mitsuba, room.normals.ravel().astype(np.float32))
    parameters["faces"] = _buffer(mitsuba, np.arange(3 * count, dtype=np.uint32))
    parameters.update()
    if not mitsuba.is_fast:
        mesh.add_attribute(FACE_REFLECTANCE, SLOTS, slots.diffuse[room.face_material].ravel().astype(np.float32))
    return mesh


def _buffer(mitsuba: Mitsuba, values: NDArray[Any]) -> Any:
    """The array in the type that the variant's meshes hold."""
    if not mitsuba.is_fast:
        return values
    return mitsuba.mi.UInt32(values) if values.dtype == np.uint32 else mitsuba.mi.Float(values)


def _surface(mitsuba: Mitsuba, room: RoomShape, slots: Slots, custom: Custom) -> Any:
    mi = mitsuba.mi
    if mitsuba.is_fast:
        surface = make_surface(mitsuba, custom=custom, is_glossy=bool(slots.glossy.max() > 0))
        surface.material = mi.UInt32(room.face_material.astype(np.uint32))
        surface.diffuse = mi.Color3f(slots.diffuse.T.astype(np.float32))
        surface.glossy = mi.Color3f(slots.glossy.T.astype(np.float32))
        surface.roughness = mi.Float(slots.roughness.astype(np.float32))
        return surface
    if slots.glossy.max() > 0:
        raise MaterialError(
            expected="matt surfaces, all that Mitsuba's plain variant is given",
            found="a specularity above 0",
            where="second opinion",
            todo=GET_LLVM,
        )
    faces = {"type": "mesh_attribute", "name": FACE_REFLECTANCE}
    return mi.load_dict({"type": "twosided", "surface": {"type": "diffuse", "reflectance": faces}})


def _lamp(mitsuba: Mitsuba, lamp: Lamp, surface: Surface, flux: FloatArray) -> dict[str, Any]:
    """A surface of a lamp."""
    shape: dict[str, Any]
    match surface:
        case Sphere(center=center):
            shape = {"type": "sphere", "center": center.tolist(), "radius": surface.radius}
        case Circle(place=place):
            shape = {"type": "disk", "to_world": _transform(mitsuba, place, surface.radius, surface.radius)}
        case Rectangle(place=place):
            sides = 0.5 * surface.length, 0.5 * surface.width
            shape = {"type": "rectangle", "to_world": _transform(mitsuba, place, *sides)}
        case _:
            raise LampError(
                expected="rectangles, circles and spheres", found=type(surface).__name__, where=f"lamp '{lamp.name}'"
            )
    shape["surface"] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    if flux.max() > 0:
        shape["emitter"] = _emitter(mitsuba, lamp, flux)
    return shape


def _transform(mitsuba: Mitsuba, place: Place, along: float, across: float) -> Any:
    """From the unit square or disc to a place, by half its sides [m]."""
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1] = along * place.length, across * place.width
    matrix[:3, 2], matrix[:3, 3] = place.normal, place.center
    return mitsuba.mi.ScalarTransform4f(matrix)


def _emitter(mitsuba: Mitsuba, lamp: Lamp, flux: FloatArray) -> dict[str, Any]:
    mi = mitsuba.mi
    pattern = lamp.shape.pattern
    if not isinstance(pattern, Lambertian | CosinePower):
        raise LampError(expected="diffuse lamps and beams", found=lamp.shape.word, where=f"lamp '{lamp.name}'")
    radiance = flux * pattern.radiance_per_flux(lamp.shape.area)
    exponent = pattern.exponent if isinstance(pattern, CosinePower) else 1.0
    if exponent == 1.0:
        return {"type": "area", "radiance": {"type": "rgb", "value": radiance.tolist()}}
    if not mitsuba.is_fast:
        raise LampError(
            expected="diffuse lamps, all that Mitsuba's plain variant is given",
            found="a beam",
            where=f"lamp '{lamp.name}' (second opinion)",
            todo=GET_LLVM,
        )
    return {"type": "beam", "radiance": mi.ScalarColor3f(radiance.tolist()), "exponent": exponent - 1.0}
