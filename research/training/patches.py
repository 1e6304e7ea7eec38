"""Patterns that surfaces are made of, learned from patches of pictures without their classes.

Patches of 5 x 5 pixels in opponent colours lose their mean and their contrast and are whitened; K-means by angle, a
pattern and its negative being one, finds what they have in common.

References
----------
Coates, Ng (2012) Learning feature representations with K-means, Neural Networks: Tricks of the Trade, Section 2.
"""

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray
from research.training.model_input import model_input
from research.training.surface_statistics import OPPONENT

RESOLUTIONS = 3  # each half the one before
PATTERNS = 48  # of each resolution
SIZE_PX = 5  # [px]
PATCHES = 10  # of each picture
ROUNDS = 15  # of K-means; patterns change little after 10
MIN_CONTRAST = 0.05  # [1] added to a patch's deviation: what is flatter than that is noise
MIN_VARIANCE = 0.05  # [1] added to variances before whitening, against patterns of noise
FEWEST = 4  # patches of a pattern; others start anew


def learn_patterns(pictures: ByteArray, generator: np.random.Generator) -> FloatArray:
    """Learn patterns of pictures at several resolutions.

    Parameters
    ----------
    pictures : (picture, height, width, 3) uint8
        Sides multiples of 4.
    generator : numpy.random.Generator

    Returns
    -------
    patterns : (resolution, pattern, 3, size, size) float
        Filters without mean, whose absolute responses are 1 in the mean over the patches.
    """
    level = np.einsum("oc,nchw->nohw", OPPONENT, model_input(pictures))
    learned = []
    for number in range(RESOLUTIONS):
        if number:
            count, _, height, width = level.shape
            level = level.reshape(count, 3, height // 2, 2, width // 2, 2).mean(axis=(3, 5))
        learned.append(_patterns(_patches(level, generator), generator))
    return np.stack(learned)


def _patches(level: FloatArray, generator: np.random.Generator) -> FloatArray:
    """(patch, 3 size²) patches without their mean colour."""
    rows = generator.integers(0, level.shape[2] - SIZE_PX + 1, (len(level), PATCHES))
    columns = generator.integers(0, level.shape[3] - SIZE_PX + 1, (len(level), PATCHES))
    found = [
        level[n, :, row : row + SIZE_PX, column : column + SIZE_PX]
        for n in range(len(level))
        for row, column in zip(rows[n], columns[n], strict=True)
    ]
    patches = np.stack(found)
    return np.asarray((patches - patches.mean(axis=(2, 3), keepdims=True)).reshape(len(patches), -1), dtype=np.float64)


def _patterns(patches: FloatArray, generator: np.random.Generator) -> FloatArray:
    """(pattern, 3, size, size) filters of one resolution."""
    even = patches / (patches.std(axis=1, keepdims=True) + MIN_CONTRAST)
    variance, directions = np.linalg.eigh(np.cov(even.T))
    whitening = directions / np.sqrt(np.maximum(variance, 0.0) + MIN_VARIANCE) @ directions.T
    units = _unit((even - even.mean(axis=0)) @ whitening)
    center = units[generator.choice(len(units), PATTERNS, replace=False)]
    for _ in range(ROUNDS):
        cosine = units @ center.T
        nearest = np.abs(cosine).argmax(axis=1)
        sign = np.sign(cosine[np.arange(len(units)), nearest])
        for number in range(PATTERNS):
            member = nearest == number
            lone = np.count_nonzero(member) < FEWEST
            total = units[generator.integers(len(units))] if lone else sign[member] @ units[member]
            center[number] = total
        center = _unit(center)
    filters = (center @ whitening).reshape(PATTERNS, 3, SIZE_PX, SIZE_PX)
    filters = (filters - filters.mean(axis=(2, 3), keepdims=True)).reshape(PATTERNS, -1)
    filters /= np.abs(patches @ filters.T).mean(axis=0)[:, None]
    return np.asarray(filters.reshape(PATTERNS, 3, SIZE_PX, SIZE_PX), dtype=np.float64)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9), dtype=np.float64)
