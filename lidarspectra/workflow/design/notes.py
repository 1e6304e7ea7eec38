"""What a reader of a design should know, as full sentences."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.mapping.design.conditions import Condition
from lidarspectra.mapping.design.solving import Obstacles
from lidarspectra.mapping.photometry.channel_estimate import channel_estimate
from lidarspectra.mapping.photometry.indoor_spectra import indoor_spectra
from lidarspectra.radiance.sampling.folding import MAX_SPECTRUM_ERROR
from lidarspectra.words import digits, two_digits
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design.lamps import ASSUMED_EFFICACY_LM_W, DesignedLamp, DesignLamps
from lidarspectra.workflow.design.light import DesignLight
from lidarspectra.workflow.design.points import TargetPoints

MAX_CHANNEL_ERROR = 0.05  # [1] 95th percentile; above it the channels do not tell a quantity well enough for a target
SHOWN_GAP = 1e-3  # [1]
MAX_NAMED = 6
LEVEL_M = 0.3  # [m] between heights of one plane of work, over a floor that slopes
NAME_THOSE = "Name those that are meant by points = [...], numbered from 1 as the rows of map.csv."
UPWARD = 0.7  # [1] cosine from which a sensor looks up, within 45 degrees


def shortfall_words(
    conditions: Sequence[tuple[Condition, TargetPoints]],
    values: Sequence[tuple[float, float]],
    blocked: Obstacles | None,
) -> str:
    """By how much targets are missed at least, and what limits them.

    Parameters
    ----------
    conditions : sequence of (Condition, TargetPoints)
    values : sequence of (float, float)
        Of the design that misses them least, with standard errors.
    blocked : Obstacles or None
        None where only the rounding of the dimming is in the way.
    """
    missed = []
    for (condition, _), (value, _) in zip(conditions, values, strict=True):
        if not condition.holds(value):
            off = 100.0 * abs(value / condition.wanted - 1.0)
            unit = "" if condition.kind == "uniformity" else f" {condition.unit}"
            side = "over" if condition.kind == "at most" else "short"
            found = f"comes to {digits(value, '.4g')}{unit}, {two_digits(off)} % {side}"
            missed.append(f"'{condition.target}' ({condition.words}) {found}")
    words = f"The targets cannot all be met. The least violated design has: {'; '.join(missed)}."
    if blocked is None:
        return f"{words} Only the rounding of the dimming to four digits is in the way: ask for a little less of these."
    return f"{words} {_limits(conditions, blocked)}"


def design_notes(
    designed: Sequence[DesignedLamp],
    lamps: DesignLamps,
    light: DesignLight,
    conditions: Sequence[tuple[Condition, TargetPoints]],
    room: RunRoom,
    gap: float,
) -> tuple[str, ...]:
    """Notes on power, spectra, channels, points, and how far the optimum is proven.

    Parameters
    ----------
    designed : sequence of DesignedLamp
    lamps : DesignLamps
    light : DesignLight
    conditions : sequence of (Condition, TargetPoints)
    room : RunRoom
    gap : float
        Of the solver. [1]
    """
    notes = []
    if lamps.assumed:
        notes.append(
            f"The power of {_listed(lamps.assumed)} is assumed: {ASSUMED_EFFICACY_LM_W:g} lm/W, as of common LED "
            "luminaires. With equal efficacies the design is the same at any value; where they differ, give power_W or "
            "efficacy_lm_W under [lamps] of the target file."
        )
    if daylight := [f"'{lamp.name}'" for lamp in lamps.fixed if is_daylight(lamp)]:
        notes.append(
            f"{', '.join(daylight)} {'sends' if len(daylight) == 1 else 'send'} the light of the run's moment, and the "
            "lamps add what is missing then: by another sky, or by night, the targets do not hold with this dimming. "
            "For lamps that do without it, design in a run without [daylight]."
        )
    off = [section.name for section in room.run_file.lamps if section.dim == 0]
    if off:
        notes.append(
            f"{_listed(off)} {'is' if len(off) == 1 else 'are'} off in the run file (dim = 0) and was not traced, so "
            "the design cannot use it. To have it considered, give it a dim above 0 and run the room again."
        )
    for each in designed:
        if each.shares:
            asked = light.run.spectrum_error(each.of.lamp.name, each.flux)
            if asked > MAX_SPECTRUM_ERROR:
                notes.append(
                    f"The spectrum of '{each.of.lamp.name}' asks for more than this run has: the reflected light of "
                    f"one channel may be predicted wrong by {100 * asked:.1f} %, because the traced slots were cut for "
                    "another spectrum. --check, or a run of the new run file, traces it as it is."
                )
    notes += _channel_notes(conditions, room)
    notes += _direction_notes(conditions, light.places)
    if gap > SHOWN_GAP:
        notes.append(
            f"The solver ran out of time: the targets hold, but a design of up to {100 * gap:.1f} % less power may "
            "exist. Fewer candidates, spectra or points let it finish."
        )
    buried = int(light.places["buried"].to_numpy().sum())
    if buried:
        notes.append(
            f"{buried} of the run's points lie inside furniture or outside the room and are left out of the targets; "
            "their light is not to be trusted."
        )
    return tuple(notes)


def _limits(conditions: Sequence[tuple[Condition, TargetPoints]], blocked: Obstacles) -> str:
    """What is in the way, each reason tried by taking it away."""
    hard = [condition for condition, _ in conditions if condition.is_hard]
    reasons = []
    if blocked.flux_factor is not None:
        reasons.append(
            f"the lamps' flux limits it: {_up(blocked.flux_factor):.2f} times as much would meet all targets"
        )
    if blocked.lamps_needed is not None:
        reasons.append(f"the number of lamps limits it: {blocked.lamps_needed} lit ones would do")
    if blocked.without:
        named = [f"'{hard[number].target}' ({hard[number].words})" for number in blocked.without]
        reasons.append(
            f"without {' or without '.join(named)} all others would be met"
            if len(hard) > 1
            else f"{named[0]} alone cannot be met"
        )
    if blocked.flux_factor is None and not blocked.without:
        reasons += [
            f"'{condition.target}' ({condition.words}) alone "
            + (
                "cannot be met by these lamps at any flux"
                if factor is None
                else f"needs {_up(factor):.2f} times the flux"
            )
            for condition, factor in zip(hard, blocked.alone, strict=True)
            if factor != 1.0
        ]
    if not reasons:
        return (
            "No single cause limits it: each target can be met alone, but neither more flux nor one target less lets "
            "the rest be met. Give lamps in other places, or lower targets."
        )
    return f"What limits it: {'; '.join(reasons)}."


def _up(factor: float) -> float:
    """Rounded up to a hundredth, so that what is said is enough."""
    return float(np.ceil(factor * 100.0) / 100.0)


def _channel_notes(conditions: Sequence[tuple[Condition, TargetPoints]], room: RunRoom) -> list[str]:
    """Quantities that the run's channels tell badly."""
    quantities = {condition.quantity.name: condition.quantity for condition, _ in conditions}
    ensemble = indoor_spectra()
    notes = []
    for quantity in quantities.values():
        error = channel_estimate(ensemble, room.bands, quantity.response, method="lamps").percentile(95.0)
        if error > MAX_CHANNEL_ERROR:
            notes.append(
                f"The run's {len(room.bands)} channels tell {quantity.words} to {100 * error:.0f} % only (95 % of "
                "indoor spectra). For a target on it, run the room with a device of more channels, such as "
                "'as7265x-14' or 'full-spectrum'."
            )
    return notes


def _direction_notes(conditions: Sequence[tuple[Condition, TargetPoints]], places: xr.Dataset) -> list[str]:
    """Targets at points that look different ways or lie at several heights: a desk's is then asked of others too."""
    notes = []
    for name, index in {condition.target: points.index for condition, points in conditions if not points.own}.items():
        up = places["nz"].to_numpy()[index]
        counts = {"up": up > UPWARD, "down": up < -UPWARD, "to a side": np.abs(up) <= UPWARD}
        words = [f"{int(chosen.sum())} {way}" for way, chosen in counts.items() if chosen.any()]
        if len(words) > 1:
            notes.append(
                f"The points of '{name}' look different ways ({', '.join(words)}), and the target is asked of each. "
                + NAME_THOSE
            )
        height = places["z"].to_numpy()[index]
        if np.ptp(height) > LEVEL_M:
            notes.append(
                f"The points of '{name}' lie at heights from {height.min():.2f} to {height.max():.2f} m, and the "
                f"target is asked of each. {NAME_THOSE}"
            )
    return notes


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:MAX_NAMED])
    return shown if len(names) <= MAX_NAMED else f"{shown} and {len(names) - MAX_NAMED} more"
