"""A mesh from the depth of frames, for apps that export none: a truncated signed distance on a grid of voxels.

Each pixel of a depth map puts its signed distance into the voxels along its ray about the point that it measured, with
a weight that falls with distance and confidence; the surface is where the mean is zero (marching cubes). Voxels are so
large that a pixel reaches every one, and that the grid keeps to a bounded number, whatever the room. Surfaces are left
open where nothing was measured.

References
----------
Curless, Levoy (1996) A volumetric method for building complex models from range images, SIGGRAPH, 303.
Lewiner, Lopes, Vieira, Tavares (2003) Efficient implementation of marching cubes' cases, J. Graphics Tools 8, 1.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray, SmallFloatArray, linked
from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.frames import DepthMap, Frame, FrameFault
from lidarspectra.hardware.phone.raw_mesh import MeshPart, RawMesh
from lidarspectra.progress import Progress, silent

VOXEL_M = 0.025  # [m] of a small room: the LiDAR's own points lie 1 to 3 cm apart at 2 m
MAX_VOXELS = 24_000_000  # which bounds the memory to about 0.4 GB
PIXELS_PER_VOXEL = 1.5  # least, at the usual distance
TRUNCATION = 3.0  # [voxel] about a measured point
STEP = 0.6  # [voxel] along a ray
FARTHEST_M = 4.0  # [m] along the axis: a phone's LiDAR measures 5 m, its last metre badly
WEIGHTS = (0.0, 0.25, 1.0)  # [1] by ARKit's confidence: low, medium, high
MIN_WEIGHT = 0.3  # [1] of a voxel: one or two samples at 2 m
MARGIN = 4  # [voxel] around what was measured
OUTLIERS = 0.002  # [1] share of the points at either end of an axis that does not make the grid larger
BOUNDS_STRIDE = 8  # [px] of the depth by which the grid's extent is found
MIN_PIECE_FACES = 200  # smaller pieces float in the air
APPROXIMATE_NOTE = (
    "The app exported no mesh, so one was made of the LiDAR's depth, in voxels of {size:.0f} mm: edges are rounded by "
    "about that, and what the LiDAR did not see is open. If the app can export a mesh, give that one."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """Voxels: where the first one's middle is [m], their size [m], how many there are, and what they hold."""

    origin: FloatArray
    size_m: float
    shape: tuple[int, int, int]
    weight: SmallFloatArray
    total: SmallFloatArray


def fuse_depth(frames: Sequence[Frame], where: str, progress: Progress = silent) -> RawMesh:
    """Make a mesh of the depth of frames.

    Parameters
    ----------
    frames : sequence of Frame
        With poses in metres, y up.
    where : str
        For errors.
    progress : callable
        Receives the share that is done.

    Returns
    -------
    mesh : RawMesh
        In the axes of the poses, facing the cameras, without colour.

    Raises
    ------
    ScanError
        If no frame has depth, or the library for the surface is missing.
    """
    surface = _library(where)
    grid = _grid_around(frames, where, progress)
    for number, (frame, depth) in enumerate(_depths(frames)):
        progress(0.3 + 0.6 * number / len(frames), "combining depth")
        _put(grid, frame, depth)
    progress(0.9, "making a mesh of the depth")
    seen = grid.weight.reshape(grid.shape) >= MIN_WEIGHT
    if not seen.any():
        raise _nothing(where, "too few measurements of any place")
    mean = np.where(grid.weight > 0, grid.total / np.maximum(grid.weight, 1e-6), 1.0).reshape(grid.shape)
    if not (mean[seen].min() < 0 < mean[seen].max()):
        raise _nothing(where, "no surface among its measurements")
    from scipy.ndimage import minimum_filter  # loads slowly

    inside = minimum_filter(seen, size=3)  # all corners of the cubes on either side of a voxel are known
    vertices, faces, _, _ = surface(mean, level=0.0, mask=inside, gradient_direction="descent")
    faces = _large_pieces(np.asarray(faces, dtype=np.int64), len(vertices))
    if not len(faces):
        raise _nothing(where, "pieces of less than a hand's size alone")
    used, renumbered = np.unique(faces, return_inverse=True)
    points = grid.origin + grid.size_m * np.asarray(vertices, dtype=np.float64)[used]
    part = MeshPart(vertices=points, faces=renumbered.reshape(faces.shape).astype(np.int64))
    return RawMesh(parts=(part,), unit="m", notes=(APPROXIMATE_NOTE.format(size=1000 * grid.size_m),))


def _nothing(where: str, found: str) -> ScanError:
    return ScanError(
        expected="frames with depth, of which a mesh is made where the app exported none",
        found=found,
        where=where,
        todo="Scan with the LiDAR switched on, or export a mesh from the app as GLB.",
    )


