"""The true room: the exact surface between air and things, each triangle knowing its part and material.

Air is the union of the plan's room boxes less its parts, so the surface is closed, has no hidden faces inside or
between things, and its normals look into the air.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import pymeshlab
import trimesh
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import PlanError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from research.virtual_rooms.room_plan import (
    BoxSection,
    ChairSection,
    CylinderSection,
    Part,
    RoomPlan,
    RoomSection,
    Side,
    TableSection,
    TrueMaterial,
)

CYLINDER_SIDES = 16  # as round as a centimetre's noise lets one see
OVERLAP_M = 0.01  # [m] legs reach so far into floor and top, so that no two faces coincide
ON_SURFACE_M = 1e-6  # [m] a boolean's new corners are off their planes by rounding only
LOOK_AHEAD_M = 0.08  # [m] a scan's surface is that close to the true one, else the nearest true point is taken
SAMPLE_SPACING_M = 0.02  # [m] of the points that stand for the true surface in nearest-point questions
NORMAL_WEIGHT_M = 0.1  # [m] a normal turned by 90 degrees counts as this distance times the square root of 2


@dataclass(frozen=True, kw_only=True)
class Surface:
    """What a true face belongs to.

    Parameters
    ----------
    part : str
        Name of the part, or 'room/floor', 'room/ceiling', 'room/walls'.
    material : int
        Index in the plan's materials.
    lamp : str or None
        The lamp whose lit face this is.
    """

    part: str
    material: int
    lamp: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueRoom:
    """The closed surface of a plan's air.

    Parameters
    ----------
    vertices : (vertex, 3) float
        [m]
    faces : (face, 3) int
        Counter-clockwise seen from the air.
    face_surface : (face,) int
        Index in `surfaces`.
    surfaces : tuple of Surface
        Every part, and the sides of every room.
    materials : tuple of TrueMaterial
        The plan's.
    rooms : tuple of Solid
        The boxes of air, and the air that goes from box to box where two touch.
    solids : tuple of Solid
        What stands in them.
    """

    vertices: FloatArray
    faces: IntArray
    face_surface: IntArray
    surfaces: tuple[Surface, ...]
    materials: tuple[TrueMaterial, ...]
    rooms: tuple["Solid", ...]
    solids: tuple["Solid", ...]

    @cached_property
    def face_material(self) -> IntArray:
        """(face,) index of each face's material."""
        return np.array([surface.material for surface in self.surfaces], dtype=np.int64)[self.face_surface]

    @cached_property
    def normals(self) -> FloatArray:
        """(face, 3) unit normals into the air [1]."""
        return self.scan.normals

    @cached_property
    def scan(self) -> Scan:
        """The surface as a scan without colour, for ray casting and for a scene of the truth."""
        return bare_scan(self.vertices, self.faces)

    def nearest_faces(self, points: ArrayLike, normals: ArrayLike) -> IntArray:
        """True face that each point of a scanned surface stands for.

        The surface is looked at from the front, against the scan's normal; what lies more than `LOOK_AHEAD_M` off,
        or is seen from behind, is replaced by the nearest true point that faces the same way.

        Parameters
        ----------
        points : (n, 3) float
            On the scanned surface. [m]
        normals : (n, 3) float
            Unit normals there.

        Returns
        -------
        faces : (n,) int
        """
        positions, directions = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
        hits = self._caster.nearest(positions + LOOK_AHEAD_M * directions, -directions, max_distance=2 * LOOK_AHEAD_M)
        facing = np.einsum("nc,nc->n", self.normals[hits.face], directions) > 0.3
        faces = np.where(hits.met & facing, hits.face, -1)
        lost = np.flatnonzero(faces < 0)
        if lost.size:
            tree, owner = self._samples
            _, index = tree.query(np.hstack([positions[lost], NORMAL_WEIGHT_M * directions[lost]]))
            faces[lost] = owner[index]
        return np.asarray(faces, dtype=np.int64)

    def sample(self, spacing_m: float, generator: np.random.Generator) -> tuple[FloatArray, IntArray]:
        """Points spread evenly over the surface, about one in every square of `spacing_m`.

        Parameters
        ----------
        spacing_m : float
            [m]
        generator : Generator
            Scatters them.

        Returns
        -------
        points : (n, 3) float
            [m]
        faces : (n,) int
            The face that each is on.
        """
        mesh = trimesh.Trimesh(vertices=self.vertices, faces=self.faces, process=False)
        count = round(mesh.area / spacing_m**2)
        points, faces = trimesh.sample.sample_surface_even(mesh, count, seed=int(generator.integers(2**31)))
        return np.asarray(points, dtype=np.float64), np.asarray(faces, dtype=np.int64)

    def in_air(self, points: ArrayLike) -> BoolArray:
        """Which points (n, 3) [m] lie in the room's air, not in a wall and not inside of anything.

        Returns
        -------
        free : (n,) bool
        """
        positions = np.asarray(points, dtype=np.float64)
        free = np.zeros(len(positions), dtype=np.bool_)
        for air in self.rooms:
            free |= air.outside(positions) < 0
        for solid in self.solids:
            free &= solid.outside(positions) > 0
        return free

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.scan)

    @cached_property
    def _samples(self) -> tuple[cKDTree, IntArray]:
        points, owner = self.sample(SAMPLE_SPACING_M, np.random.default_rng(0))
        return cKDTree(np.hstack([points, NORMAL_WEIGHT_M * self.normals[owner]])), owner


