"""What a trace, and a map made of it, say of their own error.

Three parts, each relative to the mean irradiance in the worst band, none hidden in another: the standard error of the
sampling; light beyond the last reflection traced, which is missing (`truncation`); and what reflectances that change
within a channel still cost after its slots were cut (`radiance.scene.slots`). A target is met if none is above it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, FloatArray


def stated_error(
    *,
    irradiance: FloatArray,
    irradiance_se: NDArray[np.floating],
    truncation: NDArray[np.floating] | None,
    slot_error: FloatArray,
    counted: BoolArray,
    target: float,
    each_point: bool = False,
) -> tuple[dict[str, float | int], BoolArray | None]:
    """The attributes by which a Dataset states its error.

    Parameters
    ----------
    irradiance, irradiance_se : (point, band) float
        [W/m²/nm]
    truncation : (point, band) float or None
        None where the method does not estimate it. [W/m²/nm]
    slot_error : (band,) float
        Predicted relative error of reflected light. [1]
    counted : (point,) bool
        Points that are not buried.
    target : float
        Wanted relative standard error. [1]
    each_point : bool
        Whether the target is each point's, of its own light.

    Returns
    -------
    attributes : dict
        achieved_relative_se, truncated_share where it is known, slot_error [1], and target_met (0 or 1).
    missed : (point,) bool or None
        With `each_point`: the points above the target.
    """
    means = irradiance[counted].mean(axis=0, dtype=np.float64)
    achieved = relative_rms(irradiance_se[counted], means)
    slots = float(np.abs(slot_error[means > 0]).max(initial=0.0))
    stated: dict[str, float | int] = {"achieved_relative_se": achieved, "slot_error": slots}
    missed = counted & (own_relative_se(irradiance_se, irradiance) > target) if each_point else None
    met = (achieved <= target if missed is None else not missed.any()) and slots <= target
    if truncation is not None:
        stated["truncated_share"] = relative_rms(truncation[counted], means)
        met = met and stated["truncated_share"] <= target
    return {**stated, "target_met": int(met)}, missed


def opening_stated(opening: FloatArray, irradiance: FloatArray, counted: BoolArray) -> dict[str, float]:
    """What a Dataset states of light by way of openings: how far it may be off for what was not scanned.

    Parameters
    ----------
    opening, irradiance : (point, band) float
        [W/m²/nm]
    counted : (point,) bool
        Points that are not buried.

    Returns
    -------
    attributes : dict
        opening_share: its mean over the mean irradiance, in the worst band [1].
    """
    means = irradiance[counted].mean(axis=0, dtype=np.float64)
    lit = means > 0
    share = opening[counted].mean(axis=0, dtype=np.float64)[lit] / means[lit]
    return {"opening_share": float(share.max(initial=0.0))}


def opening_in_words(attributes: Mapping[str, Any]) -> str | None:
    """What a Dataset states of its openings, as a sentence; None where there are none to speak of."""
    share, effect = float(attributes.get("open_share", 0.0)), float(attributes.get("opening_share", 0.0))
    if effect <= 0.0:
        return None
    if attributes.get("opening_closed"):
        return (
            f"{100 * share:.1f} % of what the sensors see are default walls that close the scan, and "
            f"{100 * effect:.1f} % of the mean irradiance in the worst channel comes by way of them: so much less "
            "it is if all is dark beyond. Scan what is missing to do without this guess."
        )
    return (
        f"{100 * share:.1f} % of what the sensors see leaves the scan, and is counted as dark. A bright wall in the "
        f"openings would add {100 * effect:.1f} % to the mean irradiance in the worst channel, and more beside them: "
        "the truth lies between, unless light comes in from outside. Scan what is missing, or write close = true under "
        "[scan] for a default wall."
    )


def relative_rms(error: NDArray[np.floating], means: FloatArray) -> float:
    """Root mean square over points of the error, over the mean irradiance, in the worst band that has light."""
    lit = means > 0
    rms = np.sqrt(np.mean(np.square(error, dtype=np.float64), axis=0))
    return float((rms[lit] / means[lit]).max(initial=0.0))


def own_relative_se(error: NDArray[np.floating], light: NDArray[np.floating]) -> FloatArray:
    """Each point's standard error over its own light, in its worst band.

    Parameters
    ----------
    error, light : (point, band) float
        [W/m²/nm]

    Returns
    -------
    relative : (point,) float
        Bands in which no light was found at a point do not count there. [1]
    """
    lit = light > 0
    relative = np.divide(error, light, out=np.zeros(light.shape), where=lit)
    worst: FloatArray = relative.max(axis=1, initial=0.0)
    return worst
