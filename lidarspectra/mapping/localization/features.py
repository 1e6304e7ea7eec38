"""Features of a locator: the change that a person makes at each sensor, or in each channel, in units of its noise.

    u = ln(N / N0)                               change against the reference N0, in each sensor and channel
    c = Σ_b u/σ² / Σ_b 1/σ²                       change of a sensor
    c' = c - median of c over the sensors         a common change of level, as by dimming, is taken out
    σ_s² = 1 / Σ_b 1/σ² + d²                      variance of c
    z = asinh(κ c'/σ_s) / κ                       the feature of a sensor
    z = asinh(κ u'/σ) / κ                         of a channel, with u' = u - median of c over the sensors

A sensor's gain, its dies' errors and the lamps' spectrum cancel in the ratio. N0 is the empty room, or the median over
readings of many places, which is close to it because a person changes few sensors at a time. σ is the standard
deviation of u by rounding to whole counts, repeatability and the drift d. κ is the relative error of a simulated
change: asinh(κ c/σ_s)/κ is the variance-stabilising transform for a variance of c of σ_s² + (κc)². Channels whose
reference is only a few counts are left out, since one count is then more than a person changes.

By how much a sensor changes tells where somebody stands; in which colours it changes tells what they wear and, by the
colours of the room around them, where they stand. Who has seen one person alone cannot know which: channels are then
averaged, and on virtual nights, where another person comes, every locator is right more often so. Fingerprints of
several people tell how much clothes do, and whether a feature for each channel is better (`chosen_features`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import (
    DEFAULT_SETTINGS,
    FULL_SCALE_PER_STEP,
    GAIN_FACTORS,
    SATURATED_COUNT,
    SensorSettings,
    count_uncertainty,
    nominal_responsivity,
)
from lidarspectra.mapping.localization.fingerprint_table import quantity_of

Reference = Literal["empty", "median"]
Per = Literal["sensor", "channel"]
"""Of what there is a feature."""
DARKEST_COUNT = 0.5  # [count] replaces a count of 0, which has no logarithm
HEADROOM = 0.9  # [1] of full scale, up to which a gain is used
DRIFT = 0.003  # [1] of a sensor against its own reference within hours, beside rounding and repeatability


@dataclass(frozen=True, kw_only=True)
class FeatureSettings:
    """How features are made.

    Parameters
    ----------
    min_count : float
        Channels whose reference is less are left out. [count]
    mismatch : float
        κ: relative error of a simulated change. [1]
    remove_level : bool
        Whether a common change of level is taken out.
    per : 'sensor' or 'channel', optional
        Of what there is a feature; without it, training chooses by the people that it has (`chosen_features`), and a
        feature space has one for each sensor.
    """

    min_count: float = 10.0
    mismatch: float = 0.15
    remove_level: bool = True
    per: Per | None = None

    def __post_init__(self) -> None:
        if not (self.min_count >= 0 and 0 < self.mismatch <= 1):
            raise MapError(
                expected="a minimum count of 0 or more, and a mismatch above 0 and up to 1",
                found=f"{self.min_count:g} and {self.mismatch:g}",
                where="features",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class FeatureSpace:
    """The features of a set of sensors.

    Parameters
    ----------
    sensors : tuple of str
    bands_nm : (band,) float
        Centres. [nm]
    usable : (sensor, band) bool
        Which channels are used; a sensor without any has no feature.
    noise : (sensor, band) float
        σ, the standard deviation of ln(N/N0). [1]
    settings : FeatureSettings
    """

    sensors: tuple[str, ...]
    bands_nm: FloatArray
    usable: BoolArray
    noise: FloatArray
    settings: FeatureSettings

    def __post_init__(self) -> None:
        bands = float_array(self.bands_nm, name="FeatureSpace.bands_nm", shape=(None,))
        shape = (len(self.sensors), bands.size)
        noise = float_array(self.noise, name="FeatureSpace.noise", shape=shape)
        if np.shape(self.usable) != shape or not np.any(self.usable) or noise.min() <= 0:
            raise MapError(
                expected="usable channels for the sensors, and noise above 0",
                found=f"{int(np.sum(self.usable))} of {shape}, least noise {noise.min():g}",
                where="features",
                todo="Use a higher gain, or allow lower counts (--min-count).",
            )
        object.__setattr__(self, "bands_nm", bands)
        object.__setattr__(self, "noise", noise)

    @property
    def per(self) -> Per:
        """Of what there is a feature."""
        return self.settings.per or "sensor"

    @property
    def is_of_channels(self) -> bool:
        """Whether each channel has a feature, not each sensor."""
        return self.per == "channel"

    @property
    def count(self) -> int:
        """Number of features, one for each usable channel or for each sensor that has one."""
        return int(self.usable.sum() if self.is_of_channels else self.usable.any(axis=1).sum())

    @property
    def sensor_noise(self) -> FloatArray:
        """(heard sensor,) σ_s, standard deviation of the change of each sensor with a usable channel [1]."""
        precision = np.where(self.usable, self.noise**-2.0, 0.0).sum(axis=1)[self.usable.any(axis=1)]
        return np.asarray(np.hypot(1.0 / np.sqrt(precision), DRIFT), dtype=np.float64)

    @property
    def difference_noise(self) -> float:
        """Root mean square over the features of how much two readings of the same differ, in units of their noise [1].

        Of rounding and repeatability, and of the simulation where fingerprints are traced, but without drift: within
        seconds no sensor drifts. So it is rather too large, and `Memory` learns how much less readings differ by.
        """
        own = np.maximum(self.noise[self.usable] ** 2 - DRIFT**2, 0.0)
        return float(np.sqrt(np.mean(2.0 * (self.averaging**2 @ own) / self.feature_noise**2)))

    @property
    def feature_noise(self) -> FloatArray:
        """(feature,) standard deviation of the change that each feature is made of [1]."""
        return np.asarray(self.noise[self.usable] if self.is_of_channels else self.sensor_noise, dtype=np.float64)

    @property
    def averaging(self) -> FloatArray:
        """(feature, usable channel) weights by which the channels' changes make up each feature's [1]."""
        if self.is_of_channels:
            return np.eye(self.count)
        return self._sensor_averaging()

    def _sensor_averaging(self) -> FloatArray:
        """(heard sensor, usable channel) weights of the channels in each sensor's change [1]."""
        sensor, _ = np.nonzero(self.usable)
        heard = np.flatnonzero(self.usable.any(axis=1))
        weight = np.where(heard[:, None] == sensor[None, :], self.noise[self.usable] ** -2.0, 0.0)
        return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float64)

    def changes(self, readings: FloatArray, reference: FloatArray) -> FloatArray:
        """u': changes of the logarithm against the reference, the common level taken out.

        Parameters
        ----------
        readings : (reading, sensor, band) float
            NaN where missing. In any unit, the reference in the same.
        reference : (sensor, band) or (reading, sensor, band) float
            N0, one for all readings or for each its own.

        Returns
        -------
        changes : (reading, sensor, band) float
            NaN where a reading is missing, or the reference is dark. [1]
        """
        lit = np.where(reference > 0, reference, np.nan)
        floor = DARKEST_COUNT / self.settings.min_count if self.settings.min_count else 1e-3
        changes = np.log(np.maximum(readings / lit, floor))
        if self.settings.remove_level:
            changes = changes - self._level(changes)[:, None, None]
        return np.asarray(changes, dtype=np.float64)

    def features(self, readings: FloatArray, reference: FloatArray, *, usable: BoolArray | None = None) -> FloatArray:
        """z: the features of readings.

        Parameters
        ----------
        readings, reference
            As in `changes`.
        usable : (sensor, band) or (reading, sensor, band) bool, optional
            Of these readings; channels that are too dark in them do not count.

        Returns
        -------
        features : (reading, feature) float
            NaN where a sensor has no reading. [1]
        """
        changes = self.changes(readings, reference)
        if usable is not None:
            changes = np.where(usable, changes, np.nan)
        if self.is_of_channels:
            return self._pressed(changes[:, self.usable] / self.feature_noise)
        return self._pressed(self.sensor_changes(changes)[:, self.usable.any(axis=1)] / self.feature_noise)

    def of_sensors(self) -> "FeatureSpace":
        """The same sensors with a feature for each."""
        return replace(self, settings=replace(self.settings, per="sensor"))

    def sensor_features(self, features: FloatArray) -> FloatArray:
        """(reading, heard sensor) features of the sensors out of those of readings; NaN where one has no reading.

        Parameters
        ----------
        features : (reading, feature) float
            Of this space. [1]
        """
        if not self.is_of_channels:
            return features
        kappa = self.settings.mismatch
        changes = np.sinh(kappa * np.nan_to_num(features)) / kappa * self.feature_noise
        weight = np.isfinite(features)[:, None, :] * self._sensor_averaging()
        total = weight.sum(axis=2)
        mean = np.einsum("rsc,rc->rs", weight, changes) / np.where(total > 0, total, 1.0)
        return self._pressed(np.where(total > 0, mean, np.nan) / self.sensor_noise)

    def _pressed(self, relative: FloatArray) -> FloatArray:
        """Changes in units of noise, the larger the more pressed together."""
        kappa = self.settings.mismatch
        return np.asarray(np.arcsinh(kappa * relative) / kappa, dtype=np.float64)

    def _level(self, changes: FloatArray) -> FloatArray:
        """(reading,) change of the level that most sensors share; 0 where no sensor has a reading."""
        return known_median(self.sensor_changes(changes), axis=1)

    def sensor_changes(self, changes: FloatArray) -> FloatArray:
        """(reading, sensor) mean of the channels' changes, weighted by their precision; NaN where none is known.

        Parameters
        ----------
        changes : (reading, sensor, band) float
            NaN where missing. [1]
        """
        weight = np.where(self.usable & np.isfinite(changes), self.noise**-2.0, 0.0)
        total = weight.sum(axis=2)
        mean = (weight * np.nan_to_num(changes)).sum(axis=2) / np.where(total > 0, total, 1.0)
        return np.asarray(np.where(total > 0, mean, np.nan), dtype=np.float64)