def depth_in_air(room: TrueRoom, axes: tuple[FloatArray, FloatArray, FloatArray], limit_m: float) -> FloatArray:
    """How deep the points of a grid lie in the air, cut at a limit.

    Distances are those to the planes of the nearest solid: exact up to the surface, too small around outer edges.

    Parameters
    ----------
    room : TrueRoom
    axes : three (n,) float
        Ascending coordinates of the grid. [m]
    limit_m : float
        Largest depth that is told apart. [m]

    Returns
    -------
    depth : (x, y, z) float
        Positive in the air, negative inside things. [m]
    """
    shape = (axes[0].size, axes[1].size, axes[2].size)
    depth = np.full(shape, -limit_m)
    for air in room.rooms:
        near, grid = _grid_near(air, axes, limit_m)
        depth[near] = np.maximum(depth[near], -air.outside(grid))
    for solid in room.solids:
        near, grid = _grid_near(solid, axes, limit_m)
        depth[near] = np.minimum(depth[near], solid.outside(grid))
    return np.asarray(np.clip(depth, -limit_m, limit_m), dtype=np.float64)


def _grid_near(
    solid: "Solid", axes: tuple[FloatArray, FloatArray, FloatArray], margin_m: float
) -> tuple[tuple[slice, slice, slice], FloatArray]:
    """The part of a grid around a solid: slices into it, and its points."""
    low, high = solid.bounds[0] - margin_m, solid.bounds[1] + margin_m
    x, y, z = (
        slice(int(np.searchsorted(axis, below)), int(np.searchsorted(axis, above)))
        for axis, below, above in zip(axes, low, high, strict=True)
    )
    grid = np.stack(np.meshgrid(axes[0][x], axes[1][y], axes[2][z], indexing="ij"), axis=-1)
    return (x, y, z), grid


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A convex body.

    Parameters
    ----------
    mesh : Trimesh
        Closed, normals outward.
    """

    mesh: trimesh.Trimesh

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest corner [m]."""
        return np.asarray(self.mesh.bounds, dtype=np.float64)

    def outside(self, points: FloatArray) -> FloatArray:
        """(...) distance outside the farthest plane [m]; negative inside the body, zero on its surface."""
        normals, offsets = self._planes
        return np.asarray((points @ normals.T - offsets).max(axis=-1), dtype=np.float64)

    @cached_property
    def _planes(self) -> tuple[FloatArray, FloatArray]:
        normals = np.asarray(self.mesh.face_normals, dtype=np.float64)
        offsets = np.einsum("fc,fc->f", normals, np.asarray(self.mesh.triangles[:, 0]))
        unique = np.unique(np.round(np.column_stack([normals, offsets]), 9), axis=0)
        return unique[:, :3], unique[:, 3]


