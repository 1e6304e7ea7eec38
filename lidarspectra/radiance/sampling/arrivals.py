"""First hits ("arrivals") of the sensors' rays: on which surface of the room, and how it reflects."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import SceneError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.radiance.sampling.receptors import tangents
from lidarspectra.radiance.scene.mesh_text import read_mesh_text
from lidarspectra.radiance.scene.pane_text import pane_transmittance
from lidarspectra.radiance.scene.panes import PANE
from lidarspectra.radiance.scene.primitives import Primitive, read_primitives
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.radiance.scene.scene_record import LAMPS_FILE

CELL_SHARE = 1.0 / 8.0  # [1] of the room's diagonal: longest side of a cell, 0.6 m in a room of 3 m x 3 m
MAX_CELL_M = 0.75  # [m] but no longer than this
MAX_BOXES = 6_000  # about the most boxes of half a cell's side that cover all surfaces; else cells are larger
MAX_POOLED_GLOSS = 0.1  # [1] specularity above which a surface's radiance depends too much on the direction of view
MARGIN_M = 1e-3  # [m] by which what encloses a ring or a sphere is larger than it
MAX_PASSED = 12  # panes, and corners of what encloses lamps, that a ray may pass
BEFORE_LAMP = 1.0 - 1e-4  # [1] of the way to a lamp's surface on which something may stand
PAST_M = 1e-4  # [m] behind what was passed
_SIDES = 6  # a face's side is the axis direction nearest to its normal
_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_CUBE = np.concatenate(
    [
        np.insert(_SQUARE, axis, side, axis=1)[[[0, 1, 2], [0, 2, 3]]]  # two triangles a face
        for axis in range(3)
        for side in (-1.0, 1.0)
    ]
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scattering:
    """Reflection of the materials of a pass; the last row stands for lamps.

    Parameters
    ----------
    is_matt : (material,) bool
        Whether it reflects equally in all directions, or nearly.
    is_diffuse : (material,) bool
        Whether it is exactly Lambertian and opaque, so that its reflectance is sufficient.
    reflectance : (material, slot) float
        In the engine's order; 0 for those that are not diffuse. [0-1]
    diffuse_part : (material, slot) float
        The same, and of surfaces that gleam what they reflect alike in all directions. [0-1]
    transmissivity : (material,) float
        Of one passage through a pane of glass; 0 for all others. [1]
    """

    is_matt: BoolArray
    is_diffuse: BoolArray
    reflectance: FloatArray
    diffuse_part: FloatArray
    transmissivity: FloatArray

    @property
    def is_glass(self) -> BoolArray:
        """(material,) whether it is a clear pane."""
        clear: BoolArray = self.transmissivity > 0
        return clear


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrivals:
    """First hits of rays.

    Parameters
    ----------
    places : (ray, 3) float
        [m]
    normals : (ray, 3) float
        Of the faces, on the side of the rays' origins.
    material : (ray,) int
        -1 where a ray met nothing.
    kind : (ray,) int
        Material and the axis that the normal is nearest to; 0 where a ray met nothing. Arrivals of different kinds
        never share a cell.
    """

    places: FloatArray
    normals: FloatArray
    material: IntArray
    kind: IntArray

    def take(self, rays: IntArray) -> "Arrivals":
        """A selection of them."""
        return Arrivals(
            places=self.places[rays], normals=self.normals[rays], material=self.material[rays], kind=self.kind[rays]
        )

    def joined(self, other: "Arrivals") -> "Arrivals":
        """Both joined."""
        return Arrivals(
            places=np.concatenate([self.places, other.places]),
            normals=np.concatenate([self.normals, other.normals]),
            material=np.concatenate([self.material, other.material]),
            kind=np.concatenate([self.kind, other.kind]),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ShadedArrivals:
    """First hits of rays, and the normals by which the engine shades there.

    Parameters
    ----------
    arrivals : Arrivals
    shading_normals : (ray, 3) float
        As the engine has them, smooth from face to face; on the side of the rays' origins.
    """

    arrivals: Arrivals
    shading_normals: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LampBodies:
    """What lamps are made of: polygons, rings and spheres, each enclosed by triangles.

    Parameters
    ----------
    lamp : (body,) int
        Index of the scene's lamp; of several that are one shape, of the first.
    first : (lamp,) int
        First of the lamps that each is one shape with.
    center : (body, 3) float
        [m]
    radius : (body,) float
        Within which a ring or a sphere lies; infinite for a polygon, which its triangles fill. [m]
    is_sphere : (body,) bool
    """

    lamp: IntArray
    first: IntArray
    center: FloatArray
    radius: FloatArray
    is_sphere: BoolArray

    @classmethod
    def of(cls, primitives: Sequence[Primitive], modifiers: Sequence[str]) -> "LampBodies":
        """Of primitives of some lamps' modifiers."""
        numbers = [np.array(each.numbers) for each in primitives]
        place = {"ring": 7, "sphere": 3}
        radius = [
            part[place[each.kind]] if each.kind in place else np.inf
            for each, part in zip(primitives, numbers, strict=True)
        ]
        known = {modifier: modifiers.index(modifier) for modifier in modifiers}
        return cls(
            lamp=np.array([known.get(each.modifier, -1) for each in primitives], dtype=np.int64),
            first=np.array([known[modifier] for modifier in modifiers], dtype=np.int64),
            center=np.array([part[:3] for part in numbers]).reshape(-1, 3),
            radius=np.array(radius),
            is_sphere=np.array([each.kind == "sphere" for each in primitives], dtype=np.bool_),
        )

    def are_met(self, body: IntArray, places: FloatArray, directions: FloatArray) -> BoolArray:
        """(ray,) whether rays that meet the triangles around a body at some places (ray, 3) [m] meet the body too."""
        away = self.center[body] - places
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        along = np.einsum("ij,ij->i", away, unit)
        aside = np.where(self.is_sphere[body], along, 0.0)[:, None] * unit  # of a sphere, to where the ray is nearest
        met: BoolArray = np.linalg.norm(away - aside, axis=1) <= self.radius[body]
        return met


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """The surfaces of a pass, for finding first hits.

    Parameters
    ----------
    caster : RayCaster
    face_material : (face,) int
    shading_normals : (face of the room, 3, 3) float32
        At each corner; lamps, whose faces come after the room's, have none.
    face_body : (face of a lamp,) int
        Which of the bodies it encloses.
    bodies : LampBodies
    scattering : Scattering
    diffuse_share : float
        Of the room's area that is exactly Lambertian and opaque. [1]
    cell_m : float
        Longest side of a cell. [m]
    bounds : (2, 3) float
        Lowest and highest corner of all surfaces and lamps. [m]
    """

    caster: RayCaster
    face_material: IntArray
    scattering: Scattering
    diffuse_share: float
    cell_m: float
    bounds: FloatArray
    shading_normals: NDArray[np.float32] = field(repr=False)
    face_body: IntArray = field(repr=False)
    bodies: LampBodies = field(repr=False)

    def box(self, places: FloatArray) -> IntArray:
        """(place, 3) indices of the boxes, of half a cell's side, that places lie in."""
        last = np.floor(np.ptp(self.bounds, axis=0) / (0.5 * self.cell_m)).astype(np.int64)
        boxes: IntArray = np.floor((places - self.bounds[0]) / (0.5 * self.cell_m)).astype(np.int64)
        return boxes.clip(0, last)

    def key(self, arrivals: Arrivals) -> IntArray:
        """(ray,) unique number of each arrival's box and kind."""
        across, deep, high = np.floor(np.ptp(self.bounds, axis=0) / (0.5 * self.cell_m)).astype(np.int64) + 1
        x, y, z = self.box(arrivals.places).T
        key: IntArray = ((arrivals.kind * across + x) * deep + y) * high + z
        return key

    def can_share(self, arrivals: Arrivals) -> BoolArray:
        """(ray,) whether it arrived on a matt surface of the room."""
        shares: BoolArray = ~self.are_dark(arrivals) & self.scattering.is_matt[arrivals.material]
        return shares

    def light_through(self, origins: FloatArray, ways: FloatArray, *, to_lamp: int) -> FloatArray:
        """Share of light that comes along some ways from a lamp.

        Parameters
        ----------
        origins : (ray, 3) float
            [m]
        ways : (ray, 3) float
            To the lamp. [m]
        to_lamp : int
            Index of the scene's lamp; its own surfaces are no obstacle.

        Returns
        -------
        share : (ray,) float
            0 through walls and other lamps, T of each pane of glass. [1]
        """
        share, left = np.ones(len(origins)), np.arange(len(origins))
        starts, rest = origins, ways
        for _ in range(MAX_PASSED):
            hits = self.caster.nearest(starts, rest, max_distance=BEFORE_LAMP)
            met = np.flatnonzero(hits.met)
            left, starts, rest = left[met], starts[met], rest[met]
            if not left.size:
                return share
            face, done = hits.face[met], hits.distance[met]
            share[left] *= self._passed(face, starts + done[:, None] * rest, rest, to_lamp)
            onward = (done + PAST_M / np.linalg.norm(rest, axis=1))[:, None] * rest
            on = np.flatnonzero(share[left] > 0)
            left, starts, rest = left[on], (starts + onward)[on], (rest - onward)[on]
        return share

    def _passed(self, face: IntArray, places: FloatArray, ways: FloatArray, to_lamp: int) -> FloatArray:
        """(ray,) share of the light that passes the face met [1]."""
        clear = self.scattering.transmissivity[self.face_material[face]]
        passed = np.zeros(len(face))
        panes = np.flatnonzero(clear > 0)
        unit = ways[panes] / np.linalg.norm(ways[panes], axis=1, keepdims=True)
        cosine = np.abs(np.einsum("ij,ij->i", unit, self.caster.normals[face[panes]]))
        passed[panes] = pane_transmittance(cosine, clear[panes])
        near_lamps = np.flatnonzero(face >= len(self.shading_normals))
        body = self.face_body[face[near_lamps] - len(self.shading_normals)]
        missed = ~self.bodies.are_met(body, places[near_lamps], ways[near_lamps])
        passed[near_lamps] = missed | (self.bodies.lamp[body] == self.bodies.first[to_lamp])
        return passed

    def arrivals(self, rays: FloatArray) -> Arrivals:
        """First hits of rays (ray, 6), which pass lamps by as closely as they may."""
        return self._first_hits(rays)[0]

    def shaded_arrivals(self, rays: FloatArray) -> ShadedArrivals:
        """First hits of rays (ray, 6), and the normals by which the engine shades there."""
        arrivals, face, weights = self._first_hits(rays)
        normals = arrivals.normals.copy()
        smooth = np.flatnonzero((face >= 0) & (face < len(self.shading_normals)))
        normals[smooth] = np.einsum("rk,rkc->rc", weights[smooth], self.shading_normals[face[smooth]])
        normals[smooth] /= np.linalg.norm(normals[smooth], axis=1, keepdims=True)
        behind = np.einsum("ij,ij->i", self.caster.normals[face[smooth]], rays[smooth, 3:]) > 0
        normals[smooth[behind]] *= -1.0
        return ShadedArrivals(arrivals=arrivals, shading_normals=normals)

    def _first_hits(self, rays: FloatArray) -> tuple[Arrivals, IntArray, FloatArray]:
        """First hits, the face of each, -1 of none, and the weights (ray, 3) of its corners."""
        starts = rays[:, :3].copy()
        directions = rays[:, 3:]
        hits = self.caster.nearest(starts, directions)
        face, distance, weights = hits.face.copy(), hits.distance.copy(), hits.barycentric.copy()
        room = len(self.shading_normals)
        left = np.flatnonzero(face >= room)
        for _ in range(MAX_PASSED):
            places = starts[left] + distance[left, None] * directions[left]
            left = left[~self.bodies.are_met(self.face_body[face[left] - room], places, directions[left])]
            if not left.size:
                break
            starts[left] += (distance[left, None] + PAST_M) * directions[left]
            again = self.caster.nearest(starts[left], directions[left])
            face[left], distance[left], weights[left] = again.face, again.distance, again.barycentric
            left = left[again.face >= room]
        met = face >= 0
        places = starts + np.where(met, distance, 0.0)[:, None] * directions
        return self._arrivals(np.where(met, face, 0), met, places, directions), face, weights

    def are_glass(self, arrivals: Arrivals) -> BoolArray:
        """(ray,) whether it arrived on a pane of glass."""
        clear: BoolArray = (arrivals.material >= 0) & self.scattering.is_glass[arrivals.material]
        return clear

    def are_dark(self, arrivals: Arrivals) -> BoolArray:
        """(ray,) whether it met nothing or a lamp, where paths end."""
        dark: BoolArray = (arrivals.material < 0) | (arrivals.material == self.scattering.is_matt.size - 1)
        return dark

    def _arrivals(self, face: IntArray, met: BoolArray, places: FloatArray, directions: FloatArray) -> Arrivals:
        normals = self.caster.normals[face]
        away = np.einsum("ij,ij->i", normals, directions) > 0
        normals = np.where(away[:, None], -normals, normals)  # towards the ray: the two sides of a face differ
        axis = np.abs(normals).argmax(axis=1)
        side = 2 * axis + (normals[np.arange(len(axis)), axis] > 0)
        material = self.face_material[face]
        return Arrivals(
            places=places,
            normals=normals,
            material=np.where(met, material, -1),
            kind=np.where(met, 1 + _SIDES * material + side, 0),
        )


