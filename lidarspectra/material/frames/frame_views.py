"""A frame held against the mesh: which points of the surface it shows, where, and how well.

A point is seen if nothing of the mesh lies before it and the LiDAR of that moment, where it is told, measured about its
distance: a person who walked by, or a pose that is wrong, does not. Edges of what lies in front are kept away from,
since poses are off by a centimetre and half a degree.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray, SmallFloatArray
from lidarspectra.geometry.rays import Hits, RayCaster
from lidarspectra.hardware.phone.frames import DepthMap, Frame, FrameFault
from lidarspectra.spectra.colorimetry import decode_srgb

BUFFER_PX = 192  # width of the depth that the mesh would show; a pixel is a third of a degree
EDGE_PX = 2  # of that buffer, kept away from the edges of what lies in front: .7°, more than poses are off
PICTURE_PX = 480  # width to which pictures are averaged: 3 mm at 2 m, finer than the texels
BORDER = 0.02  # [1] of the picture along its border that is not used
NEAREST_M, FARTHEST_M = 0.15, 8.0  # [m] along the axis
MIN_COSINE = 0.2  # [1] flatter views smear
TOLERANCE, TOLERANCE_M = 0.02, 0.03  # [1, m] of the mesh's depth, by which a point may lie behind it
LIDAR_TOLERANCE, LIDAR_TOLERANCE_M = 0.05, 0.08  # [1, m] between mesh and LiDAR
LOST_SHARE = 0.12  # [1] median of |mesh over LiDAR - 1|, from which a frame's pose is wrong
LOST_PIXELS = 500  # that both see, fewer say nothing
CLIPPED_BYTE = 250  # from which a channel is cut at white: JPEG blurs the 255
CLIPPED_SHARE = 0.02  # [1] of what a pixel of the small picture averages
GRADIENT_PX = 7  # window of the small picture in which its evenness is told: half of it is a pose's error
AHEAD = 2  # pictures that are decoded while one is worked on
LOW_CONFIDENCE = 0.5  # [1] weight where the LiDAR was not sure
DARK = 0.004  # [1] of white, down to which a picture tells a ratio
USUAL_DISTANCE_M = 2.0  # [m] at which a view's weight is halved


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A frame's picture, averaged to `PICTURE_PX` in light.

    Parameters
    ----------
    light : (row, column, 3) float32
        Light by the table that it was decoded with; linear sRGB without another. [1]
    uneven : (row, column) float32
        Relative deviation of the light around. [1]
    clipped : (row, column) bool
        Whether a part is cut at white.
    sharpness : float
        Mean of the absolute Laplacian over the light. [1]
    depth : DepthMap or None
        What the LiDAR measured.
    """

    light: SmallFloatArray
    uneven: SmallFloatArray
    clipped: BoolArray
    sharpness: float
    depth: DepthMap | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """Points that a frame shows.

    Parameters
    ----------
    index : (seen,) int
        Of the points asked for.
    pixel : (seen, 2) float32
        Column and row in the small picture. [px]
    radius2 : (seen,) float
        Squared distance from the picture's middle, over that of a corner. [0-1]
    weight : (seen,) float
        How well: cosine, distance, the LiDAR's confidence. [0-1]
    """

    index: IntArray
    pixel: SmallFloatArray
    radius2: FloatArray
    weight: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownFaces:
    """Points of the mesh that a frame's pose shows.

    Parameters
    ----------
    face : (point,) int
    barycentric : (point, 3) float
        Weights of the face's corners. [1]
    """

    face: IntArray
    barycentric: FloatArray


def linear_table() -> FloatArray:
    """(256, 3) linear sRGB of each byte [0-1]."""
    return np.repeat(decode_srgb(np.arange(256) / 255.0)[:, None], 3, axis=1)