def feature_space(
    table: xr.Dataset, settings: FeatureSettings | None = None, device: SensorSettings | None = None
) -> FeatureSpace:
    """The features of a table's sensors.

    Parameters
    ----------
    table : xarray.Dataset
        Fingerprints.
    settings : FeatureSettings, optional
    device : SensorSettings, optional
        Gain and time of the sensors, where the table holds irradiances; see `device_settings`.

    Returns
    -------
    space : FeatureSpace

    Raises
    ------
    MapError
        If no channel is bright enough.
    """
    settings = settings or FeatureSettings()
    counts = reference_counts(table, device)
    bright = np.maximum(counts, 1.0)
    noise = np.hypot(count_uncertainty(bright) / bright, DRIFT)
    if "effect_se" in table:
        lit = np.maximum(reference_of(table), np.finfo(float).tiny)
        noise = np.hypot(noise, np.sqrt((table["effect_se"].to_numpy() ** 2).mean(axis=0)) / lit)
    return FeatureSpace(
        sensors=tuple(table["sensor"].to_numpy().astype(str).tolist()),
        bands_nm=table["band"].to_numpy().astype(np.float64),
        usable=(counts >= settings.min_count) & (counts > 0),
        noise=noise,
        settings=settings,
    )


def reference_of(table: xr.Dataset) -> FloatArray:
    """(sensor, band) reference of a table: its empty room, or the median over its readings; 0 where none was read."""
    if "empty" in table:
        return np.asarray(table["empty"].to_numpy(), dtype=np.float64)
    return known_median(table[quantity_of(table)].to_numpy(), axis=0)


