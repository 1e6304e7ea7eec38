"""Checks of a run's inputs: every file is opened, every name looked up, every number held against what rooms have.

They are the same before a run, in a dry run and in `lidarspectra check`. What is opened here is opened again by the
stage that needs it; a scan of a phone takes a second.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import CellSection, DaylightSection, GridSection, LampSection, MaterialsSection, RunFile
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.decimation import load_decimation
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.lamps.ies import CandelaTable
from lidarspectra.lamps.lamp_spectra import DAYLIGHT_FROM_K, cct_spectrum, luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Luminaire
from lidarspectra.material.assignments import check_assignments, read_assignments
from lidarspectra.material.delighting.cards import nearest_surface
from lidarspectra.material.estimate import default_material
from lidarspectra.material.segmentation.segmentation import Classifier
from lidarspectra.radiance.engine.bands import lamp_band_flux
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.scene.daylight import Window
from lidarspectra.radiance.scene.sky import NIGHT_DEG, sun_altitude_deg
from lidarspectra.radiance.scene.weather import SYNTHETIC, read_epw
from lidarspectra.room.sensor_points import SensorPoints, read_points
from lidarspectra.spectra.databases import lamp_spectrum, load_reflectances
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum import BandSet, Spectrum
from lidarspectra.threads import available_cores
from lidarspectra.workflow.checks import plausible_numbers as plausible
from lidarspectra.workflow.checks.findings import Findings, listed, number_words
from lidarspectra.workflow.checks.scan_checks import ScanExtent, check_in_scan
from lidarspectra.workflow.materials.materials_of_run import all_given
from lidarspectra.workflow.run_folder.cards_of_run import cards_of_run
from lidarspectra.workflow.run_folder.inputs import Inputs
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from lidarspectra.workflow.run_folder.sensing_of_run import receptor_of_run

WHITE_LEDS_K = {"LED-B1": 2733.0, "LED-B2": 2998.0, "LED-B3": 4103.0, "LED-B4": 5109.0, "LED-B5": 6598.0}
"""[K] of the built-in white LEDs with blue chip and phosphor (CIE 15:2018, Table 12)."""
MAX_PER_CORE = 4  # processes per core, above which the user is asked


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckedInputs:
    """What the checks have read; parts that could not be read are None or missing.

    Parameters
    ----------
    lamps : tuple of Lamp
        The run file's, dimmed; those at 0 are left out.
    bands : BandSet or None
        The sensor's channels.
    point_count : int or None
        Points of a file; None for a grid.
    scan : Scan or None
        As its file has it; None where stage 1 is up to date.
    extent : ScanExtent or None
        Of the scan.
    """

    lamps: tuple[Lamp, ...] = ()
    bands: BandSet | None = None
    point_count: int | None = None
    scan: Scan | None = None
    extent: ScanExtent | None = None


def check_inputs(inputs: Inputs, findings: Findings, known: ScanExtent | None = None) -> CheckedInputs:
    """Look through everything that a run file names and says.

    Parameters
    ----------
    inputs : Inputs
    findings : Findings
        Gets the faults and questions.
    known : ScanExtent, optional
        Of a stage 1 that is up to date: the scan's file is not read then.

    Returns
    -------
    checked : CheckedInputs
    """
    run_file, base = inputs.run_file, inputs.base
    findings.number("scan.max_hole_m", run_file.scan.max_hole_m, plausible.HOLE)
    scan = _scan(inputs, findings) if known is None else None
    if known is None and run_file.scan.max_faces is not None:
        with findings.at("scan.max_faces"):
            load_decimation()
    extent = known if scan is None else ScanExtent(bounds=scan.bounds)
    bands = _bands(inputs, findings)
    lamps = tuple(
        lamp
        for number, section in enumerate(run_file.lamps, start=1)
        if (lamp := _lamp(f"lamps.{number}", section, bands, base, findings)) is not None
    )
    _check_light(inputs, scan, bands, findings)
    _check_calibration(run_file, findings)
    _check_materials(run_file.materials, base, findings)
    _check_cards(run_file.materials, base, scan, findings)
    points = _sensors(inputs, findings)
    if extent is not None:
        check_in_scan(findings, run_file, extent, points)
    for number, cell in enumerate(run_file.cells, start=1):
        _check_cell(f"cells.{number}", cell, base, findings)
    _check_machine(inputs, findings)
    return CheckedInputs(
        lamps=lamps, bands=bands, point_count=None if points is None else len(points), scan=scan, extent=extent
    )


def _scan(inputs: Inputs, findings: Findings) -> Scan | None:
    section = inputs.run_file.scan
    with findings.at("scan.file"):
        return read_scan(inputs.base / section.file, unit=section.unit, up=section.up, level=section.level)
    return None


def _bands(inputs: Inputs, findings: Findings) -> BandSet | None:
    with findings.at("sensors.device"):
        return find_bands(inputs.run_file.sensors.device, inputs.base)
    return None


# --- light


def _lamp(key: str, section: LampSection, bands: BandSet | None, base: Path, findings: Findings) -> Lamp | None:
    """The lamp of a table, dimmed; None if it is faulty or off."""
    findings.number(f"{key}.luminous_flux_lm", section.luminous_flux_lm, plausible.LUMINOUS_FLUX)
    for size_m in np.atleast_1d(section.size if section.size is not None else ()):
        findings.number(f"{key}.size", float(size_m), plausible.LAMP_SIZE)
    if not any(section.normal):
        _refuse_direction(f"{key}.normal", findings)
    light = "cct_k" if section.spectrum is None else "spectrum"
    with findings.at(f"{key}.{light}"):
        _require_seen(_spectrum(section.spectrum, section.cct_k, base), bands)
        _tell_notes(f"{key}.{light}", section.spectrum, base, findings)
    if section.cct_k is not None and section.shape != "window":
        _ask_about_color(f"{key}.cct_k", section.cct_k, findings)
    if findings.is_faulty(key):
        return None
    with findings.at(key if section.file is None else f"{key}.file"):
        (lamp,) = resolve_lamps([section.model_copy(update={"dim": 1.0})], base)
        _check_flux(key, section, lamp, findings)
        return next(iter(resolve_lamps([section], base)), None)
    return None


def _ask_about_color(key: str, cct_k: float, findings: Findings) -> None:
    """Tell what a colour temperature stands for, since most lamps are LEDs and an LED sends another spectrum."""
    led, led_k = min(WHITE_LEDS_K.items(), key=lambda each: abs(1.0 / each[1] - 1.0 / cct_k))  # as the eye tells them
    kind = "a thermal lamp's" if cct_k < DAYLIGHT_FROM_K else "daylight's"
    findings.ask(
        key,
        f"{cct_k:g} K stands for {kind} spectrum. A white LED of that colour and flux sends a third of what this does "
        "at 680 nm, and about a tenth or less at 410 and 730 nm. For an LED give in its place "
        f'spectrum = "{led}" ({led_k:.0f} K), or the lamp\'s own; for a halogen lamp spectrum = "A", which is not '
        "asked about.",
    )


def _check_flux(key: str, section: LampSection, lamp: Lamp, findings: Findings) -> None:
    """Hold watts and lumens against those of lamps, whichever of them is given."""
    given = next(
        (name for name in ("luminous_flux_lm", "radiant_flux_W", "file") if getattr(section, name)), "spectrum"
    )
    if given == "luminous_flux_lm":
        return  # known before the spectrum is
    if given == "file" and isinstance(lamp.shape, Luminaire):
        _check_output(f"{key}.file", lamp.shape.table, findings)
    findings.number(f"{key}.{given}", lamp.flux.integral(), plausible.RADIANT_FLUX)
    lumens = luminous_flux_lm(lamp.flux)
    if given != "radiant_flux_W" and lumens > 0:  # a lamp beyond the visible has none
        findings.number(f"{key}.{given}", lumens, plausible.LUMINOUS_FLUX)


def _check_output(key: str, table: CandelaTable, findings: Findings) -> None:
    """Hold a luminaire's candela against the lumens of its lamps: it sends less, but not by much."""
    if table.lamps_lm is None:
        return
    lumens = table.luminous_flux_lm()
    if not plausible.LIGHT_OUTPUT_RATIO[0] <= lumens / table.lamps_lm <= plausible.LIGHT_OUTPUT_RATIO[1]:
        findings.ask(
            key,
            f"its candela are {number_words(round(lumens))} lm in all, its lamps have "
            f"{number_words(round(table.lamps_lm))} lm. A luminaire sends no more light than its lamps, seldom less "
            "than a fifth of it. The candela are taken: look into the file's multiplier and lumens, or give "
            "'luminous_flux_lm'.",
        )


