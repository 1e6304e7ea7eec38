"""A room as its `[calibration]` has it: factors on the lamps' fluxes and on the reflectances of its parts."""

from dataclasses import replace

import numpy as np

from lidarspectra.config import CalibrationSection
from lidarspectra.errors import LampError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.scaled import scaled_materials
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom


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
    if section is None:
        return materials
    factors = np.array([getattr(section.reflectance, part) for part in PARTS])
    if np.all(factors == 1.0):
        return materials
    return scaled_materials(materials, surface_parts(scanned.scan, scanned.room), factors)


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
