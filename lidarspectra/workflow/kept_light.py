"""Which edits of lamps leave materials, scene and trace as they are.

The materials stage takes the light of the scan's picture out of its colours. That light is touched by a lamp's place,
spectrum and flux relative to the other lamps while it was scanned; not by its name, by `dim`, or by a factor that all
fluxes have in common. Scene and trace hold each lamp's light by itself: another name, flux or dimming is exact without
tracing again, and another spectrum as long as the slots that were traced carry it as well as a new trace would
(`radiance.scene.relit_scene`).
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from lidarspectra.config import RunFile
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.radiance.scene.relit_scene import flux_ratio, knows_reflectances, largest_error, relighting_error
from lidarspectra.radiance.scene.scene_record import RadianceScene
from lidarspectra.words import two_digits
from lidarspectra.workflow.checks.findings import listed
from lidarspectra.workflow.run_folder.calibration_of_run import calibrated_lamps
from lidarspectra.workflow.run_folder.lamps_of_run import lit_lamps, resolve_lamps, with_estimated_fluxes
from lidarspectra.workflow.run_folder.workspace import StageRecord

Settings = Mapping[str, Any]
Table = dict[str, Any]
NAME_KEYS = ("name", "assumed", "flux_deviation")  # which no light depends on
FLUX_KEYS = ("luminous_flux_lm", "radiant_flux_W")
LIGHT_KEYS = (*NAME_KEYS, *FLUX_KEYS, "spectrum", "cct_k", "dim", "dim_in_scan")
FOUND_LIGHT_KEYS = ("spectrum", "cct_k", "luminous_exitance_lm_m2")
SAME_RATIO = 1e-9  # [1] relative difference of factors that are one number


def present_lamps(
    run_file: RunFile, written: Sequence[Lamp], materials_folder: Path, *, base: Path
) -> tuple[Lamp, ...]:
    """The lamps of a scene with the names, fluxes and spectra that the run file gives them now.

    Parameters
    ----------
    run_file : RunFile
        With lamps in the same places.
    written : sequence of Lamp
        Which the scene was written with: the run file's or those found in the scan, then daylight's.
    materials_folder : Path
        Of the materials stage, with estimated fluxes.
    base : Path
        Where relative file names start.

    Returns
    -------
    lamps : tuple of Lamp
        In the same order and places; daylight is as it was, with its calibration.
    """
    outside = {"sun", *(window.name for window in run_file.daylight.windows)} if run_file.daylight else set()
    inside = [lamp for lamp in written if lamp.name not in outside]
    if run_file.lamps_from_scan is not None:
        named = lit_lamps(run_file.lamps_from_scan, inside, base)
    else:
        named = resolve_lamps(run_file.lamps, base)
    daylight = tuple(written[len(inside) :])
    now = calibrated_lamps((*with_estimated_fluxes(named, materials_folder), *daylight), run_file.calibration)
    lit = zip(inside, now, strict=False)  # where they were moved to
    return (*(replace(lamp, name=new.name, flux=new.flux) for lamp, new in lit), *daylight)


def same_picture_light(then: Settings, now: Settings) -> bool:
    """Whether the light of the scan's picture is the same for two settings of the materials stage, but for a factor.

    Parameters
    ----------
    then, now : mapping
        Settings of the stage's record, and its present ones.
    """
    before, after = _copy(then), _copy(now)
    strengths = [_taken_strengths(each) for each in (before, after)]
    return before == after and _proportional(*strengths)


def same_room(then: Settings, now: Settings) -> bool:
    """Whether two settings of the scene stage differ in nothing but names, fluxes and spectra of its lamps.

    Parameters
    ----------
    then, now : mapping
        Settings of the stage's record, and its present ones.
    """
    before, after = _copy(then), _copy(now)
    for settings in (before, after):
        _take_light_out(settings)
    return bool(before == after)


def why_not_relit(scene: RadianceScene, written: Sequence[Lamp], present: Sequence[Lamp]) -> str | None:
    """Why light has to be traced again for the present lamps, as a sentence; None if relighting is as good.

    Parameters
    ----------
    scene : RadianceScene
    written, present : sequence of Lamp
        Which it was written with, and the same lamps as they are now.
    """
    for row, (before, after) in enumerate(zip(written, present, strict=True)):
        if flux_ratio(before.flux, after.flux) is not None:
            continue
        error = abs(relighting_error(scene, row, after.flux)).max() if knows_reflectances(scene) else float("inf")
        if error > largest_error(scene):
            by = f"by about {two_digits(100 * error)} % wrong" if error < 1 else "wrong by an unknown amount"
            return (
                f"The light is traced again, because lamp '{after.name}' has another spectrum: in the slots of the "
                f"last trace its reflected light would be {by}, and {two_digits(100 * largest_error(scene))} % is "
                "allowed."
            )
    return None


def relit_notes(light_map: xr.Dataset, traced: Sequence[Lamp], present: Sequence[Lamp]) -> tuple[str, ...]:
    """Notes to a map whose light was traced for other fluxes or spectra of its lamps.

    Parameters
    ----------
    light_map : xarray.Dataset
        With attributes that state its error.
    traced, present : sequence of Lamp
        The same lamps in the same order.
    """
    pairs = zip(traced, present, strict=True)
    changed = [f"'{after.name}'" for before, after in pairs if flux_ratio(before.flux, after.flux) != 1.0]
    if not changed:
        return ()
    notes = [
        f"Flux or spectrum of {listed(changed)} changed since the light was traced: the map is made of each lamp's "
        "traced light, which is as exact. The exported Radiance model (5-trace/model) still has the lamps as they were "
        "traced; 'lidarspectra run ROOM.toml --from scene' makes it again."
    ]
    achieved, target = (light_map.attrs[f"{kind}_relative_se"] for kind in ("achieved", "target"))
    if achieved > target:
        notes.append(
            f"Under the present lamps its standard error is {100 * achieved:.1f} % of the mean, above the target of "
            f"{100 * target:.1f} %, because paths were spent on the lamps as they were traced. The map is right within "
            "these error bars; 'lidarspectra run ROOM.toml --from scene' traces it to the target."
        )
    return tuple(notes)


def with_present_names(record: StageRecord, then: Sequence[str], now: Sequence[str]) -> StageRecord:
    """A stage's record whose sentences call its lamps by their present names.

    Parameters
    ----------
    record : StageRecord
    then, now : sequence of str
        The lamps' names when the stage was made, and now, in the same order.
    """
    names = {f"'{before}'": f"'{after}'" for before, after in zip(then, now, strict=False) if before != after}
    if not names:
        return record
    pattern = re.compile("|".join(map(re.escape, names)))
    warnings = tuple(pattern.sub(lambda found: names[found[0]], warning) for warning in record.warnings)
    return replace(record, warnings=warnings)


def lamp_names(settings: Settings) -> tuple[str, ...]:
    """Names of the lamps in a stage's settings, in their order."""
    return tuple(str(lamp["name"]) for lamp in _tables(settings, "lamps"))


