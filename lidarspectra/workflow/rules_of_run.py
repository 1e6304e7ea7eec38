"""Hold a run's light against rules: EN 12464-1, WELL, UL DG 24480, CIE S 026, EN 17037, LM-83, and what plants need.

Every requirement gets the probability that it is kept, from all that the run does not know (`mapping.rules.chances`).
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.config import AreaSection, RulesSection
from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.mapping.calibration.model import FLUX_SD
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.photometry.annual_light import YEAR_FILE, load_year
from lidarspectra.mapping.photometry.schedule import SECONDS_PER_HOUR
from lidarspectra.mapping.photometry.week import UMOL_PER_MOL
from lidarspectra.mapping.rules.daylight_rules import daylight_criteria
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
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.pictures.glare import LEAST_UGR, Glare, Luminaires, evalglare, luminaires_of, ugr_of
from lidarspectra.radiance.pictures.render import Picture, render
from lidarspectra.radiance.pictures.view import View
from lidarspectra.workflow.calibration_light import RunRoom, run_room
from lidarspectra.workflow.picture_of_run import observer_scene, white_of
from lidarspectra.workflow.rule_light import EDI, LUX, PPFD, RuleLight, rule_light
from lidarspectra.workflow.rule_points import AreaPoints, rule_points
from lidarspectra.workflow.workspace import require_stage

EN, WELL, UL, CIE, PLANTS = "EN 12464-1", "WELL v2 L03", "UL DG 24480", "CIE S 026", "plants"
GLARE_PIXELS = 360  # of a side of a fisheye: 1e-4 sr a pixel in the middle
TRACE_SHARE = 0.6  # of the progress, with glare


@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """What a person sees who looks one way.

    Parameters
    ----------
    area : str
        Where they are.
    angle_deg : float
        Of the look, counter-clockwise from the x axis. [deg]
    picture : Picture
        A fisheye.
    luminaires : Luminaires
    glare : Glare
        By evalglare.
    """

    area: str
    angle_deg: float
    picture: Picture
    luminaires: Luminaires
    glare: Glare


@dataclass(frozen=True, kw_only=True, eq=False)
class RuleCheck:
    """A run's light against the rules.

    Parameters
    ----------
    section : RulesSection
        By which it was judged.
    areas : tuple of AreaSection
        With the one that was taken where none was given.
    criteria : tuple of Criterion
    looks : tuple of Look
        Empty where no glare was asked for.
    white_xyz : (3,) float
        Of the lamps, for the pictures.
    notes : tuple of str
        As full sentences.
    """

    section: RulesSection
    areas: tuple[AreaSection, ...]
    criteria: tuple[Criterion, ...]
    looks: tuple[Look, ...]
    white_xyz: FloatArray
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        likely = sum(each.probability >= 0.5 for each in self.criteria)
        return f"<RuleCheck: {likely} of {len(self.criteria)} requirements are more likely kept than not>"


def rules_run(run: str | PathLike[str], *, workers: int | None = None, progress: Progress = silent) -> RuleCheck:
    """Hold a finished run against the rules, by its `[rules]`.

    Parameters
    ----------
    run : str or path
        Run folder with a finished map.
    workers : int, optional
        Processes; one a core by default.
    progress : callable

    Returns
    -------
    check : RuleCheck

    Raises
    ------
    WorkspaceError
        If the run is not finished.
    RunFileError
        If an area has no place in the room.
    MapError
        If the run's channels do not cover V(λ).
    """
    run = path_of(run, name="run")
    room = run_room(run)
    section = room.run_file.rules or RulesSection()
    points = rule_points(room, section.areas)
    end = TRACE_SHARE if section.glare else 1.0
    light = rule_light(run, room, points, workers=workers, progress=part_of(progress, 0.0, end))
    looks: tuple[Look, ...] = ()
    if section.glare:
        looks = _looks(room, light, workers=workers, progress=part_of(progress, end, 1.0))
    criteria = list(_surface_criteria(section, light))
    for area in points.areas:
        if area.area.activity in WORK_PLACES:
            criteria += _area_criteria(section, area, light)
            criteria += _eye_criteria(area, light, daylit=room.run_file.daylight is not None)
            criteria += _ugr_criteria(area, light, [look for look in looks if look.area == area.area.name])
        criteria += _plant_criteria(section, area, light)
    year = run / "annual" / YEAR_FILE
    if year.is_file():
        criteria += daylight_criteria(load_year(year), light.draws, _daylight_sd(light))
    return RuleCheck(
        section=section,
        areas=tuple(each.area for each in points.areas),
        criteria=tuple(criteria),
        looks=looks,
        white_xyz=white_of(room.lamps),
        notes=_notes(run, section, light),
    )


def _mean(values: FloatArray) -> FloatArray:
    return np.asarray(values.mean(axis=-1), dtype=np.float64)


def _uniformity(values: FloatArray) -> FloatArray:
    return np.asarray(values.min(axis=-1) / np.maximum(values.mean(axis=-1), 1e-300), dtype=np.float64)


def _area_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Task area and faces, EN 12464-1."""
    area, factor = points.area, section.maintenance_factor
    place = WORK_PLACES[area.activity]
    task = light.drawn(LUX, points.task)
    wanted = place.illuminance_lx if area.illuminance_lx is None else area.illuminance_lx
    yield _of(EN, "maintained illuminance", area.name, "lx", wanted, tuple(factor * _mean(each) for each in task))
    if points.task.size > 1:
        least = place.uniformity if area.uniformity is None else area.uniformity
        yield _of(EN, "uniformity U0", area.name, "", least, tuple(_uniformity(each) for each in task))
    value, drawn = light.drawn(LUX, points.cylinder.ravel())
    around = tuple(each.reshape(*each.shape[:-1], *points.cylinder.shape).mean(axis=-1) for each in (value, drawn))
    least = place.cylindrical_lx if area.cylindrical_lx is None else area.cylindrical_lx
    yield _of(
        EN, "maintained cylindrical illuminance", area.name, "lx", least, tuple(factor * _mean(each) for each in around)
    )


