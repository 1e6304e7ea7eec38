"""A room as its `[calibration]` has it: factors on the lamps' fluxes and on the reflectances of its parts."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import CalibrationSection, parse_run_file
from lidarspectra.errors import LampError, WorkspaceError
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import MaterialMap, load_materials
from lidarspectra.material.scaled import scaled_material, scaled_materials
from lidarspectra.room.room import load_room
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom
from lidarspectra.workflow.run_folder.workspace import read_request, require_stage


def calibrated_lamps(lamps: tuple[Lamp, ...], section: CalibrationSection | None) -> tuple[Lamp, ...]:
    """Lamps with the factors on their fluxes.

    Parameters
    ----------
    lamps : tuple of Lamp
        Windows and the sun among them.
    section : CalibrationSection or None
        Lamps without a factor stay.

    Returns
    -------
    lamps : tuple of Lamp

    Raises
    ------
    LampError
        If a factor is for a lamp that there is not.
    """
    factors = {} if section is None else section.lamps
    names = [lamp.name for lamp in lamps]
    for name in factors:
        if name not in names:
            raise LampError(
                expected=f"one of the run's lamps ({', '.join(names)})",
                found=f"'{name}'",
                where="lamps under [calibration]",
                todo="Give the factor under the lamp's new name, or calibrate again.",
            )
    return tuple(replace(lamp, flux=lamp.flux.scaled(factors.get(lamp.name, 1.0))) for lamp in lamps)


def calibrated_materials(
    materials: MaterialMap, scanned: ScannedRoom, section: CalibrationSection | None
) -> MaterialMap:
    """Materials with the factors on the parts' reflectances; the same object where there are none."""
    factors = _part_factors(section)
    if np.all(factors == 1.0):
        return materials
    return scaled_materials(materials, surface_parts(scanned.scan, scanned.room), factors)


def shown_materials(materials: MaterialMap, scanned: ScannedRoom, section: CalibrationSection | None) -> MaterialMap:
    """The materials as people are shown them: each once, with the factors of the parts that it is on, mean by area.

    Their stated deviations go with the reflectances. The same object where there are no factors.
    """
    factors = _part_factors(section)
    if np.all(factors == 1.0):
        return materials
    areas, count = scanned.scan.areas, len(materials.materials)
    of_face = factors[surface_parts(scanned.scan, scanned.room)]
    total, scaled = (
        np.bincount(materials.face_material, weights=weights, minlength=count) for weights in (areas, areas * of_face)
    )
    mean = np.divide(scaled, total, out=np.ones(count), where=total > 0)
    whole = tuple(
        scaled_material(each, factor) for each, factor in zip(materials.materials, mean.tolist(), strict=True)
    )
    return replace(materials, materials=whole)


def materials_of_run(run: Path, scan: Scan) -> tuple[MaterialMap, MaterialMap]:
    """Materials of a finished run as its light was traced with them, and as they are shown (`shown_materials`).

    Parameters
    ----------
    run : Path
    scan : Scan
        The run's.

    Raises
    ------
    WorkspaceError
        If a stage is not finished, or the materials are of another scan.
    """
    materials = load_materials(require_stage(run, "materials"))
    if materials.face_material.size != scan.faces.shape[0]:
        raise WorkspaceError(
            expected="materials of the run's scan", found="those of another", where=str(run), todo="Run it again."
        )
    request = read_request(run)
    section = None if request is None else parse_run_file(request.text, where=request.name).calibration
    scanned = ScannedRoom(scan=scan, room=load_room(require_stage(run, "scan")))
    return calibrated_materials(materials, scanned, section), shown_materials(materials, scanned, section)


def _part_factors(section: CalibrationSection | None) -> FloatArray:
    """(part,) factors on the reflectances [1]."""
    return np.array([1.0 if section is None else getattr(section.reflectance, part) for part in PARTS])


def calibration_notes(section: CalibrationSection | None) -> tuple[str, ...]:
    """What a reader of the run should know of it, as full sentences."""
    if section is None:
        return ()
    lamps = ", ".join(f"{name} x {factor:.3g}" for name, factor in section.lamps.items())
    parts = ", ".join(
        f"{part} x {getattr(section.reflectance, part):.3g}"
        for part in PARTS
        if getattr(section.reflectance, part) != 1.0
    )
    factors = "; ".join(words for words in (lamps, f"reflectance of {parts}" if parts else "") if words)
    by = f" by {section.measured}" if section.measured else ""
    return (f"The room is calibrated{by}: {factors or 'nothing changed'}. What each factor rests on is in its tables.",)
