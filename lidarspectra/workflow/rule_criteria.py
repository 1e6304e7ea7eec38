"""What rules ask of light at areas, at surfaces, at eyes and for plants, of a run's light in every state."""

from collections.abc import Iterator

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import RulesSection
from lidarspectra.mapping.photometry.schedule import SECONDS_PER_HOUR
from lidarspectra.mapping.photometry.week import UMOL_PER_MOL
from lidarspectra.mapping.rules.limits import (
    DAY_EDI_LX,
    SURFACE_UNIFORMITY,
    UL_EDI_LX,
    WELL_DAYLIT_EDI_LX,
    WELL_EDI_LX,
    WORK_PLACES,
    Criterion,
    Sense,
)
from lidarspectra.workflow.rule_light import EDI, LUX, PPFD, RuleLight
from lidarspectra.workflow.rule_points import AreaPoints

EN, WELL, UL, CIE, PLANTS = "EN 12464-1", "WELL v2 L03", "UL DG 24480", "CIE S 026", "plants"


def _mean(values: FloatArray) -> FloatArray:
    return np.asarray(values.mean(axis=-1), dtype=np.float64)


def _uniformity(values: FloatArray) -> FloatArray:
    return np.asarray(values.min(axis=-1) / np.maximum(values.mean(axis=-1), 1e-300), dtype=np.float64)


def area_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Task area and faces, EN 12464-1."""
    area, factor = points.area, section.maintenance_factor
    place = WORK_PLACES[area.activity]
    task = light.drawn(LUX, points.task)
    wanted = place.illuminance_lx if area.illuminance_lx is None else area.illuminance_lx
    yield criterion(EN, "maintained illuminance", area.name, "lx", wanted, tuple(factor * _mean(each) for each in task))
    if points.task.size > 1:
        least = place.uniformity if area.uniformity is None else area.uniformity
        yield criterion(EN, "uniformity U0", area.name, "", least, tuple(_uniformity(each) for each in task))
    value, drawn = light.drawn(LUX, points.cylinder.ravel())
    around = tuple(each.reshape(*each.shape[:-1], *points.cylinder.shape).mean(axis=-1) for each in (value, drawn))
    least = place.cylindrical_lx if area.cylindrical_lx is None else area.cylindrical_lx
    yield criterion(
        EN, "maintained cylindrical illuminance", area.name, "lx", least, tuple(factor * _mean(each) for each in around)
    )


def surface_criteria(section: RulesSection, light: RuleLight) -> Iterator[Criterion]:
    """Walls and ceiling, EN 12464-1: the highest that the areas' activities ask for."""
    places = [WORK_PLACES[each.area.activity] for each in light.points.areas if each.area.activity in WORK_PLACES]
    highest = {
        "walls": max((each.walls_lx for each in places), default=0.0),
        "ceiling": max((each.ceiling_lx for each in places), default=0.0),
    }
    given = {"walls": section.walls_lx, "ceiling": section.ceiling_lx}
    wanted = {part: highest[part] if given[part] is None else float(given[part] or 0.0) for part in highest}
    for part, index in light.points.surfaces.items():
        if wanted[part] <= 0.0:
            continue  # no people work here
        drawn = light.drawn(LUX, index)
        means = tuple(section.maintenance_factor * _mean(each) for each in drawn)
        yield criterion(EN, "maintained illuminance", part, "lx", wanted[part], means)
        yield criterion(EN, "uniformity U0", part, "", SURFACE_UNIFORMITY, tuple(_uniformity(each) for each in drawn))


def eye_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Melanopic EDI at the eye, upright, in the look that gets least; WELL asks it of electric light."""
    electric, worst = (
        tuple(each.min(axis=-1) for each in light.drawn(EDI, points.eyes, lamps=lamps))
        for lamps in (light.electric, None)
    )
    name = points.area.name
    limits = WELL_DAYLIT_EDI_LX if section.well_daylight_points else WELL_EDI_LX
    for points_of, limit in limits.items():
        yield criterion(WELL, f"melanopic EDI at the eye by electric light, {points_of}", name, "lx", limit, electric)
    yield criterion(UL, "melanopic EDI at the eye for CS 0.3", name, "lx", UL_EDI_LX, worst)
    yield criterion(CIE, "melanopic EDI at the eye by day (Brown 2022)", name, "lx", DAY_EDI_LX, worst)


def plant_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Daily light integral of the electric lamps, over the photoperiod: daylight does not last as long."""
    if points.area.dli_mol_m2 is None:
        return
    factor = section.photoperiod_h * SECONDS_PER_HOUR / UMOL_PER_MOL
    drawn = tuple(factor * _mean(each) for each in light.drawn(PPFD, points.task, lamps=light.electric))
    what = f"daily light integral of the lamps in {section.photoperiod_h:g} h"
    yield criterion(PLANTS, what, points.area.name, "mol/m²", points.area.dli_mol_m2, drawn)


def criterion(
    rule: str,
    what: str,
    where: str,
    unit: str,
    limit: float,
    parts: tuple[FloatArray, ...],
    *,
    sense: Sense = "at least",
) -> Criterion:
    """A requirement of a quantity as traced and as drawn."""
    value, draws = parts
    return Criterion(
        rule=rule, what=what, where=where, unit=unit, limit=limit, sense=sense, traced=float(value), draws=draws
    )
