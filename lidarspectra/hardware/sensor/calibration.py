"""Calibration of a spectral sensor: responsivity per channel and per die, with its uncertainty.

Model, for each channel c: signal = responsivity_c x E_c + dark_c, with E_c the band value of the reference spectrum.
Responsivity and dark offset are fitted by weighted least squares over the observations; where a lamp sends nothing
into a channel, the mean factor of the channel's die stands in, with the scatter of that die as its uncertainty.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_COUNT, CHANNEL_LABELS, DIE_INDEX, DIES, nominal_responsivity
from lidarspectra.hardware.sensor.readings import Signal, best_signal, signal
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands

Kind = Literal["lamp", "field"]

LIT_FRACTION = 1e-3  # share of the brightest channel below which a reference does not determine a channel
MAX_UNKNOWN_SHARE = 0.02  # of a channel's response beyond the end of a reference's spectrum: a full width from it
MIN_SIGNIFICANCE = 5.0  # standard uncertainties above dark below which a signal does not determine a channel
FIELD_UNCERTAINTY = 0.15  # relative, of simulated light at a point: the paper's maps are 12 to 15 % off (Table 3)
MAX_SPREAD = 1.0  # assumed scatter of the logarithm for a die of which a single channel is known


@dataclass(frozen=True, kw_only=True, eq=False)
class Observation:
    """The sensor under a known light.

    Parameters
    ----------
    name : str
        Of the lamp, level or place.
    signal, signal_se : (18,) float
        Mean signal of the readings and its standard error; NaN where masked. [1/ms]
    reference : (18,) float
        Band values of the light that falls on the sensor; zero for a dark observation, NaN in channels of which the
        reference says nothing. [W/m²/nm]
    reference_uncertainty : float
        Relative standard uncertainty of the reference. [1]
    """

    name: str
    signal: FloatArray
    signal_se: FloatArray
    reference: FloatArray
    reference_uncertainty: float

    def __post_init__(self) -> None:
        given = np.asarray(self.reference, dtype=np.float64)
        reference = float_array(
            np.where(np.isnan(given), 0.0, given), name=f"reference '{self.name}'", shape=(CHANNEL_COUNT,)
        )
        if np.any(reference < 0) or not 0 <= self.reference_uncertainty < 1:
            raise ReadingError(
                expected="a reference that is nowhere negative, and its relative uncertainty between 0 and 1",
                found=f"values from {reference.min():g}, uncertainty {self.reference_uncertainty:g}",
                where=f"observation '{self.name}'",
                todo="Give the spectrum in W/m²/nm as it falls on the sensor.",
            )

    @property
    def is_dark(self) -> bool:
        """Whether no light fell on the sensor."""
        return not np.any(self.reference > 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """The calibration of one device.

    Parameters
    ----------
    name : str
        The user's name for it.
    device : str
        Which device.
    kind : str
        'lamp': against a measured reference. 'field': against a simulated map, and so no independent measure of it.
    signal : str
        Which signal it is for, see `readings.signal`.
    gain, integration_ms : float
        Settings it was made with; NaN if unknown. [1], [ms]
    responsivity, responsivity_se : (18,) float
        [signal per W/m²/nm]
    dark, dark_se : (18,) float
        [signal]
    is_measured : (18,) bool
        False where the die's mean factor is used instead.
    die_factor, die_factor_se : (3,) float
        Mean factor of each die on the data sheet's responsivity, and its relative standard error. [1]
    residual : float
        Root mean square of the relative misfit of the observations. [1]
    observations : tuple of str
        Their names.
    version : int
        Counted up each time it is saved; 0 is unsaved.
    created : str
        When, ISO 8601.
    notes : tuple of str
        What the user should know about the calibration.
    """

    name: str
    device: str
    kind: Kind
    signal: Signal
    gain: float
    integration_ms: float
    responsivity: FloatArray
    responsivity_se: FloatArray
    dark: FloatArray
    dark_se: FloatArray
    is_measured: BoolArray
    die_factor: FloatArray
    die_factor_se: FloatArray
    residual: float
    observations: tuple[str, ...]
    version: int = 0
    created: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for name in ("responsivity", "responsivity_se", "dark", "dark_se"):
            object.__setattr__(self, name, float_array(getattr(self, name), name=name, shape=(CHANNEL_COUNT,)))
        for name in ("die_factor", "die_factor_se"):
            object.__setattr__(self, name, float_array(getattr(self, name), name=name, shape=(len(DIES),)))
        object.__setattr__(self, "is_measured", np.array(self.is_measured, dtype=np.bool_).reshape(CHANNEL_COUNT))
        if np.any(self.responsivity <= 0):
            raise ReadingError(
                expected="positive responsivities",
                found=f"{self.responsivity.min():g}",
                where=f"calibration '{self.name}'",
            )

    @property
    def label(self) -> str:
        """Name and version."""
        return f"{self.name} v{self.version} ({self.kind}, {self.device})"


def observe(
    readings: xr.Dataset, reference: ArrayLike, *, name: str, kind: Signal | None = None, uncertainty: float
) -> Observation:
    """Average readings under one steady light.

    Parameters
    ----------
    readings : xarray.Dataset
        Taken with one gain and integration time.
    reference : (18,) float
        Band values of that light; zeros for darkness, NaN where it is not known. [W/m²/nm]
    name : str
        Of the light.
    kind : str, optional
        Which signal; the best one by default.
    uncertainty : float
        Relative standard uncertainty of the reference. [1]

    Returns
    -------
    observation : Observation
        Its standard error is the readings' scatter over √n, or their repeatability where there are fewer than three;
        and, where they scatter by less than a count, the rounding, which then does not average out.
    """
    used_kind = kind if kind is not None else best_signal(readings)
    values, noise = signal(readings, used_kind)
    n = np.isfinite(values).sum(axis=0)
    known, many = n > 0, n >= 3
    mean, scatter = np.full(CHANNEL_COUNT, np.nan), np.full(CHANNEL_COUNT, np.nan)
    mean[known] = np.nanmean(values[:, known], axis=0)
    scatter[known] = np.nanmean(noise[:, known], axis=0)
    scatter[many] = np.nanstd(values[:, many], axis=0, ddof=1)
    rounding = _rounding(readings, used_kind)
    stuck = np.where(scatter < rounding, rounding, 0.0)
    return Observation(
        name=name,
        signal=mean,
        signal_se=np.hypot(scatter / np.sqrt(np.maximum(n, 1)), stuck),
        reference=np.asarray(reference, dtype=np.float64),
        reference_uncertainty=uncertainty,
    )


def _rounding(readings: xr.Dataset, kind: Signal) -> float:
    """Standard uncertainty of a signal by the rounding to whole counts."""
    if kind == "module values":
        return float(1.0 / np.sqrt(12.0))
    exposure = readings["gain"].to_numpy() * readings["integration_ms"].to_numpy()
    return float(1.0 / np.sqrt(12.0) / np.nanmean(exposure))


def reference_bands(spectrum: Spectrum) -> FloatArray:
    """Band values of a reference spectrum in the sensor's 18 channels. (18,) [its unit].

    NaN in channels that reach beyond an end at which it still has light: what the lamp sends there is not known.
    """
    bands = sensor_bands("as7265x-18")
    values, dark = spectrum.values, LIT_FRACTION * spectrum.values.max()
    below = bands.wavelengths_nm < spectrum.wavelengths_nm[0]
    above = bands.wavelengths_nm > spectrum.wavelengths_nm[-1]
    unknown = (below & (values[0] > dark)) | (above & (values[-1] > dark))
    share = bands.weights[:, unknown].sum(axis=1)
    known = np.where(share <= MAX_UNKNOWN_SHARE, 1.0 - share, np.nan)
    return np.asarray(bands.band_values(spectrum, outside="zero") / known, dtype=np.float64)


def fit_calibration(
    observations: Sequence[Observation],
    *,
    name: str,
    device: str,
    kind: Kind = "lamp",
    of_signal: Signal = "basic counts",
    gain: float = float("nan"),
    integration_ms: float = float("nan"),
) -> Calibration:
    """Fit responsivity and dark offset of every channel.

    Parameters
    ----------
    observations : sequence of Observation
        One lit one at least; a dark one, or several levels, give the dark offset.
    name, device : str
        Names for it.
    kind : str
        See `Calibration`.
    of_signal : str
        Which signal the observations hold.
    gain, integration_ms : float
        Settings they were made with. [1], [ms]

    Returns
    -------
    calibration : Calibration

    Raises
    ------
    ReadingError
        If no channel is lit.
    """
    channels = [_fit_channel(observations, c) for c in range(CHANNEL_COUNT)]
    measured = np.array([fit is not None for fit in channels])
    if not measured.any():
        raise ReadingError(
            expected="one observation at least under light that the sensor sees",
            found=f"{len(observations)} observation(s), no channel lit well above its dark signal and below saturation",
            where=f"calibration '{name}'",
            todo="Put the sensor nearer to the lamp, or lower the gain if channels are saturated.",
        )
    fits = np.array([fit if fit is not None else (np.nan,) * 5 for fit in channels])
    responsivity, dark, responsivity_se, dark_se, misfit = fits.T
    nominal, _ = nominal_responsivity()
    factor, factor_se, spread = _die_factors(responsivity / nominal, measured)
    stand_in = nominal * factor[DIE_INDEX]
    responsivity = np.where(measured, responsivity, stand_in)
    responsivity_se = np.where(measured, responsivity_se, stand_in * spread[DIE_INDEX])
    notes = []
    if not measured.all():
        unlit = ", ".join(label for label, known in zip(CHANNEL_LABELS, measured, strict=True) if not known)
        notes.append(
            f"The references send too little light into the channels {unlit} nm, or their spectra end before, so the"
            " mean factor of their die was used, with its scatter as the uncertainty. Calibrate with a halogen lamp"
            " too, which lights all channels, by a spectrum from 390 to 960 nm."
        )
    if kind == "field":
        notes.append(
            "This calibration was fitted to a simulated map, so it takes over that map's absolute level and cannot"
            " confirm it. Calibrate with a lamp of known spectrum for an independent measurement."
        )
    return Calibration(
        name=name,
        device=device,
        kind=kind,
        signal=of_signal,
        gain=gain,
        integration_ms=integration_ms,
        responsivity=responsivity,
        responsivity_se=responsivity_se,
        dark=np.where(measured, dark, 0.0),
        dark_se=np.where(measured, dark_se, np.nanmedian(dark_se)),
        is_measured=measured,
        die_factor=factor,
        die_factor_se=factor_se,
        residual=float(np.sqrt(np.nanmean(misfit**2))),
        observations=tuple(observation.name for observation in observations),
        notes=tuple(notes),
    )


def _fit_channel(observations: Sequence[Observation], c: int) -> tuple[float, float, float, float, float] | None:
    """Responsivity, dark offset, their uncertainties, relative misfit; None if no observation determines them."""
    rows = [o for o in observations if np.isfinite(o.signal[c]) and np.isfinite(o.reference[c])]
    light = np.array([o.reference[c] for o in rows])
    brightest = np.array([np.nanmax(o.reference) for o in rows])
    y = np.array([o.signal[c] for o in rows])
    noise = np.array([o.signal_se[c] for o in rows])
    off = np.array([o.reference_uncertainty for o in rows])
    lit = (light > LIT_FRACTION * brightest) & (light > 0)
    base = y[~lit].min() if np.any(~lit) else 0.0
    if not np.any(lit & (y - base > MIN_SIGNIFICANCE * noise)):
        return None
    levels = np.unique(np.round(light / light.max(), 6))
    fits_dark = levels.size >= 2
    slope = float(np.median((y[lit] - base) / light[lit]))
    weight = 1.0 / np.hypot(noise, slope * light * off) if np.any(noise > 0) or np.any(off > 0) else np.ones_like(y)
    columns = np.stack([light, np.ones_like(light)], axis=1) if fits_dark else light[:, None]
    design, target = columns * weight[:, None], y * weight
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    normal = np.linalg.inv(design.T @ design)
    freedom = y.size - columns.shape[1]
    chi2 = float(np.sum((target - design @ solution) ** 2)) / freedom if freedom > 0 else 0.0
    if chi2 > 1.0:  # scatter beyond the stated uncertainties enlarges the covariance
        covariance = normal * chi2
    else:  # from noise alone: the references' uncertainty does not average out, and is added below
        gain_matrix = normal @ (design * weight[:, None]).T
        covariance = gain_matrix @ np.diag(noise**2) @ gain_matrix.T
    responsivity = float(solution[0])
    if responsivity <= 0:
        return None
    shared = float(off[lit].min()) * responsivity
    model = columns @ solution
    misfit = float(np.sqrt(np.mean(((y - model)[lit] / model[lit]) ** 2)))
    dark = float(solution[1]) if fits_dark else 0.0
    dark_se = float(np.sqrt(covariance[1, 1])) if fits_dark else float(noise.max())
    return responsivity, dark, float(np.hypot(np.sqrt(covariance[0, 0]), shared)), dark_se, misfit


def _die_factors(factor: FloatArray, measured: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Geometric mean of each die's factors, its relative standard error, and the scatter of one channel [1]."""
    means, errors, spreads = np.ones(len(DIES)), np.ones(len(DIES)), np.full(len(DIES), MAX_SPREAD)
    _, nominal_uncertainty = nominal_responsivity()
    overall = float(np.mean(np.log(factor[measured])))
    for die in range(len(DIES)):
        logs = np.log(factor[measured & (die == DIE_INDEX)])
        if logs.size == 0:
            means[die] = np.exp(overall)
            continue
        means[die] = np.exp(logs.mean())
        spread = max(float(logs.std(ddof=1)), nominal_uncertainty) if logs.size > 1 else MAX_SPREAD
        errors[die] = spread / np.sqrt(logs.size)
        spreads[die] = spread * np.sqrt(1.0 + 1.0 / logs.size)
    return means, errors, spreads


