"""Greedy choice of k among n candidate sensor places: for localization, or for predicting the whole map (kriging).

One sensor is added at a time, the one that reduces the loss most. Both losses are functions of the set chosen so far:

    locate    Somebody at place p changes sensor s by m_ps, in units of its noise: rounding and repeatability
              (`features`), and the differences between people at one place. With the chosen sensors C, two places have
              the distance d²(p, q) = Σ_{s in C} (m_ps - m_qs)². Minimised is the expected error of choosing the
              more probable of two, averaged over all pairs:
                  e(C) = Σ_{p,q} |x_p - x_q| Q(d(p, q)/2) / number of pairs,   Q the normal tail; [m], or [1] where
              coordinates are not known. It is no locator's error, but it is smooth, and small where that is small.
    rebuild   The true map over the n places is the simulated one plus what the simulation does not know: by how much
              each lamp l is off or dimmed (spread a), and an error in proportion to the light that is alike at places
              near one another (spread b, correlation length L):
                  K_ij = a² Σ_l E_li E_lj + b² E_i E_j exp(-|x_i - x_j|²/2L²)
              Readings at C tell the others by regression (kriging); what is minimised is the root mean variance that is
              left, sqrt(tr(K - K_C (K_CC + σ²)⁻¹ K_C') / n).

References
----------
Krause, Singh, Guestrin (2008) Near-optimal sensor placements in Gaussian processes, JMLR 9, 235-284.
"""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.special import ndtr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.features import feature_space, reference_of
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.mapping.localization.places import places_of_table
from lidarspectra.progress import Progress, silent

TINY = 1e-12  # [1] noise of a sensor that has no channel, and no change
LARGEST_DISTANCE = 60.0  # [1] standard deviations: farther places are never confused, and squares stay small


@dataclass(frozen=True, kw_only=True, eq=False)
class ChosenSensors:
    """Sensors in the order in which they were chosen.

    Parameters
    ----------
    order : (chosen,) int
        Of the candidates.
    loss : (chosen + 1,) float
        Loss with none, one, two, ... of them. [m], or the unit of the maps
    """

    order: IntArray
    loss: FloatArray


def place_changes(table: xr.Dataset) -> FloatArray:
    """m_ps: the mean change of each sensor by somebody at each place, in units of its noise.

    The channels of a sensor change together, as a larger body or a darker shirt does it; so they are averaged, and how
    much a sensor scatters between the readings of one place is part of its noise.

    Parameters
    ----------
    table : xarray.Dataset
        Fingerprints, best several of each place.

    Returns
    -------
    changes : (place, sensor, 1) float
        Places in the order of `places_of_table`; 0 for a sensor without a usable channel. [1]
    """
    space, places = feature_space(table), places_of_table(table)
    changes = space.changes(table[quantity_of(table)].to_numpy(), reference_of(table))
    known = np.where(space.usable & np.isfinite(changes), changes, 0.0)  # a missing reading counts as no change
    channels = np.maximum(space.usable.sum(axis=1), 1)
    by_sensor = known.sum(axis=2) / channels  # (fingerprint, sensor)
    index = places.index(table["label"].to_numpy())
    mean = np.array([by_sensor[index == number].mean(axis=0) for number in range(len(places))])
    freedom = max(len(by_sensor) - len(places), 1)
    scatter = np.sqrt(((by_sensor - mean[index]) ** 2).sum(axis=0) / freedom)
    rounding = np.sqrt((np.where(space.usable, space.noise, 0.0) ** 2).sum(axis=1)) / channels
    return np.asarray((mean / np.maximum(np.hypot(rounding, scatter), TINY))[:, :, None], dtype=np.float64)


def choose_to_locate(
    changes: FloatArray,
    count: int,
    *,
    positions_m: FloatArray | None = None,
    progress: Progress = silent,
) -> ChosenSensors:
    """Choose sensors that distinguish places.

    Parameters
    ----------
    changes : (place, sensor, band) float
        Mean change of each place in units of its standard deviation; NaN where a channel is not usable. [1]
    count : int
        How many to choose.
    positions_m : (place, axis) float, optional
        Of the places, in three axes where they lie on several storeys; without them every mistake counts 1. [m]
    progress : Progress, optional

    Returns
    -------
    chosen : ChosenSensors

    Raises
    ------
    MapError
        If there are less than two places, or fewer sensors than wanted.
    """
    known = np.nan_to_num(np.asarray(changes, dtype=np.float64))
    places, sensors, _ = known.shape
    _require_count(count, sensors)
    if places < 2:
        raise MapError(expected="two places or more", found=f"{places}", where="sensor placement")
    first, second = np.triu_indices(places, 1)
    cost = np.ones(first.size)
    if positions_m is not None:
        where = float_array(positions_m, name="positions_m", shape=(places, None))
        cost = np.linalg.norm(where[first] - where[second], axis=1)
    squares = ((known[first] - known[second]) ** 2).sum(axis=2)  # (pair, sensor)

    def loss(apart: FloatArray) -> FloatArray:
        half = np.minimum(np.sqrt(apart), LARGEST_DISTANCE) / 2.0
        return np.asarray((cost[:, None] * ndtr(-half)).mean(axis=0), dtype=np.float64)

    order: list[int] = []
    losses = [float(loss(np.zeros((first.size, 1)))[0])]
    total = np.zeros((first.size, 1))
    for number in range(count):
        left = _left(sensors, order)
        trial = loss(total + squares[:, left])
        best = int(np.argmin(trial))
        order.append(int(left[best]))
        losses.append(float(trial[best]))
        total = total + squares[:, [order[-1]]]
        progress((number + 1) / count, "choosing sensors")
    return ChosenSensors(order=np.array(order), loss=np.array(losses))