def load_surfaces(scene: RadianceScene) -> dict[str, Surfaces]:
    """The surfaces of every pass, by its name.

    Parameters
    ----------
    scene : RadianceScene

    Returns
    -------
    surfaces : dict of str to Surfaces
        Passes of the same mesh, materials and lamps' shapes share theirs.

    Raises
    ------
    SceneError
        If a file of the scene cannot be read.
    """
    known: dict[tuple[str, str, bytes], Surfaces] = {}
    passes: dict[str, Surfaces] = {}
    for scene_pass in scene.passes:
        files = [scene.folder / name for name in (LAMPS_FILE, scene_pass.scene_file)]
        shapes = [each for path in files for each in read_primitives(path) if not each.modifier.startswith(PANE)]
        enclosed = [(each, _triangles(each)) for each in shapes]
        enclosed = [(each, triangles) for each, triangles in enclosed if len(triangles)]
        key = (scene_pass.mesh, scene_pass.materials_file, b"".join(part.tobytes() for _, part in enclosed))
        if key not in known:
            mesh, materials = scene.folder / scene_pass.mesh, scene.folder / scene_pass.materials_file
            known[key] = _surfaces(mesh, materials, enclosed, scene.lamp_modifiers)
        passes[scene_pass.name] = known[key]
    return passes