def _library(where: str):  # type: ignore[no-untyped-def]
    """Marching cubes, of a library that is an extra."""
    try:
        from skimage.measure import marching_cubes
    except ImportError as cause:
        raise ScanError(
            expected="the library that makes a mesh of depth (scikit-image)",
            found="none",
            where=where,
            todo="Install it with 'pip install lidarspectra[frames]', or export a mesh from the app as GLB.",
        ) from cause
    return marching_cubes


def _depths(frames: Sequence[Frame]) -> Iterator[tuple[Frame, DepthMap]]:
    """Frames with their depth, without those whose depth is missing or damaged."""
    for frame in frames:
        try:
            depth = frame.read_depth()
        except FrameFault:
            continue  # its picture may be whole; where its depth is asked for again, the frame is left out by name
        if depth is not None:
            yield frame, depth


def _grid_around(frames: Sequence[Frame], where: str, progress: Progress) -> _Grid:
    """An empty grid around what the frames measured; ScanError if that is hardly anything."""
    points, apart = [], []
    for number, (frame, depth) in enumerate(_depths(frames)):
        progress(0.3 * number / len(frames), "reading depth")
        ways, metres, weight = _rays(frame, depth, BOUNDS_STRIDE)
        points.append((frame.position + ways * metres[:, None])[weight > 0])
        focal_px = frame.intrinsics[0, 0] * depth.depth_m.shape[1] / frame.size_px[0]
        apart.append(metres[weight > 0] / focal_px)
    some = np.concatenate(points) if points else np.zeros((0, 3))
    if len(some) < MIN_PIECE_FACES:
        raise _nothing(where, "no frame with depth" if not points else "hardly any depth in them")
    low, high = np.quantile(some, [OUTLIERS, 1.0 - OUTLIERS], axis=0)
    extent = np.maximum(high - low, VOXEL_M)
    pixel_m = float(np.median(np.concatenate(apart)))
    size = max(VOXEL_M, PIXELS_PER_VOXEL * pixel_m, float(np.cbrt(extent.prod() / MAX_VOXELS)))
    counts = np.ceil(extent / size).astype(np.int64) + 2 * MARGIN
    shape = (int(counts[0]), int(counts[1]), int(counts[2]))
    empty = np.zeros(int(counts.prod()), dtype=np.float32)
    return _Grid(origin=low - MARGIN * size, size_m=size, shape=shape, weight=empty, total=empty.copy())


def _rays(frame: Frame, depth: DepthMap, stride: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, 3) directions of length 1 along the axis, (n,) depth [m] and (n,) weight [1] of a depth map's pixels."""
    metres = depth.depth_m[::stride, ::stride].astype(np.float64)
    sure = depth.confidence[::stride, ::stride]
    rows, columns = np.indices(metres.shape)
    height, width = depth.depth_m.shape
    matrix = frame.intrinsics
    x = ((stride * columns + 0.5) / width * frame.size_px[0] - matrix[0, 2]) / matrix[0, 0]
    y = ((stride * rows + 0.5) / height * frame.size_px[1] - matrix[1, 2]) / matrix[1, 1]
    good = (metres > 0) & (metres < FARTHEST_M)
    ways = np.stack([x, -y, -np.ones_like(x)], axis=-1)[good] @ frame.camera_to_world[:3, :3].T
    return ways, metres[good], np.asarray(WEIGHTS)[sure[good]] / (1.0 + metres[good] ** 2)


def _put(grid: _Grid, frame: Frame, depth: DepthMap) -> None:
    """Add a depth map's signed distances, in voxels over the truncation, positive before the surface."""
    ways, metres, weight = _rays(frame, depth, 1)
    ways, metres, weight = ways[weight > 0], metres[weight > 0], weight[weight > 0]
    ahead = -frame.camera_to_world[:3, 2]
    reach = TRUNCATION * grid.size_m
    along = np.linalg.norm(ways, axis=1)
    for offset in np.arange(-TRUNCATION, TRUNCATION + STEP / 2, STEP) * grid.size_m:
        points = frame.position + ways * (metres + offset / along)[:, None]
        place = np.rint((points - grid.origin) / grid.size_m).astype(np.int64)
        inside = ((place >= 0) & (place < grid.shape)).all(axis=1)
        middle = grid.origin + grid.size_m * place[inside]
        distance = (metres[inside] - (middle - frame.position) @ ahead) * along[inside]
        index = np.ravel_multi_index(tuple(place[inside].T), grid.shape)
        part = weight[inside].astype(np.float32)
        np.add.at(grid.weight, index, part)
        np.add.at(grid.total, index, part * np.clip(distance / reach, -1.0, 1.0).astype(np.float32))


def _large_pieces(faces: IntArray, vertices: int) -> IntArray:
    """Faces of pieces that are not crumbs."""
    if not len(faces):
        return faces
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    piece = linked(ends, vertices)[faces[:, 0]]
    return np.asarray(faces[np.bincount(piece)[piece] >= MIN_PIECE_FACES], dtype=np.int64)
