"""Flat panes of glass and flat mirrors: where lamps are seen reflected.

A path that ends on a lamp after a mirror-like reflection is one that no shadow ray follows: the engine leaves its light
out, for shadow rays go straight. In a flat surface a lamp has one image, so that the shadow ray can be aimed at that:
Radiance's `mirror` does so, for flat polygons alone, each lamp having an image in each of them. So here the faces of a
material that make up a plane become one pane, whose outline is a polygon; panes in one plane are one (`pane_text`).

A lamp's image has images in other panes in turn, which the engine follows for some reflections in a row (-dr). Eight
are enough for mirrors that face each other at less than a right angle, three for corners, two for glass, which returns
a tenth of the light. Their number grows with every pane; a mirror with which there would be too many is left as it was,
a little rough, so that lamps' light is spread by it and none is lost, at the price of noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, linked
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.scene.mesh_text import merged_vertices
from lidarspectra.radiance.scene.surfaces import MIN_ROUGHNESS

PANE = "pane"  # how the modifiers of panes begin
MIN_PANE_M2 = 0.05  # [m²] a smaller one is not worth a shadow ray at every corner of every path
MAX_PANES = 16  # planes; a lamp has an image in each of them, and images of images
FLAT_M = 0.02  # [m] from the plane; a scan's noise
BEND_DEG = 30.0  # [deg] between neighbouring faces, and to the plane: more is an edge, or no pane
MIN_FLAT_SHARE = 0.9  # [1] of the area of connected faces; else they are curved
FIT_ROUNDS = 3  # of the plane, each through the faces that lay near the last
SAME_PLANE_M = 0.005  # [m] panes of a window in one frame
SAME_NORMAL = float(np.cos(np.radians(0.5)))  # [1]
RIGHT_ANGLE = 0.02  # [1] cosine above which mirrors that face each other have more than a corner's images
RELAYS_FACING, RELAYS_CORNER, RELAYS_GLASS = 8, 3, 2  # reflections in a row that are followed
MAX_IMAGES = 64  # of a lamp
STRAIGHT_M = 1e-5  # [m] corners of an outline nearer to the line between their neighbours are left out
CLEARANCE_M = 2e-5  # [m] by which its polygons lie before all of its faces: sensors start 1e-4 m off a surface


@dataclass(frozen=True, kw_only=True, eq=False)
class Pane:
    """Faces of one material in one plane.

    Parameters
    ----------
    material : int
        Index into the materials.
    faces : (face,) int
        Of the scan.
    outline : (corner, 3) float
        Closed polygon in the plane, counter-clockwise about the normal; several pieces and holes are joined by seams
        that are run along to and fro. [m]
    center : (3,) float
        A point in the plane. [m]
    normal : (3,) float
        Unit vector.
    depth_m : float
        Largest distance of a corner of its faces from the plane. [m]
    area : float
        [m²]
    """

    material: int
    faces: IntArray
    outline: FloatArray
    center: FloatArray
    normal: FloatArray
    depth_m: float
    area: float

    def sides(self) -> tuple[FloatArray, FloatArray]:
        """(corner, 3) outlines that face along the normal and against it, each just before all faces [m]."""
        lift = (self.depth_m + CLEARANCE_M) * self.normal
        return self.outline + lift, self.outline[::-1] - lift


@dataclass(frozen=True, kw_only=True, eq=False)
class Panes:
    """What is found in a room.

    Parameters
    ----------
    panes : tuple of Pane
        Largest first.
    relays : int
        Reflections in a row, from pane to pane, that are followed. [1]
    left_out_m2 : dict of str to float
        Area of 'glass' and 'mirror' that is in no pane: curved, too small, or one too many. [m²]
    """

    panes: tuple[Pane, ...]
    relays: int
    left_out_m2: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Mesh:
    """Of every face of the scan.

    Parameters
    ----------
    corners : (face, 3, 3) float
        [m]
    areas : (face,) float
        [m²]
    normals : (face, 3) float
        Unit vectors.
    places : (face, 3) int
        The place that each corner is at, whatever vertex stands there.
    """

    corners: FloatArray
    areas: FloatArray
    normals: FloatArray
    places: IntArray


def find_panes(scan: Scan, materials: MaterialMap) -> Panes:
    """Find the flat panes of glass and flat mirrors in a room.

    Parameters
    ----------
    scan : Scan
    materials : MaterialMap
        A material for each of its faces.

    Returns
    -------
    panes : Panes
    """
    kinds = np.array([material.kind for material in materials.materials])
    if not np.isin(kinds, ("glass", "mirror")).any():
        return Panes(panes=(), relays=RELAYS_GLASS, left_out_m2={})
    places = merged_vertices(scan)[scan.faces]
    mesh = _Mesh(corners=scan.corners, areas=scan.areas, normals=scan.normals, places=places)
    found: dict[str, list[Pane]] = {"glass": [], "mirror": []}
    for number, material in enumerate(materials.materials):
        if material.kind == "glass" or is_smooth_mirror(material):
            faces = np.flatnonzero((materials.face_material == number) & (mesh.areas > 0))
            flat = [part for part in _parts(mesh, faces) if _is_pane(mesh, part)]
            found[material.kind] += _joined(mesh, number, flat)
    glass, mirrors = (sorted(found[kind], key=lambda pane: -pane.area) for kind in ("glass", "mirror"))
    kept, relays = glass[:MAX_PANES], RELAYS_GLASS
    for mirror in mirrors:
        tried = [*(pane for pane in kept if kinds[pane.material] == "mirror"), mirror]
        wanted = RELAYS_FACING if _face_each_other(tried) else RELAYS_CORNER
        if _images([*kept, mirror], wanted) <= MAX_IMAGES:
            kept, relays = [*kept, mirror], wanted
    while relays > 1 and _images(kept, relays) > MAX_IMAGES:
        relays -= 1
    area = np.bincount(materials.face_material, weights=mesh.areas, minlength=kinds.size)
    for pane in kept:
        area[pane.material] -= pane.area
    left_out = {kind: float(area[kinds == kind].sum()) for kind in ("glass", "mirror")}
    return Panes(
        panes=tuple(kept),
        relays=relays,
        left_out_m2={kind: each for kind, each in left_out.items() if each > MIN_PANE_M2},
    )


def _parts(mesh: _Mesh, faces: IntArray) -> list[IntArray]:
    """Faces that hang together without an edge between them."""
    if not faces.size:
        return []
    places = mesh.places[faces]
    ends = np.sort(np.concatenate([places[:, [0, 1]], places[:, [1, 2]], places[:, [2, 0]]]), axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    face, edge = np.tile(np.arange(faces.size), 3)[order], edge.ravel()[order]
    next_to = np.flatnonzero(edge[1:] == edge[:-1])
    first, second = face[next_to], face[next_to + 1]
    normals = mesh.normals[faces]
    smooth = np.abs(np.einsum("ij,ij->i", normals[first], normals[second])) >= np.cos(np.radians(BEND_DEG))
    label = linked(np.stack([first[smooth], second[smooth]], axis=1), faces.size)
    by_label = np.argsort(label, kind="stable")
    return [faces[part] for part in np.split(by_label, np.cumsum(np.bincount(label))[:-1])]


def _is_pane(mesh: _Mesh, faces: IntArray) -> bool:
    area = float(mesh.areas[faces].sum())
    if area < MIN_PANE_M2:
        return False
    flat = float(mesh.areas[_flat_faces(mesh, faces)[0]].sum())
    return flat >= max(MIN_FLAT_SHARE * area, MIN_PANE_M2)


def _flat_faces(mesh: _Mesh, faces: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Those of the faces that lie in their plane, a point of it and its unit normal."""
    near = faces
    for _ in range(FIT_ROUNDS):
        center, normal = _plane(mesh, near)
        depth = np.abs((mesh.corners[faces] - center) @ normal).max(axis=1)
        leaning = np.abs(mesh.normals[faces] @ normal) >= np.cos(np.radians(BEND_DEG))
        chosen = faces[(depth <= FLAT_M) & leaning]
        if not chosen.size:
            break
        near = chosen
    return chosen, center, normal