def pictures(frames: Sequence[Frame], table: FloatArray) -> Iterator[Picture | FrameFault]:
    """Pictures of frames in their order, decoded ahead by other threads; the fault of those that are damaged.

    Parameters
    ----------
    frames : sequence of Frame
    table : (256, 3) float
        Light of each byte in each channel. [1]

    Yields
    ------
    picture : Picture or FrameFault
    """
    rows = np.ascontiguousarray(table, dtype=np.float32)
    with ThreadPoolExecutor(max_workers=1) as pool:  # decoding silences warnings, which is of the process, not a thread
        coming: list[Future[Picture | FrameFault]] = []
        for ahead in range(len(frames) + AHEAD):
            if ahead < len(frames):
                coming.append(pool.submit(_picture, frames[ahead], rows))
            if ahead >= AHEAD:
                yield coming.pop(0).result()


def _picture(frame: Frame, table: SmallFloatArray) -> Picture | FrameFault:
    try:
        image = frame.read_image(PICTURE_PX)
        depth = frame.read_depth()
    except FrameFault as fault:
        return fault
    return averaged(image, table, depth)


def averaged(image: ByteArray, table: SmallFloatArray, depth: DepthMap | None = None) -> Picture:
    """Average a picture in light.

    Parameters
    ----------
    image : (height, width, 3) uint8
        sRGB.
    table : (256, 3) float32
        Light of each byte in each channel. [1]
    depth : DepthMap, optional
        What the LiDAR measured; kept as it is.

    Returns
    -------
    picture : Picture
        `PICTURE_PX` wide, or as wide as the image if that is less.
    """
    width = min(PICTURE_PX, image.shape[1])
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    light = cv2.resize(cv2.LUT(image, table[None]), size, interpolation=cv2.INTER_AREA)
    cut = cv2.LUT(image, (255 * (np.arange(256) >= CLIPPED_BYTE)).astype(np.uint8))
    clipped = (cv2.resize(cut, size, interpolation=cv2.INTER_AREA) > 255 * CLIPPED_SHARE).any(axis=2)
    level = np.maximum(light.mean(axis=2), 1e-4)
    window = (GRADIENT_PX, GRADIENT_PX)
    mean, square = cv2.blur(level, window), cv2.blur(level * level, window)
    uneven = np.sqrt(np.maximum(square - mean * mean, 0.0)) / mean
    sharpness = float(np.abs(cv2.Laplacian(np.log(level), cv2.CV_32F)).mean())
    return Picture(
        light=np.asarray(light, dtype=np.float32),
        uneven=np.asarray(uneven, dtype=np.float32),
        clipped=np.asarray(clipped, dtype=np.bool_),
        sharpness=sharpness,
        depth=depth,
    )


