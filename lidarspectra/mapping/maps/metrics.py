"""How far one map is from another: the paper's Eq. 8 and 9, with and without its 0-1 normalisation.

Eq. 8 and 9 are written for wavelengths i and then averaged "for all locations and wavelengths" (Section 3.3.2): here
Eq. 8 is taken over the bands of each point, Eq. 9 at each point and band, and both are averaged; the medians stand
beside the means, because a few dark points dominate a mean of percentages.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArrayError, MapError

Normalisation = Literal["absolute", "band", "all"]
RIGHT_ANGLE_DEG = 90.0  # [deg] the largest angle between two spectra without negative values


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A synthetic map against a real one.

    Parameters
    ----------
    normalisation : str
        See `normalised`.
    points, bands : int
        How many were compared.
    nrmse_mean, nrmse_median : float
        Eq. 8 over the bands of each point; mean and median over points. [1]
    nrmse_all : float
        Eq. 8 once over all points and bands: bright places and bands have the largest weight. [1]
    mape_mean, mape_median : float
        Eq. 9; mean and median over points and bands. [%]
    bias_percent : float
        (Σ synthetic - Σ real) / Σ real. [%]
    angle_mean_deg, angle_median_deg : float
        Spectral angle: it compares the shapes of two spectra and ignores their levels. [deg]
    """

    normalisation: Normalisation
    points: int
    bands: int
    nrmse_mean: float
    nrmse_median: float
    nrmse_all: float
    mape_mean: float
    mape_median: float
    bias_percent: float
    angle_mean_deg: float
    angle_median_deg: float


def compare_maps(synthetic: ArrayLike, real: ArrayLike, *, normalisation: Normalisation = "absolute") -> Comparison:
    """All metrics of a synthetic map against a real one.

    Parameters
    ----------
    synthetic, real : (point, band) float
        Spectral irradiance, in one unit. [W/m²/nm]
    normalisation : str
        See `normalised`.

    Returns
    -------
    comparison : Comparison

    Raises
    ------
    MapError
        If the shapes differ, a number is NaN or infinite, or the truth is zero where it divides.
    """
    first, second = _pair(synthetic, real)
    a, b = _brightest_one(first, normalisation), normalised(second, normalisation)
    per_point = nrmse(a, b, axis=1)
    percent = absolute_percentage_error(a, b)
    angle = spectral_angle_deg(first, second)
    return Comparison(
        normalisation=normalisation,
        points=a.shape[0],
        bands=a.shape[1],
        nrmse_mean=float(per_point.mean()),
        nrmse_median=float(np.median(per_point)),
        nrmse_all=float(nrmse(a, b, axis=None)),
        mape_mean=float(percent.mean()),
        mape_median=float(np.median(percent)),
        bias_percent=float(100.0 * (a.sum() - b.sum()) / b.sum()),
        angle_mean_deg=float(angle.mean()),
        angle_median_deg=float(np.median(angle)),
    )


def nrmse(synthetic: ArrayLike, real: ArrayLike, *, axis: int | None) -> FloatArray:
    """Root mean square error over the mean of the truth, sqrt(mean[(syn - real)²]) / mean[real] (paper, Eq. 8).

    Parameters
    ----------
    synthetic, real : (point, band) float
        In one unit.
    axis : 0, 1 or None
        What the means run over: points (one value a band), bands (one value a point), or all.

    Returns
    -------
    error : float array
        [1]

    Raises
    ------
    MapError
        If a mean of the truth is not above zero.
    """
    a, b = _pair(synthetic, real)
    level = np.asarray(b.mean(axis=axis), dtype=np.float64)
    _refuse_zero(level, of={0: "bands", 1: "points"}.get(-1 if axis is None else axis, "maps"), equation="Eq. 8")
    return np.asarray(np.sqrt(((a - b) ** 2).mean(axis=axis)) / level, dtype=np.float64)


def absolute_percentage_error(synthetic: ArrayLike, real: ArrayLike) -> FloatArray:
    """100 % |syn - real| / |real| at every point and band (paper, Eq. 9, before averaging).

    Returns
    -------
    error : (point, band) float
        [%]

    Raises
    ------
    MapError
        If the truth is zero somewhere: the percentage is undefined there.
    """
    a, b = _pair(synthetic, real)
    _refuse_zero(np.abs(b), of="point-bands", equation="Eq. 9")
    return np.asarray(100.0 * np.abs((a - b) / b), dtype=np.float64)


