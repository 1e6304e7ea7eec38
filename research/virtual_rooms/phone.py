"""A virtual phone: what a LiDAR phone would hand over of a room whose truth is known.

The true surface goes through what happens in a phone: fused into a voxel grid of signed distances (edges rounded,
thin things thickened or lost), meshed with triangles of a few centimetres, drifting and noisy by millimetres, with
holes where the phone did not look. Colour comes from the light in the room, which the caller gives as irradiance at
points of the true surface; nothing here traces light.

References
----------
Newcombe et al., "KinectFusion: real-time dense surface mapping and tracking", ISMAR 2011 (fusion of depth images
into signed distances, the form in which phones hold a scan).
"""

from dataclasses import dataclass

import numpy as np
import pymeshlab
import trimesh
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array, int_array, linked
from lidarspectra.errors import ScanError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.geometry.triangles import triangle_areas, triangle_crosses
from lidarspectra.geometry.zero_surface import zero_surface
from research.virtual_rooms.room_plan import PhoneSection
from research.virtual_rooms.true_room import TrueRoom, depth_in_air

REMESH_ITERATIONS = 5  # lengths have settled by then
FEATURE_DEG = 30.0  # [deg] edges sharper than this are kept by remeshing
SMALLEST_PIECE_FACES = 60  # a phone drops crumbs of surface
DRIFT_WAVES = 6  # plane waves that make up the drift
PATH_POINTS = 12  # where the phone looked from, along the user's walk around the room
PATH_HEIGHT_M = 1.5  # [m] a phone held before the chest
HIDDEN_WEIGHT = 12.0  # [1] how much likelier a hole is where the phone did not look


@dataclass(frozen=True, kw_only=True, eq=False)
class ScannedShape:
    """The geometry that the phone hands over, and what is true there.

    Parameters
    ----------
    vertices : (vertex, 3) float
        z up, in the plan's coordinates. [m]
    faces : (face, 3) int
        Counter-clockwise seen from the room.
    true_face : (face,) int
        The true room's face that each triangle stands for.
    hole_area_m2 : float
        Area taken away as holes. [m²]
    """

    vertices: FloatArray
    faces: IntArray
    true_face: IntArray
    hole_area_m2: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", float_array(self.vertices, name="ScannedShape.vertices", shape=(None, 3)))
        object.__setattr__(self, "faces", int_array(self.faces, name="ScannedShape.faces", shape=(None, 3)))
        true_face = int_array(self.true_face, name="ScannedShape.true_face", shape=(self.faces.shape[0],))
        object.__setattr__(self, "true_face", true_face)


def scan_shape(room: TrueRoom, settings: PhoneSection, generator: np.random.Generator) -> ScannedShape:
    """Scan the geometry of a room.

    Parameters
    ----------
    room : TrueRoom
    settings : PhoneSection
    generator : Generator
        Noise, drift and holes; the same seed gives the same scan.

    Returns
    -------
    shape : ScannedShape

    Raises
    ------
    ScanError
        If nothing of the room is thicker than a voxel.
    """
    fused_vertices, faces = _without_crumbs(*_fused(room, settings))
    normals = _vertex_normals(fused_vertices, faces)
    vertices = (
        fused_vertices
        + generator.normal(scale=settings.noise_m, size=(len(fused_vertices), 1)) * normals
        + _drift(fused_vertices, settings, generator)
    )
    corners = vertices[faces]
    missing = _holes(vertices, faces, settings, generator)
    areas = triangle_areas(corners)
    vertices, kept_faces = _compact(vertices, faces[~missing])
    kept = vertices[kept_faces]
    return ScannedShape(
        vertices=vertices,
        faces=kept_faces,
        # What a triangle stands for is asked before the noise moved it.
        true_face=room.nearest_faces(
            fused_vertices[faces[~missing]].mean(axis=1), _unit(triangle_crosses(fused_vertices[faces[~missing]]))
        ),
        hole_area_m2=float(areas.sum() - triangle_areas(kept).sum()),
    )


