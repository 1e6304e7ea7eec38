"""What a run does not know of its room's light, from its own stages, and from readings where it is calibrated."""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.config import CalibrationSection, LampSection, RunFile
from lidarspectra.errors import WorkspaceError
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamp_spectra import beyond_ends
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.usual_spectra import spread_of_usual_lamps
from lidarspectra.mapping.calibration.model import (
    ASSUMED_FLUX_SD,
    FLUX_SD,
    LOCAL_SD,
    PROPOSED_FLUX_SD,
    REFLECTANCE_SD,
    STEEPEST,
    Priors,
)
from lidarspectra.mapping.maps.light_unknowns import LightUnknowns
from lidarspectra.mapping.maps.reflected_change import Surfaces, reflectance_effects
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.sampling.direct_light import direct_coefficients
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.room.light_samples import samples_of
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.workflow.calibration.results import SUMMARY
from lidarspectra.workflow.run_folder.assumed import assumed_lamps
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom

CERTAIN_SD = 0.03  # [1] of reflectances that the user assigned
LARGEST_SD = 0.5  # [1] of a part's level
COMMON_SHARE = 0.5  # [1] of a material's deviation that all have in common: exposure and white balance of the picture
ALIKE_ON_PARTS = 0.95  # [1] correlation of one material on two parts: nearly one unknown, and an invertible covariance
FOUND = "found"  # what lamps of no entry in the run file are: of the scan, or windows
REFERENCE_NM = 555.0  # [nm] where the level of a reflectance is taken
SAMPLES = 800  # of the surfaces; with 3,000, deviations differ by 2 to 4 %
SEED = 20261124


def priors_of_room(
    run_file: RunFile, lamps: Sequence[str], materials: MaterialMap, part: IntArray, areas: FloatArray
) -> Priors:
    """How well a run knows its lamps and reflectances.

    Unless the run file states it, fluxes that were guessed, of lamps found in the scan and of windows are known worst;
    those of lamps of one shape err alike, since one rule gave them, and so do those of all windows. Where lamps stand
    in place of the room's own, how much light it has is a guess, whatever lumens they were given. Lamps that the run
    file describes alike are of one data sheet and one age, so that half of their error's variance is common.
    The levels of the parts' reflectances are known as well as `levels_covariance` says.

    Parameters
    ----------
    run_file : RunFile
        With `lamps`, what is assumed of them, and `calibration`.
    lamps : sequence of str
        Of the run, windows and sun among them.
    materials : MaterialMap
    part : (face,) int
        Of the room, for every face.
    areas : (face,) float
        [m²]
    """
    determined = set(run_file.calibration.determined if run_file.calibration else ())
    stated = {lamp.name: lamp.flux_deviation for lamp in run_file.lamps if lamp.flux_deviation is not None}
    proposed = {lamp.name for lamp in run_file.lamps if "place" in lamp.guesses} - determined
    known = {lamp.name for lamp in run_file.lamps if "flux" not in lamp.guesses} - proposed
    known |= determined
    usual = {name: FLUX_SD if name in known else ASSUMED_FLUX_SD for name in lamps}
    usual |= dict.fromkeys(proposed, PROPOSED_FLUX_SD)
    shape = {lamp.name: lamp.shape for lamp in run_file.lamps}
    of_sheet = {lamp.name: _data_sheet(lamp) for lamp in run_file.lamps if lamp.name not in {*stated, *determined}}
    guessed = [None if name in known or name in stated else shape.get(name, FOUND) for name in lamps]
    return Priors(
        guess=_numbered(guessed),
        sheet=_numbered([of_sheet.get(name) if name in known else None for name in lamps]),
        flux_sd=np.array([stated.get(name, usual[name]) for name in lamps]),
        levels_covariance=levels_covariance(materials, part, areas),
    )


def _data_sheet(lamp: LampSection) -> str:
    """What the run file says of a lamp's light: lamps of which it says the same are of one data sheet."""
    said = (lamp.shape, lamp.beam_angle_deg, lamp.spectrum, lamp.cct_k, lamp.file, lamp.luminous_flux_lm)
    return repr((*said, lamp.radiant_flux_W))


def _numbered(groups: Sequence[str | None]) -> IntArray:
    """Each group of names by a number, -1 for none."""
    names = sorted({group for group in groups if group is not None})
    return np.array([-1 if group is None else names.index(group) for group in groups], dtype=np.int64)