def mape(synthetic: ArrayLike, real: ArrayLike) -> float:
    """Mean absolute percentage error over points and bands (paper, Eq. 9), in per cent."""
    return float(absolute_percentage_error(synthetic, real).mean())


def covered_percent(synthetic: ArrayLike, real: ArrayLike, deviation: ArrayLike) -> FloatArray:
    """Share of points whose truth lies within a deviation of the synthetic map.

    Parameters
    ----------
    synthetic, real, deviation : (point, band) float
        In one unit.

    Returns
    -------
    share : (band,) float
        [%]

    Raises
    ------
    MapError
        If shapes differ, or a number is NaN or infinite.
    """
    a, b = _pair(synthetic, real)
    width, _ = _pair(deviation, real)
    return np.asarray(100.0 * (np.abs(a - b) <= width).mean(axis=0), dtype=np.float64)


def spectral_angle_deg(synthetic: ArrayLike, real: ArrayLike) -> FloatArray:
    """Angle between two spectra as vectors, arccos(a·b / |a||b|), one a point.

    It is computed from the chord of the unit vectors, 2 arcsin(|u - v| / 2), which is accurate near zero. Where the
    synthetic map is zero in all bands the angle is undefined, and is set to the largest that spectra can have.

    Returns
    -------
    angle : (point,) float
        [deg]

    Raises
    ------
    MapError
        If a true spectrum is zero in all bands.
    """
    a, b = _pair(synthetic, real)
    _refuse_zero(np.linalg.norm(b, axis=1), of="points", equation="the spectral angle")
    lengths = [np.linalg.norm(values, axis=1, keepdims=True) for values in (a, b)]
    black = lengths[0][:, 0] <= 0
    chord = np.linalg.norm(a / np.where(lengths[0] > 0, lengths[0], 1.0) - b / lengths[1], axis=1)
    angle = np.degrees(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))
    return np.asarray(np.where(black, RIGHT_ANGLE_DEG, angle), dtype=np.float64)


def normalised(values: ArrayLike, normalisation: Normalisation) -> FloatArray:
    """A map scaled to 0-1 as in the paper, by its largest value.

    The paper says "normalized, scaling them to values between 0 and 1" and no more. Division by the maximum is the
    interpretation that leaves Eq. 9 defined: subtracting the minimum too would make the darkest truth zero.

    Parameters
    ----------
    values : (point, band) float
    normalisation : 'absolute', 'band' or 'all'
        None; by the maximum of each band's map, as each of the 14 maps is drawn; or by that of the whole map.

    Raises
    ------
    MapError
        If a map to be scaled is zero everywhere.
    """
    if normalisation != "absolute":
        _refuse_zero(_largest(values, normalisation), of="bands", equation="the 0-1 normalisation")
    return _brightest_one(values, normalisation)


def _largest(values: ArrayLike, normalisation: Normalisation) -> FloatArray:
    return np.asarray(np.max(values, axis=0 if normalisation == "band" else None), dtype=np.float64)


def _brightest_one(values: ArrayLike, normalisation: Normalisation) -> FloatArray:
    """`normalised`, of a map that may be dark: a band in which no lamp sends anything is 0 on any scale."""
    array = np.asarray(values, dtype=np.float64)
    if normalisation == "absolute":
        return array
    largest = _largest(array, normalisation)
    return np.asarray(array / np.where(largest > 0, largest, 1.0), dtype=np.float64)


def _pair(synthetic: ArrayLike, real: ArrayLike) -> tuple[FloatArray, FloatArray]:
    for name, values in (("synthetic map", synthetic), ("real map", real)):
        if isinstance(values, xr.Dataset):
            raise MapError(
                expected="an array (point, band)", found="a Dataset", where=name, todo="Take its ['irradiance']."
            )
    try:
        b = float_array(real, name="real map", shape=(None, None))
        a = float_array(synthetic, name="synthetic map", shape=b.shape)
    except ArrayError as cause:
        raise MapError(expected=cause.expected, found=cause.found, where=cause.where) from cause
    if b.size == 0:
        raise MapError(expected="at least one point and one band", found="none", where="real map")
    return a, b


def _refuse_zero(values: FloatArray, *, of: str, equation: str) -> None:
    dark = int((values <= 0).sum())
    if dark:
        raise MapError(
            expected=f"a truth above zero, as {equation} divides by it",
            found=f"zero or less in {dark} of {values.size} {of}",
            where="real map",
            todo="Leave those points or bands out, and report that you did.",
        )