def _surfaces(
    mesh: Path, materials: Path, enclosed: Sequence[tuple[Primitive, FloatArray]], modifiers: Sequence[str]
) -> Surfaces:
    """Surfaces of a mesh and of lamps in their (triangle, 3, 3) enclosures, which are of one further material."""
    scan, face_material, names, shading_normals = read_mesh_text(mesh)
    lamps = np.concatenate([np.empty((0, 3, 3)), *(triangles for _, triangles in enclosed)])
    corners = np.arange(3 * len(lamps)).reshape(-1, 3)
    whole = bare_scan(
        np.concatenate([scan.vertices, lamps.reshape(-1, 3)]),
        np.concatenate([scan.faces, len(scan.vertices) + corners]),
    )
    scattering = read_scattering(names, materials)
    return Surfaces(
        caster=RayCaster(whole),
        face_material=np.concatenate([face_material, np.full(len(lamps), len(names))]),
        scattering=scattering,
        diffuse_share=float(scan.areas @ scattering.is_diffuse[face_material] / scan.areas.sum()),
        cell_m=cell_side_m(scan),
        bounds=whole.bounds,
        shading_normals=shading_normals,
        face_body=np.repeat(np.arange(len(enclosed)), [len(triangles) for _, triangles in enclosed]),
        bodies=LampBodies.of([each for each, _ in enclosed], modifiers),
    )


