"""A fully connected conditional random field over an image: labels follow the picture's edges (paper, Section 2.3.1).

Each pixel i has a class x_i. With p_i, I_i its place and colour, the energy of a labelling is

    E(x) = sum_i -log P(x_i)  +  sum_i<j [x_i != x_j] (w1 k1(i, j) + w2 k2(i, j)),
    k1 = exp(-|p_i - p_j|² / 2 a² - |I_i - I_j|² / 2 b²)    (appearance),
    k2 = exp(-|p_i - p_j|² / 2 c²)                          (smoothness),

and mean field iterates Q_i(l) ~ P_i(l) exp(w1 m1_i(l) + w2 m2_i(l)) until it settles, where m is the kernel-weighted
mean of Q. A mean, not a sum: the weights then do not depend on the image's size.

k2 is a Gaussian blur. k1 is one in five dimensions, place and colour: pixels are gathered in the cells of a lattice
there, cells that pixels lie in are blurred with their neighbours by 1/4 1/2 1/4 along one dimension after the other,
and pixels read their cells (a bilateral grid). Gathering, blur and reading together spread by
sqrt(1/2 + 1/6) cells, from which the cells' size follows; the mean of some shifted lattices is smoother than one.
(OpenCV's adaptive manifolds do the same job, but start from random numbers and give NaN for plain pictures.)

References
----------
Krähenbühl, Koltun (2011) Efficient inference in fully connected CRFs with Gaussian edge potentials, NIPS 24, Eq. 1 to 3
and Algorithm 1. Barron, Poole (2016) The fast bilateral solver, ECCV, Section 2.1 (sparse bilateral grids).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import ArrayError

_SmallFloats = NDArray[np.float32]  # enough for probabilities
MIN_PROBABILITY = 1e-4  # [1] of a class, lower limit for the network's probabilities
CELL_OVER_SIGMA = (1.0 / 2.0 + 1.0 / 6.0) ** -0.5  # [1] size of a lattice's cells over the kernel's sigma
LATTICES = 4  # shifted against one another


@dataclass(frozen=True, kw_only=True)
class CrfSettings:
    """Kernels and weights.

    Parameters
    ----------
    appearance_weight, smoothness_weight : float
        w1 and w2. [1]
    appearance_px : float
        a. [pixel]
    appearance_color : float
        b, of sRGB-encoded colours. [1]
    smoothness_px : float
        c. [pixel]
    rounds : int
        Mean-field updates.
    """

    appearance_weight: float = 3.0
    smoothness_weight: float = 1.0
    appearance_px: float = 12.0
    appearance_color: float = 0.08
    smoothness_px: float = 1.5
    rounds: int = 8


def refine(probabilities: FloatArray, image: ByteArray, settings: CrfSettings | None = None) -> FloatArray:
    """Mean-field probabilities of the classes, given each pixel's own and the picture.

    Parameters
    ----------
    probabilities : (height, width, class) float
        Of each pixel by itself. [0-1]
    image : (height, width, 3) uint8
        sRGB encoded.
    settings : CrfSettings, optional

    Returns
    -------
    refined : (height, width, class) float
        Summing to 1 over the classes.

    Raises
    ------
    ArrayError
        If image and probabilities differ in size, or are not finite.
    """
    chosen = settings or CrfSettings()
    if probabilities.ndim != 3 or image.shape != (*probabilities.shape[:2], 3) or not np.isfinite(probabilities).all():
        raise ArrayError(
            expected="finite probabilities (height, width, class) and an image of that height and width",
            found=f"shapes {probabilities.shape} and {image.shape}",
            where="crf.refine",
        )
    own = np.log(np.maximum(probabilities, MIN_PROBABILITY)).astype(np.float32)
    belief = _normalized(np.exp(own))
    lattices = _lattices(image, chosen)
    near = _sum_over(lattices, np.ones((belief[..., 0].size, 1), dtype=np.float32))
    highest = np.float32(chosen.smoothness_weight + chosen.appearance_weight)
    for _ in range(chosen.rounds):
        alike = _sum_over(lattices, belief.reshape(-1, belief.shape[2])) / near
        score = own + chosen.smoothness_weight * _blur(belief, chosen.smoothness_px)
        score += chosen.appearance_weight * alike.reshape(belief.shape)
        score -= highest  # which none is above, so that no exponential is
        belief = _normalized(np.exp(score, out=score))
    refined = belief.astype(np.float64)
    return np.asarray(refined / refined.sum(axis=-1, keepdims=True), dtype=np.float64)


def _normalized(weights: _SmallFloats) -> _SmallFloats:
    """Probabilities of (height, width, class) weights, written in their place."""
    weights /= (weights @ np.ones(weights.shape[-1], dtype=np.float32))[..., None]  # many times as fast as `sum`
    return weights


def _blur(belief: _SmallFloats, sigma_px: float) -> _SmallFloats:
    blurred = cv2.GaussianBlur(belief, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred, dtype=np.float32).reshape(belief.shape)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lattice:
    """Cells that pixels lie in: (pixel,) numbers of them, (cell, pixel) gathering, and (cell, cell) blurs in turn."""

    number: IntArray
    gather: csr_array
    blurs: tuple[csr_array, ...]

    def sums(self, values: _SmallFloats) -> _SmallFloats:
        """(pixel, value) sums of (pixel, value) numbers over what lies near in place and colour."""
        cells = self.gather @ values
        for blur in self.blurs:
            cells = blur @ cells
        return np.asarray(cells[self.number], dtype=np.float32)


def _lattices(image: ByteArray, settings: CrfSettings) -> list[_Lattice]:
    y, x = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    place = np.stack([x.ravel(), y.ravel()], axis=1) / (CELL_OVER_SIGMA * settings.appearance_px)
    color = image.reshape(-1, 3) / (255.0 * CELL_OVER_SIGMA * settings.appearance_color)
    coordinates = np.hstack([place, color])
    return [_lattice(np.floor(coordinates + number / LATTICES).astype(np.int64)) for number in range(LATTICES)]


def _sum_over(lattices: list[_Lattice], values: _SmallFloats) -> _SmallFloats:
    """(pixel, value) sums over all lattices."""
    total = np.zeros_like(values)
    for each in lattices:
        total += each.sums(values)
    return total


def _lattice(cells: IntArray) -> _Lattice:
    """Lattice of the (pixel, 5) whole-numbered cells that pixels lie in."""
    low = cells.min(axis=0) - 1
    extent = cells.max(axis=0) - low + 2  # a cell more at either end, so that no step leaves its row
    step = np.concatenate([[1], np.cumprod(extent)[:-1]])
    keys, number = np.unique((cells - low) @ step, return_inverse=True)
    count, pixels = len(keys), len(cells)
    number = number.reshape(-1)
    gather = csr_array((np.ones(pixels, dtype=np.float32), (number, np.arange(pixels))), shape=(count, pixels))
    return _Lattice(number=number, gather=gather, blurs=tuple(_blur_along(keys, int(stride)) for stride in step))


def _blur_along(keys: IntArray, stride: int) -> csr_array:
    """(cell, cell) blur by 1/4 1/2 1/4 of cells with ascending keys with those whose key is a stride away."""
    count = len(keys)
    found = np.minimum(np.searchsorted(keys, keys + stride), count - 1)
    lower = np.flatnonzero(keys[found] == keys + stride)
    upper, own = found[lower], np.arange(count)
    weights = np.repeat(np.array([0.5, 0.25, 0.25], dtype=np.float32), (count, lower.size, lower.size))
    rows, columns = np.concatenate([own, lower, upper]), np.concatenate([own, upper, lower])
    return csr_array((weights, (rows, columns)), shape=(count, count))
