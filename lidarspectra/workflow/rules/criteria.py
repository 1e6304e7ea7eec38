"""What rules ask of light at areas, at surfaces, at eyes and for plants, of a run's light in every state."""

from collections.abc import Iterator, Sequence

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import AreaSection, RulesSection
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
from lidarspectra.room.surface_parts import Part
from lidarspectra.workflow.rules.light import EDI, LUX, PPFD, RuleLight
from lidarspectra.workflow.rules.points import AreaPoints

EN, WELL, UL, CIE, PLANTS = "EN 12464-1", "WELL v2 L03", "UL DG 24480", "CIE S 026", "plants"
UGR = "UGR of luminaires"


def area_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Task area and faces, EN 12464-1."""
    area, factor = points.area, section.maintenance_factor
    place = WORK_PLACES[area.activity]
    task = light.drawn(LUX, points.task)
    wanted = place.illuminance_lx if area.illuminance_lx is None else area.illuminance_lx
    yield criterion(EN, "maintained illuminance", area.name, "lx", wanted, task.mean(), factor=factor)
    if points.task.size > 1:
        least = place.uniformity if area.uniformity is None else area.uniformity
        yield criterion(EN, "uniformity U0", area.name, "", least, task.uniformity())
    sides = points.cylinder.shape[1]
    around = light.drawn(LUX, points.cylinder.ravel()).grouped(np.arange(points.cylinder.size).reshape(-1, sides))
    wanted = place.cylindrical_lx if area.cylindrical_lx is None else area.cylindrical_lx
    what = "maintained cylindrical illuminance"
    yield criterion(EN, what, area.name, "lx", wanted, around.mean(), factor=factor)
    if len(points.cylinder) > 1:
        what = "uniformity U0 of cylindrical illuminance"
        yield criterion(EN, what, area.name, "", SURFACE_UNIFORMITY, around.uniformity())


def surface_criteria(section: RulesSection, light: RuleLight) -> Iterator[Criterion]:
    """Walls and ceiling, EN 12464-1: the highest that the areas' activities ask for."""
    for part, wanted in wanted_of_surfaces(section, [each.area for each in light.points.areas]).items():
        if part not in light.points.surfaces:
            continue
        drawn = light.drawn(LUX, light.points.surfaces[part])
        what = "maintained illuminance"
        yield criterion(EN, what, part, "lx", wanted, drawn.mean(), factor=section.maintenance_factor)
        yield criterion(EN, "uniformity U0", part, "", SURFACE_UNIFORMITY, drawn.uniformity())


def wanted_of_surfaces(section: RulesSection, areas: Sequence[AreaSection]) -> dict[Part, float]:
    """Mean illuminance that walls and ceiling must have [lx]; those that no activity asks any of are left out."""
    places = [WORK_PLACES[area.activity] for area in areas if area.activity in WORK_PLACES]
    walls = max((each.walls_lx for each in places), default=0.0) if section.walls_lx is None else section.walls_lx
    ceiling = max((each.ceiling_lx for each in places), default=0.0)
    ceiling = ceiling if section.ceiling_lx is None else section.ceiling_lx
    wanted: dict[Part, float] = {"walls": walls, "ceiling": ceiling}
    return {part: lux for part, lux in wanted.items() if lux > 0}


def eye_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Melanopic EDI at the eye, upright, in the look that gets least; WELL asks it of electric light."""
    electric, worst = (light.drawn(EDI, points.eyes, lamps=lamps).least() for lamps in (light.electric, None))
    name = points.area.name
    limits = WELL_DAYLIT_EDI_LX if section.well_daylight_points else WELL_EDI_LX
    for tier, limit in limits.items():
        yield criterion(f"{WELL}, {tier}", "melanopic EDI at the eye by electric light", name, "lx", limit, electric)
    yield criterion(UL, "melanopic EDI at the eye for CS 0.3", name, "lx", UL_EDI_LX, worst)
    yield criterion(CIE, "melanopic EDI at the eye by day (Brown 2022)", name, "lx", DAY_EDI_LX, worst)


def plant_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Daily light integral of the electric lamps, over the photoperiod: daylight does not last as long."""
    if points.area.dli_mol_m2 is None:
        return
    factor = section.photoperiod_h * SECONDS_PER_HOUR / UMOL_PER_MOL
    drawn = light.drawn(PPFD, points.task, lamps=light.electric).mean()
    what = f"daily light integral of the lamps in {section.photoperiod_h:g} h"
    yield criterion(PLANTS, what, points.area.name, "mol/m²", points.area.dli_mol_m2, drawn, factor=factor)


def criterion(
    rule: str,
    what: str,
    where: str,
    unit: str,
    limit: float,
    parts: tuple[float, FloatArray],
    *,
    factor: float = 1.0,
    sense: Sense = "at least",
) -> Criterion:
    """A requirement of a quantity as traced and as drawn, both times a factor."""
    value, draws = parts
    return Criterion(
        rule=rule,
        what=what,
        where=where,
        unit=unit,
        limit=limit,
        sense=sense,
        traced=factor * value,
        draws=factor * draws,
    )