def map_covariance(
    irradiance: FloatArray, positions_m: FloatArray, *, lamp_spread: float, error: float, length_m: float
) -> FloatArray:
    """K: prior covariance of the map's errors between places.

    Parameters
    ----------
    irradiance : (lamp, point) float
        Each lamp's share of the simulated map. Any unit
    positions_m : (point, 3) float
        [m]
    lamp_spread : float
        a: relative standard deviation of each lamp's level. [1]
    error : float
        b: relative standard deviation of all other errors of the map. [1]
    length_m : float
        L: correlation length of those errors. [m]

    Returns
    -------
    covariance : (point, point) float
        In the square of the unit.

    Raises
    ------
    MapError
        If a spread is negative, both are 0, or the length is not above 0.
    """
    shares = float_array(irradiance, name="irradiance", shape=(None, None))
    places = float_array(positions_m, name="positions_m", shape=(shares.shape[1], 3))
    if min(lamp_spread, error) < 0 or max(lamp_spread, error) <= 0 or not length_m > 0:
        raise MapError(
            expected="spreads of 0 or more, one of them above it, and a length above 0",
            found=f"{lamp_spread:g}, {error:g}, {length_m:g} m",
            where="sensor placement",
        )
    total = shares.sum(axis=0)
    squared = ((places[:, None, :] - places[None, :, :]) ** 2).sum(axis=2)
    local = np.outer(total, total) * np.exp(-squared / (2.0 * length_m**2))
    return np.asarray(lamp_spread**2 * shares.T @ shares + error**2 * local, dtype=np.float64)


def choose_to_rebuild(
    covariance: FloatArray, count: int, *, noise: FloatArray, progress: Progress = silent
) -> ChosenSensors:
    """Choose sensors from whose readings the map at all places is best predicted.

    Parameters
    ----------
    covariance : (point, point) float
        See `map_covariance`.
    count : int
        How many to choose.
    noise : (point,) float
        Standard deviation of a reading at each place, in the map's unit; above 0.
    progress : Progress, optional

    Returns
    -------
    chosen : ChosenSensors
        The loss is the root mean square error over all places.

    Raises
    ------
    MapError
        If fewer sensors are there than wanted, or a reading has no noise.
    """
    left_over = np.array(covariance, dtype=np.float64)
    points = len(left_over)
    sigma = float_array(noise, name="noise", shape=(points,))
    _require_count(count, points)
    if sigma.min() <= 0:
        raise MapError(expected="noise above 0", found=f"{sigma.min():g}", where="sensor placement")
    order: list[int] = []
    losses = [_root_mean_variance(left_over)]
    for number in range(count):
        left = _left(points, order)
        # Reading s takes K_s K_s'/(K_ss + σ²) off the covariance, so that much off its trace.
        gain = (left_over[:, left] ** 2).sum(axis=0) / (np.diag(left_over)[left] + sigma[left] ** 2)
        best = int(left[int(np.argmax(gain))])
        column = left_over[:, best]
        left_over = left_over - np.outer(column, column) / (column[best] + sigma[best] ** 2)
        order.append(best)
        losses.append(_root_mean_variance(left_over))
        progress((number + 1) / count, "choosing sensors")
    return ChosenSensors(order=np.array(order), loss=np.array(losses))


def _root_mean_variance(covariance: FloatArray) -> float:
    return float(np.sqrt(max(float(np.trace(covariance)), 0.0) / len(covariance)))


def _left(sensors: int, order: list[int]) -> IntArray:
    free: BoolArray = np.ones(sensors, dtype=np.bool_)
    free[order] = False
    return np.flatnonzero(free)


def _require_count(count: int, sensors: int) -> None:
    if not 1 <= count <= sensors:
        raise MapError(
            expected=f"1 to {sensors} sensors to choose, as many as there are candidates",
            found=f"{count}",
            where="sensor placement",
        )