def _plane(mesh: _Mesh, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Centre [m] and unit normal of the plane through faces, by their areas; its side is that of the largest one."""
    areas = mesh.areas[faces]
    normals = mesh.normals[faces]
    towards = np.where(normals @ normals[np.argmax(areas)] < 0, -1.0, 1.0)
    normal = (areas * towards) @ normals
    center = areas @ mesh.corners[faces].mean(axis=1) / areas.sum()
    return center, normal / np.linalg.norm(normal)


def _joined(mesh: _Mesh, material: int, parts: Sequence[IntArray]) -> list[Pane]:
    """Panes, those of one plane made one."""
    groups: list[list[IntArray]] = []
    planes: list[tuple[FloatArray, FloatArray]] = []
    for part in sorted(parts, key=lambda faces: -float(mesh.areas[faces].sum())):
        flat, center, normal = _flat_faces(mesh, part)
        for group, (middle, axis) in zip(groups, planes, strict=True):
            if abs(normal @ axis) >= SAME_NORMAL and abs((center - middle) @ axis) <= SAME_PLANE_M:
                group.append(flat)
                break
        else:
            groups.append([flat])
            planes.append((center, normal))
    return [_pane(mesh, material, np.concatenate(group)) for group in groups]


def _pane(mesh: _Mesh, material: int, faces: IntArray) -> Pane:
    center, normal = _plane(mesh, faces)
    away = (mesh.corners[faces] - center) @ normal
    outline = _outline(mesh, faces, normal)
    return Pane(
        material=material,
        faces=faces,
        outline=outline - ((outline - center) @ normal)[:, None] * normal,
        center=center,
        normal=normal,
        depth_m=float(np.abs(away).max()),
        area=float(mesh.areas[faces].sum()),
    )


def _outline(mesh: _Mesh, faces: IntArray, normal: FloatArray) -> FloatArray:
    """(corner, 3) the faces' outer edges, loop after loop, each reached from the first corner and left to it [m]."""
    places, corners = mesh.places[faces], mesh.corners[faces]
    turned = mesh.normals[faces] @ normal < 0
    places[turned], corners[turned] = places[turned, ::-1], corners[turned, ::-1]
    ways = np.concatenate([places[:, [0, 1]], places[:, [1, 2]], places[:, [2, 0]]])
    starts = np.concatenate([corners[:, 0], corners[:, 1], corners[:, 2]])
    known = {(a, b) for a, b in ways.tolist()}
    outer = [index for index, (a, b) in enumerate(ways.tolist()) if (b, a) not in known]
    leaving: dict[int, list[int]] = {}
    for index in outer:
        leaving.setdefault(int(ways[index, 0]), []).append(index)
    loops = []
    while leaving:
        start = at = next(iter(leaving))
        loop = []
        while at in leaving:
            index = leaving[at].pop()
            if not leaving[at]:
                del leaving[at]
            loop.append(starts[index])
            at = int(ways[index, 1])
            if at == start:
                break
        loops.append(_without_straight(np.array(loop)))
    anchor = loops[0][0]
    seamed = [loops[0], *(np.concatenate([[anchor], loop, loop[:1]]) for loop in loops[1:])]
    return np.concatenate(seamed)


def _without_straight(loop: FloatArray) -> FloatArray:
    """A loop's corners without those on a straight line between their neighbours."""
    before, after = np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0)
    along = after - before
    length = np.maximum(np.linalg.norm(along, axis=1), STRAIGHT_M)
    bent = np.linalg.norm(np.cross(loop - before, along), axis=1) / length > STRAIGHT_M
    return loop[bent] if bent.sum() >= 3 else loop