def _surface_criteria(section: RulesSection, light: RuleLight) -> Iterator[Criterion]:
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
        yield _of(EN, "maintained illuminance", part, "lx", wanted[part], means)
        yield _of(EN, "uniformity U0", part, "", SURFACE_UNIFORMITY, tuple(_uniformity(each) for each in drawn))


def _eye_criteria(points: AreaPoints, light: RuleLight, *, daylit: bool) -> Iterator[Criterion]:
    """Melanopic EDI at the eye, upright, in the look that gets least."""
    worst = tuple(each.min(axis=-1) for each in light.drawn(EDI, points.eyes))
    name = points.area.name
    for points_of, limit in (WELL_DAYLIT_EDI_LX if daylit else WELL_EDI_LX).items():
        yield _of(WELL, f"melanopic EDI at the eye, {points_of}", name, "lx", limit, worst)
    yield _of(UL, "melanopic EDI at the eye for CS 0.3", name, "lx", UL_EDI_LX, worst)
    yield _of(CIE, "melanopic EDI at the eye by day (Brown 2022)", name, "lx", DAY_EDI_LX, worst)


def _plant_criteria(section: RulesSection, points: AreaPoints, light: RuleLight) -> Iterator[Criterion]:
    """Daily light integral over the photoperiod."""
    if points.area.dli_mol_m2 is None:
        return
    factor = section.photoperiod_h * SECONDS_PER_HOUR / UMOL_PER_MOL
    drawn = tuple(factor * _mean(each) for each in light.drawn(PPFD, points.task))
    what = f"daily light integral in {section.photoperiod_h:g} h"
    yield _of(PLANTS, what, points.area.name, "mol/m²", points.area.dli_mol_m2, drawn)


def _ugr_criteria(points: AreaPoints, light: RuleLight, looks: Sequence[Look]) -> Iterator[Criterion]:
    """UGR of the look that is worst."""
    if not looks:
        return
    drawn = np.stack([_ugr_draws(light, look, eye) for look, eye in zip(looks, points.eyes, strict=True)])
    limit = WORK_PLACES[points.area.activity].ugr if points.area.ugr is None else points.area.ugr
    value = max(max(look.luminaires.ugr, LEAST_UGR) for look in looks)
    parts = (np.array(value), drawn.max(axis=0))
    yield _of(EN, "UGR of luminaires", points.area.name, "", limit, parts, sense="at most")


