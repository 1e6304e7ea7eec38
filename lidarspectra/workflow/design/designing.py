"""Inverse lighting: from targets of light to dimming, spectra and places of a run's lamps (docs/howto-design.md)."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.config import RunFile
from lidarspectra.errors import RunFileError
from lidarspectra.mapping.design.conditions import Condition
from lidarspectra.mapping.design.figures import ShownLamp, ShownLight, design_figure
from lidarspectra.mapping.design.problem import Freedom, Problem
from lidarspectra.mapping.design.solving import Obstacles, Solution, obstacles, solve
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.spectra.spectrum_files import write_spectrum_file
from lidarspectra.workflow.calibration.light import RunRoom, run_room
from lidarspectra.workflow.design.designed_run_file import (
    FOLDER,
    designed_run_file,
    mixtures_of,
    same_trace,
)
from lidarspectra.workflow.design.lamps import DesignedLamp, DesignLamps, design_lamps
from lidarspectra.workflow.design.light import (
    CHECK_SEED,
    DesignLight,
    TracedLamps,
    light_with_candidates,
    present_light,
    run_points,
    trace_lamps,
)
from lidarspectra.workflow.design.notes import design_notes, shortfall_words
from lidarspectra.workflow.design.points import TargetPoints, target_points
from lidarspectra.workflow.design.tables import check_table, lamps_table, targets_table
from lidarspectra.workflow.design.target import Target, read_target
from lidarspectra.workflow.design.work import DesignWork, conditions_of
from lidarspectra.workflow.run_folder.assumed import notes_of_light
from lidarspectra.workflow.run_folder.light_of_run import transport_of_run
from lidarspectra.workflow.run_folder.workspace import STAGES, Workspace, require_stage, stage_folder, writing_run

SHARES = (0.2, 0.7)  # of the progress, after the light as it is, and after that of candidates
FIGURE = "before-after"
OFF = 1e-7  # [1] of its flux below which a lamp is off: the solver's own tolerance


@dataclass(frozen=True, kw_only=True, eq=False)
class Design:
    """A design of a run's lamps.

    Parameters
    ----------
    lamps : Table
        Dimming, spectrum, flux and power of every lamp.
    targets : Table
        What is asked, what there is before, and what is predicted with its standard error.
    is_met : bool
        Whether all that must hold does.
    power_W, power_before_W : float
        Of the lamps that may be changed. [W]
    run_file : RunFile
        Of the room with the lamps as designed.
    notes : tuple of str
        As full sentences; where `is_met` is false, the first says by how much, and what limits.
    work : DesignWork
        For `save_design` and `check_design`.
    """

    lamps: Table
    targets: Table
    is_met: bool
    power_W: float  # noqa: N815 - watts are W
    power_before_W: float  # noqa: N815
    run_file: RunFile
    notes: tuple[str, ...]
    work: DesignWork

    def __repr__(self) -> str:
        lit = sum(bool(each.shares) for each in self.work.designed)
        words = "all targets met" if self.is_met else "targets not met"
        return f"<Design: {lit} of {len(self.work.designed)} lamps lit, {self.power_W:.4g} W, {words}>"


def design_lighting(
    run: str | PathLike[str],
    target: str | PathLike[str] | Mapping[str, Any],
    *,
    workers: int | None = None,
    progress: Progress = silent,
) -> Design:
    """Find dimming, spectra or places of lamps that give the light that is wanted, with the least power.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace. It stays as it is.
    target : str, path or mapping
        A target file (docs/howto-design.md), or its tables:
        `{"targets": [{"name": "desks", "polygon": [...], "at_least": 500}], "lamps": {"efficacy_lm_W": 120}}`.
    workers : int, optional
        Processes, where candidates or places of one's own are traced; one a core by default.
    progress : callable

    Returns
    -------
    design : Design
        Where the targets cannot all be met, the one that misses them least.

    Raises
    ------
    RunFileError
        If the target is malformed, or names points or lamps that there are not.
    LampError, DatabaseError
        If a spectrum is unknown or cannot be scaled.
    MapError
        If the solver finds nothing in its time.
    WorkspaceError
        If the run has no finished trace.
    """
    run = path_of(run, name="run")
    given, where, base = read_target(target)
    room = run_room(run)
    _require_cosine(room, run)
    lamps = design_lamps(given, room, where=where, base=base)
    places = transport_of_run(run)
    points, own = target_points(given.targets, room, places, where=where)
    present = present_light(run, room, places, own, workers=workers, progress=part_of(progress, 0.0, SHARES[0]))
    conditions = tuple(
        (condition, spots)
        for section, spots in zip(given.targets, points, strict=True)
        for condition in conditions_of(section, room.bands, where=where, base=base)
    )
    work, problem, solution = _best(given, room, lamps, present, conditions, workers, progress)
    _require_light(work, where)
    values = work.predicted
    held = [condition.holds(value) for (condition, _), (value, _) in zip(conditions, values, strict=True)]
    blocked: Obstacles | None = None if all(held) or solution.is_met else obstacles(problem)
    progress(1.0, "done")
    shortfall = () if all(held) else (shortfall_words(conditions, values, blocked),)
    return Design(
        lamps=lamps_table(work.designed, lamps.fixed, lamps.removed),
        targets=targets_table([condition for condition, _ in conditions], work.before, values),
        is_met=all(held),
        power_W=sum(each.watts for each in work.designed),
        power_before_W=lamps.watts_before,
        run_file=designed_run_file(work.designed, lamps, room, run=run, base=base),
        notes=(
            *shortfall,
            *design_notes(work.designed, lamps, work.light, conditions, room, solution.gap),
            *notes_of_light(run),
        ),
        work=work,
    )


def _best(
    given: Target,
    room: RunRoom,
    lamps: DesignLamps,
    present: DesignLight,
    conditions: tuple[tuple[Condition, TargetPoints], ...],
    workers: int | None,
    progress: Progress,
) -> tuple[DesignWork, Problem, Solution]:
    """The design, and the problem that it solves.

    Of candidates the first trace finds the places; those that are chosen are traced anew as they will hang, and their
    dimming is solved again in that light.
    """
    light = present
    has_candidates = any(each.is_candidate for each in lamps.free)
    if has_candidates:
        part = part_of(progress, SHARES[0], SHARES[1])
        light = light_with_candidates(present, room, lamps, small=True, workers=workers, progress=part)
    progress(SHARES[1], "solving")
    problem = _problem(given, lamps, light, conditions)
    solution = solve(problem)
    designed = _designed(lamps, solution)
    chosen = replace(lamps, free=tuple(each.of for each in designed if each.shares))
    if has_candidates and chosen.free:
        part = part_of(progress, SHARES[1], 1.0)
        light = light_with_candidates(present, room, chosen, small=False, workers=workers, progress=part)
        progress(1.0, "solving")
        again = _problem(given, chosen, light, conditions)
        was_met, exact = solution.is_met, solve(again)
        exact = replace(exact, gap=max(exact.gap, solution.gap))
        by_name = {each.of.lamp.name: each for each in _designed(chosen, exact)}
        designed = tuple(by_name.get(each.of.lamp.name, each) for each in designed)
        problem, solution = (again, exact) if was_met else (problem, exact)
    work = DesignWork(room=room, target=given, lamps=lamps, light=light, conditions=conditions, designed=designed)
    return work, problem, solution


def _problem(
    given: Target, lamps: DesignLamps, light: DesignLight, conditions: Sequence[tuple[Condition, TargetPoints]]
) -> Problem:
    limits, aims = [], []
    for condition, points in conditions:
        if condition.kind == "spectrum":
            channels, rest = light.channels(points, lamps)
            aims.append(condition.form(channels, rest, light.run.bands.centers_nm))
            continue
        weights, fixed = light.weights(points, lamps, condition.quantity.response)
        if condition.is_hard:
            limits.append(condition.limit(weights, fixed))
        else:
            aims.append(condition.level(weights, fixed))
    section = given.lamps
    freedom = Freedom(
        max_lamps=section.count,
        dimmable=section.dimmable,
        min_dim=section.min_dim,
        mix=section.mix,
        least=section.least,
    )
    return Problem(sources=lamps.sources, limits=tuple(limits), aims=tuple(aims), freedom=freedom)


def _designed(lamps: DesignLamps, solution: Solution) -> tuple[DesignedLamp, ...]:
    dims = _rounded_up(solution.dims)
    starts = np.cumsum([0, *(len(free.choices) for free in lamps.free)])
    found = []
    for free, start in zip(lamps.free, starts, strict=False):
        pairs = zip(free.choices, dims[start:].tolist(), strict=False)
        found.append(DesignedLamp(of=free, shares=tuple((choice, dim) for choice, dim in pairs if dim > 0)))
    return tuple(found)


def _rounded_up(dims: FloatArray) -> FloatArray:
    """Dims as they are written: four digits that count, so that a strong lamp that glows is as exact as a full one."""
    step = 10.0 ** (np.floor(np.log10(np.maximum(dims, OFF))) - 3.0)
    rounded = np.minimum(np.ceil(dims / step - 1e-3) * step, 1.0)
    return np.asarray(np.where(dims < OFF, 0.0, rounded), dtype=np.float64)


def _require_light(work: DesignWork, where: str) -> None:
    if not work.fluxes:
        raise RunFileError(
            expected="targets that ask for light",
            found="targets that a dark room comes nearest to",
            where=where,
            todo="Give at_least, or an about that the lamps can reach.",
        )


def _require_cosine(room: RunRoom, run: Path) -> None:
    sensors = room.run_file.sensors
    if sensors.receptor is not None or sensors.field_of_view_deg is not None:
        raise RunFileError(
            expected="the cosine receptor, by which illuminance and the other quantities are defined",
            found="receptor" if sensors.receptor is not None else "field_of_view_deg",
            where=f"[sensors] of {run}",
            todo="Leave it out in the run file of the design, and run it again.",
        )


def save_design(design: Design, run: str | PathLike[str], *, force: bool = False) -> tuple[Path, Path]:
    """Write the designed run file beside the run's, a run folder for it with all it can take over, tables and figure.

    Parameters
    ----------
    design : Design
    run : str or path
        The folder that was designed for.
    force : bool
        Replace a run file that is there.

    Returns
    -------
    run_file, folder : Path
        The run file, to be run, and the folder design in the run folder: design.csv, targets.csv, before-after.png.

    Raises
    ------
    RunFileError, WorkspaceError, MapError
        If there is such a run file already, or something cannot be written.
    """
    run = path_of(run, name="run")
    work, folder = design.work, path_of(run, name="run") / FOLDER
    path = design.run_file.save(design.run_file.folder / f"{design.run_file.name}.toml", force=force)
    target = path.with_suffix(".run")
    kept = STAGES[:5] if same_trace(work.designed, work.lamps) else STAGES[:3]
    with Workspace(target), writing_run(target):
        for stage in kept:
            if not stage_folder(target, stage).exists():
                shutil.copytree(require_stage(run, stage), stage_folder(target, stage))
    with writing_run(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for file, flux in mixtures_of(work.designed, work.room).values():
            write_spectrum_file(folder / file, flux)
    for table in (design.lamps, design.targets):
        save_table(table, folder)
    save_figure(_figure(work), folder, FIGURE)
    return path, folder


def check_design(design: Design, *, workers: int | None = None, progress: Progress = silent) -> Table:
    """Trace the designed light anew, with other random numbers, and compare it with what was predicted.

    Parameters
    ----------
    design : Design
    workers : int, optional
    progress : callable

    Returns
    -------
    check : Table
        Every target: what is asked, predicted and traced, with standard errors, and how many of them they are apart.
    """
    work = design.work
    fluxes, room = work.fluxes, work.room
    own = None if work.light.own is None else run_points(work.light.own.transport)
    parts = [run_points(work.light.places), *([] if own is None else [own])]
    found = []
    for number, points in enumerate(parts):
        part = part_of(progress, number / len(parts), (number + 1) / len(parts))
        transport = trace_lamps(room, work.lit_lamps, points, seed=CHECK_SEED + number, workers=workers, progress=part)
        found.append(TracedLamps(transport=transport, fluxes=fluxes, bands=room.bands))
    traced = work.values(found[0], found[1] if own is not None else None, fluxes)
    return check_table([condition for condition, _ in work.conditions], work.predicted, traced)


def _figure(work: DesignWork) -> Figure:
    """Before and after, for each quantity that is asked for."""
    after = work.light.run.lit(work.fluxes)
    before = work.light.run_before.lit(work.light.run_before.fluxes)
    quantities = {condition.quantity.name: condition.quantity for condition, _ in work.conditions}
    shown = [
        ShownLight(
            words=quantity.words,
            unit=quantity.unit,
            before=before.weigh(quantity.response)[0],
            after=after.weigh(quantity.response)[0],
        )
        for quantity in quantities.values()
    ]
    dims = {section.name: section.dim for section in work.room.run_file.lamps}
    removed = [lamp for lamp in work.room.lamps if lamp.name in work.lamps.removed]
    lamps = [
        *(ShownLamp(lamp=lamp, before=1.0, after=1.0) for lamp in work.lamps.fixed),
        *(ShownLamp(lamp=lamp, before=dims.get(lamp.name, 1.0), after=None) for lamp in removed),
        *(
            ShownLamp(
                lamp=each.of.lamp,
                before=None if each.of.is_candidate else each.of.present_dim,
                after=each.dim,
            )
            for each in work.designed
        ),
    ]
    areas = [(target.name, np.array(target.polygon)) for target in work.target.targets if target.polygon is not None]
    return design_figure(shown, work.light.places, floor_plan(work.room.scan, work.room.room), lamps, areas)
