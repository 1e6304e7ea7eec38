"""Readings that cannot be: outside the room, in another unit, of another room, swapped, or of a sensor turned over."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import IntArray
from lidarspectra.errors import MapError
from lidarspectra.lamps.lamp_spectra import dark_channels
from lidarspectra.mapping.calibration.model import LightModel, Priors
from lidarspectra.mapping.calibration.posterior import STRANGE, disagreement, fit, swapped, turned_over
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.calibration.readings import CALIBRATED_SD, CHANNEL_SD, Readings, unit_of

UNIT_FACTOR = 6.0  # [1] readings that are all off by more are in another unit, or of another room
HOPELESS = 1e-9  # [1] so unlikely a fit, with half of the rows strange, is of another room
MAX_SHOWN = 5  # readings beside the run's light, the least probable first
DESPITE = "Give --despite-doubts (despite_doubts=True in Python) to calibrate by them all the same."


def require_inside(readings: Readings, room: RunRoom, where: Path) -> None:
    """Raise a MapError if a reading was taken outside the scan."""
    low, high = room.scan.bounds
    outside = np.flatnonzero(((readings.positions < low) | (readings.positions > high)).any(axis=1))
    if outside.size:
        box = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
        raise MapError(
            expected=f"readings inside the scan ({box} m)",
            found=f"{_listed(readings, outside)} outside it",
            where=str(where),
            todo="Give x, y, z in metres in the scan's frame, as the report's plan has them: the readings are of "
            "another room, in another unit, or measured from another corner.",
        )


def without_dark_channels(readings: Readings, room: RunRoom, where: Path) -> Readings:
    """The readings but for those of `dark_channels`, with a note.

    Of LEDs an AS7265x reads next to nothing from 810 to 940 nm, but not nothing, whose logarithm would outweigh all
    others. Raises a MapError if a row has no other number.
    """
    numbers, dark = readings.numbers, dark_channels([lamp.flux for lamp in room.lamps], room.bands)
    out = np.array([isinstance(each, int) and bool(dark[each]) for each in readings.quantities])
    if not out.any():
        return readings
    alone = np.setdiff1d(numbers.row, numbers.row[~out])
    if alone.size:
        raise MapError(
            expected="readings in channels into which the lamps send light, by their spectra",
            found=f"none at {_listed(readings, alone)}",
            where=str(where),
            todo="Leave the reading out, or give the lamps spectra that reach as far.",
        )
    kept = np.flatnonzero(~out)
    channels = {each for each, is_out in zip(readings.quantities, out, strict=True) if is_out}
    named = ", ".join(label for number, label in enumerate(room.bands.labels) if number in channels)
    note = (
        f"{int(out.sum())} numbers are left out, of channels into which no lamp of the run sends light to speak of, by "
        f"its spectrum: {named} nm. If they do, give them spectra that reach as far."
    )
    return replace(
        readings,
        quantities=tuple(readings.quantities[number] for number in kept),
        numbers=numbers.some(kept),
        notes=(*readings.notes, note),
    )


def require_light(model: LightModel, readings: Readings, where: Path) -> None:
    """Raise a MapError if no lamp's light reaches a reading in the model."""
    dark = np.unique(readings.numbers.row[~(model.light.sum(axis=1) > 0)])
    if dark.size:
        raise MapError(
            expected="readings at places that the traced lamps reach",
            found=f"no light in the model at {_listed(readings, dark)}",
            where=str(where),
            todo="The place lies inside something, or behind a closed wall, or the quantity lies outside the lamps' "
            "spectra: leave the reading out.",
        )


def doubts(
    model: LightModel, reverse: LightModel, readings: Readings, priors: Priors, where: Path, *, despite: bool
) -> tuple[str, ...]:
    """What is strange about readings, as notes; a MapError for what cannot be.

    Parameters
    ----------
    model, reverse : LightModel
        Of the readings, and with every sensor turned over.
    readings : Readings
    priors : Priors
    where : Path
        Their file.
    despite : bool
        Tell everything in notes.

    Raises
    ------
    MapError
        Unless `despite`: if units, rows or directions are wrong in a way that can be named, or most of the readings
        contradict one another.
    """
    found = [_wrong_unit(model, readings, priors)]
    if found == [None]:
        found = _strange_rows(model, reverse, readings, priors)
    faults = [each for each in found if each is not None]
    for sentence, is_fault in faults:
        if is_fault and not despite:
            raise MapError(
                expected="readings that this room can have",
                found=sentence,
                where=str(where),
                todo=f"Mend them. {DESPITE}",
            )
    return tuple(f"{sentence[0].upper()}{sentence[1:]}." for sentence, _ in faults)


def _wrong_unit(model: LightModel, readings: Readings, priors: Priors) -> tuple[str, bool] | None:
    known = priors.meter_sd[readings.numbers.meter] <= max(CALIBRATED_SD, CHANNEL_SD)
    if not known.any():
        return None
    ratio = float(np.exp(np.median(np.log(readings.numbers.value / model.light.sum(axis=1))[known])))
    if 1.0 / UNIT_FACTOR < ratio < UNIT_FACTOR:
        return None
    words = f"{ratio:.3g} times" if ratio > 1 else f"1/{1 / ratio:.3g} of"
    return (
        f"readings that are {words} what the run has: they are in another unit, of another room, or the lamps' fluxes "
        "are far off",
        True,
    )


def _strange_rows(
    model: LightModel, reverse: LightModel, readings: Readings, priors: Priors
) -> list[tuple[str, bool] | None]:
    probability = disagreement(model, readings.numbers, priors)
    strange = np.flatnonzero(probability < STRANGE)
    whole = fit(model, readings.numbers, priors).probability
    if strange.size == 0 and whole > STRANGE:
        return []
    suspects = np.argsort(probability, kind="stable")
    pair = swapped(model, readings.numbers, priors, suspects)
    if pair is not None:
        return [(f"{_listed(readings, pair)} swapped: all readings fit once they are exchanged", True)]
    turned = turned_over(model, reverse, readings.numbers, priors, suspects)
    if turned:
        return [(f"the sensor turned over at {_listed(readings, turned)}: they fit with the other direction", True)]
    if whole < HOPELESS and strange.size * 2 >= len(readings.names):
        return [
            (
                "readings that contradict this room and one another: they are of another room, or other lamps "
                f"({_beside_the_run(model, readings, suspects)})",
                True,
            )
        ]
    if strange.size == 0:
        return [
            (f"the readings together are further from the model than chance allows (probability {whole:.1g})", False)
        ]
    return [
        (f"{_listed(readings, strange)} disagrees with what the other readings tell of it: look at that place", False)
    ]


def _beside_the_run(model: LightModel, readings: Readings, rows: IntArray) -> str:
    """The numbers of some rows beside those of the run, the first few of them."""
    predicted = model.light.sum(axis=1)
    numbers = [number for row in rows for number in np.flatnonzero(readings.numbers.row == row)]
    words = [
        f"'{readings.names[readings.numbers.row[number]]}' {readings.numbers.value[number]:.3g} "
        f"{unit_of(readings.quantities[number])} where the run has {predicted[number]:.3g}"
        for number in numbers[:MAX_SHOWN]
    ]
    return ", ".join(words) + (", ..." if len(numbers) > MAX_SHOWN else "")


def _listed(readings: Readings, rows: IntArray | Sequence[int]) -> str:
    names = [f"'{readings.names[row]}'" for row in rows]
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return ", ".join(names[:5]) + more