def _check_light(inputs: Inputs, scan: Scan | None, bands: BandSet | None, findings: Findings) -> None:
    """Light that is not listed lamp by lamp: lamps found in the scan, daylight, or none at all."""
    run_file = inputs.run_file
    found = run_file.lamps_from_scan
    if found is not None:
        findings.number("lamps_from_scan.luminous_exitance_lm_m2", found.luminous_exitance_lm_m2, plausible.EXITANCE)
        with findings.at("lamps_from_scan.spectrum" if found.spectrum is not None else "lamps_from_scan.cct_k"):
            _require_seen(_spectrum(found.spectrum, found.cct_k, inputs.base), bands)
            _tell_notes("lamps_from_scan.spectrum", found.spectrum, inputs.base, findings)
        if found.cct_k is not None:
            _ask_about_color("lamps_from_scan.cct_k", found.cct_k, findings)
        if scan is not None and not scan.appearance.known:
            findings.refuse(
                "lamps_from_scan",
                expected="a scan with colours, in which lit lamps are found by their brightness",
                found=f"none in {run_file.scan.file}",
                todo="Scan again with colour, or give each lamp as [[lamps]] in its place: centre, size and flux.",
            )
    if run_file.daylight is not None:
        _check_daylight(run_file.daylight, alone=not run_file.lamps and found is None, findings=findings)
        if run_file.daylight.weather not in (None, SYNTHETIC):
            with findings.at("daylight.weather"):
                read_epw(inputs.base / str(run_file.daylight.weather))
    elif run_file.lamps and all(lamp.dim == 0 for lamp in run_file.lamps):
        findings.refuse(
            "lamps.1.dim",
            expected="a lamp that is lit, or [daylight]",
            found="dim = 0 for every lamp: a dark room has no map",
            todo="Set 'dim' of a lamp above 0.",
        )


