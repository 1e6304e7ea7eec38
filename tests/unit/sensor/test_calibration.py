"""Light from readings, and calibration: what goes in as light comes out as light, with an uncertainty that holds."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.robot.reference_files import reference_from_file, unit_scale
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DIE_INDEX, mask_counts, nominal_responsivity
from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
from lidarspectra.hardware.sensor.calibration import (
    Calibration,
    Observation,
    field_calibration,
    fit_calibration,
    observe,
    reference_bands,
)
from lidarspectra.hardware.sensor.calibration_checks import cross_check, leave_one_out
from lidarspectra.hardware.sensor.calibration_files import (
    calibration_folder,
    list_calibrations,
    load_calibration,
    save_calibration,
    versions,
)
from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
from lidarspectra.hardware.sensor.readings import (
    channel_irradiance,
    make_readings,
    readings_table,
    write_readings,
)
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, Spectrum

NOMINAL, _ = nominal_responsivity()
DIES_OFF = np.array([4.0, 1.0, 0.7])[DIE_INDEX]  # as a real device's three dies disagree
CHANNELS_OFF = np.random.default_rng(7).uniform(0.8, 1.25, 18)
TRUE = NOMINAL * DIES_OFF * CHANNELS_OFF
DARK = 4e-4  # [1/ms] one count or so at gain 16 and 166 ms


def lamp(temperature_k: float, *, end_nm: float = 1100.0) -> FloatArray:
    """Band values of a black body, as a halogen lamp on a bench sends them, of a spectrum up to an end [W/m²/nm]."""
    wavelengths = np.arange(350.0, 1101.0, 5.0)
    body = wavelengths**-5.0 / np.expm1(1.4388e7 / (wavelengths * temperature_k))  # Planck, any scale
    read = wavelengths <= end_nm
    return reference_bands(Spectrum(wavelengths_nm=wavelengths[read], values=(0.01 * body / body.max())[read]))


def readings_under(
    light: FloatArray, *, n: int = 30, gain: float = 16.0, time_ms: float = 165.2, seed: int = 0
) -> xr.Dataset:
    """Readings of the device above, with its noise and rounding."""
    rng = np.random.default_rng(seed)
    counts = (TRUE * light + DARK) * gain * time_ms * (1.0 + 0.004 * rng.standard_normal((n, 18)))
    masked, flags = mask_counts(np.minimum(np.rint(counts), 65535))
    return make_readings(unix_s=np.arange(n), counts=masked, flag=flags, gain=gain, integration_ms=time_ms)


def calibrated(uncertainty: float = 0.0) -> Calibration:
    lamps = [
        observe(
            readings_under(factor * lamp(2800.0), seed=i),
            factor * lamp(2800.0),
            name=f"lamp {factor}",
            uncertainty=uncertainty,
        )
        for i, factor in enumerate((1.0, 0.3, 0.1))
    ]
    dark = observe(readings_under(np.zeros(18), seed=9), np.zeros(18), name="dark", uncertainty=0.0)
    return fit_calibration([*lamps, dark], name="bench", device="test", gain=16.0, integration_ms=165.2)


def test_a_calibration_finds_every_channel_and_every_die() -> None:
    found = calibrated()
    assert found.is_measured.all()
    # 30 readings of 0.4 %: 0.1 % a channel, and a count of rounding on the weakest, some 50 counts
    assert np.allclose(found.responsivity, TRUE, rtol=0.015)
    deviation = (found.responsivity - TRUE) / found.responsivity_se
    assert np.abs(deviation).max() < 4.0  # 18 normal numbers stay below 4 but once in a thousand
    for die, factor in enumerate((4.0, 1.0, 0.7)):
        typical = np.exp(np.log(CHANNELS_OFF[die == DIE_INDEX]).mean())
        assert found.die_factor[die] == pytest.approx(factor * typical, rel=0.02)


def test_light_comes_out_as_it_went_in_at_another_gain() -> None:
    light = 0.2 * lamp(3200.0)
    readings = readings_under(light, gain=64.0, time_ms=56.0, seed=3)
    out = spectral_irradiance(readings, calibrated())
    mean = out["irradiance"].to_numpy().mean(axis=0)
    known = np.isfinite(mean)
    assert known.sum() > 10
    assert np.allclose(mean[known], light[known], rtol=0.03)
    # another gain than that of the calibration brings the tolerance of gains in: 10 %, as a rectangle 5.8 %
    relative = (out["irradiance_se"] / out["irradiance"]).to_numpy()[:, known]
    assert relative.min() > 0.055


def test_the_stated_uncertainty_covers_the_truth() -> None:
    """Of many devices calibrated against a lamp that is 5 % uncertain, about 68 % read within one uncertainty."""
    light = 0.3 * lamp(2800.0)
    rng = np.random.default_rng(11)
    inside = []
    for seed in range(60):
        off = 1.0 + 0.05 * rng.standard_normal()  # the lamp's certificate errs by this
        seen = observe(readings_under(light * off, seed=seed), light, name="lamp", uncertainty=0.05)
        dark = observe(readings_under(np.zeros(18), seed=seed + 500), np.zeros(18), name="dark", uncertainty=0.0)
        fitted = fit_calibration([seen, dark], name="x", device="", gain=16.0, integration_ms=165.2)
        out = spectral_irradiance(readings_under(light, n=1, seed=seed + 900), fitted)
        inside.append(np.abs(out["irradiance"].to_numpy()[0] - light) <= out["irradiance_se"].to_numpy()[0])
    share = float(np.mean(inside))
    assert 0.55 < share < 0.82  # 0.68, and the scatter of 60 lamps, which all channels share: 0.06


def test_without_calibration_the_data_sheets_figure_is_taken_and_said() -> None:
    light = np.full(18, 0.001)
    counts = np.rint(NOMINAL * light * 16.0 * 166.0)
    readings = make_readings(unix_s=[0.0], counts=counts[None], gain=16.0, integration_ms=166.0)
    out = spectral_irradiance(readings)
    assert np.allclose(out["irradiance"], 0.001, rtol=0.01)  # rounding of 74 counts
    assert "nominal" in out.attrs["calibration"]
    assert float((out["irradiance_se"] / out["irradiance"]).min()) > 0.069  # 12 % limits, as a rectangle


def test_35_counts_are_a_microwatt_by_the_data_sheet() -> None:
    # 35 counts at gain 16 and 166 ms are 1 uW/cm2 by the data sheet
    readings = make_readings(unix_s=[0.0], counts=np.full((1, 18), 35.0), gain=16.0, integration_ms=166.0)
    out = channel_irradiance(spectral_irradiance(readings))
    assert np.allclose(out["irradiance"], 1.0, rtol=1e-12)
    assert out["irradiance"].attrs["units"] == "uW cm-2"


def test_module_values_without_settings_need_a_calibration_and_then_do() -> None:
    module = np.full((5, 18), 40.0)
    readings = make_readings(unix_s=np.arange(5), module_value=module)
    with pytest.raises(ReadingError, match="gain and integration time"):
        spectral_irradiance(readings)
    seen = observe(readings, np.full(18, 0.002), name="lamp", kind="module values", uncertainty=0.03)
    fitted = fit_calibration([seen], name="x", device="", of_signal="module values")
    assert np.allclose(spectral_irradiance(readings, fitted)["irradiance"], 0.002, rtol=1e-9)


def test_readings_without_what_the_calibration_is_for_are_refused() -> None:
    readings = make_readings(unix_s=[0.0], module_value=np.full((1, 18), 40.0))
    with pytest.raises(ReadingError, match="for which the calibration was made"):
        spectral_irradiance(readings, calibrated())


def test_a_channel_that_a_lamp_does_not_light_takes_its_dies_factor_with_its_scatter() -> None:
    blue = np.where(np.array(AS7265X_CENTERS_NM) < 700, 0.005, 0.0)
    fitted = fit_calibration([observe(readings_under(blue), blue, name="blue", uncertainty=0.02)], name="x", device="")
    assert not fitted.is_measured[CHANNEL_LABELS.index("760")]
    ratio = fitted.responsivity / TRUE
    assert np.all((ratio > 0.6) & (ratio < 1.7))  # the channels' own scatter is 0.8 to 1.25
    deviation = np.abs(fitted.responsivity - TRUE) / fitted.responsivity_se
    assert deviation[~fitted.is_measured].max() < 3.0
    assert "760" in fitted.notes[0]


def test_saturated_and_dark_lamps_are_refused() -> None:
    bright = np.full(18, 10.0)
    with pytest.raises(ReadingError, match="lower the gain"):
        fit_calibration([observe(readings_under(bright), bright, name="sun", uncertainty=0.02)], name="x", device="")
    with pytest.raises(ReadingError):
        fit_calibration(
            [observe(readings_under(np.zeros(18)), np.zeros(18), name="d", uncertainty=0.0)], name="x", device=""
        )


def test_gain_that_changed_is_no_calibration() -> None:
    mixed = readings_under(lamp(2800.0))
    mixed["gain"][5:] = 64.0
    with pytest.raises(ReadingError, match="auto-gain"):
        field_calibration(mixed, lamp(2800.0), name="x", device="")


def test_a_field_calibration_reads_what_the_map_says_and_says_so() -> None:
    simulated = np.where(np.arange(18) < 14, lamp(2800.0), 0.0)  # a map of 14 channels
    readings = readings_under(lamp(2800.0))
    fitted = field_calibration(readings, simulated, name="desk", device="test")
    out = spectral_irradiance(readings, fitted)["irradiance"].to_numpy().mean(axis=0)
    assert np.allclose(out[:14], simulated[:14], rtol=0.01)
    assert fitted.kind == "field"
    assert any("cannot confirm" in note for note in fitted.notes)
    assert (fitted.responsivity_se[:14] / fitted.responsivity[:14]).min() > 0.14  # what the map is uncertain by


def test_cross_check_against_another_lamp_tells_agreement_and_a_wrong_die() -> None:
    other = 0.5 * lamp(3400.0)
    seen = observe(readings_under(other, seed=21), other, name="other", uncertainty=0.02)
    good = cross_check(calibrated(0.02), seen)
    assert good["deviation"].abs().max() < 4.0
    found = calibrated(0.02)
    wrong = replace(found, responsivity=np.where(DIE_INDEX == 0, 4.0, 1.0) * found.responsivity)
    table = cross_check(wrong, seen)
    assert table.loc[table["die"] == "AS72651", "ratio"].max() < 0.3
    assert table.loc[table["die"] == "AS72653", "ratio"].min() > 0.9


def test_lamps_predict_one_another() -> None:
    lamps = [
        observe(readings_under(f * lamp(t), seed=i), f * lamp(t), name=str(t), uncertainty=0.02)
        for i, (f, t) in enumerate([(1.0, 2800.0), (0.5, 3200.0), (0.3, 2600.0)])
    ]
    assert leave_one_out(lamps) < 0.05
    spoiled = replace(lamps[0], reference=2.0 * lamps[0].reference)
    assert leave_one_out([spoiled, *lamps[1:]]) > 0.2
    with pytest.raises(ReadingError):
        leave_one_out(lamps[:1])


def test_calibrations_are_saved_by_name_and_version_and_never_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path))
    first = save_calibration(calibrated())
    second = save_calibration(replace(calibrated(), device="other"))
    assert (first.version, second.version) == (1, 2)
    assert versions("bench") == (1, 2)
    again = load_calibration("bench")
    assert again.device == "other"
    assert np.array_equal(again.responsivity, second.responsivity)
    assert load_calibration("bench", 1).device == "test"
    assert [calibration.label for calibration in list_calibrations()] == [second.label]
    assert json.loads((calibration_folder() / "bench" / "v0001.json").read_text(encoding="utf-8"))["channels_nm"]


@pytest.mark.parametrize("name", ["", "..", "../x", "a/b", "a\\b", ".hidden", "x" * 65, "a b", "con:", "x."])
def test_a_name_that_is_no_folders_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path))
    with pytest.raises(ReadingError, match="calibration name"):
        save_calibration(replace(calibrated(), name=name))
    assert list(tmp_path.rglob("*.json")) == []


def test_a_damaged_calibration_file_is_a_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path))
    save_calibration(calibrated())
    path = calibration_folder() / "bench" / "v0001.json"
    whole = json.loads(path.read_text(encoding="utf-8"))
    for spoiled in ("", "{", "[]", json.dumps(whole | {"format": "x"}), json.dumps(whole | {"responsivity": [1.0]}),
                    json.dumps(whole | {"extra": 1}), json.dumps(whole | {"responsivity": [-1.0] * 18})):  # fmt: skip
        path.write_text(spoiled, encoding="utf-8")
        with pytest.raises(ReadingError, match="calibrat"):
            load_calibration("bench")
    with pytest.raises(ReadingError, match="only bench"):
        load_calibration("nobody")


@pytest.mark.parametrize(
    ("words", "scale"),
    [
        ("irradiance [W/m²/nm]", 1.0),
        ("mW/m2/nm", 1e-3),
        ("µW/cm²/nm", 0.01),
        ("E (W m-2 nm-1)", 1.0),
        ("W/nm", None),
        ("lux", None),
    ],
)
def test_units_of_a_reference_are_read_from_its_heading(words: str, scale: float | None) -> None:
    assert unit_scale(words) == scale


def test_a_reference_file_without_a_unit_asks_for_one(tmp_path: Path) -> None:
    path = tmp_path / "lamp.csv"
    path.write_text("wavelength_nm,value\n" + "".join(f"{w},2\n" for w in range(380, 1001, 10)), encoding="utf-8")
    with pytest.raises(ReadingError, match="--unit"):
        reference_from_file(path)
    assert np.allclose(reference_from_file(path, unit="mW/m2/nm"), 0.002, rtol=1e-3)  # 410 nm has a tail below 380


def test_what_a_lamp_sends_beyond_the_end_of_its_spectrum_is_not_known_and_no_darkness() -> None:
    long, short = lamp(2800.0), lamp(2600.0, end_nm=780.0)
    assert np.flatnonzero(np.isnan(short)).tolist() == [14, 15, 16, 17]  # 810 nm and above
    lamps = [
        observe(readings_under(long), long, name="long", uncertainty=0.0),
        observe(readings_under(lamp(2600.0), seed=1), short, name="short", uncertainty=0.0),
    ]
    fitted = fit_calibration(lamps, name="x", device="")
    assert fitted.is_measured.all()
    np.testing.assert_allclose(fitted.responsivity, TRUE, rtol=0.03)  # two levels that are near tell the dark badly
    assert abs(leave_one_out(lamps)) < 0.1
    alone = fit_calibration(lamps[1:], name="x", device="")
    assert not alone.is_measured[14:].any()
    assert "end before" in alone.notes[0]


def test_a_lamp_whose_spectrum_ends_in_the_dark_sends_nothing_beyond() -> None:
    led = Spectrum(wavelengths_nm=np.array([400.0, 450.0, 600.0, 700.0]), values=np.array([0.0, 1.0, 1.0, 0.0]))
    assert (reference_bands(led)[-4:] < 1e-30).all()


def test_observations_refuse_negative_light() -> None:
    with pytest.raises(ReadingError):
        Observation(
            name="x", signal=np.ones(18), signal_se=np.ones(18), reference=-np.ones(18), reference_uncertainty=0.0
        )


def test_a_table_of_readings_is_written_and_read_again(tmp_path: Path) -> None:
    readings = readings_under(0.3 * lamp(2800.0)).assign_coords(x=("reading", np.arange(30.0)))
    light = spectral_irradiance(readings, calibrated())
    write_readings(readings, tmp_path / "table.csv", light=light)
    again = readings_from_csv(tmp_path / "table.csv")
    for name in ("counts", "gain", "integration_ms", "unix_s", "x"):
        assert np.allclose(again[name], readings[name], rtol=1e-9, equal_nan=True), name
    table = readings_table(readings, light)
    assert {"E_410", "SE_940", "count_610", "flag_860", "basic_se_435"} <= set(table.columns)
    assert np.allclose(table["basic_560"], table["count_560"] / (16.0 * 165.2), rtol=1e-12)
    assert np.allclose(table["U_560"], table["E_560"] * 2129, rtol=1e-3)  # 21.29 nm, rounded here; 100 uW/cm2 a W/m2
