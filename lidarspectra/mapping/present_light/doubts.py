"""What could be wrong where readings do not fit: one sensor at a time left out, one switch at a time not believed."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.present_light.model import LampKnowledge, SensorModel
from lidarspectra.mapping.present_light.states import States, solve_states

STRANGE = 0.001  # [1] readings with a less likely chi-square do not fit
EXPLAINED = 0.01  # [1] they fit again, without a sensor or its switch, where chi-square is at least as likely as this
COVERED = 0.5  # [1] a sensor that reads less than this share of what the others tell may be covered
DEAD = 0.1  # [1] a lamp with less than this share of its full light gives none


@dataclass(frozen=True, kw_only=True)
class Suspect:
    """Something that explains readings that do not fit.

    Parameters
    ----------
    kind : 'sensor' or 'lamp'
    index : int
        Which one.
    probability : float
        Of the other readings' chi-square once it is left out, or its switch is not believed. [0-1]
    share : float
        A sensor's reading over what the others tell of it, or a lamp's state over its full light. [1]
    """

    kind: Literal["sensor", "lamp"]
    index: int
    probability: float
    share: float


def suspects(model: SensorModel, readings: FloatArray, knowledge: LampKnowledge, said: FloatArray) -> list[Suspect]:
    """Single faults that explain readings which do not fit, the most likely first.

    Parameters
    ----------
    model : SensorModel
    readings : (number,) float
        NaN where there is none. [unit of the number]
    knowledge : LampKnowledge
    said : (lamp,) float
        What the switches say; see `LampKnowledge.prior`.

    Returns
    -------
    suspects : list of Suspect
        Empty where no single fault explains them. More than one is an ambiguity: the readings cannot tell which.
    """
    found = [
        suspect
        for sensor in np.unique(model.sensor[np.isfinite(readings)])
        if (suspect := _without_sensor(model, readings, knowledge, said, int(sensor))) is not None
    ]
    for lamp in np.flatnonzero(~np.isnan(said)):
        believed = said.copy()
        believed[lamp] = np.nan
        free = solve_states(model, readings, knowledge.prior(believed))
        share = float(free.state[lamp] / knowledge.full[lamp])
        found.append(Suspect(kind="lamp", index=int(lamp), probability=free.probability, share=share))
    return sorted((each for each in found if each.probability >= EXPLAINED), key=lambda each: -each.probability)


def _without_sensor(
    model: SensorModel, readings: FloatArray, knowledge: LampKnowledge, said: FloatArray, sensor: int
) -> Suspect | None:
    own = (model.sensor == sensor) & np.isfinite(readings)
    others = solve_states(model, readings, knowledge.prior(said), chosen=model.sensor != sensor)
    if others.count == 0:
        return None  # a single sensor contradicts the switches alone
    weight = others.expected[own] / model.noise(others.expected, own).diagonal()
    share = float(weight @ readings[own] / max(float(weight @ others.expected[own]), np.finfo(float).tiny))
    return Suspect(kind="sensor", index=sensor, probability=others.probability, share=share)


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """Readings that have not fitted for a while.

    Parameters
    ----------
    since_s : float
        First answer that did not fit. [s since 1970]
    sentences : tuple of str
        What happened, what may be the cause, and what to do.
    suspects : tuple of Suspect
        Single faults that explain it.
    """

    since_s: float
    sentences: tuple[str, ...]
    suspects: tuple[Suspect, ...]


def alarm_sentences(
    states: States, found: list[Suspect], model: SensorModel, sensors: tuple[str, ...], lamps: tuple[str, ...]
) -> tuple[str, ...]:
    """An alarm in words.

    Parameters
    ----------
    states : States
        Of the readings that do not fit.
    found : list of Suspect
    model : SensorModel
    sensors, lamps : tuple of str
        Names.
    """
    misfit = f"chi-square {states.chi_square:.3g} of {states.count} numbers"
    if not found:
        worst = int(model.sensor[np.nanargmax(np.abs(states.residual))])
        return (
            f"The readings contradict the run ({misfit}), and no single sensor or switch explains it; sensor "
            f"'{sensors[worst]}' is farthest off.",
            "Furniture may have moved, a blind may be drawn, or the lamps are not those of the run: look at the room, "
            "and run it or calibrate it again if it has changed.",
        )
    doubts = [f"The readings contradict the run ({misfit})."]
    for suspect in found:
        doubts.append(
            _of_sensor(sensors[suspect.index], suspect.share)
            if suspect.kind == "sensor"
            else _of_lamp(lamps[suspect.index], suspect.share)
        )
    if len(found) == 1:
        doubts.append("The map of now goes without it.")
    else:
        doubts.append(
            f"Each of these {len(found)} explains the readings alone, and they cannot tell which it is: look at each, "
            "or add a sensor."
        )
    return tuple(doubts)


def _of_sensor(name: str, share: float) -> str:
    off = f"Sensor '{name}' reads {share:.2f} times what the others tell of its place: "
    if share < COVERED:
        return off + "it may be covered, turned or shaded, or a lamp that it alone sees gives no light."
    if share < 1.0:
        return off + "it may have been moved or turned, or something stands in its light."
    return off + "it may have been moved or turned, or light falls on it that the run does not know."


def _of_lamp(name: str, share: float) -> str:
    if share < DEAD:
        return (
            f"Lamp '{name}' gives no light (state {max(share, 0.0):.2f}) while its switch is said to be on: it may be "
            "dead, or its switch is reported wrongly."
        )
    return (
        f"Lamp '{name}' gives {share:.2f} of its full light, which its switch does not say: it may have aged, or its "
        "switch is reported wrongly."
    )