class MeshView:
    """The mesh as frames see it.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    """

    def __init__(self, caster: RayCaster) -> None:
        self._caster = caster

    def depth(self, frame: Frame) -> FloatArray:
        """(row, column) depth of the mesh along the axis, `BUFFER_PX` wide; infinite where there is none [m]."""
        return self.looked(frame)[0].distance.reshape(buffer_size(frame)[::-1])

    def shown(self, frame: Frame) -> ShownFaces:
        """What a frame's pose shows, pixel by pixel of the buffer, without flat views and edges of what is in front."""
        hits, ways = self.looked(frame)
        shape = buffer_size(frame)[::-1]
        depth = np.minimum(hits.distance, 1e6).reshape(shape)
        front = cv2.erode(depth, np.ones((2 * EDGE_PX + 1,) * 2))
        inner = (depth - (1.0 + TOLERANCE) * front < TOLERANCE_M / MIN_COSINE).ravel()
        cosine = -np.einsum("nc,nc->n", self._caster.normals[hits.face], ways) / np.linalg.norm(ways, axis=1)
        kept = hits.met & inner & (cosine > MIN_COSINE) & (hits.distance > NEAREST_M) & (hits.distance < FARTHEST_M)
        return ShownFaces(face=hits.face[kept], barycentric=hits.barycentric[kept])

    def looked(self, frame: Frame) -> tuple[Hits, FloatArray]:
        """What the rays of a frame's pose meet, pixel by pixel of a small picture.

        Parameters
        ----------
        frame : Frame

        Returns
        -------
        hits : Hits
            Of each pixel of a picture of `buffer_size`, row by row.
        ways : (pixel, 3) float
            Directions of the rays, of length 1 along the camera's axis. [1]
        """
        width, height = buffer_size(frame)
        columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        scale = width / frame.size_px[0]
        matrix = frame.intrinsics
        x = (columns / scale - matrix[0, 2]) / matrix[0, 0]
        y = (rows / scale - matrix[1, 2]) / matrix[1, 1]
        ways = np.stack([x, -y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ frame.camera_to_world[:3, :3].T
        return self._caster.nearest(np.broadcast_to(frame.position, ways.shape), ways), ways

    def is_lost(self, mesh_depth: FloatArray, lidar: DepthMap | None) -> bool:
        """Whether the LiDAR measured something else than the mesh shows from this pose: the pose is wrong.

        Parameters
        ----------
        mesh_depth : (row, column) float
            As of `depth`. [m]
        lidar : DepthMap or None
            Without it, or with fewer than `LOST_PIXELS` of high confidence, no pose is held to be wrong.
        """
        if lidar is None:
            return False
        there = cv2.resize(lidar.depth_m, mesh_depth.shape[::-1], interpolation=cv2.INTER_NEAREST)
        sure = cv2.resize(lidar.confidence, mesh_depth.shape[::-1], interpolation=cv2.INTER_NEAREST) == 2
        both = sure & (there > NEAREST_M) & np.isfinite(mesh_depth)
        if both.sum() < LOST_PIXELS:
            return False
        return bool(np.median(np.abs(mesh_depth[both] / there[both] - 1.0)) > LOST_SHARE)

    def sight(
        self, frame: Frame, mesh_depth: FloatArray, lidar: DepthMap | None, points: FloatArray, normals: FloatArray
    ) -> Sight:
        """Which points a frame shows.

        Parameters
        ----------
        frame : Frame
        mesh_depth : (row, column) float
            As of `depth`. [m]
        lidar : DepthMap or None
            Hides points at other distances than it measured.
        points, normals : (n, 3) float
            In the mesh's axes. [m, 1]

        Returns
        -------
        sight : Sight
            Of those that are in the picture, face the camera, and have nothing before them.
        """
        relative = (points - frame.position) @ frame.camera_to_world[:3, :3]
        depth = -relative[:, 2]
        index = np.flatnonzero((depth > NEAREST_M) & (depth < FARTHEST_M))
        relative, depth = relative[index], depth[index]
        matrix, (width, height) = frame.intrinsics, frame.size_px
        u = (matrix[0, 0] * relative[:, 0] / depth + matrix[0, 2]) / width
        v = (-matrix[1, 1] * relative[:, 1] / depth + matrix[1, 2]) / height
        inside = (np.minimum(u, v) > BORDER) & (np.maximum(u, v) < 1.0 - BORDER)
        index, relative, depth, u, v = index[inside], relative[inside], depth[inside], u[inside], v[inside]
        front = cv2.erode(np.minimum(mesh_depth, 1e6), np.ones((2 * EDGE_PX + 1,) * 2))
        behind = depth - (1.0 + TOLERANCE) * _at(front, u, v)
        near = behind < TOLERANCE_M / MIN_COSINE
        index, relative, depth, u, v, behind = (each[near] for each in (index, relative, depth, u, v, behind))
        distance = np.linalg.norm(relative, axis=1)
        toward = (frame.position - points[index]) / np.maximum(distance, 1e-9)[:, None]
        cosine = np.einsum("nc,nc->n", toward, normals[index])
        kept = (cosine > MIN_COSINE) & (behind < TOLERANCE_M / np.maximum(cosine, MIN_COSINE))
        weight = cosine / (1.0 + (distance / USUAL_DISTANCE_M) ** 2)
        if lidar is not None:
            there, sure = _at(lidar.depth_m, u, v), _at(lidar.confidence, u, v)
            apart = np.abs(there - depth) > LIDAR_TOLERANCE * depth + LIDAR_TOLERANCE_M
            kept &= ~(apart & (sure == 2) & (there > 0))
            weight = np.where(sure == 2, weight, LOW_CONFIDENCE * weight)
        small = np.stack([u, v], axis=1)[kept] * _picture_size(frame) - 0.5
        center = np.array([matrix[0, 2] / width, matrix[1, 2] / height])
        offset = (np.stack([u, v], axis=1)[kept] - center) * (width, height)
        return Sight(
            index=index[kept],
            pixel=small.astype(np.float32),
            radius2=np.asarray((offset**2).sum(axis=1) / (0.25 * (width**2 + height**2)), dtype=np.float64),
            weight=np.asarray(weight[kept], dtype=np.float64),
        )


def buffer_size(frame: Frame) -> tuple[int, int]:
    """Width and height of the small picture in which a frame's pose is held against the mesh [px]."""
    width, height = frame.size_px
    return BUFFER_PX, max(1, round(BUFFER_PX * height / width))


def _picture_size(frame: Frame) -> FloatArray:
    width, height = frame.size_px
    small = min(PICTURE_PX, width)
    return np.array([small, max(1, round(height * small / width))], dtype=np.float64)


def radius2_of(frame: Frame, shape: tuple[int, ...]) -> FloatArray:
    """Squared distance of a small picture's pixels from the principal point, over that of a corner.

    Parameters
    ----------
    frame : Frame
    shape : (int, int)
        Rows and columns of the small picture.

    Returns
    -------
    radius2 : (row, column) float
        [0-1]
    """
    width, height = frame.size_px
    across = (np.arange(shape[1]) + 0.5) * width / shape[1] - frame.intrinsics[0, 2]
    down = (np.arange(shape[0]) + 0.5) * height / shape[0] - frame.intrinsics[1, 2]
    return np.asarray((across[None] ** 2 + down[:, None] ** 2) / (0.25 * (width**2 + height**2)), dtype=np.float64)


def _at(image: "np.ndarray[tuple[int, ...], np.dtype[np.generic]]", u: FloatArray, v: FloatArray) -> FloatArray:
    """Values of the pixels at shares of width and height."""
    rows = np.clip((v * image.shape[0]).astype(np.int64), 0, image.shape[0] - 1)
    columns = np.clip((u * image.shape[1]).astype(np.int64), 0, image.shape[1] - 1)
    return np.asarray(image[rows, columns], dtype=np.float64)


def sampled(picture: Picture, sight: Sight) -> tuple[FloatArray, FloatArray, BoolArray]:
    """What a picture shows at points.

    Parameters
    ----------
    picture : Picture
    sight : Sight
        Of the same frame.

    Returns
    -------
    light : (seen, 3) float
        Bilinear, by the picture's table. [1]
    uneven : (seen,) float
        Relative deviation around. [1]
    clipped : (seen,) bool
        Whether one of the four pixels around is cut at white.
    """
    height, width = picture.uneven.shape
    last = np.array([width - 2, height - 2], dtype=np.int64)
    first = np.clip(np.floor(sight.pixel).astype(np.int64), 0, last)
    share = np.clip(sight.pixel - first, 0.0, 1.0)
    across, down = share[:, :1], share[:, 1:]
    start = first[:, 1] * width + first[:, 0]
    pixels = picture.light.reshape(-1, 3)
    above = pixels[start] * (1.0 - across) + pixels[start + 1] * across
    below = pixels[start + width] * (1.0 - across) + pixels[start + width + 1] * across
    light = above * (1.0 - down) + below * down
    clipped = picture.clipped.ravel()
    cut = clipped[start] | clipped[start + 1] | clipped[start + width] | clipped[start + width + 1]
    return light.astype(np.float64), picture.uneven.ravel()[start].astype(np.float64), cut