def cell_side_m(scan: Scan) -> float:
    """Longest side of a cell in a room [m]."""
    share = CELL_SHARE * float(np.linalg.norm(np.ptp(scan.bounds, axis=0)))
    return max(min(share, MAX_CELL_M), 2.0 * float(np.sqrt(scan.areas.sum() / MAX_BOXES)))


def _triangles(primitive: Primitive) -> FloatArray:
    """(triangle, 3, 3) corners [m] of a polygon, or of what encloses a ring or sphere; none for other primitives."""
    numbers = np.array(primitive.numbers)
    if primitive.kind == "polygon":
        corners = numbers.reshape(-1, 3)
    elif primitive.kind == "ring":
        half = numbers[7] + MARGIN_M
        corners = numbers[:3] + half * (_SQUARE @ tangents(numbers[3:6] / np.linalg.norm(numbers[3:6])))
    elif primitive.kind == "sphere":
        return np.asarray(numbers[:3] + (numbers[3] + MARGIN_M) * _CUBE, dtype=np.float64)
    else:
        return np.empty((0, 3, 3))
    return np.stack([corners[[0, second, second + 1]] for second in range(1, len(corners) - 1)])


def read_scattering(names: Sequence[str], path: Path) -> Scattering:
    """Reflection of the named materials of a scene file.

    Parameters
    ----------
    names : sequence of str
    path : Path
        As `surfaces.surface_text` writes it.

    Returns
    -------
    scattering : Scattering
        One row more than names, for lamps.

    Raises
    ------
    SceneError
        If the file cannot be read or lacks a material.
    """
    patterns, plastics, glass, others = {"void": np.ones(1)}, {}, {}, set()
    for each in read_primitives(path):
        if (
            each.kind == "spectrum"
        ):  # its range, then samples by rising wavelength; results of the engine fall in wavelength
            patterns[each.name] = np.array(each.numbers[:1:-1])
        elif each.kind == "plastic" and each.modifier in patterns:
            color = np.array(each.numbers[:3] if each.modifier == "void" else each.numbers[:1])
            plastics[each.name] = (patterns[each.modifier] * color, each.numbers[3])
        else:
            others.add(each.name)
            if each.kind == "glass":  # grey, so that its first number and slot stand for all
                glass[each.name] = each.numbers[0] * float(patterns[each.modifier][0])
    missing = [name for name in names if name not in plastics and name not in others]
    if missing:
        raise SceneError(
            expected="all materials of the mesh",
            found=f"no {missing[0]}",
            where=str(path),
            todo="Write the scene again: lidarspectra run ROOM.toml --from scene.",
        )
    gloss = np.array([plastics[name][1] if name in plastics else np.inf for name in names] + [np.inf])
    slots = max((color.size for color, _ in plastics.values()), default=1)
    reflectance = np.zeros((len(names) + 1, slots))
    diffuse_part = np.zeros_like(reflectance)
    for row in np.flatnonzero(np.isfinite(gloss)):
        diffuse_part[row] = (1.0 - gloss[row]) * plastics[names[int(row)]][0]
    reflectance[gloss == 0.0] = diffuse_part[gloss == 0.0]
    is_matt = gloss <= MAX_POOLED_GLOSS
    is_matt[-1] = True  # paths end on lamps, from any direction
    clear = np.array([glass.get(name, 0.0) for name in names] + [0.0])
    return Scattering(
        is_matt=is_matt,
        is_diffuse=gloss == 0.0,
        reflectance=reflectance,
        diffuse_part=diffuse_part,
        transmissivity=clear,
    )
