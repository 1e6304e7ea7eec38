"""What the network must beat: histograms of colour and of local texture, told apart by a random forest."""

import cv2
import numpy as np
from sklearn.ensemble import RandomForestClassifier

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from research.training.pictures import CLASSES

LIGHTNESS_BINS, COLOR_BINS, GRADIENT_BINS = 8, 8, 8
TREES = 300


def histogram_features(image: ByteArray) -> FloatArray:
    """Histograms of L*, a*, b*, of local binary patterns at three scales, and of gradients, each summing to 1.

    Parameters
    ----------
    image : (height, width, 3) uint8

    Returns
    -------
    features : (feature,) float
    """
    lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), dtype=np.float64).reshape(-1, 3)
    parts = [_histogram(lab[:, 0], LIGHTNESS_BINS, 0, 256)]
    parts += [_histogram(lab[:, channel], 2 * COLOR_BINS, 64, 192) for channel in (1, 2)]
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    for _ in range(3):
        parts.append(_binary_patterns(grey))
        across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)
        parts.append(_histogram(np.log1p(np.hypot(across, down)), GRADIENT_BINS, 0, 7))
        grey = np.asarray(cv2.pyrDown(grey), dtype=np.uint8)
    return np.concatenate(parts)


def fit_baseline(images: list[ByteArray], labels: IntArray, seed: int) -> RandomForestClassifier:
    """Forest on the features of pictures."""
    features = np.stack([histogram_features(image) for image in images])
    forest = RandomForestClassifier(TREES, class_weight="balanced", random_state=seed, n_jobs=1)
    return forest.fit(features, labels)


def baseline_probabilities(forest: RandomForestClassifier, images: list[ByteArray]) -> FloatArray:
    """(picture, class) what the forest says of pictures."""
    found = np.zeros((len(images), len(CLASSES)))
    found[:, forest.classes_] = forest.predict_proba(np.stack([histogram_features(image) for image in images]))
    return found


def _histogram(values: FloatArray, bins: int, low: float, high: float) -> FloatArray:
    counts, _ = np.histogram(np.clip(values, low, high - 1e-6), bins=bins, range=(low, high))
    return np.asarray(counts / max(1, counts.sum()), dtype=np.float64)


def _binary_patterns(grey: ByteArray) -> FloatArray:
    """Histogram of rotation-invariant uniform patterns of the eight neighbours (Ojala et al. 2002)."""
    value = grey.astype(np.int16)
    middle = value[1:-1, 1:-1]
    ring = ((0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0))
    height, width = middle.shape
    above = np.stack([value[y : y + height, x : x + width] > middle for y, x in ring])
    changes = (above != np.roll(above, 1, axis=0)).sum(axis=0)
    code = np.where(changes <= 2, above.sum(axis=0), 9)
    return _histogram(code.ravel().astype(np.float64), 10, 0, 10)