def reference_counts(table: xr.Dataset, device: SensorSettings | None = None) -> FloatArray:
    """(sensor, band) reference in counts of a sensor.

    Irradiances are turned into counts by the data sheet's responsivity, at the gain and time of `device`.
    """
    reference = reference_of(table)
    if quantity_of(table) == "counts":
        return reference
    return reference * counts_per_irradiance(device or device_settings(table))


def counts_per_irradiance(device: SensorSettings) -> float:
    """Counts per irradiance at a gain and time, by the data sheet [count per W/m²/nm]."""
    return nominal_responsivity()[0] * device.gain * device.integration_ms


def device_settings(table: xr.Dataset) -> SensorSettings:
    """The highest gain at the usual integration time at which none of the table's irradiances saturates."""
    brightest = float(np.nanmax(table["irradiance"].to_numpy()))
    steps = DEFAULT_SETTINGS.integration_steps
    limit = HEADROOM * min(SATURATED_COUNT, FULL_SCALE_PER_STEP * steps)
    for code in reversed(range(len(GAIN_FACTORS))):
        settings = SensorSettings(gain_code=code, integration_steps=steps)
        if brightest * counts_per_irradiance(settings) < limit:
            return settings
    return SensorSettings(gain_code=0, integration_steps=steps)


def require_same_sensors(table: xr.Dataset, space: FeatureSpace, *, where: str) -> xr.Dataset:
    """The table with its sensors and bands in the order of a feature space; more than those are left out.

    Raises
    ------
    MapError
        If the table lacks a sensor or a band.
    """
    missing = [name for name in space.sensors if name not in table["sensor"].to_numpy()]
    if missing:
        raise MapError(
            expected=f"the sensors that the model was trained for, {_first(space.sensors)}",
            found=f"no '{missing[0]}' among {_first(table['sensor'].to_numpy().astype(str).tolist())}",
            where=where,
        )
    try:
        return table.sel(sensor=list(space.sensors)).sel(band=space.bands_nm, method="nearest", tolerance=1.0)
    except KeyError as cause:
        raise MapError(
            expected="the bands " + ", ".join(f"{band:g}" for band in space.bands_nm) + " nm",
            found=", ".join(f"{band:g}" for band in table["band"].to_numpy()) + " nm",
            where=where,
        ) from cause


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")


def known_median(values: FloatArray, *, axis: int) -> FloatArray:
    """Median of the values that are not NaN; 0 where there are none."""
    nothing = np.isnan(values).all(axis=axis, keepdims=True)
    return np.asarray(np.nanmedian(np.where(nothing, 0.0, values), axis=axis), dtype=np.float64)


def known_quantile(values: FloatArray, quantile: float, *, axis: int) -> FloatArray:
    """Quantile [0-1] of the values that are not NaN; 0 where there are none."""
    missing = np.isnan(values)
    given = np.where(missing.all(axis=axis, keepdims=True), 0.0, values)
    # numpy takes quantiles with missing values column by column, which is a hundred times slower.
    find = np.nanquantile if np.isnan(given).any() else np.quantile
    return np.asarray(find(given, quantile, axis=axis), dtype=np.float64)


def known_mean(values: FloatArray, *, axis: int) -> FloatArray:
    """Mean of the values that are not NaN; NaN where there are none."""
    known = np.isfinite(values)
    total, count = np.where(known, values, 0.0).sum(axis=axis), known.sum(axis=axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan), dtype=np.float64)
