"""Classifiers of places from features: a neural network, nearest neighbours, and ridge regression.

A fourth, the linear discriminant, has a module of its own (`discriminant`). The default, together, is the mean of
network (which counts twice), neighbours and ridge, whose errors differ: on one night or another each is the worst. Each
gives a score for every place that sum to 1, and the position is the geometric median of the places with these weights
(`places`).

The network (one hidden layer, ReLU, softmax) takes the place of that of Iris, which is not published. It is trained by
scikit-learn and stored as an ONNX graph, which onnxruntime runs here and on devices.
"""

import warnings
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.io.onnx_errors import onnx_errors

Method = Literal["together", "network", "discriminant", "neighbours", "ridge"]
METHODS: tuple[Method, ...] = ("together", "network", "discriminant", "neighbours", "ridge")
NEIGHBOURS = 5  # nearest fingerprints that vote
RIDGE_ALPHAS = np.logspace(-1, 6, 15)  # [1] tried by leave-one-out
READINGS_PER_STEP = 200  # of the network's training
# [1] of network, neighbours and ridge: best by the logarithmic score on virtual nights
TOGETHER_WEIGHTS = (2.0, 1.0, 1.0)
CONFIDENCE_POWER = 1.3  # [1] of the mean scores: then they are as often right as they say there
TINY = 1e-12  # [1] squared distance, in units of noise
READINGS_AT_ONCE = 256  # bounds the memory of distances


