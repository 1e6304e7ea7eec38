"""Hold a run's light against rules: EN 12464-1, WELL, UL DG 24480, CIE S 026, EN 17037, LM-83, and what plants need.

Every requirement gets the probability that it is kept, from all that the run does not know (`mapping.rules.chances`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.config import AreaSection, RulesSection
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.rules.limits import WORK_PLACES, Criterion
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.workflow.calibration.light import run_room
from lidarspectra.workflow.rules.criteria import (
    EN,
    UGR,
    area_criteria,
    eye_criteria,
    plant_criteria,
    surface_criteria,
    wanted_of_surfaces,
)
from lidarspectra.workflow.rules.light import RuleLight, rule_light
from lidarspectra.workflow.rules.looks import Look, looks_of_run, ugr_criteria
from lidarspectra.workflow.rules.points import RulePoints, rule_points
from lidarspectra.workflow.rules.year import year_criteria
from lidarspectra.workflow.run_folder.workspace import require_stage
from lidarspectra.workflow.scenarios.picture_of_run import white_of

TRACE_SHARE = 0.6  # of the progress, with glare


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
    absent : dict of str to tuple of str
        By rule: its requirements that were not judged, each with the reason.
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
    absent: dict[str, tuple[str, ...]]
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
        looks = looks_of_run(room, light, workers=workers, progress=part_of(progress, end, 1.0))
    criteria = list(surface_criteria(section, light))
    for area in points.areas:
        if area.area.activity in WORK_PLACES:
            criteria += area_criteria(section, area, light)
            criteria += eye_criteria(section, area, light)
            criteria += ugr_criteria(area, light, [look for look in looks if look.area == area.area.name])
        criteria += plant_criteria(section, area, light)
    of_year, year_notes = year_criteria(run, light)
    criteria += of_year
    absent = not_judged(section, points, criteria, lit=bool(light.electric.any()))
    return RuleCheck(
        section=section,
        areas=tuple(each.area for each in points.areas),
        criteria=tuple(criteria),
        absent=absent,
        looks=looks,
        white_xyz=white_of(room.lamps),
        notes=(*_notes(run, section, light), *_absent_notes(absent), *year_notes),
    )


def not_judged(
    section: RulesSection, points: RulePoints, criteria: Sequence[Criterion], *, lit: bool = True
) -> dict[str, tuple[str, ...]]:
    """By rule, what it asks of such areas and was not judged, each with the reason in brackets.

    Parameters
    ----------
    section : RulesSection
    points : RulePoints
    criteria : sequence of Criterion
        What was judged.
    lit : bool
        Whether any lamp is.
    """
    areas = [each.area for each in points.areas]
    wanted = wanted_of_surfaces(section, areas)
    found = [f"{part} (none, or no free point of them, in the scan)" for part in wanted if part not in points.surfaces]
    judged = {each.where for each in criteria if each.what == UGR}
    work = [area.name for area in areas if area.activity in WORK_PLACES]
    if work and not section.glare:
        found.append("UGR (glare = false in [rules])")
    elif missing := [name for name in work if name not in judged]:
        reason = "no reflected light behind the luminaires" if lit else "no lamp is lit"
        found.append(f"UGR in {', '.join(missing)} ({reason})")
    return {EN: tuple(found)} if found else {}


def _absent_notes(absent: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    return tuple(
        f"Not judged of {rule}: {'; '.join(missing)}. Its probability as a whole is of the requirements that were "
        "judged, so that it proves nothing of these: see to them before you call the rule kept."
        for rule, missing in absent.items()
    )


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
            "within a factor of 1.5 (one standard deviation), where the lamps' places are too within one of 2.5, so "
            "that few requirements are near 0 or 1. Write "
            "what you know into the run file, or calibrate the run by readings ('lidarspectra calibrate'), and give "
            "this command again."
        )
    beneath = [f"{each.beneath} of '{each.area.name}'" for each in light.points.areas if each.beneath]
    if beneath:
        notes.append(
            f"Points of the task that something is over below people's eyes are left out, as under a table top: "
            f"{', '.join(beneath)}. If people work on top of it, give that area its height ([[rules.areas]] height)."
        )
    if not light.electric.all():
        notes.append(
            "The run has daylight, of one moment. What EN 12464-1, UL DG 24480 and CIE S 026 ask is judged with it; "
            "WELL L03 and the daily light integral of plants by the electric lamps alone, since daylight is not there "
            "whenever they are lit. To judge EN 12464-1 by electric light, make a run without [daylight]."
        )
    return tuple(notes)
