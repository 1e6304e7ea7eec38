"""Linear discriminant analysis: the most probable place if fingerprints are normal with one covariance for all places.

    p(place k | z) ∝ exp(m_k' C⁻¹ z - m_k' C⁻¹ m_k / 2)

with the features z and the mean m_k of the n fingerprints of place k. It differs from the textbook in C: a few people
per place are far too few to estimate it in hundreds of dimensions, but most of it is known in advance:

    C = (1 + 1/n) P + N + d² D + T

    P   differences between people at one place: the scatter of fingerprints about their place's mean, with Ledoit-Wolf
        shrinkage; the mean itself has 1/n of it again
    N   noise of a reading: rounding to whole counts and repeatability, independent for each channel
    D   drift of the dies since the reference: common to all channels of one die of one sensor, standard deviation d
    T   Monte Carlo noise of the simulation: common to a sensor's channels, which share their paths

N, D and T are independent from sensor to sensor; where a feature is a sensor's they lie on the diagonal. The scatter of
real readings contains N already, so that it is added to traced fingerprints only.

References
----------
Fisher (1936) The use of multiple measurements in taxonomic problems, Annals of Eugenics 7, 179-188.
Ledoit, Wolf (2004) A well-conditioned estimator for large-dimensional covariance matrices, J. Multivariate Analysis
88, 365-411.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.linalg import cho_factor, cho_solve
from scipy.special import softmax

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import DIE_INDEX, SensorSettings, count_uncertainty
from lidarspectra.mapping.localization.features import FeatureSpace, reference_counts, reference_of
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM

BAND_TOLERANCE_NM = 1.0  # [nm] within which a band counts as a channel of the AS7265x


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscriminantPlaces:
    """Probabilities whose logarithms are linear in the features, softmax(z W + b).

    Parameters
    ----------
    weights : (feature, place) float
    offset : (place,) float
    """

    weights: FloatArray
    offset: FloatArray

    def scores(self, features: FloatArray) -> FloatArray:
        """(reading, place) probabilities; a missing feature counts as no change."""
        return np.asarray(softmax(np.nan_to_num(features) @ self.weights + self.offset, axis=1), dtype=np.float64)


def fit_discriminant(
    features: FloatArray, place: IntArray, place_count: int, blur: FloatArray, *, mismatch: float
) -> DiscriminantPlaces:
    """Fit the discriminant.

    Parameters
    ----------
    features : (fingerprint, feature) float
        As they are, with no noise drawn; NaN where missing, which counts as no change.
    place : (fingerprint,) int
        Each place must come.
    place_count : int
    blur : (feature, feature) float
        N + d² D + T; see `sensor_blur`.
    mismatch : float
        Relative standard deviation between people of the change that they make, for tables with a single fingerprint
        per place, from which it cannot be estimated. [1]

    Raises
    ------
    MapError
        If a place has no fingerprint.
    """
    counts = np.bincount(place, minlength=place_count)
    if place_count < 2 or counts.min() < 1:
        raise MapError(
            expected=f"fingerprints of all {place_count} places, two or more",
            found=f"of {int((counts > 0).sum())}",
            where="training",
        )
    given = np.nan_to_num(features)
    mean = np.zeros((place_count, given.shape[1]))
    np.add.at(mean, place, given)
    mean /= counts[:, None]
    people = _scatter(given - mean[place], place_count)
    if people is None:
        people = np.diag(mismatch**2 * (mean**2).mean(axis=0))
    covariance = (1.0 + place_count / len(given)) * people + float_array(blur, name="blur", shape=people.shape)
    weights = np.asarray(cho_solve(cho_factor(covariance), mean.T), dtype=np.float64)
    return DiscriminantPlaces(weights=weights, offset=-0.5 * (mean * weights.T).sum(axis=1))


def sensor_blur(space: FeatureSpace, table: xr.Dataset, device: SensorSettings | None, *, drift: float) -> FloatArray:
    """N + d² D + T: covariance of the features due to the sensors and the simulation.

    Parameters
    ----------
    space : FeatureSpace
    table : xarray.Dataset
        Fingerprints, of the space's sensors and bands.
    device : SensorSettings, optional
        Gain and time of the sensors, where the table holds irradiances; see `features.device_settings`.
    drift : float
        d, of a die since its reference. [1]

    Returns
    -------
    blur : (feature, feature) float
        For small changes, where a feature is the change in units of its noise. [1]
    """
    sensor, band = np.nonzero(space.usable)
    die = sensor * (DIE_INDEX.max() + 1) + _dies(space.bands_nm)[band]
    channels = np.where(die[:, None] == die[None, :], drift**2, 0.0)
    if quantity_of(table) == "irradiance":
        counts = np.maximum(reference_counts(table, device), 1.0)
        channels[np.diag_indices_from(channels)] += (count_uncertainty(counts) / counts)[space.usable] ** 2
    if "effect_se" in table:
        effect_se = np.sqrt((table["effect_se"].to_numpy() ** 2).mean(axis=0))[space.usable]
        traced = effect_se / reference_of(table)[space.usable]
        channels += np.where(sensor[:, None] == sensor[None, :], np.outer(traced, traced), 0.0)
    per_noise = space.averaging / space.feature_noise[:, None]
    # A thousandth of the features' unit keeps the matrix regular where all fingerprints of counts are equal.
    return np.asarray(per_noise @ channels @ per_noise.T + 1e-6 * np.eye(space.count), dtype=np.float64)


def _scatter(deviations: FloatArray, place_count: int) -> FloatArray | None:
    """(feature, feature) shrunk covariance of (fingerprint, feature) deviations; None if there are too few."""
    from sklearn.covariance import ledoit_wolf

    freedom = len(deviations) - place_count
    if freedom < 1:
        return None
    covariance, _ = ledoit_wolf(deviations * np.sqrt(len(deviations) / freedom), assume_centered=True)
    return np.asarray(covariance, dtype=np.float64)


def _dies(bands_nm: FloatArray) -> IntArray:
    """(band,) die that holds each channel of the AS7265x; 0 for all where the bands are others."""
    centers = np.array(AS7265X_CENTERS_NM)
    nearest = np.abs(centers[None, :] - bands_nm[:, None]).argmin(axis=1)
    if np.abs(centers[nearest] - bands_nm).max() > BAND_TOLERANCE_NM:
        return np.zeros(bands_nm.size, dtype=np.int64)
    return np.asarray(DIE_INDEX[nearest], dtype=np.int64)
