"""A texture atlas: flat charts of a mesh, packed into one image.

Connected triangles that face roughly the same of the six directions make a chart; each chart is seen along its own
mean normal, so it keeps its proportions, and all charts have the same scale [px/m]. Charts are packed as upright
rectangles on shelves, with padding so that neither bilinear lookup nor JPEG mixes neighbours.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, SmallIntArray, linked
from lidarspectra.errors import ScanError
from lidarspectra.geometry.triangles import triangle_crosses

SMOOTHING_ROUNDS = 3  # rounds in which single triangles on a noisy edge join their neighbours' chart
SMALLEST_CHART_FACES = 8  # a smaller chart has more padding than texture
PADDING_PX = 4  # [px] on each side of a chart; half a JPEG block
SUBPIXEL_BITS = 6  # corners are drawn with a resolution of 1/64 px
SCALE_STEPS = 24  # steps of bisection for the scale, exact to a millionth


@dataclass(frozen=True, kw_only=True, eq=False)
class Atlas:
    """Where every triangle lies in the image, and which triangle every pixel shows.

    Parameters
    ----------
    size_px : int
        Edge of the square image. [px]
    pixels_per_m : float
        [px/m]
    face_chart : (face,) int
        Chart of each triangle.
    chart_normal : (chart, 3) float
        Unit vector along which each chart is seen.
    corner_px : (face, 3, 2) float
        Column and row of each corner, whole numbers at pixel centres, row 0 at the top. [px]
    texel_face : (size_px, size_px) int32
        Triangle that a pixel shows; beyond the charts that of the nearest pixel.
    covered : (size_px, size_px) bool
        Whether the pixel lies inside a chart.
    """

    size_px: int
    pixels_per_m: float
    face_chart: IntArray
    chart_normal: FloatArray
    corner_px: FloatArray
    texel_face: SmallIntArray
    covered: BoolArray

    @property
    def corner_uv(self) -> FloatArray:
        """(face, 3, 2) texture coordinates, v up [1]."""
        uv = (self.corner_px + 0.5) / self.size_px
        return np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1)

    def barycentric(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """(n, 3) weights of a triangle's corners at pixels that show it; kept inside the triangle."""
        corners = self.corner_px[self.texel_face[rows, columns]]
        edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        offset = np.stack([columns, rows], axis=1) - corners[:, 0]
        area = edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0]
        area = np.where(np.abs(area) > 1e-9, area, 1.0)
        u = (offset[:, 0] * edge2[:, 1] - offset[:, 1] * edge2[:, 0]) / area
        v = (edge1[:, 0] * offset[:, 1] - edge1[:, 1] * offset[:, 0]) / area
        weights = np.clip(np.stack([1 - u - v, u, v], axis=1), 0.0, None)
        return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float64)


def unwrap(vertices: FloatArray, faces: IntArray, directions: FloatArray, size_px: int) -> Atlas:
    """Cut a mesh into charts and pack them.

    Parameters
    ----------
    vertices : (vertex, 3) float
        [m]
    faces : (face, 3) int
    directions : (face, 3) float
        Direction that each triangle faces; may be smoother than its own noisy normal.
    size_px : int
        Edge of the image. [px]

    Returns
    -------
    atlas : Atlas

    Raises
    ------
    ScanError
        If the image is too small for the charts.
    """
    import trimesh

    adjacency = np.asarray(trimesh.Trimesh(vertices, faces, process=False).face_adjacency, dtype=np.int64)
    side = _smoothed(_sides(directions), adjacency)
    chart = _joined(_charts(side, adjacency), adjacency)
    normal = _chart_normals(vertices[faces], chart)
    flat, extent = _flattened(vertices[faces], normal, chart)
    scale, corner = _packed(extent, size_px)
    corner_px = corner[chart][:, None, :] + PADDING_PX + flat * scale
    texel_face = _drawn(corner_px, size_px)
    covered = texel_face >= 0
    fill_from_nearest(texel_face, covered)
    return Atlas(
        size_px=size_px,
        pixels_per_m=scale,
        face_chart=chart,
        chart_normal=normal,
        corner_px=corner_px,
        texel_face=texel_face,
        covered=covered,
    )


def fill_from_nearest(image: NDArray[np.generic], known: BoolArray) -> None:
    """Give every pixel of an image that is not known the value of the nearest one that is.

    Parameters
    ----------
    image : (row, column, ...) array
        Changed in place.
    known : (row, column) bool
        One pixel or more.
    """
    from scipy.ndimage import distance_transform_edt  # loads slowly

    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    for row, told in enumerate(known):  # row by row, so that the image need not be there twice
        image[row, ~told] = image[nearest[0, row, ~told], nearest[1, row, ~told]]


def split_at_charts(faces: IntArray, atlas: Atlas) -> tuple[IntArray, IntArray, FloatArray]:
    """Give every vertex one texture coordinate, by duplicating it where charts meet.

    Parameters
    ----------
    faces : (face, 3) int
    atlas : Atlas

    Returns
    -------
    origin : (new vertex,) int
        The vertex that each new one repeats.
    new_faces : (face, 3) int
        In the same order.
    uv : (new vertex, 2) float
        [1]
    """
    keys = np.stack([faces.ravel(), np.repeat(atlas.face_chart, 3)], axis=1)
    unique, first, renumbered = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    uv = atlas.corner_uv.reshape(-1, 2)[first]
    return unique[:, 0].astype(np.int64), renumbered.reshape(faces.shape).astype(np.int64), uv