def _fused(room: TrueRoom, settings: PhoneSection) -> tuple[FloatArray, IntArray]:
    """Signed distances on voxels, their zero surface, remeshed to even triangles."""
    low = np.min([air.bounds[0] for air in room.rooms], axis=0) - 2 * settings.voxel_m
    high = np.max([air.bounds[1] for air in room.rooms], axis=0) + 2 * settings.voxel_m
    x, y, z = (np.arange(below, above, settings.voxel_m) for below, above in zip(low, high, strict=True))
    vertices, faces = zero_surface(depth_in_air(room, (x, y, z), 3 * settings.voxel_m))
    if len(faces) == 0:
        raise ScanError(
            expected="a room larger than a few voxels", found="nothing left of it", where="virtual phone",
            todo="Choose a smaller voxel_m.",
        )  # fmt: skip
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices * settings.voxel_m + low, faces.astype(np.int32)))
    meshes.meshing_repair_non_manifold_edges(method="Split Vertices")
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=REMESH_ITERATIONS,
        targetlen=pymeshlab.PureValue(settings.edge_m),
        featuredeg=FEATURE_DEG,
        checksurfdist=False,
    )
    mesh = meshes.current_mesh()
    return np.asarray(mesh.vertex_matrix(), dtype=np.float64), np.asarray(mesh.face_matrix(), dtype=np.int64)


def _without_crumbs(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Drop pieces of a few triangles, and triangles without area."""
    faces = faces[triangle_areas(vertices[faces]) > 0]
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    piece = linked(ends, len(vertices))
    sizes = np.bincount(piece[faces[:, 0]], minlength=int(piece.max()) + 1)
    return _compact(vertices, faces[sizes[piece[faces[:, 0]]] >= SMALLEST_PIECE_FACES])


def _drift(points: FloatArray, settings: PhoneSection, generator: np.random.Generator) -> FloatArray:
    """Slow displacement, the same for neighbours: a sum of plane waves with random directions."""
    shift = np.zeros_like(points)
    for _ in range(DRIFT_WAVES):
        length = settings.drift_wavelength_m * generator.uniform(1.0, 3.0)
        wave = _unit(generator.normal(size=3)) * 2 * np.pi / length
        phase = generator.uniform(0, 2 * np.pi)
        amplitude = generator.normal(size=3)
        shift += np.sin(points @ wave + phase)[:, None] * amplitude
    # A sine's mean square is 1/2, that of a 3-vector of unit normals 3.
    return np.asarray(shift * settings.drift_m / np.sqrt(1.5 * DRIFT_WAVES), dtype=np.float64)


def _holes(vertices: FloatArray, faces: IntArray, settings: PhoneSection, generator: np.random.Generator) -> BoolArray:
    """(face,) which triangles are missing: round patches, mostly where the phone did not look."""
    corners = vertices[faces]
    centers, normals, areas = corners.mean(axis=1), _unit(triangle_crosses(corners)), triangle_areas(corners)
    weights = areas * np.where(_seen(vertices, faces), 1.0, HIDDEN_WEIGHT)
    weights /= weights.sum()
    tree = cKDTree(centers)
    missing = np.zeros(len(faces), dtype=np.bool_)
    while areas[missing].sum() < settings.hole_share * areas.sum():
        middle = int(generator.choice(len(faces), p=weights))
        radius = generator.uniform(*settings.hole_radius_m)
        near = np.array(tree.query_ball_point(centers[middle], radius), dtype=np.int64)
        # A hole goes through one side of a thin thing only.
        missing[near[normals[near] @ normals[middle] > 0.5]] = True
    return missing


def _seen(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """(face,) whether some point of the user's walk sees the triangle's centre."""
    caster = RayCaster(bare_scan(vertices, faces))
    corners = vertices[faces]
    centers, normals = corners.mean(axis=1), _unit(triangle_crosses(corners))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    angles = np.linspace(0, 2 * np.pi, PATH_POINTS, endpoint=False)
    middle, reach = (low + high) / 2, 0.3 * (high - low)
    seen = np.zeros(len(faces), dtype=np.bool_)
    for angle in angles:
        eye = np.array(
            [middle[0] + reach[0] * np.cos(angle), middle[1] + reach[1] * np.sin(angle), low[2] + PATH_HEIGHT_M]
        )
        towards = eye - centers
        hits = caster.nearest(np.broadcast_to(eye, centers.shape), -towards)
        seen |= (hits.face == np.arange(len(faces))) & (np.einsum("fc,fc->f", towards, normals) > 0)
    return seen


def _compact(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Drop vertices that no triangle uses."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(faces.shape).astype(np.int64)


def _vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    mesh = trimesh.Trimesh(vertices=vertices, faces=faces, process=False)
    return np.asarray(mesh.vertex_normals, dtype=np.float64)


def _unit(vectors: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0), dtype=np.float64)
