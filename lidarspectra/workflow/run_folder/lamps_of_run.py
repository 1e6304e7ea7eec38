"""The lamps of a run: listed in its run file or found lit in the scan (fluxes by de-lighting), and windows."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from lidarspectra.config import LampSection, LampsFromScanSection, RunFile
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamp_spectra import cct_spectrum
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import EXITANCE_LM_M2, LitShape, lamps_from_lit, make_lamp
from lidarspectra.material.lit_lamps.fluxes import flux_factors, load_lamp_fluxes
from lidarspectra.material.lit_lamps.lit_lamps import find_lit_lamps
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.scene.daylight import Window, daylight_lamps
from lidarspectra.radiance.scene.sky import Daylight, compute_sky
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import lamp_spectrum

SKY_FOLDER = "sky"
LAMP_KEYS = ("lamps", "lamps_from_scan")  # of the run file
MOMENT_KEYS = tuple(field.name for field in fields(Daylight))  # of [daylight]: all but the windows and the year


@dataclass(frozen=True, kw_only=True)
class ScannedRoom:
    """Result of stage 1: the repaired mesh, and the room found in it."""

    scan: Scan
    room: Room


def without_names(scanned: ScannedRoom) -> ScannedRoom:
    """The same as if the scan's file named no parts: the colours that it draws them in count."""
    scan = replace(scanned.scan, appearance=scanned.scan.appearance.without_names())
    return ScannedRoom(scan=scan, room=scanned.room)


def lamps_of_run(run_file: RunFile, scanned: ScannedRoom, *, base: Path) -> tuple[Lamp, ...]:
    """The run file's lamps, or those found lit in the scan's texture."""
    if run_file.lamps_from_scan is None:
        return resolve_lamps(run_file.lamps, base)
    return lit_lamps(run_file.lamps_from_scan, find_lit_lamps(scanned.scan, scanned.room), base)


def lamps_in_picture(run_file: RunFile, scanned: ScannedRoom, *, base: Path) -> tuple[Lamp, ...]:
    """The lamps as they were lit when the room was scanned, whatever they are dimmed to in the map."""
    then = [lamp.model_copy(update={"dim": lamp.dim_in_scan}) for lamp in run_file.lamps]
    return resolve_lamps(then, base) if then else lamps_of_run(run_file, scanned, base=base)


def lit_lamps(section: LampsFromScanSection, found: Sequence[LitShape], base: Path) -> tuple[Lamp, ...]:
    """Lamps found lit in the scan, with the spectrum and exitance that the run file gives them."""
    spectrum = (
        cct_spectrum(section.cct_k)
        if section.cct_k is not None
        else lamp_spectrum(section.spectrum or "", base).spectrum
    )
    return lamps_from_lit(found, spectrum, luminous_exitance_lm_m2=section.luminous_exitance_lm_m2 or EXITANCE_LM_M2)


def resolve_lamps(sections: Sequence[LampSection], folder: Path) -> tuple[Lamp, ...]:
    """Turn `[[lamps]]` of a run file into lamps with absolute spectra (`make_lamp`), dimmed.

    Parameters
    ----------
    sections : sequence of LampSection
    folder : Path
        Where relative file names start; the run file's folder.

    Returns
    -------
    lamps : tuple of Lamp
        In their order; lamps dimmed to 0 are left out.

    Raises
    ------
    LampError
        If a lamp lacks size or flux, or a candela file cannot be read.
    DatabaseError
        If there is no such spectrum.
    """
    lamps = []
    for section in sections:
        if section.dim > 0:
            lamp = make_lamp(
                **section.model_dump(exclude={"dim", "dim_in_scan", "flux_deviation", "assumed"}), folder=folder
            )
            lamps.append(replace(lamp, flux=lamp.flux.scaled(section.dim)))
    return tuple(lamps)


def with_estimated_fluxes(lamps: tuple[Lamp, ...], materials_folder: Path) -> tuple[Lamp, ...]:
    """Lamps with the relative fluxes that the materials stage estimated; unchanged where it estimated none."""
    fluxes = load_lamp_fluxes(materials_folder)
    if not fluxes:
        return lamps
    factors = flux_factors([lamp.name for lamp in lamps], fluxes, np.array([lamp.flux.integral() for lamp in lamps]))
    return tuple(
        replace(lamp, flux=lamp.flux.scaled(float(factor))) for lamp, factor in zip(lamps, factors, strict=True)
    )


def windows_of_run(run_file: RunFile) -> tuple[Window, ...]:
    """The run file's windows; none without daylight."""
    section = run_file.daylight
    return () if section is None else tuple(Window(**window.model_dump()) for window in section.windows)


def daylight_of_run(run_file: RunFile, folder: Path) -> tuple[Lamp, ...]:
    """Windows as lamps lit by sky and sun; none at night."""
    section = run_file.daylight
    if section is None:
        return ()
    day = Daylight(**{key: getattr(section, key) for key in MOMENT_KEYS})
    windows = windows_of_run(run_file)
    sky = compute_sky(
        day, folder / SKY_FOLDER, find_engine(), atmosphere=user_cache_path("lidarspectra") / "atmosphere"
    )
    return daylight_lamps(sky, windows)
