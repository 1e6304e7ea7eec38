"""A calibration's covariance goes with the lamps' names, and a map whose lamps are others says that it is lost."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.config import CalibrationSection, RunFile
from lidarspectra.errors import WorkspaceError
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.lamps.usual_spectra import USUAL, spread_of_usual_lamps
from lidarspectra.material.material_map import Material, MaterialMap, save_materials
from lidarspectra.room.room import find_room, save_room
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands
from lidarspectra.workflow.calibration.unknowns_of_run import (
    COMMON_SHARE,
    calibrated_covariance,
    guessed_spectra,
    levels_covariance,
    lost_calibration_note,
    priors_of_room,
)
from lidarspectra.workflow.run_folder import calibration_of_run
from lidarspectra.workflow.run_folder.calibration_of_run import materials_of_run, shown_materials
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom

SECTION = CalibrationSection(lamps={"known": 1.1, "unknown": 0.9})
VARIANCE = [0.01, 0.4, *(0.07 + 0.01 * number for number in range(len(PARTS)))]


def run_folder(folder: Path, **changed: object) -> Path:
    (folder / "calibration").mkdir()
    summary = {
        "factors": SECTION.model_dump(mode="json"), "lamps": ["known", "unknown"],
        "covariance": np.diag(VARIANCE).tolist(), "local_sd": 0.02, **changed,
    }  # fmt: skip
    summary = {key: value for key, value in summary.items() if value is not None}
    (folder / "calibration" / "calibration.json").write_text(json.dumps(summary), encoding="utf-8")
    return folder


def test_lamps_in_another_order_keep_their_own_variance(tmp_path: Path) -> None:
    run = run_folder(tmp_path)
    for names, expected in ((["known", "unknown"], [0.01, 0.4]), (["unknown", "known"], [0.4, 0.01])):
        told = calibrated_covariance(SECTION, run, names)
        assert isinstance(told, tuple)
        assert np.diag(told[0]).tolist() == [*expected, *VARIANCE[2:]]
        assert told[1] == 0.02
        assert lost_calibration_note(SECTION, run, names) == ()


@pytest.mark.parametrize("names", [["known"], ["known", "unknown", "new"], ["known", "renamed"]])
def test_a_map_with_other_lamps_says_that_the_readings_are_lost(tmp_path: Path, names: list[str]) -> None:
    (note,) = lost_calibration_note(SECTION, run_folder(tmp_path), names)
    assert "other lamps (known, unknown)" in note
    assert "calibrate again" in note


def test_factors_changed_by_hand_and_files_of_earlier_versions_are_told(tmp_path: Path) -> None:
    run = run_folder(tmp_path)
    changed = SECTION.model_copy(update={"lamps": {"known": 1.2, "unknown": 0.9}})
    assert "by hand" in lost_calibration_note(changed, run, ["known", "unknown"])[0]
    assert lost_calibration_note(None, run, ["known"]) == ()
    (run / "calibration" / "calibration.json").unlink()
    (run / "calibration").rmdir()
    assert lost_calibration_note(SECTION, run, ["known", "unknown"]) == ()  # factors that somebody wrote
    written = SECTION.model_copy(update={"measured": "lux.csv"})
    (note,) = lost_calibration_note(written, run, ["known", "unknown"])
    assert "copy that folder" in note
    assert (
        "earlier version" in lost_calibration_note(SECTION, run_folder(tmp_path, lamps=None), ["known", "unknown"])[0]
    )


def test_a_damaged_covariance_is_refused(tmp_path: Path) -> None:
    run = run_folder(tmp_path, covariance=[[0.1]])
    with pytest.raises(WorkspaceError, match="calibrate"):
        calibrated_covariance(SECTION, run, ["known", "unknown"])


def paints(face_material: list[int], deviation: float = 0.1) -> MaterialMap:
    """Even paints of reflectance .5, each known to a deviation, on faces."""

    def even(value: float) -> Spectrum:
        return Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.full(2, value))

    material = Material(
        name="paint", category="painted", reflectance=even(0.5), source="test", provenance="recovered",
        confidence=1.0, measured_range_nm=(400.0, 700.0), color=(0.5, 0.5, 0.5), uncertainty=even(0.5 * deviation),
    )  # fmt: skip
    count = len(face_material)
    return MaterialMap(
        materials=(material,) * (max(face_material) + 1),
        face_material=np.array(face_material),
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )


def test_one_paint_on_walls_and_ceiling_errs_alike_on_both() -> None:
    part, areas = np.arange(len(PARTS)), np.ones(len(PARTS))
    common, own = (COMMON_SHARE * 0.1) ** 2, (1.0 - COMMON_SHARE**2) * 0.1**2
    apart = levels_covariance(paints([0, 1, 2, 3]), part, areas)
    np.testing.assert_allclose(apart, common + own * np.eye(len(PARTS)), atol=1e-12)
    one = levels_covariance(paints([0, 0, 0, 0]), part, areas)
    np.testing.assert_allclose(np.diag(one), 0.1**2)
    np.testing.assert_allclose(one[0, 1:], common + own, rtol=0.05)  # nearly one unknown
    # Half of each part in a paint that both have: a quarter of the variance of each paint's own, in common.
    half = levels_covariance(paints([0, 1, 0, 2, 3, 4]), np.array([0, 0, 1, 1, 2, 3]), np.ones(6))
    np.testing.assert_allclose(half[0, 1], common + own / 4.0, rtol=0.05)
    np.testing.assert_allclose(half[0, 0], common + own / 2.0)
    for found in (apart, one, half):
        np.linalg.cholesky(found)


def test_which_lamps_are_of_one_data_sheet_the_run_file_tells() -> None:
    strip: dict[str, Any] = {"shape": "strip", "center": [0.0, 0.0, 2.5], "size": [0.5, 0.1], "spectrum": "FL11"}
    lamps = [
        {**strip, "name": "one", "luminous_flux_lm": 700.0},
        {**strip, "name": "two", "luminous_flux_lm": 700.0, "size": [0.4, 0.1], "dim": 0.5},
        {**strip, "name": "brighter", "luminous_flux_lm": 900.0},
        {**strip, "name": "measured", "luminous_flux_lm": 700.0, "flux_deviation": 0.05},
        {**strip, "name": "guessed", "luminous_flux_lm": 700.0, "assumed": ["flux"]},
        {**strip, "name": "read", "luminous_flux_lm": 700.0},
    ]
    run_file = RunFile.model_validate(
        {"scan": {"file": "scan.glb"}, "lamps": lamps, "calibration": {"determined": ["read"]}}
    )
    names = [*(lamp.name for lamp in run_file.lamps), "sun"]
    known = priors_of_room(run_file, names, paints([0, 1, 2, 3]), np.arange(4), np.ones(4))
    correlation = known.flux_correlation
    assert correlation[0, 1] == 0.5
    assert np.count_nonzero(correlation - np.eye(7)) == 2
    assert known.flux_sd == pytest.approx([0.15, 0.15, 0.15, 0.05, 0.4, 0.15, 0.4])


def test_a_calibrated_run_shows_the_reflectances_of_its_light(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = ls.RoomModel.from_box(4.0, 3.0, 2.5).scan
    scanned = ScannedRoom(scan=scan, room=find_room(scan))
    part = surface_parts(scan, scanned.room)
    floor, ceiling = (part == PARTS.index(name) for name in ("floor", "ceiling"))
    assert scan.areas[floor].sum() == pytest.approx(12.0)
    estimated = paints(np.where(floor | ceiling, 0, 1).tolist())  # floor and ceiling of one paint
    section = CalibrationSection(reflectance={"floor": 0.5, "ceiling": 1.2, "walls": 0.8})
    shown = shown_materials(estimated, scanned, section)
    assert [each.reflectance.values[0] for each in shown.materials] == pytest.approx([0.5 * 0.85, 0.5 * 0.8])
    assert shown.materials[0].uncertainty is not None
    assert shown.materials[0].uncertainty.values[0] == pytest.approx(0.05 * 0.85)  # a tenth of it, as before
    assert shown_materials(estimated, scanned, None) is estimated

    save_room(scanned.room, tmp_path)
    save_materials(estimated, tmp_path)
    monkeypatch.setattr(calibration_of_run, "require_stage", lambda run, _: run)
    text = '[scan]\nfile = "a.glb"\n[lamps_from_scan]\ncct_k = 3000\n[sensors.grid]\ncount = 4\n'
    text += "[calibration.reflectance]\nfloor = 0.5\nceiling = 1.2\nwalls = 0.8\n"
    request = {"name": "room.toml", "folder": ".", "sha256": "", "text": text, "seed": 0}
    (tmp_path / "lidarspectra-run.json").write_text(json.dumps({"run_file": request}), encoding="utf-8")
    traced, told = materials_of_run(tmp_path, scan)
    of_face = np.array([each.reflectance.values[0] for each in traced.materials])[traced.face_material]
    np.testing.assert_allclose(of_face, 0.5 * np.where(floor, 0.5, np.where(ceiling, 1.2, 0.8)))
    assert [each.reflectance.values[0] for each in told.materials] == pytest.approx([0.425, 0.4])


def test_a_guessed_spectrum_is_off_by_what_usual_lamps_differ_from_it_at_one_flux() -> None:
    bands = sensor_bands("as7265x-14")
    led = lamp_spectrum("LED-B3").spectrum
    spread = dict(zip(bands.labels, spread_of_usual_lamps(led, bands), strict=True))
    np.testing.assert_allclose(list(spread.values()), spread_of_usual_lamps(led.scaled(7.0), bands))
    # where V(λ) is large, lumens fix the light; at both ends lamps of one flux differ by factors
    assert spread["410"] == pytest.approx(1.51, abs=0.01)  # as docs/concepts.md has them
    assert max(spread["535"], spread["560"]) == pytest.approx(0.19, abs=0.005)
    assert max(spread["585"], spread["610"]) == pytest.approx(0.26, abs=0.005)
    others = [spread[label] for label in spread if label not in ("410", "535", "560", "585", "610")]
    assert (min(others), max(others)) == pytest.approx((0.46, 0.71), abs=0.01)
    usual = [bands.band_values(lamp_spectrum(name).spectrum, outside="zero") for name in USUAL]
    lumens = [luminous_flux_lm(lamp_spectrum(name).spectrum) for name in USUAL]
    green = np.log([values[6] / lumen for values, lumen in zip(usual, lumens, strict=True)])
    own = np.log(bands.band_values(led, outside="zero")[6] / luminous_flux_lm(led))
    assert spread["560"] == pytest.approx(np.sqrt(((green - own) ** 2).mean()))
    line = Spectrum(wavelengths_nm=np.array([559.0, 560.0, 561.0]), values=np.array([0.0, 1.0, 0.0]))
    lone = spread_of_usual_lamps(line, bands)
    assert lone[0] == pytest.approx(np.log(10.0))  # all but dark: any lamp is far brighter, and the ratio has a limit
    assert lone[6] > 1.0


def test_which_spectra_are_guesses_the_run_file_tells() -> None:
    bands = sensor_bands("as7265x-14")
    strip: dict[str, Any] = {"shape": "strip", "center": [0.0, 0.0, 2.5], "spectrum": "FL11", "luminous_flux_lm": 700.0}
    told: dict[str, Any] = {"both": ["flux", "spectrum"], "flux": ["flux"], "spectrum": ["spectrum"], "none": False}
    tables = [{**strip, "name": name, "assumed": assumed} for name, assumed in told.items()]
    run_file = RunFile.model_validate({"scan": {"file": "scan.glb"}, "lamps": tables})
    light: dict[str, Any] = {"size": (1.0, 0.1), "spectrum": "FL11", "luminous_flux_lm": 700.0}
    lamps = [make_lamp(name=name, shape="strip", center=(0.0, 0.0, 2.5), **light) for name in told]
    found = guessed_spectra(run_file, lamps, bands)
    assert found.any(axis=1).tolist() == [True, False, True, False]
    np.testing.assert_allclose(found[0], spread_of_usual_lamps(lamps[0].flux, bands))