def _check_calibration(run_file: RunFile, findings: Findings) -> None:
    """Refuse factors on lamps that there are not; those found in the scan have no names yet."""
    if run_file.calibration is None or run_file.lamps_from_scan is not None:
        return
    known = {lamp.name for lamp in run_file.lamps if lamp.dim > 0}
    if run_file.daylight is not None:
        known |= {"sun", *(window.name for window in run_file.daylight.windows)}
    for name in run_file.calibration.lamps.keys() - known:
        findings.refuse(
            f"calibration.lamps.{name}",
            expected=f"the name of a lamp that is lit ({listed(sorted(known))})",
            found=f"'{name}'",
            todo="Give the factor under the lamp's new name, or take it out.",
        )


def _spectrum(name: str | None, cct_k: float | None, base: Path) -> Spectrum:
    return cct_spectrum(cct_k) if cct_k is not None else lamp_spectrum(name or "", base).spectrum


def _tell_notes(key: str, name: str | None, base: Path, findings: Findings) -> None:
    """What was changed or chosen in reading a spectrum's file."""
    for note in () if name is None else lamp_spectrum(name, base).notes:
        findings.ask(key, note)


def _require_seen(spectrum: Spectrum, bands: BandSet | None) -> None:
    """Refuse light that the sensor has no channel for."""
    if bands is not None:
        lamp_band_flux([spectrum], bands)


def _check_daylight(section: DaylightSection, *, alone: bool, findings: Findings) -> None:
    for number, window in enumerate(section.windows, start=1):
        key = f"daylight.windows.{number}"
        for side_m in window.size:
            findings.number(f"{key}.size", side_m, plausible.WINDOW_SIZE)
        with findings.at(key):
            Window(**window.model_dump())
        if not any(window.normal):
            _refuse_direction(f"{key}.normal", findings)
    altitude_deg = sun_altitude_deg(section.time, section.latitude_deg, section.longitude_deg)
    if altitude_deg > NIGHT_DEG:
        return
    time = f"{section.time:%Y-%m-%d %H:%M %z}"
    if alone:
        findings.refuse(
            "daylight.time",
            expected="a time at which light comes through the windows, since there is no lamp",
            found=f"{time}, when the sun is {-altitude_deg:.0f} degrees below the horizon there",
            todo="Correct time, latitude_deg or longitude_deg (east is positive), or give lamps.",
        )
    else:
        findings.ask(
            "daylight.time",
            f"at {time} the sun is {-altitude_deg:.0f} degrees below the horizon, so that the windows are dark. "
            "Correct time, latitude_deg or longitude_deg (east is positive) if day is meant.",
        )


