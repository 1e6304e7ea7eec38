"""Lamp spectra out of the databases, where readings of many channels tell them.

Every spectrum of the databases takes the place of the lamps' own, at the same luminous flux, without tracing again: the
coefficients of the channels stay. How likely each makes the readings says which it is.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.config import LampSection
from lidarspectra.hardware.sensor.measured_readings import Scale
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.calibration.model import UNKNOWN_METER_SD, LightModel, Observations, Priors
from lidarspectra.mapping.calibration.posterior import STRANGE
from lidarspectra.mapping.calibration.spectra import spectrum_posterior
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.spectra.databases import list_lamps
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.calibration.light import RunRoom, TracedLight, weights_of
from lidarspectra.workflow.calibration.readings import CHANNEL_SD, Readings

MIN_CHANNELS = 4  # fewer determine a colour, not a spectrum
ALIKE_SD = 0.1  # [1] of a channel between two lamps of one kind, and of walls' reflectance in it
WEAK = 1e-2  # [1] of a row's strongest channel: a weaker one reads stray light and its neighbours
STRAY = 1e-3  # [1] of a row's strongest channel, that every candidate has at least
SAME = 1e-3  # [1] of the light in a channel, within which two spectra are one
MIN_PROBABILITY = 0.95  # [1] that it is not the run's own, from which another spectrum takes its place
SHOWN = 5  # candidates in the table
OWN = "as in the run file"


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedSpectra:
    """The lamps' spectra that fit the readings best.

    Parameters
    ----------
    room : RunRoom
        With the spectra that were found.
    names : dict of str to str
        Spectrum by lamp of the run file, where another one fits better.
    table : Table or None
        The likeliest candidates; None where the readings do not determine spectra.
    notes : tuple of str
    """

    room: RunRoom
    names: dict[str, str]
    table: Table | None = None
    notes: tuple[str, ...] = ()


def fit_spectra(room: RunRoom, readings: Readings, light: TracedLight, priors: Priors, scale: Scale) -> FittedSpectra:
    """Look the lamps' spectra up in the databases by readings of channels.

    Parameters
    ----------
    room : RunRoom
    readings : Readings
    light : TracedLight
        Of the readings' places, first of all.
    priors : Priors
    scale : str
        Of the meter: where every channel or die has an unknown factor of its own, spectra are not identifiable.
    """
    candidates = {each.name: each.spectrum for each in list_lamps()}
    chosen = _usable(room, readings, candidates)
    channels = {readings.quantities[number] for number in chosen}
    if len(channels) < MIN_CHANNELS or scale not in ("none", "one"):
        return FittedSpectra(room=room, names={})
    fitted, rows, notes = room, [], []
    names: dict[str, str] = {}
    for group in _groups(room):
        label = ", ".join(room.lamps[index].name for index in group)
        labels, models = [OWN], [_model(fitted, readings, light, chosen)]
        for name, each in candidates.items():
            model = _model(_with_spectrum(fitted, group, each), readings, light, chosen)
            if not np.allclose(model.light, models[0].light, rtol=SAME, atol=0.0):  # else it is the run's own
                labels.append(name)
                models.append(model)
        numbers, own_priors = _comparison(readings, chosen, priors, scale)
        found = spectrum_posterior(models, numbers, own_priors)
        order = np.argsort(-found.probability, kind="stable")[:SHOWN]
        rows += [(label, labels[index], found.probability[index], found.fits[index]) for index in order]
        best = int(order[0])
        if found.fits[best] < STRANGE:
            notes.append(f"No spectrum of the databases explains the readings of {label}: the run's own stays.")
        elif best > 0 and found.probability[0] <= 1.0 - MIN_PROBABILITY:
            fitted = _with_spectrum(fitted, group, candidates[labels[best]])
            changed = [room.lamps[index].name for index in group if _may_change(room, room.lamps[index].name)]
            names |= dict.fromkeys(changed, labels[best])
            notes.append(_change_note(label, labels[best], float(found.probability[best]), len(changed) == len(group)))
        elif best > 0:
            notes.append(
                f"The readings do not settle the spectrum of {label}: '{labels[best]}' is likeliest, with "
                f"{found.probability[best]:.0%}. The run's own stays; readings of more channels, or nearer to the "
                "lamps, tell more."
            )
    frame = pd.DataFrame(rows, columns=["lamps", "spectrum", "probability [1]", "fit [1]"])
    table = Table(
        name="spectra",
        caption="Lamp spectra out of the databases that explain the channels best, all equally likely before. The fit "
        "is the probability of so large a chi-square.",
        frame=frame,
        formats={"probability [1]": ".3f", "fit [1]": ".2g"},
    )
    return FittedSpectra(room=fitted, names=names, table=table, notes=tuple(notes))


def _change_note(label: str, name: str, probability: float, is_changed: bool) -> str:
    end = (
        "the calibrated run file has it."
        if is_changed
        else f"set spectrum = '{name}' in the run file where that lamp is described, for its maps to have it."
    )
    return f"The readings tell that the spectrum of {label} is like '{name}' (probability {probability:.0%}); {end}"


def _usable(room: RunRoom, readings: Readings, candidates: dict[str, Spectrum]) -> IntArray:
    """Numbers of channels that every candidate's spectrum covers."""
    low = max(spectrum.range_nm[0] for spectrum in candidates.values())
    high = min(spectrum.range_nm[1] for spectrum in candidates.values())
    covered = [
        number
        for number, quantity in enumerate(readings.quantities)
        if not isinstance(quantity, str) and low <= room.bands.centers_nm[quantity] <= high
    ]
    chosen = np.array(covered, dtype=np.int64)
    value, row = readings.numbers.value[chosen], readings.numbers.row[chosen]
    return chosen[value >= WEAK * _strongest(value, row)]


