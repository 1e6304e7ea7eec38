"""The surface where a sampled field changes its sign."""

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray


def zero_surface(depth: FloatArray) -> tuple[FloatArray, IntArray]:
    """Surface of a sampled field where it changes its sign, by naive surface nets.

    Each cell of eight samples that has both signs gets one vertex, the mean of the crossings on its edges; each edge
    of the grid with both signs joins the four cells around it.

    Parameters
    ----------
    depth : (x, y, z) float
        Positive on the side that the surface faces; its border must be negative.

    Returns
    -------
    vertices : (vertex, 3) float
        In units of the grid, the first sample at (0, 0, 0).
    faces : (face, 3) int
        Counter-clockwise seen from the positive side.

    References
    ----------
    Gibson, "Constrained elastic surface nets", MICCAI 1998.
    """
    positive = depth > 0
    cells = np.array(depth.shape) - 1
    total = np.zeros((*cells, 3))
    crossings = np.zeros(tuple(cells))
    edges: list[tuple[int, IntArray]] = []
    for axis in range(3):
        ahead, behind = _shifted(axis, 1), _shifted(axis, 0)
        crossing = np.argwhere(positive[ahead] != positive[behind])
        step = np.eye(3, dtype=np.int64)[axis]
        first, second = depth[tuple(crossing.T)], depth[tuple((crossing + step).T)]
        point = crossing + step * (first / (first - second))[:, None]
        # The edge belongs to the four cells around it: one step back along either other axis.
        for back in np.ndindex(2, 2):
            cell = crossing - np.insert(np.array(back), axis, 0)
            np.add.at(total, tuple(cell.T), point)
            np.add.at(crossings, tuple(cell.T), 1.0)
        edges.append((axis, crossing))
    used = crossings > 0
    number = np.full(used.shape, -1, dtype=np.int64)
    number[used] = np.arange(used.sum())
    faces = np.concatenate([_quads(axis, crossing, positive, number) for axis, crossing in edges])
    return total[used] / crossings[used][:, None], faces


def _shifted(axis: int, start: int) -> tuple[slice, slice, slice]:
    index = [slice(None)] * 3
    index[axis] = slice(start, None) if start else slice(None, -1)
    return index[0], index[1], index[2]


def _quads(axis: int, crossing: IntArray, positive: BoolArray, number: IntArray) -> IntArray:
    """Two triangles for each crossed edge of the grid, over the four cells around it."""
    one, other = np.roll(np.eye(3, dtype=np.int64), -axis - 1, axis=0)[:2]
    around = [crossing - one - other, crossing - other, crossing, crossing - one]
    a, b, c, d = (number[tuple(cell.T)] for cell in around)
    # Counter-clockwise about +axis, right where the positive side lies ahead; turned where it lies behind.
    ahead = ~positive[tuple(crossing.T)]
    b, d = np.where(ahead, b, d), np.where(ahead, d, b)
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