def true_room(plan: RoomPlan) -> TrueRoom:
    """Build the surface of a plan's air.

    Parameters
    ----------
    plan : RoomPlan

    Returns
    -------
    room : TrueRoom
        A closed surface.

    Raises
    ------
    PlanError
        If no air is left.
    """
    pieces = [piece for part in plan.file.parts for piece in _pieces(part, plan)]
    corners_of_air = [(np.array(room.low), np.array(room.high)) for room in plan.file.rooms]
    boxes, passages = (
        [Solid(mesh=trimesh.creation.box(bounds=bounds)) for bounds in each]
        for each in (corners_of_air, _passages(corners_of_air))
    )
    solids = [solid for solid, _ in pieces]
    vertices, faces = _air(boxes, solids)
    sides = [surface for room in plan.file.rooms for surface in _sides(room, plan)]
    surfaces = (*sides, *(surface for _, surface in pieces))
    corners = vertices[faces]
    owner = _shell_owner(plan.file.rooms, corners)
    for number, solid in enumerate(solids, start=len(sides)):
        # The last part listed wins where two coincide; a face is on a solid where its centre is.
        owner[np.abs(solid.outside(corners.mean(axis=1))) < ON_SURFACE_M] = number
    if np.any(owner < 0):
        raise PlanError(
            expected="every surface to belong to a part or a room",
            found=f"{int((owner < 0).sum())} triangles that do not",
            where=plan.file.name,
            todo="Rooms whose boxes meet at another angle than a right one cannot be told apart.",
        )
    return TrueRoom(
        vertices=vertices,
        faces=faces,
        face_surface=owner,
        surfaces=surfaces,
        materials=plan.materials,
        rooms=(*boxes, *passages),
        solids=tuple(solids),
    )


def _passages(boxes: Sequence[tuple[FloatArray, FloatArray]]) -> list[tuple[FloatArray, FloatArray]]:
    """Boxes of air through the faces that two of the boxes share.

    Where boxes touch, each alone has a wall: the depth in their union, taken as the larger of both depths, is zero
    there, and a phone that fuses depths sees a sheet. A box through the shared face has its depth there.
    """
    found = []
    for (low, high), (other_low, other_high) in combinations(boxes, 2):
        shared_low, shared_high = np.maximum(low, other_low), np.minimum(high, other_high)
        touching = np.abs(shared_high - shared_low) < ON_SURFACE_M
        if touching.sum() == 1 and np.all(shared_high > shared_low, where=~touching):
            found.append(
                (
                    np.where(touching, np.minimum(low, other_low), shared_low),
                    np.where(touching, np.maximum(high, other_high), shared_high),
                )
            )
    return found


def _air(rooms: list[Solid], solids: list[Solid]) -> tuple[FloatArray, IntArray]:
    """Union of the rooms less the solids, faces turned into the air."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(_to_pymeshlab(rooms[0].mesh))
    try:
        for room in rooms[1:]:
            air = meshes.current_mesh_id()
            meshes.add_mesh(_to_pymeshlab(room.mesh))
            meshes.generate_boolean_union(first_mesh=air, second_mesh=meshes.current_mesh_id())
        if solids:
            air = meshes.current_mesh_id()
            meshes.add_mesh(_to_pymeshlab(_together([solid.mesh for solid in solids])))
            meshes.generate_boolean_difference(first_mesh=air, second_mesh=meshes.current_mesh_id())
    except pymeshlab.PyMeshLabException as cause:
        raise PlanError(
            expected="rooms that hold air around their parts",
            found=f"none that can be built ({str(cause).splitlines()[-1]})",
            todo="Parts that fill every room leave no air.",
        ) from cause
    mesh = meshes.current_mesh()
    outward = np.asarray(mesh.face_matrix(), dtype=np.int64)
    vertices = np.asarray(mesh.vertex_matrix(), dtype=np.float64)
    return vertices, np.ascontiguousarray(outward[:, ::-1])


def _together(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """One mesh of several closed ones; where they overlap, the boolean counts what is inside any as inside."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return trimesh.Trimesh(
        vertices=np.concatenate([np.asarray(mesh.vertices) for mesh in meshes]),
        faces=np.concatenate([np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts, strict=True)]),
        process=False,
    )


def _to_pymeshlab(mesh: trimesh.Trimesh) -> pymeshlab.Mesh:
    return pymeshlab.Mesh(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int32))


def _sides(room: RoomSection, plan: RoomPlan) -> list[Surface]:
    """Floor, ceiling, and the walls west, east, south, north, in the order that `_shell_owner` counts on."""
    sides: tuple[Side, ...] = ("west", "east", "south", "north")
    names = {"floor": room.floor, "ceiling": room.ceiling}
    names |= {f"{side} wall": room.accents.get(side, room.walls) for side in sides}
    return [
        Surface(part=f"{room.name}/{side}", material=plan.material_number(material)) for side, material in names.items()
    ]