def _sides(directions: FloatArray) -> IntArray:
    """(face,) 0 to 5: which of +x, +y, +z, -x, -y, -z a direction is closest to."""
    axis = np.abs(directions).argmax(axis=1)
    backward = np.take_along_axis(directions, axis[:, None], axis=1)[:, 0] < 0
    return np.asarray(axis + 3 * backward, dtype=np.int64)


def _smoothed(side: IntArray, adjacency: IntArray) -> IntArray:
    """Let a triangle whose neighbours mostly face elsewhere join them."""
    for _ in range(SMOOTHING_ROUNDS):
        votes = np.zeros((len(side), 6))
        np.add.at(votes, (adjacency[:, 0], side[adjacency[:, 1]]), 1.0)
        np.add.at(votes, (adjacency[:, 1], side[adjacency[:, 0]]), 1.0)
        votes[np.arange(len(side)), side] += 0.5
        # Two of three neighbours outvote; one neighbour against one's own half does only where it is the only one.
        side = np.where(votes.max(axis=1) >= 1.5, votes.argmax(axis=1), side)
    return side


def _charts(side: IntArray, adjacency: IntArray) -> IntArray:
    return linked(adjacency[side[adjacency[:, 0]] == side[adjacency[:, 1]]], len(side))


def _joined(chart: IntArray, adjacency: IntArray) -> IntArray:
    """Let charts of a few triangles join the neighbour that they share most edges with; number them from 0."""
    for _ in range(SMOOTHING_ROUNDS):
        sizes = np.bincount(chart)
        pairs = chart[np.concatenate([adjacency, adjacency[:, ::-1]])]
        pairs = pairs[(sizes[pairs[:, 0]] < SMALLEST_CHART_FACES) & (sizes[pairs[:, 1]] > sizes[pairs[:, 0]])]
        unique, edges = np.unique(pairs, axis=0, return_counts=True)
        target = np.arange(len(sizes))
        ascending = np.argsort(edges, kind="stable")
        target[unique[ascending, 0]] = unique[ascending, 1]  # the last written, the most edges, wins
        chart = target[chart]
    return np.unique(chart, return_inverse=True)[1].astype(np.int64)


def _chart_normals(corners: FloatArray, chart: IntArray) -> FloatArray:
    count = int(chart.max()) + 1
    crosses = triangle_crosses(corners)
    sums = np.stack([np.bincount(chart, weights=crosses[:, axis], minlength=count) for axis in range(3)], axis=1)
    return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12), dtype=np.float64)


def _flattened(corners: FloatArray, normals: FloatArray, chart: IntArray) -> tuple[FloatArray, FloatArray]:
    """(face, 3, 2) corners in the plane of each chart from its own corner on [m], rows down; (chart, 2) extents."""
    level = np.abs(normals[:, 2]) > 0.9
    right = np.where(level[:, None], np.cross([0.0, 1.0, 0.0], normals), np.cross([0.0, 0.0, 1.0], normals))
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-12)
    down = np.cross(right, normals)
    flat = np.stack(
        [
            np.einsum("fkc,fc->fk", corners, right[chart]),
            np.einsum("fkc,fc->fk", corners, down[chart]),
        ],
        axis=-1,
    )
    low = np.full((len(normals), 2), np.inf)
    np.minimum.at(low, chart, flat.min(axis=1))
    flat -= low[chart][:, None, :]
    extent = np.zeros((len(normals), 2))
    np.maximum.at(extent, chart, flat.max(axis=1))
    # Lying rectangles pack better: tall ones are turned by a quarter, rows becoming columns.
    tall = extent[:, 1] > extent[:, 0]
    turned = np.stack([extent[chart][:, None, 1] - flat[..., 1], flat[..., 0]], axis=-1)
    flat = np.where(tall[chart][:, None, None], turned, flat)
    return flat, np.where(tall[:, None], extent[:, ::-1], extent)


def _packed(extent: FloatArray, size_px: int) -> tuple[float, FloatArray]:
    """Largest scale at which all rectangles fit, and their upper left corners [px]."""
    small, large = 0.0, size_px / float(extent.max())
    for _ in range(SCALE_STEPS):
        middle = (small + large) / 2
        if _shelves(extent, middle, size_px) is None:
            large = middle
        else:
            small = middle
    corner = _shelves(extent, small, size_px)
    if corner is None or small == 0.0:
        raise ScanError(
            expected="a texture that holds all charts", found=f"{len(extent)} charts for {size_px} px",
            where="texture atlas", todo="Choose a larger texture.",
        )  # fmt: skip
    return small, corner


def _shelves(extent: FloatArray, scale: float, size_px: int) -> FloatArray | None:
    """Corners of the rectangles, highest first on shelves from the top; None where they do not fit."""
    sizes = np.ceil(extent * scale) + 1 + 2 * PADDING_PX
    corner = np.zeros_like(extent)
    x = y = shelf = 0.0
    for number in np.argsort(-sizes[:, 1], kind="stable"):
        width, height = sizes[number]
        if x + width > size_px:
            x, y, shelf = 0.0, y + shelf, 0.0
        if width > size_px or y + height > size_px:
            return None
        corner[number] = x, y
        x, shelf = x + width, max(shelf, height)
    return corner


def _drawn(corner_px: FloatArray, size_px: int) -> SmallIntArray:
    """(size_px, size_px) triangle at each pixel, -1 between charts."""
    canvas = np.full((size_px, size_px), -1, dtype=np.int32)
    fixed = np.rint(corner_px * 2**SUBPIXEL_BITS).astype(np.int32)
    for face, corners in enumerate(fixed):
        cv2.fillConvexPoly(canvas, corners, float(face), lineType=cv2.LINE_8, shift=SUBPIXEL_BITS)
    return canvas
