"""What a block's components have found, as the coefficients of every lamp and their standard errors."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.sampling.estimator import BATCHES, Component
from lidarspectra.radiance.sampling.folding import fold_coefficients, folding
from lidarspectra.radiance.sampling.running_means import Batches, Moments
from lidarspectra.radiance.sampling.uncertainty import independent_points, standard_error, widened_error
from lidarspectra.radiance.scene.scene import RadianceScene


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundLight:
    """Coefficients of a block of points.

    Parameters
    ----------
    slot_coefficient : (lamp, point, slot) float
        Of the slots that were traced. [m⁻²]
    coefficient, coefficient_se : (lamp, point, band) float
        Of the channels, and its standard error. [m⁻²]
    batches : (batch, lamp, point, band) float or None
        Independent estimates of it, where they were kept. [m⁻²]
    """

    slot_coefficient: NDArray[np.float32] = field(repr=False)
    coefficient: NDArray[np.float32] = field(repr=False)
    coefficient_se: NDArray[np.float32] = field(repr=False)
    batches: NDArray[np.float32] | None = field(repr=False, default=None)


def found_light(scene: RadianceScene, components: Sequence[Component], direct: FloatArray | None) -> FoundLight:
    """Add up what the components of a block have found, and what is known beforehand.

    Parameters
    ----------
    scene : RadianceScene
    components : sequence of Component
    direct : (lamp, point) float or None
        Coefficient of light that was not traced. [m⁻²]
    """
    if all(isinstance(component.means, Batches) for component in components):
        return _from_batches(scene, components, direct)
    return _from_moments(scene, components, direct)


def _from_batches(scene: RadianceScene, components: Sequence[Component], direct: FloatArray | None) -> FoundLight:
    values: NDArray[np.float32] | None = None
    for component in components:
        assert isinstance(component.means, Batches)
        mean, written = component.means.mean, component.means.weights.written
        if values is None:
            values = np.zeros((BATCHES, len(scene.lamp_names), mean.shape[2], len(scene.slots)), dtype=np.float32)
        for row, lamp in enumerate(component.lamps):
            values[:, lamp][..., component.slots] += mean[:, row] / written[row]
    assert values is not None  # a scene has a pass
    if direct is not None:
        values += direct[None, :, :, None].astype(np.float32)
    found = fold_coefficients(values, folding(scene))
    error = np.empty(found.shape[1:], dtype=np.float32)
    for lamp in range(len(error)):
        error[lamp] = standard_error(found[:, lamp].astype(np.float64))
    return FoundLight(
        slot_coefficient=values.mean(axis=0, dtype=np.float64).astype(np.float32),
        coefficient=found.mean(axis=0, dtype=np.float64).astype(np.float32),
        coefficient_se=error,
        batches=found,
    )


def _from_moments(scene: RadianceScene, components: Sequence[Component], direct: FloatArray | None) -> FoundLight:
    values: NDArray[np.float32] | None = None
    for component in components:
        assert isinstance(component.means, Moments)
        mean = component.means.mean
        if values is None:
            values = np.zeros((len(scene.lamp_names), mean.shape[1], len(scene.slots)), dtype=np.float32)
        for row, lamp in enumerate(component.lamps):
            values[lamp][:, component.slots] += mean[row]
    assert values is not None  # a scene has a pass
    if direct is not None:
        values += direct[:, :, None].astype(np.float32)
    coefficient = fold_coefficients(values, folding(scene))
    error = np.empty_like(coefficient)
    for lamps in {component.lamps for component in components}:
        alike = [component for component in components if component.lamps == lamps]
        together = np.sum([component.means.light() for component in alike], axis=0)
        independent = [independent_points(together[:, :, band]) for band in range(together.shape[2])]
        for row, lamp in enumerate(lamps):
            variances = np.zeros(error.shape[1:])
            for component in alike:
                variances += BATCHES * _variance(component)[row]
            levels = coefficient[lamp].astype(np.float64)
            error[lamp] = widened_error(variances, levels, independent, count=BATCHES)
    return FoundLight(slot_coefficient=values, coefficient=coefficient, coefficient_se=error)


def _variance(component: Component) -> NDArray[np.float32]:
    """(lamp, point, band) of its mean over the batches [m⁻⁴]."""
    assert isinstance(component.means, Moments)
    return component.means.variance