def field_calibration(
    readings: xr.Dataset,
    simulated: ArrayLike,
    *,
    name: str,
    device: str,
    uncertainty: float = FIELD_UNCERTAINTY,
) -> Calibration:
    """One-point calibration: scale the sensor's readings at one point to the simulated map there.

    Parameters
    ----------
    readings : xarray.Dataset
        Taken at that point.
    simulated : (18,) float
        Spectral irradiance of the map there; zero for channels that it does not have. [W/m²/nm]
    name, device : str
        Names for it.
    uncertainty : float
        Relative standard uncertainty of the simulation. [1]

    Returns
    -------
    calibration : Calibration
        Of kind 'field'. Comparing the same map with readings calibrated so does not test its absolute level, only
        the distribution of light; leave the point out of the comparison.
    """
    kind = best_signal(readings)
    observation = observe(readings, simulated, name="field point", kind=kind, uncertainty=uncertainty)
    gain, time_ms = settings_of(readings)
    return fit_calibration(
        [observation], name=name, device=device, kind="field", of_signal=kind, gain=gain, integration_ms=time_ms
    )


def settings_of(readings: xr.Dataset) -> tuple[float, float]:
    """Gain [1] and integration time [ms] of a table that has one of each; NaN where unknown.

    Raises
    ------
    ReadingError
        If they change within it: automatic gain is not for calibration.
    """
    found = []
    for name in ("gain", "integration_ms"):
        values = readings[name].to_numpy()
        known = np.unique(values[np.isfinite(values)])
        if known.size > 1:
            raise ReadingError(
                expected=f"one {name} in all readings of a calibration",
                found=", ".join(f"{value:g}" for value in known),
                where=readings.attrs.get("source", "readings"),
                todo="Record without --auto-gain.",
            )
        found.append(float(known[0]) if known.size else float("nan"))
    return found[0], found[1]