def _strongest(value: FloatArray, row: IntArray) -> FloatArray:
    """(number,) largest value of each number's row."""
    largest = np.zeros(int(row.max(initial=0)) + 1)
    np.maximum.at(largest, row, value)
    return np.asarray(largest[row])


def _groups(room: RunRoom) -> list[list[int]]:
    """Lamps of the room with the same spectrum, but for its strength; windows and the sun are no lamps here."""
    outside = {window.name for window in room.run_file.daylight.windows} if room.run_file.daylight else set()
    groups: dict[bytes, list[int]] = {}
    for index, lamp in enumerate(room.lamps):
        if lamp.name in outside or not lamp.is_in_room or luminous_flux_lm(lamp.flux) <= 0:
            continue
        shape = lamp.flux.values / lamp.flux.values.max()
        groups.setdefault(lamp.flux.wavelengths_nm.tobytes() + shape.round(6).tobytes(), []).append(index)
    return list(groups.values())


def _with_spectrum(room: RunRoom, group: list[int], spectrum: Spectrum) -> RunRoom:
    lamps = list(room.lamps)
    for index in group:
        lamps[index] = _with_flux_of(lamps[index], spectrum)
    return replace(room, lamps=tuple(lamps))


def _with_flux_of(lamp: Lamp, spectrum: Spectrum) -> Lamp:
    """The lamp with another spectrum and the same luminous flux."""
    return replace(lamp, flux=spectrum.scaled(luminous_flux_lm(lamp.flux) / luminous_flux_lm(spectrum)))


def _model(room: RunRoom, readings: Readings, light: TracedLight, chosen: IntArray) -> LightModel:
    weights = weights_of([readings.quantities[number] for number in chosen], room)
    row = readings.numbers.row[chosen]
    model = light.model(weights, row)
    least = STRAY * np.stack([_strongest(by_lamp, row) for by_lamp in model.light.T], axis=1)
    return LightModel(light=np.maximum(model.light, least), slope=model.slope)


def _comparison(readings: Readings, chosen: IntArray, priors: Priors, scale: Scale) -> tuple[Observations, Priors]:
    """The numbers with a factor for every channel, and lamps of any flux where the meter's factor is not known."""
    channels, meter = np.unique([int(readings.quantities[number]) for number in chosen], return_inverse=True)
    numbers = replace(readings.numbers.some(chosen), meter=meter.reshape(-1))
    flux_sd = priors.flux_sd if scale == "none" else np.full_like(priors.flux_sd, UNKNOWN_METER_SD)
    meter_sd = np.full(channels.size, np.hypot(CHANNEL_SD, ALIKE_SD))
    return numbers, replace(priors, flux_sd=flux_sd, meter_sd=meter_sd)


def _may_change(room: RunRoom, name: str) -> bool:
    """Whether the run file describes the lamp by a relative spectrum and its lumens, which stay."""
    lamp: LampSection | None = next((each for each in room.run_file.lamps if each.name == name), None)
    return lamp is not None and lamp.luminous_flux_lm is not None