def _ugr_draws(light: RuleLight, look: Look, eye: int) -> FloatArray:
    """(draw,) UGR of a look: luminances go with their lamps' fluxes, the background with all light and reflectances."""
    seen, model = look.luminaires, light.model(LUX, np.array([eye]))
    by_lamp = model.light[0].copy()
    direct = np.zeros_like(by_lamp)
    direct[seen.lamp] = seen.direct_lx
    indirect = np.maximum(by_lamp - direct, 0.01 * by_lamp)
    slope = model.slope[0] * (by_lamp / np.maximum(indirect, 1e-300))[:, None]  # of the reflected part alone
    factors = np.exp(light.draws.flux[:, :, None] + (light.draws.reflectance @ slope.T)[:, :, None])[..., 0]
    background = (factors @ indirect) / max(float(indirect.sum()), 1e-300) * seen.indirect_lx
    background = background * light.draws.level * light.own_error[:, eye]
    weight = seen.weight * np.exp(2.0 * light.draws.flux[:, seen.lamp])
    return np.maximum(ugr_of(weight, background), LEAST_UGR)


def _of(
    rule: str,
    what: str,
    where: str,
    unit: str,
    limit: float,
    parts: tuple[FloatArray, ...],
    *,
    sense: Sense = "at least",
) -> Criterion:
    value, draws = parts
    return Criterion(
        rule=rule, what=what, where=where, unit=unit, limit=limit, sense=sense, traced=float(value), draws=draws
    )


def _looks(room: RunRoom, light: RuleLight, *, workers: int | None, progress: Progress) -> tuple[Look, ...]:
    """Render what people see, and judge its glare."""
    points = light.points.points
    people = [area for area in light.points.areas if area.area.activity in WORK_PLACES]
    places = [(area.area.name, int(eye)) for area in people for eye in area.eyes]
    views = [
        View(
            eye=points.positions[eye],
            direction=points.normals[eye],
            projection="fisheye",
            angle_deg=180.0,
            pixels=(GLARE_PIXELS, GLARE_PIXELS),
        )
        for _, eye in places
    ]
    daylight = [number for number, lamp in enumerate(room.lamps) if is_daylight(lamp)]
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = observer_scene(room, room.lamps, Path(name))
        pictures = render(scene, views, smooth=False, workers=workers, progress=progress)
    return tuple(
        Look(
            area=area,
            angle_deg=round(float(np.degrees(np.arctan2(*points.normals[eye][1::-1]))), 1) % 360.0,
            picture=picture,
            luminaires=luminaires_of(picture, daylight=daylight),
            glare=evalglare(picture),
        )
        for (area, eye), picture in zip(places, pictures, strict=True)
    )


def _daylight_sd(light: RuleLight) -> float:
    """Relative deviation of daylight: a window's flux, known as a lamp's from its data sheet, and reflectances."""
    index: IntArray = np.concatenate([each.task for each in light.points.areas])
    reflected = (light.draws.reflectance @ light.model(LUX, index).slope.mean(axis=(0, 1))).std()
    return float(np.hypot(FLUX_SD, reflected))


def _notes(run: Path, section: RulesSection, light: RuleLight) -> tuple[str, ...]:
    assumed = assumptions_of(load_map(require_stage(run, "map") / MAP_FILE))
    notes = [
        f"EN 12464-1 asks for maintained light: the run's light is multiplied by {section.maintenance_factor:g} for it "
        "([rules] maintenance_factor), and taken as it is for glare, melanopic light and plants. Limits are those of "
        "the editions that docs/howto-rules.md names; check them against the edition that binds you."
    ]
    if assumed:
        notes.append(
            f"These probabilities rest on guesses: {assumed.in_words()}. Where a flux is guessed, it is taken as known "
            "within a factor of 1.5 (one standard deviation), so that few requirements are near 0 or 1. Write "
            "what you know into the run file, or calibrate the run by readings ('lidarspectra calibrate'), and give "
            "this command again."
        )
    if not any(light.points.surfaces):
        notes.append("Neither walls nor ceiling were found in the scan: their illuminance is left out.")
    return tuple(notes)