def _refuse_direction(key: str, findings: Findings) -> None:
    findings.refuse(
        key,
        expected="a direction, three numbers that are not all 0",
        found="[0, 0, 0]",
        todo="[0, 0, 1] looks up, [0, 0, -1] down.",
    )


# --- materials, sensors, cells


def _check_materials(section: MaterialsSection, base: Path, findings: Findings) -> None:
    library = None
    with findings.at("materials.databases"):
        library = load_reflectances(section.databases, base)
    if library is not None:
        with findings.at("materials.default"):
            default_material(section.default, library)
    if section.file is not None:
        with findings.at("materials.file"):
            assignments = read_assignments(base / section.file)
            if library is not None:
                check_assignments(assignments, library, where=base / section.file)
    if section.model not in ("builtin", "none") and section.method != "default":
        with findings.at("materials.model"):
            Classifier(base / section.model)


def _check_cards(section: MaterialsSection, base: Path, scan: Scan | None, findings: Findings) -> None:
    """Whether each card has a surface to lie on, where the picture's light is fitted and the scan is at hand."""
    if scan is None or not section.delight or all_given(section, base):
        return
    for number, card in enumerate(cards_of_run(section.cards), start=1):
        with findings.at(f"materials.cards.{number}.center"):
            nearest_surface(caster_of(scan), card)


def _sensors(inputs: Inputs, findings: Findings) -> FloatArray | None:
    """Check where the sensors stand and how they see; gives the (point, 3) points of a file [m]."""
    section = inputs.run_file.sensors
    if section.receptor is not None:
        with findings.at("sensors.receptor"):
            receptor_of_run(section, inputs.base)
    if section.grid is not None:
        _check_grid(section.grid, findings)
    if section.points is None:
        return None
    with findings.at("sensors.points"):
        positions, normals = read_points(inputs.base / section.points)
        SensorPoints(positions=positions, normals=normals)  # refuses directions of length 0
        findings.number("sensors.points", float(len(positions)), plausible.GRID_POINTS)
        return positions
    return None


def _check_grid(grid: GridSection, findings: Findings) -> None:
    findings.number("sensors.grid.height", grid.height, plausible.GRID_HEIGHT)
    findings.number("sensors.grid.margin", grid.margin, plausible.GRID_MARGIN)
    findings.number("sensors.grid.spacing", grid.spacing, plausible.GRID_SPACING)
    findings.number("sensors.grid.count", grid.count, plausible.GRID_POINTS)
    if not any(grid.normal):
        _refuse_direction("sensors.grid.normal", findings)


def _check_cell(key: str, section: CellSection, base: Path, findings: Findings) -> None:
    from lidarspectra.workflow.report.report_applications import check_cell  # loads what draws

    findings.number(f"{key}.area_cm2", section.area_cm2, plausible.CELL_AREA)
    findings.number(f"{key}.volt", section.volt, plausible.CELL_VOLTAGE)
    findings.number(f"{key}.scale", section.scale, plausible.CELL_SCALE)
    with findings.at(key):
        check_cell(section, base=base)


# --- the machine


def _check_machine(inputs: Inputs, findings: Findings) -> None:
    """Radiance's programs are there; there are not more processes than the machine can feed."""
    with findings.at("Radiance"):
        find_engine()
    cores = available_cores()
    if inputs.cluster is None and inputs.workers is not None and inputs.workers > MAX_PER_CORE * cores:
        findings.ask(
            "trace.workers",
            f"are {inputs.workers} processes meant? This machine has {cores} cores; more processes than cores take "
            "memory and gain no time. Leave it out to use one per core.",
        )
