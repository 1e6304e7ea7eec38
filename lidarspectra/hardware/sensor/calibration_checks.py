"""Cross-checks of a calibration: against a light that it was not made from, and of lamps against one another."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DIE_INDEX, DIES
from lidarspectra.hardware.sensor.calibration import Calibration, Observation, fit_calibration


def cross_check(calibration: Calibration, observation: Observation) -> pd.DataFrame:
    """Hold a calibration against a light that it was not made from.

    Returns
    -------
    table : pandas.DataFrame
        channel, die, reference and measured [W/m²/nm], ratio [1], deviation in standard uncertainties [1], is_measured.
    """
    light = (observation.signal - calibration.dark) / calibration.responsivity
    noise = np.hypot(observation.signal_se, calibration.dark_se) / calibration.responsivity
    own = np.hypot(noise, light * calibration.responsivity_se / calibration.responsivity)
    total = np.hypot(own, observation.reference * observation.reference_uncertainty)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(observation.reference > 0, light / observation.reference, np.nan)
        deviation = (light - observation.reference) / total
    return pd.DataFrame(
        {
            "channel": CHANNEL_LABELS,
            "die": [DIES[i] for i in DIE_INDEX],
            "reference": observation.reference,
            "measured": light,
            "ratio": ratio,
            "deviation": deviation,
            "is_measured": calibration.is_measured,
        }
    )


def leave_one_out(observations: Sequence[Observation]) -> float:
    """Root mean square relative error with which a calibration from the others predicts each lit observation [1].

    Raises
    ------
    ReadingError
        If fewer than two observations are lit.
    """
    lit = [observation for observation in observations if not observation.is_dark]
    if len(lit) < 2:
        raise ReadingError(
            expected="two or more lit observations",
            found=f"{len(lit)}",
            where="cross-check",
            todo="Measure another lamp.",
        )
    errors = []
    for left_out in lit:
        others = [observation for observation in observations if observation is not left_out]
        table = cross_check(fit_calibration(others, name="others", device=""), left_out)
        errors.append((table["ratio"][table["is_measured"]] - 1.0).to_numpy())
    return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2)))