def _shell_owner(rooms: tuple[RoomSection, ...], corners: FloatArray) -> IntArray:
    """(face,) which side of which room each triangle lies on; -1 for none."""
    owner = np.full(len(corners), -1, dtype=np.int64)
    center = corners.mean(axis=1)
    for number, room in enumerate(rooms):
        low, high = np.array(room.low), np.array(room.high)
        inside = np.all((center > low - ON_SURFACE_M) & (center < high + ON_SURFACE_M), axis=1)
        for axis, sides in ((2, (0, 1)), (0, (2, 3)), (1, (4, 5))):
            for side, plane in zip(sides, (low[axis], high[axis]), strict=True):
                on_plane = np.all(np.abs(corners[:, :, axis] - plane) < ON_SURFACE_M, axis=1)
                owner[inside & on_plane] = 6 * number + side
    return owner


def _pieces(part: Part, plan: RoomPlan) -> list[tuple[Solid, Surface]]:
    """Cut a part into convex solids, each with the surface that it shows."""
    surface = Surface(part=part.name, material=plan.material_number(part.material), lamp=part.lamp)
    match part:
        case BoxSection():
            low, high = np.array(part.low), np.array(part.high)
            meshes = [(_box(low - (low + high) / 2, high - (low + high) / 2, part.yaw_deg, (low + high) / 2), surface)]
        case CylinderSection():
            mesh = trimesh.creation.cylinder(radius=part.radius, height=part.height, sections=CYLINDER_SIDES)
            mesh.apply_translation(np.array(part.foot) + [0.0, 0.0, part.height / 2])
            meshes = [(mesh, surface)]
        case TableSection():
            legs = Surface(part=f"{part.name}/legs", material=plan.material_number(part.leg_material))
            meshes = _table(part, surface, legs)
        case ChairSection():
            legs = Surface(part=f"{part.name}/legs", material=plan.material_number(part.leg_material))
            meshes = _chair(part, surface, legs)
    return [(Solid(mesh=mesh), shown) for mesh, shown in meshes]


def _table(part: TableSection, top: Surface, legs: Surface) -> list[tuple[trimesh.Trimesh, Surface]]:
    length, width = part.size
    under = part.height - part.thickness
    pieces = _legs(length - 0.06, width - 0.06, part.leg, under + OVERLAP_M, part.yaw_deg, part.center, legs)
    slab = _box(
        (-length / 2, -width / 2, under), (length / 2, width / 2, part.height), part.yaw_deg, (*part.center, 0.0)
    )
    return [*pieces, (slab, top)]


def _chair(part: ChairSection, seat: Surface, legs: Surface) -> list[tuple[trimesh.Trimesh, Surface]]:
    half, place = part.width / 2, (*part.center, 0.0)
    under = part.seat_height - 0.05  # [m] upholstered seat
    pieces = _legs(part.width - 0.04, part.width - 0.04, part.leg, under + OVERLAP_M, part.yaw_deg, part.center, legs)
    cushion = _box((-half, -half, under), (half, half, part.seat_height), part.yaw_deg, place)
    back = _box((-half, -half, part.seat_height - OVERLAP_M), (half, -half + 0.05, part.height), part.yaw_deg, place)
    return [*pieces, (cushion, seat), (back, seat)]


def _legs(
    length: float,
    width: float,
    leg: float,
    top: float,
    yaw_deg: float,
    center: tuple[float, float],
    surface: Surface,
) -> list[tuple[trimesh.Trimesh, Surface]]:
    """Four square legs, their outer sides `length` and `width` apart."""
    x, y = length / 2 - leg, width / 2 - leg
    feet = [(x, y), (-x - leg, y), (-x - leg, -y - leg), (x, -y - leg)]
    return [(_box((u, v, -OVERLAP_M), (u + leg, v + leg, top), yaw_deg, (*center, 0.0)), surface) for u, v in feet]


def _box(low: ArrayLike, high: ArrayLike, yaw_deg: float, place: ArrayLike) -> trimesh.Trimesh:
    """A box given about the origin, turned about z and moved to its place."""
    mesh: trimesh.Trimesh = trimesh.creation.box(bounds=[np.asarray(low), np.asarray(high)])
    cosine, sine = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    mesh.vertices = np.asarray(mesh.vertices) @ turn.T + np.asarray(place)
    return mesh