def unknowns_of_map(
    run_file: RunFile,
    run: Path,
    scanned: ScannedRoom,
    materials: MaterialMap,
    lamps: Sequence[Lamp],
    bands: BandSet,
    transport: xr.Dataset,
    *,
    workers: int | None = None,
) -> LightUnknowns:
    """What is not known of the light of a run's map.

    Parameters
    ----------
    run_file : RunFile
    run : Path
        Its folder, with what a calibration found.
    scanned : ScannedRoom
    materials : MaterialMap
        As they were traced.
    lamps : sequence of Lamp
        As they are in the map.
    bands : BandSet
    transport : xarray.Dataset
    workers : int, optional
        Processes; one a core by default.

    Returns
    -------
    unknowns : LightUnknowns
    """
    clear = clear_lamps(lamps, scanned.scan)  # as the scene stage did
    scan, part = clear.scan, surface_parts(scanned.scan, scanned.room)
    priors = priors_of_room(run_file, [lamp.name for lamp in lamps], materials, part, scan.areas)
    in_bands = levels_deviation(materials, part, scan.areas, bands.centers_nm)
    calibrated = calibrated_covariance(run_file.calibration, run, [lamp.name for lamp in lamps])
    covariance, local_sd = calibrated if isinstance(calibrated, tuple) else (priors.covariance(), LOCAL_SD)
    own = levels_deviation(materials, part, scan.areas, np.array([REFERENCE_NM]))
    light = spectral_map(transport)["irradiance"].to_numpy()
    positions, normals = (
        np.stack([transport[f"{kind}{axis}"].to_numpy() for axis in "xyz"], axis=1) for kind in ("", "n")
    )
    flux = np.stack([bands.band_values(lamp.flux, outside="zero") for lamp in clear.lamps])
    reflectance = np.stack([bands.band_values(each.reflectance, outside="nearest") for each in materials.materials])
    effect = reflected_effects(
        scan, part, materials, clear.lamps, flux, reflectance, positions, normals, workers=workers
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.nan_to_num(effect / light, nan=0.0, posinf=0.0, neginf=0.0)
    return LightUnknowns(
        covariance=covariance,
        slope=np.clip(slope, 0.0, STEEPEST),
        spread=in_bands / own,
        local_sd=local_sd,
        spectrum_sd=guessed_spectra(run_file, lamps, bands),
        beyond=beyond_ends([lamp.flux for lamp in lamps], bands),
    )


def guessed_spectra(run_file: RunFile, lamps: Sequence[Lamp], bands: BandSet) -> FloatArray:
    """(lamp, band) deviation of the logarithm of each lamp's light for a spectrum that is a guess, 0 for others [1]."""
    guesses = assumed_lamps(run_file, [lamp.name for lamp in lamps]).of_spectrum
    known = np.zeros(len(bands.centers_nm))
    return np.stack([spread_of_usual_lamps(lamp.flux, bands) if lamp.name in guesses else known for lamp in lamps])


def reflected_effects(
    scan: Scan,
    part: IntArray,
    materials: MaterialMap,
    lamps: Sequence[Lamp],
    flux: FloatArray,
    reflectance: FloatArray,
    positions: FloatArray,
    normals: FloatArray,
    *,
    workers: int | None,
) -> FloatArray:
    """Derivative of light at points by the logarithm of each part's reflectance, without a trace of the points.

    Parameters
    ----------
    scan : Scan
    part : (face,) int
    materials : MaterialMap
    lamps : sequence of Lamp
        Clear of the scan.
    flux : (lamp, column) float
        Of each lamp, in channels, or in whatever other quantities the light is given. [a unit of the column]
    reflectance : (material, column) float
        [0-1]
    positions, normals : (point, 3) float
        [m, 1]
    workers : int or None

    Returns
    -------
    effects : (part, point, column) float
        [the column's unit/m²]
    """
    generator = np.random.default_rng(SEED)
    caster = caster_of(scan)
    samples = samples_of(scan, caster, generator, count=SAMPLES, per_face=None)
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as folder:
        coefficients = direct_coefficients(
            scan, lamps, samples.positions, samples.normals, Path(folder), workers=workers
        )
    surfaces = Surfaces(part=part, material=materials.face_material, reflectance=reflectance, part_count=len(PARTS))
    return reflectance_effects(caster, surfaces, samples, coefficients.T @ flux, positions, normals, generator)


def levels_deviation(materials: MaterialMap, part: IntArray, areas: FloatArray, at_nm: FloatArray) -> FloatArray:
    """(part, wavelength) relative deviation of the level of each part's reflectance.

    Parameters
    ----------
    materials : MaterialMap
    part : (face,) int
        Index into `PARTS`, for every face.
    areas : (face,) float
        [m²]
    at_nm : (wavelength,) float
        [nm]

    Returns
    -------
    deviation : (part, wavelength) float
        That of its materials, weighed by area. [1]
    """
    of_material = np.stack([_relative_deviation(material, at_nm) for material in materials.materials])
    total = np.bincount(part, weights=areas, minlength=len(PARTS))
    of_part = np.zeros((len(PARTS), at_nm.size))
    for column in range(at_nm.size):
        weights = areas * of_material[materials.face_material, column]
        of_part[:, column] = np.bincount(part, weights=weights, minlength=len(PARTS)) / np.maximum(total, 1e-12)
    return np.where(total[:, None] > 0, np.clip(of_part, CERTAIN_SD, LARGEST_SD), REFLECTANCE_SD)


def levels_covariance(materials: MaterialMap, part: IntArray, areas: FloatArray) -> FloatArray:
    """Covariance of the logarithms of the parts' levels of reflectance.

    Of each material's deviation a share c is common to all, since one picture made them; the rest is its own, and
    averages out over the materials of a part, weighed by what they reflect. A material that is on two parts errs alike
    on both (.95 of that counts, so that the covariance can be inverted). With the weights w of the materials m in the
    parts i and j,

        C_ij = c² σ_i σ_j + (1 - c²) Σ_m w_im w_jm σ_m²,    σ_i = Σ_m w_im σ_m.

    Parameters
    ----------
    materials : MaterialMap
    part : (face,) int
        Index into `PARTS`, for every face.
    areas : (face,) float
        [m²]

    Returns
    -------
    covariance : (part, part) float
        [1]
    """
    at = np.array([REFERENCE_NM])
    deviation = np.array([_relative_deviation(material, at)[0] for material in materials.materials])
    reflectance = np.array(
        [float(material.reflectance.at(at, outside="nearest")[0]) for material in materials.materials]
    )
    count = len(PARTS) * deviation.size
    index = part * deviation.size + materials.face_material
    reflected = np.bincount(index, weights=areas, minlength=count).reshape(len(PARTS), -1) * reflectance
    total = reflected.sum(axis=1, keepdims=True)
    weight = np.where(total > 0, reflected / np.where(total > 0, total, 1.0), 1.0 / deviation.size)
    common = np.clip(weight @ deviation, CERTAIN_SD, LARGEST_SD)
    own = weight * deviation
    variance = (own**2).sum(axis=1)
    alike = (own @ own.T) / np.sqrt(np.maximum(np.outer(variance, variance), 1e-300))
    alike = np.where(np.eye(len(PARTS), dtype=np.bool_), 1.0, ALIKE_ON_PARTS * alike)
    sd = np.clip(np.sqrt(variance), CERTAIN_SD, LARGEST_SD)
    return COMMON_SHARE**2 * np.outer(common, common) + (1.0 - COMMON_SHARE**2) * alike * np.outer(sd, sd)


def _relative_deviation(material: Material, at_nm: FloatArray) -> FloatArray:
    value = material.reflectance.at(at_nm, outside="nearest")
    if material.uncertainty is None:
        return np.full(at_nm.size, CERTAIN_SD if material.provenance == "assigned" else REFLECTANCE_SD)
    deviation = material.uncertainty.at(at_nm, outside="nearest")
    return np.where(value > 0, deviation / np.where(value > 0, value, 1.0), REFLECTANCE_SD)


def calibrated_covariance(
    section: CalibrationSection | None, run: Path, lamps: Sequence[str]
) -> tuple[FloatArray, float] | str | None:
    """What the readings of a run's calibration left unknown.

    Parameters
    ----------
    section : CalibrationSection or None
        Of the run file.
    run : Path
        Its folder, with what the calibration found.
    lamps : sequence of str
        Names of the map's lamps.

    Returns
    -------
    calibrated : (covariance, local_sd), str or None
        (lamp + part, lamp + part) covariance of the logarithms, its rows as the map's lamps, and the model's own error
        [1]; why it does not hold for this map; None where the folder has none.

    Raises
    ------
    WorkspaceError
        If the file is damaged.
    """
    path = run / "calibration" / SUMMARY
    if section is None or not path.is_file():
        return None
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        if "covariance" not in summary or "lamps" not in summary:
            return "the calibration is of an earlier version, which kept no covariance with the lamps' names"
        names = [str(name) for name in summary["lamps"]]
        if set(names) != set(lamps):
            return f"the readings were taken with other lamps ({', '.join(names)})"
        if summary["factors"] != section.model_dump(mode="json"):
            return "[calibration] was changed by hand since"
        covariance, local_sd = np.array(summary["covariance"], dtype=np.float64), float(summary["local_sd"])
        order = [*(names.index(name) for name in lamps), *range(len(names), len(names) + len(PARTS))]
        if covariance.shape != (len(order), len(order)):
            raise ValueError(f"a covariance of {covariance.shape} for {len(names)} lamps and {len(PARTS)} parts")
        return covariance[np.ix_(order, order)], local_sd
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise WorkspaceError(
            expected="what 'lidarspectra calibrate' wrote of its readings",
            found=str(error),
            where=str(path),
            todo="Calibrate again with --force, or delete the folder: the uncertainty is then that of before.",
        ) from error


def lost_calibration_note(section: CalibrationSection | None, run: Path, lamps: Sequence[str]) -> tuple[str, ...]:
    """A note where a calibration no longer holds for a map's uncertainty; parameters as of `calibrated_covariance`."""
    reason = calibrated_covariance(section, run, lamps)
    if reason is None and section is not None and section.measured is not None:
        return (
            f"The map's uncertainty is stated as if the run had no readings, since {run.resolve().name} has no folder "
            "'calibration' with what they told. The factors of [calibration] hold all the same. Where the run file was "
            "renamed, copy that folder from the run of its former name, NAME.calibrated.run, and run it again.",
        )
    if not isinstance(reason, str):
        return ()
    return (
        f"The map's uncertainty is stated as if the run had no readings, since {reason}. The factors of [calibration] "
        "still hold; calibrate again for the smaller uncertainty.",
    )