def _facing(panes: Sequence[Pane]) -> tuple[BoolArray, FloatArray]:
    """(side, side) whether light can go between sides of panes, front and back of each, and the normals' cosine."""
    sides = [(pane, sign * pane.normal) for pane in panes for sign in (1.0, -1.0)]
    before = np.array(
        [
            [((other.outline - pane.center) @ normal).max() > SAME_PLANE_M for other, _ in sides]
            for pane, normal in sides
        ]
    )
    normals = np.array([normal for _, normal in sides])
    same = np.repeat(np.arange(len(panes)), 2)
    facing: BoolArray = before & before.T & (same[:, None] != same)
    return facing, normals @ normals.T


def _face_each_other(panes: Sequence[Pane]) -> bool:
    """Whether light can go to and fro between any two more often than in a corner."""
    facing, cosine = _facing(panes)
    return bool((facing & (cosine < -RIGHT_ANGLE)).any())


def _images(panes: Sequence[Pane], relays: int) -> float:
    """Upper limit of the images of a lamp, by way of at most so many panes in a row."""
    if not panes:
        return 0.0
    facing, _ = _facing(panes)
    ways, total = np.ones(len(facing)), 0.0
    for _ in range(relays):
        total += ways.sum() / 2.0  # a lamp is on one side of each
        ways = facing @ ways
    return total


def is_smooth_mirror(material: Material) -> bool:
    """Whether its image of a lamp is sharp, if it is flat: not one that is rougher than any mirror is written."""
    return material.kind == "mirror" and material.roughness <= MIN_ROUGHNESS
