"""Rooms drawn with faults, readings of them drawn with noise, and how far the calibrated map is from the truth."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import (
    UNKNOWN_METER_SD,
    LightModel,
    Observations,
    Priors,
    error_covariance,
)
from lidarspectra.mapping.calibration.model_error import fit_with_model_error
from lidarspectra.mapping.calibration.planning import choose_readings
from lidarspectra.mapping.maps.light_unknowns import error_scale
from lidarspectra.room.surface_parts import PARTS
from research.benchmarks.calibration_rooms import FAULTS, KNOWN_METER_SD, RoomLight

READINGS = 6
PLACES = 3
METER_NOISE = 0.03  # [1] of each reading
LEVEL_OFF, WALLS_OFF, CEILING_OFF = 0.12, 0.08, 0.08  # [1] uniform within: level; walls, and ceiling, against the rest


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is wrong in a room that the run does not know.

    Parameters
    ----------
    flux_off : float
        Of each lamp: just so far up or down if `either`, else uniform within. [1]
    either : bool
    faults : tuple of str
        Of `calibration_rooms.FAULTS`; or "scan", of a room whose run has what a scan tells of it.
    meter_off : float
        Standard deviation of the meter's factor. [1]
    meter_sd : float
        What the run is told of it. [1]
    """

    flux_off: float = 0.2
    either: bool = True
    faults: tuple[str, ...] = ()
    meter_off: float = 0.0
    meter_sd: float = KNOWN_METER_SD


CASES: dict[str, Case] = {
    "fluxes 20 %": Case(),
    "fluxes to 40 %": Case(flux_off=0.4, either=False),
    **{fault: Case(faults=(fault,)) for fault in FAULTS},
    "meter off by 3 %": Case(meter_off=0.03, meter_sd=0.03),
    "meter unknown": Case(meter_off=0.3, meter_sd=UNKNOWN_METER_SD),
    "all of them": Case(
        flux_off=0.4, either=False, faults=("furniture", "gloss", "lamp type"), meter_off=0.03, meter_sd=0.03
    ),
    "nothing": Case(flux_off=0.0),
}
FROM_SCAN = Case(faults=("scan",))
TRACED = ("reflectance", "scan")  # faults in which reflectances are off already


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Of one draw.

    Parameters
    ----------
    nrmse, bias : (before, after)
        Of the map against the truth, over the mean of the truth. [1]
    within : (float, float)
        Shares of points within one and two stated deviations, after. [1]
    stated : (before, after)
        Root of the mean squared deviation that is stated, relative. [1]
    """

    nrmse: tuple[float, float]
    bias: tuple[float, float]
    within: tuple[float, float]
    stated: tuple[float, float]


Choice = Callable[[np.random.Generator], IntArray]


def planned(room: RoomLight, meter_sd: float, count: int = READINGS) -> Choice:
    """Readings by plan: the same in every draw."""
    priors = replace(room.priors, meter_sd=np.array([meter_sd]))
    candidates = room.candidates
    found = choose_readings(
        room.model.some(candidates),
        room.place[candidates],
        room.model.some(room.on_map),
        priors,
        count,
        model_error=_model_error(room, candidates),
    )
    return lambda generator: candidates[found.chosen]


def by_lot(room: RoomLight) -> Choice:
    """Six directions by lot at three places by lot, two at each."""

    def choose(generator: np.random.Generator) -> IntArray:
        places = generator.choice(np.unique(room.place[room.candidates]), PLACES, replace=False)
        at = [room.candidates[room.place[room.candidates] == place] for place in places]
        return np.concatenate([generator.choice(own, READINGS // PLACES, replace=False) for own in at])

    return choose


def by_habit(room: RoomLight) -> Choice:
    """Up, below each lamp; six lamps by lot where there are more."""
    return lambda generator: generator.choice(room.habit, min(READINGS, room.habit.size), replace=False)


def outcomes(
    room: RoomLight, case: Case, choose: Choice, draws: int, seed: int, *, noise: float = METER_NOISE
) -> list[Outcome]:
    """So many draws of a case, with a meter of so much noise in each reading [1]."""
    generator = np.random.default_rng(seed)
    priors = replace(room.priors, meter_sd=np.array([case.meter_sd]))
    return [_outcome(room, case, priors, choose, noise, generator) for _ in range(draws)]


def _outcome(
    room: RoomLight, case: Case, priors: Priors, choose: Choice, noise: float, generator: np.random.Generator
) -> Outcome:
    truth = drawn_light(room, case, generator)
    chosen = choose(generator)
    meter = case.meter_off * generator.standard_normal()
    value = truth[chosen] * np.exp(meter + noise * generator.standard_normal(chosen.size))
    row = np.arange(chosen.size)
    readings = Observations(
        value=value,
        row=row,
        meter=np.zeros(row.size, dtype=np.int64),
        model_error=_model_error(room, chosen),
    )
    found = fit_with_model_error(room.model.some(chosen), readings, priors)
    on_map, there = room.model.some(room.on_map), truth[room.on_map]
    before, after = on_map.light.sum(axis=1), on_map.at(found.flux, found.reflectance).sum(axis=1)
    local = found.local_sd * np.sqrt(np.diag(_model_error(room, room.on_map)))
    stated = tuple(np.hypot(found.light_sd(on_map, before=early), local) for early in (True, False))
    off = np.abs(np.log(after / there)) / stated[1]
    return Outcome(
        nrmse=(_nrmse(before, there), _nrmse(after, there)),
        bias=(_bias(before, there), _bias(after, there)),
        within=(float(np.mean(off <= 1.0)), float(np.mean(off <= 2.0))),
        stated=(_root(stated[0]), _root(stated[1])),
    )


def _model_error(room: RoomLight, chosen: IntArray) -> FloatArray:
    light = room.model.light.sum(axis=1)
    scale = error_scale(light[chosen], light[room.on_map].mean())
    return error_covariance(room.positions[chosen], room.normals[chosen], scale)


def drawn_light(room: RoomLight, case: Case, generator: np.random.Generator) -> FloatArray:
    """(number,) true illuminance of a room drawn by a case [lx]."""
    lamps = room.model.light.shape[1]
    share = generator.choice([-1.0, 1.0], lamps) if case.either else generator.uniform(-1.0, 1.0, lamps)
    light = room.model.light.copy()
    for fault in case.faults:
        light *= room.truth[fault] / np.maximum(room.model.light, 1e-9)
    level, walls, ceiling = generator.uniform(-1.0, 1.0, 3) * (LEVEL_OFF, WALLS_OFF, CEILING_OFF)
    of_part = {"walls": level + walls, "ceiling": level - walls + ceiling, "floor": level - walls - ceiling}
    reflectance = np.array([of_part.get(part, level - walls) for part in PARTS])
    if set(TRACED) & set(case.faults) or case.flux_off == 0.0:
        reflectance[:] = 0.0  # the traced ones hold, or none are off
    true = LightModel(light=light, slope=room.model.slope)
    return np.asarray(true.at(np.log1p(case.flux_off * share), reflectance).sum(axis=1), dtype=np.float64)


def _nrmse(light: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.mean((light - truth) ** 2)) / truth.mean())


def _bias(light: FloatArray, truth: FloatArray) -> float:
    return float((light.sum() - truth.sum()) / truth.sum())


def _root(deviation: FloatArray) -> float:
    return float(np.sqrt(np.mean(deviation**2)))