class Locator(Protocol):
    """A classifier of places from features."""

    def scores(self, features: FloatArray) -> FloatArray:
        """(reading, place) scores of (reading, feature) features, NaN where one is missing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NearestFingerprints:
    """The places of the nearest fingerprints, weighted by 1/d².

    Distances are root mean squares over the features that both have, so that a missing sensor has no influence.

    Parameters
    ----------
    features : (fingerprint, feature) float
        NaN where missing.
    place : (fingerprint,) int
    place_count : int
    neighbours : int
        How many vote; fewer where there are fewer.
    """

    features: FloatArray
    place: IntArray
    place_count: int
    neighbours: int = NEIGHBOURS

    def scores(self, features: FloatArray) -> FloatArray:
        """(reading, place) scores."""
        if not features.shape[0]:
            return np.zeros((0, self.place_count))
        parts = np.array_split(features, max(1, -(-len(features) // READINGS_AT_ONCE)))
        return np.vstack([self._votes(self._squared(part)) for part in parts])

    def _squared(self, features: FloatArray) -> FloatArray:
        """(reading, fingerprint) mean squared difference over the features that both have."""
        own, given = np.nan_to_num(self.features), np.nan_to_num(features)
        has, gives = np.isfinite(self.features).astype(np.float64), np.isfinite(features).astype(np.float64)
        total = (given**2) @ has.T - 2.0 * given @ own.T + gives @ (own**2).T
        shared = gives @ has.T
        return np.asarray(
            np.where(shared > 0, np.maximum(total, 0.0) / np.maximum(shared, 1.0), np.inf), dtype=np.float64
        )

    def _votes(self, squared: FloatArray) -> FloatArray:
        count = min(self.neighbours, squared.shape[1])
        nearest = np.argpartition(squared, count - 1, axis=1)[:, :count]
        distance = np.take_along_axis(squared, nearest, axis=1)
        distance = np.where(
            np.isfinite(distance.min(axis=1, keepdims=True)), distance, 1.0
        )  # no reading: all places alike
        # Relative to the nearest, so that an exact fit does not divide by zero.
        weight = (distance.min(axis=1, keepdims=True) + TINY) / (distance + TINY)
        votes = np.zeros((len(squared), self.place_count))
        np.add.at(votes, (np.arange(len(squared))[:, None], self.place[nearest]), weight)
        return np.asarray(votes / votes.sum(axis=1, keepdims=True), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class RidgePlaces:
    """Scores that are linear in the features, s = W z + b.

    Parameters
    ----------
    weights : (feature, place) float
    offset : (place,) float
    """

    weights: FloatArray
    offset: FloatArray

    def scores(self, features: FloatArray) -> FloatArray:
        """(reading, place) scores; a missing feature counts as no change."""
        return np.asarray(np.nan_to_num(features) @ self.weights + self.offset, dtype=np.float64)


def fit_ridge(features: FloatArray, place: IntArray, place_count: int) -> RidgePlaces:
    """Ridge regression on one-hot places; its penalty is chosen by leave-one-out.

    Parameters
    ----------
    features : (reading, feature) float
        NaN where missing.
    place : (reading,) int
    place_count : int
    """
    from sklearn.linear_model import RidgeCV

    fitted = RidgeCV(alphas=RIDGE_ALPHAS).fit(np.nan_to_num(features), np.eye(place_count)[place])
    return RidgePlaces(weights=fitted.coef_.T.astype(np.float64), offset=fitted.intercept_.astype(np.float64))


@dataclass(frozen=True, kw_only=True, eq=False)
class TogetherPlaces:
    """The mean of several locators' scores, negative ones counted as 0, to a power that makes them probabilities.

    Parameters
    ----------
    locators : tuple of Locator
    weights : tuple of float
        Of each in the mean. [1]
    power : float
        [1]
    """

    locators: tuple[Locator, ...]
    weights: tuple[float, ...] = TOGETHER_WEIGHTS
    power: float = CONFIDENCE_POWER

    def scores(self, features: FloatArray) -> FloatArray:
        """(reading, place) probabilities."""
        parts = [np.maximum(locator.scores(features), 0.0) for locator in self.locators]
        even = (part / np.maximum(part.sum(axis=1, keepdims=True), TINY) for part in parts)
        mean = sum((weight * part for weight, part in zip(self.weights, even, strict=True)), np.zeros(1))
        sharp = (mean / sum(self.weights)) ** self.power
        return np.asarray(sharp / np.maximum(sharp.sum(axis=1, keepdims=True), TINY), dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class NetworkSettings:
    """How the network is made.

    Parameters
    ----------
    hidden : int
        Neurons of the hidden layer.
    updates : int
        Steps of the training, each on 200 readings or all; a fixed number, so that small tables are trained as long.
    penalty : float
        On the weights' squares (L2). [1]
    seed : int
    """

    hidden: int = 128
    updates: int = 1000
    penalty: float = 1e-3
    seed: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkWeights:
    """A network with one hidden layer: softmax(relu((z - mean) scale W1 + b1) W2 + b2).

    Parameters
    ----------
    mean : (feature,) float
    scale : float
        One for all features, which are in units of noise already.
    hidden_weights : (feature, hidden) float
    hidden_offset : (hidden,) float
    place_weights : (hidden, place) float
    place_offset : (place,) float
    """

    mean: FloatArray
    scale: float
    hidden_weights: FloatArray
    hidden_offset: FloatArray
    place_weights: FloatArray
    place_offset: FloatArray


def fit_network(features: FloatArray, place: IntArray, place_count: int, settings: NetworkSettings) -> NetworkWeights:
    """Train the network.

    Parameters
    ----------
    features : (reading, feature) float
        NaN where missing, which counts as no change.
    place : (reading,) int
        Each place must come.
    place_count : int
    settings : NetworkSettings

    Raises
    ------
    MapError
        If a place has no reading.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier
    from threadpoolctl import threadpool_limits

    if np.unique(place).size != place_count or place_count < 2:
        raise MapError(
            expected=f"readings of all {place_count} places, two or more",
            found=f"of {np.unique(place).size}",
            where="training",
        )
    given = np.nan_to_num(features)
    mean = given.mean(axis=0)
    scale = 1.0 / max(float(given.std()), 1e-12)
    scaled = ((given - mean) * scale).astype(np.float32)  # features are known to a few digits
    batches = -(-len(given) // READINGS_PER_STEP)
    network = MLPClassifier(
        (settings.hidden,),
        alpha=settings.penalty,
        batch_size=min(READINGS_PER_STEP, len(given)),
        max_iter=-(-settings.updates // batches),
        n_iter_no_change=settings.updates,  # no early stopping
        random_state=settings.seed,
    )
    with warnings.catch_warnings(), threadpool_limits(1):  # threads wait for one another over matrices of this size
        warnings.simplefilter("ignore", ConvergenceWarning)  # the number of steps is fixed
        network.fit(scaled, place)
    coefficients = [np.asarray(values, dtype=np.float64) for values in network.coefs_]
    offsets = [np.asarray(values, dtype=np.float64) for values in network.intercepts_]
    output_weights, output_offset = coefficients[1], offsets[1]
    if place_count == 2:  # scikit-learn has one logistic output then; a softmax over (0, x) is the same
        output_weights = np.hstack([np.zeros_like(output_weights), output_weights])
        output_offset = np.concatenate([np.zeros(1), output_offset])
    return NetworkWeights(
        mean=mean,
        scale=scale,
        hidden_weights=coefficients[0],
        hidden_offset=offsets[0],
        place_weights=output_weights,
        place_offset=output_offset,
    )


class NetworkPlaces:
    """A trained network as ONNX, loaded.

    Parameters
    ----------
    model : bytes
        The ONNX graph; see `network_graph`.
    where : str
        File, for errors.

    Raises
    ------
    MapError
        If it is no ONNX model, or none with an input of features.
    """

    def __init__(self, model: bytes, *, where: str) -> None:
        import onnxruntime

        self.model = model
        self.where = where
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1  # a matrix of this size gains nothing by more
        options.log_severity_level = 4
        try:
            self._session: Any = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        except onnx_errors() as cause:
            raise MapError(expected="a network in ONNX", found=str(cause)[:200], where=where) from cause
        inputs = self._session.get_inputs()
        if len(inputs) != 1 or len(inputs[0].shape) != 2:
            raise MapError(expected="one input (reading, feature)", found=f"{[i.shape for i in inputs]}", where=where)
        self._input = inputs[0]

    @property
    def feature_count(self) -> int | None:
        """Number of input features, if the graph states it."""
        length = self._input.shape[1]
        return length if isinstance(length, int) else None

    def scores(self, features: FloatArray) -> FloatArray:
        """(reading, place) probabilities; a missing feature counts as no change."""
        given = np.nan_to_num(features).astype(np.float32)
        try:
            answer = np.asarray(self._session.run(None, {self._input.name: given})[0], dtype=np.float64)
        except onnx_errors() as cause:
            raise MapError(
                expected=f"a network for {features.shape[1]} features", found=str(cause)[:200], where=self.where
            ) from cause
        if answer.ndim != 2 or len(answer) != len(given) or not np.isfinite(answer).all():
            raise MapError(
                expected="a finite probability of each place", found=f"shape {answer.shape}", where=self.where
            )
        return answer
