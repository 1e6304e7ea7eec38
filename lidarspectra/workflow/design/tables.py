"""Tables of a design: its lamps, its targets, and both against a trace anew."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.design.conditions import Condition
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.workflow.design.lamps import DesignedLamp

NOISE_SE = 3.0  # [1] standard errors within which a traced value may miss by noise alone


def lamps_table(designed: Sequence[DesignedLamp], fixed: Sequence[Lamp], removed: Sequence[str]) -> Table:
    """Every lamp: before, dimming, spectrum, flux, power and place.

    Parameters
    ----------
    designed : sequence of DesignedLamp
    fixed : sequence of Lamp
        That stay as they are.
    removed : sequence of str
        In whose place the candidates are.
    """
    rows = []
    for each in designed:
        lamp = each.of.lamp
        rows.append(
            {
                "lamp": lamp.name,
                "state": "lit" if each.shares else "off",
                "dim before [1]": np.nan if each.of.is_candidate else each.of.present_dim,
                "dim [1]": each.dim,
                "spectrum": spectrum_words(each),
                "flux [lm]": luminous_flux_lm(each.flux) if each.shares else 0.0,
                "power [W]": each.watts,
                **_place(lamp),
            }
        )
    for lamp in fixed:
        flux = luminous_flux_lm(lamp.flux)
        rows.append({"lamp": lamp.name, "state": "fixed", "spectrum": "as it is", "flux [lm]": flux, **_place(lamp)})
    rows += [{"lamp": name, "state": "removed", "dim [1]": 0.0, "spectrum": ""} for name in removed]
    columns = [
        "lamp",
        "state",
        "dim before [1]",
        "dim [1]",
        "spectrum",
        "flux [lm]",
        "power [W]",
        "x [m]",
        "y [m]",
        "z [m]",
    ]
    return Table(
        name="design",
        caption="The lamps as designed. Dimming is the share of the lamp's full flux.",
        frame=pd.DataFrame(rows).reindex(columns=columns),
        formats={
            "dim before [1]": ".4g", "dim [1]": ".4g", "flux [lm]": ".0f", "power [W]": ".1f",
            "x [m]": ".2f", "y [m]": ".2f", "z [m]": ".2f",
        },
    )  # fmt: skip


def targets_table(
    conditions: Sequence[Condition],
    before: Sequence[tuple[float, float]],
    predicted: Sequence[tuple[float, float]],
) -> Table:
    """Every condition: what is asked, what there was, what is predicted.

    Parameters
    ----------
    conditions : sequence of Condition
    before, predicted : sequence of (float, float)
        Values and standard errors.
    """
    frame = _conditions(conditions)
    frame["before"] = [value for value, _ in before]
    frame["predicted"] = [value for value, _ in predicted]
    frame["SE"] = [error for _, error in predicted]
    frame["met"] = [_met(condition, value) for condition, (value, _) in zip(conditions, predicted, strict=True)]
    return Table(
        name="targets",
        caption="What is asked of the light, and what there is.",
        frame=frame,
        formats={"before": ".4g", "predicted": ".4g", "SE": ".2g"},
    )


def check_table(
    conditions: Sequence[Condition],
    predicted: Sequence[tuple[float, float]],
    traced: Sequence[tuple[float, float]],
) -> Table:
    """Predicted against traced anew.

    Parameters
    ----------
    conditions : sequence of Condition
    predicted, traced : sequence of (float, float)
        Values and standard errors.
    """
    frame = _conditions(conditions)
    for heading, values in (("predicted", predicted), ("traced", traced)):
        frame[heading] = [value for value, _ in values]
        frame[f"SE {heading}"] = [error for _, error in values]
    errors = np.hypot(frame["SE predicted"], frame["SE traced"])
    with np.errstate(divide="ignore", invalid="ignore"):
        frame["off [SE]"] = (frame["traced"] - frame["predicted"]) / errors
    frame["met"] = [_met(condition, *each) for condition, each in zip(conditions, traced, strict=True)]
    return Table(
        name="check",
        caption="The design's light traced anew with other random numbers.",
        frame=frame,
        formats={
            "predicted": ".4g", "SE predicted": ".2g", "traced": ".4g", "SE traced": ".2g", "off [SE]": "+.1f",
        },
    )  # fmt: skip


def spectrum_words(designed: DesignedLamp) -> str:
    """The spectra that a lamp is lit with."""
    names = [(choice.name or "as it is", share) for choice, share in designed.shares]
    if len(names) == 1:
        return names[0][0]
    return " + ".join(f"{100 * share:.0f} % {name}" for name, share in names)


def _conditions(conditions: Sequence[Condition]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "target": [condition.target for condition in conditions],
            "quantity": [condition.quantity.words for condition in conditions],
            "wanted": [condition.words for condition in conditions],
            "unit": [condition.unit for condition in conditions],
        }
    )


def _met(condition: Condition, value: float, error: float = 0.0) -> str:
    if not condition.is_hard:
        return "–"
    if condition.holds(value):
        return "yes"
    sign = -1.0 if condition.kind == "at most" else 1.0
    return "within noise" if condition.holds(value + sign * NOISE_SE * error) else "NO"


def _place(lamp: Lamp) -> dict[str, float]:
    if not lamp.is_in_room:
        return {}
    return {f"{axis} [m]": float(value) for axis, value in zip("xyz", lamp.center, strict=True)}
