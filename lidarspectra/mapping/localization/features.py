"""Features of a locator: the change that a person makes at each sensor, over its channels, in units of its noise.

    u = ln(N / N0)                               change against the reference N0, in each sensor and channel
    c = Σ_b u/σ² / Σ_b 1/σ²                       change of a sensor
    c' = c - median of c over the sensors         a common change of level, as by dimming, is taken out
    σ_s² = 1 / Σ_b 1/σ² + d²                      variance of c
    z = asinh(κ c'/σ_s) / κ                       the feature

A sensor's gain, its dies' errors and the lamps' spectrum cancel in the ratio. N0 is the empty room, or the median over
readings of many places, which is close to it because a person changes few sensors at a time. σ is the standard
deviation of u by rounding to whole counts, repeatability and the drift d. κ is the relative error of a simulated
change: asinh(κ c/σ_s)/κ is the variance-stabilising transform for a variance of c of σ_s² + (κc)². Channels whose
reference is only a few counts are left out, since one count is then more than a person changes.

The channels are averaged because a body takes light in all of them and clothes tint what is left: by how much a sensor
changes tells where somebody stands, in which colours it changes tells what they wear. On virtual nights, where another
person comes than the one who was learned, every locator is right more often so than with a feature for each channel.
Where lamps and walls differ in colour, as in traced rooms, channels tell more than that (docs/howto-localize.md).
"""

from dataclasses import dataclass
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
    """

    min_count: float = 10.0
    mismatch: float = 0.15
    remove_level: bool = True

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
        Which channels are averaged; a sensor without any has no feature.
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
    def count(self) -> int:
        """Number of features, one for each sensor with a usable channel."""
        return int(self.usable.any(axis=1).sum())

    @property
    def sensor_noise(self) -> FloatArray:
        """(feature,) σ_s, standard deviation of a sensor's change [1]."""
        precision = np.where(self.usable, self.noise**-2.0, 0.0).sum(axis=1)[self.usable.any(axis=1)]
        return np.asarray(np.hypot(1.0 / np.sqrt(precision), DRIFT), dtype=np.float64)

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
        kappa = self.settings.mismatch
        relative = self._of_sensors(changes)[:, self.usable.any(axis=1)] / self.sensor_noise
        return np.asarray(np.arcsinh(kappa * relative) / kappa, dtype=np.float64)

    def _level(self, changes: FloatArray) -> FloatArray:
        """(reading,) change of the level that most sensors share; 0 where no sensor has a reading."""
        return known_median(self._of_sensors(changes), axis=1)

    def _of_sensors(self, changes: FloatArray) -> FloatArray:
        """(reading, sensor) mean of the channels' changes, weighted by their precision; NaN where none is known."""
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
            expected=f"the sensors that the model was trained for, {', '.join(space.sensors[:5])}, ...",
            found=f"no '{missing[0]}' among {', '.join(map(str, table['sensor'].to_numpy()[:5]))}, ...",
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