def _copy(settings: Settings) -> Table:
    """A deep copy as JSON has it, in which lists are lists."""
    copy: Table = json.loads(json.dumps(settings))
    return copy


def _tables(settings: Settings, key: str) -> list[Table]:
    found = settings.get("run_file", {}).get(key)
    return [found] if isinstance(found, dict) else found or []


def _taken_strengths(settings: Table) -> list[tuple[str, float]]:
    """Take names and fluxes out of settings; gives how each lamp's flux was stated, and how strong it was."""
    strengths = []
    for lamp in _tables(settings, "lamps"):
        kind = next((key for key in FLUX_KEYS if lamp.get(key) is not None), "its own")
        strengths.append((kind, float(lamp.get(kind, 1.0)) * float(lamp.get("dim_in_scan", 1.0))))
        for key in (*NAME_KEYS, *FLUX_KEYS, "dim", "dim_in_scan"):
            lamp.pop(key, None)
    for found in _tables(settings, "lamps_from_scan"):
        found.pop("luminous_exitance_lm_m2", None)
    return strengths


def _proportional(then: list[tuple[str, float]], now: list[tuple[str, float]]) -> bool:
    """Whether strengths that are stated alike differ by one factor."""
    if [kind for kind, _ in then] != [kind for kind, _ in now]:
        return False
    pairs = [(before, after) for (_, before), (_, after) in zip(then, now, strict=True)]
    if any((before == 0) != (after == 0) for before, after in pairs):
        return False
    ratios = [after / before for before, after in pairs if before > 0]
    return not ratios or max(ratios) - min(ratios) <= SAME_RATIO * max(ratios)


def _take_light_out(settings: Table) -> None:
    """Take names, fluxes and spectra out of settings; whether a lamp is lit at all stays."""
    settings.pop("databases", None)  # of lamps alone; what they say now is compared lamp by lamp
    windows = {str(window["name"]) for window in _tables(settings, "daylight.windows")} | {"sun"}
    calibration = settings["run_file"].pop("calibration", None) or {}
    settings["calibration"] = {  # of what is not relit, and is not 1
        "daylight": {name: factor for name, factor in _factors(calibration, "lamps") if name in windows},
        "reflectance": dict(_factors(calibration, "reflectance")),
    }
    spectra = set()
    for lamp in _tables(settings, "lamps"):
        spectra.add(lamp.get("spectrum"))
        lamp["is lit"] = lamp.get("dim", 1.0) > 0
        for key in LIGHT_KEYS:
            lamp.pop(key, None)
    for found in _tables(settings, "lamps_from_scan"):
        spectra.add(found.get("spectrum"))
        for key in FOUND_LIGHT_KEYS:
            found.pop(key, None)
    settings["files"] = {name: digest for name, digest in settings.get("files", {}).items() if name not in spectra}


def _factors(calibration: Table, key: str) -> list[tuple[str, float]]:
    """Factors of a calibration that change anything."""
    return [(name, factor) for name, factor in (calibration.get(key) or {}).items() if factor != 1.0]
