"""A cell fitted beside a sensor: chosen on blocks of time, with an error that holds, renewed, kept, and used."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from lidarspectra.cli.photocurrent import app
from lidarspectra.errors import LidarSpectraError, MapError, ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, nominal_responsivity
from lidarspectra.hardware.sensor.photocell import CellCircuit
from lidarspectra.mapping.photovoltaics.cell_fit import fit_cell, renewed
from lidarspectra.mapping.photovoltaics.cell_fit_files import SavedFit, load_fit, save_fit
from lidarspectra.mapping.photovoltaics.cells import find_cell
from lidarspectra.mapping.photovoltaics.node_day import NodeDay, light_hours
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM
from lidarspectra.workflow.applications.cell_fits import ahead_in_log

WAVELENGTHS = np.array(AS7265X_CENTERS_NM)
FLAT = np.ones(18)
CIRCUIT = CellCircuit(reference_volt=1.1, shunt_ohm=10.0, area_cm2=36.0, amplification=20.0)


def mixed_light(count: int, seed: int, shapes: int = 3) -> np.ndarray:
    """Readings under a few sources whose levels change on their own."""
    generator = np.random.default_rng(seed)
    spectra = np.random.default_rng(5).uniform(50.0, 500.0, (shapes, 18))
    level = generator.uniform(0.4, 1.2, (count, shapes))
    return np.rint(level @ spectra * (1.0 + 0.004 * generator.standard_normal((count, 18))))


def counted(light: np.ndarray, offset: float, seed: int, gain: float = 1.0) -> np.ndarray:
    weights = np.random.default_rng(6).uniform(0.0, 0.06, 18)
    return np.rint(gain * light @ weights + offset + 1.5 * np.random.default_rng(seed).standard_normal(len(light)))


@pytest.mark.parametrize("offset", [-120.0, 0.0, 80.0])
def test_the_offset_is_free_and_the_stated_error_covers_later_readings(offset: float) -> None:
    light, later = mixed_light(300, 1), mixed_light(300, 2)
    fit = fit_cell(light, counted(light, offset, 3), WAVELENGTHS, FLAT)
    told, error = fit.counts(later)
    off = np.abs(told - counted(later, offset, 4))
    assert np.mean(off) < 2.0  # 1.5 counts of noise and rounding
    assert 0.9 < np.mean(off <= 2.0 * error) <= 1.0
    assert not fit.outside(later).any()


def test_few_readings_of_many_channels_are_fitted() -> None:
    light, later = mixed_light(24, 1), mixed_light(200, 2)
    fit = fit_cell(light, counted(light, 30.0, 3), WAVELENGTHS, FLAT)
    truth = counted(later, 30.0, 4)
    assert np.mean(np.abs(fit.counts(later)[0] - truth)) < 0.35 * np.mean(np.abs(truth - truth.mean()))


def test_light_that_was_not_fitted_is_known_as_such() -> None:
    light = mixed_light(300, 1, shapes=2)
    fit = fit_cell(light, counted(light, 10.0, 3), WAVELENGTHS, FLAT)
    other = mixed_light(50, 2, shapes=2) + 300.0 * (np.arange(18) == 4)
    assert fit.outside(other).all()
    assert fit.counts(other)[1].min() > 1.5 * fit.counts(light)[1].max()


def test_one_reading_renews_a_cell_and_five_tell_gain_from_offset() -> None:
    light, later = mixed_light(300, 1), mixed_light(200, 2)
    fit = fit_cell(light, counted(light, 20.0, 3), WAVELENGTHS, FLAT)
    truth = counted(later, 50.0, 4, gain=0.9)
    errors = []
    for used in (0, 1, 5):
        fresh = renewed(fit, later[:used], truth[:used]) if used else fit
        told, error = fresh.counts(later[5:])
        errors.append(float(np.mean(np.abs(told - truth[5:]))))
        if used:
            assert np.mean(np.abs(told - truth[5:]) <= 2.0 * error) > 0.85
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 0.7 * errors[0]
    with pytest.raises(ReadingError, match="one reading"):
        renewed(fit, later[:0], truth[:0])


def test_copies_of_the_readings_that_renew_a_cell_tell_no_more_than_they() -> None:
    light, later = mixed_light(300, 1), mixed_light(200, 2)
    fit = fit_cell(light, counted(light, 20.0, 3), WAVELENGTHS, FLAT)
    truth = counted(later, 50.0, 4, gain=0.9)
    five = renewed(fit, later[:5], truth[:5])
    copies = renewed(fit, np.repeat(later[:5], 40, axis=0), np.repeat(truth[:5], 40))
    for one, other in zip(five.counts(later), copies.counts(later), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_temperature_and_angle_enter_where_they_are_given() -> None:
    light, later = mixed_light(300, 1), mixed_light(200, 2)
    warm, warm_later = np.linspace(15.0, 40.0, 300), np.full(200, 38.0)
    counts = counted(light, 20.0, 3) - 1.2 * (warm - 25.0)
    truth = counted(later, 20.0, 4) - 1.2 * (warm_later - 25.0)
    known = fit_cell(light, counts, WAVELENGTHS, FLAT, extras={"cell_temperature_c": warm})
    told, _ = known.counts(later, {"cell_temperature_c": warm_later})
    unknown = fit_cell(light, counts, WAVELENGTHS, FLAT)
    assert np.mean(np.abs(told - truth)) < 2.0 < np.mean(np.abs(unknown.counts(later)[0] - truth))


def test_a_warm_cell_is_no_change_of_gain_when_it_is_renewed() -> None:
    light, later = mixed_light(300, 1), mixed_light(200, 2)
    warm = np.linspace(15.0, 40.0, 300)
    fit = fit_cell(
        light, counted(light, 20.0, 3) - 1.2 * (warm - 25.0), WAVELENGTHS, FLAT, extras={"cell_temperature_c": warm}
    )
    hot = {"cell_temperature_c": np.full(200, 40.0)}
    truth = counted(later, 20.0, 4)
    fresh = renewed(
        fit, later[:5], truth[:5] - 1.2 * 15.0, extras={"cell_temperature_c": hot["cell_temperature_c"][:5]}
    )
    cool = {"cell_temperature_c": np.full(200, 25.0)}
    assert np.mean(np.abs(fresh.counts(later[5:], {n: v[5:] for n, v in cool.items()})[0] - truth[5:])) < 3.0


def test_a_fit_is_the_same_after_it_was_kept_and_others_are_refused(tmp_path: Path) -> None:
    light = mixed_light(100, 1)
    fit = renewed(fit_cell(light, counted(light, 20.0, 3), WAVELENGTHS, FLAT), light[:3], counted(light[:3], 9.0, 4))
    path = tmp_path / "fit.json"
    save_fit(SavedFit(fit=fit, name="mine", signal="irradiance", calibration="desk", circuit=CIRCUIT), path)
    again = load_fit(path)
    for first, second in zip(fit.counts(light), again.fit.counts(light), strict=True):
        np.testing.assert_allclose(first, second, rtol=1e-12)
    assert (again.name, again.calibration, again.circuit) == ("mine", "desk", CIRCUIT)
    for text in ("", "{}", "[]", '{"schema": "lidarspectra cell fit 1"}'):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ReadingError, match="cells fit"):
            load_fit(path)


def test_a_fit_of_irradiances_gives_back_the_cells_efficiency(tmp_path: Path) -> None:
    generator = np.random.default_rng(3)
    true = find_cell("organic-green").efficiency.at(WAVELENGTHS, outside="zero") * 0.6
    width = np.gradient(WAVELENGTHS)
    weights = true / 1239.84 * WAVELENGTHS * width * CIRCUIT.area_cm2 * 1e-4 / CIRCUIT.ampere_per_count
    light = generator.uniform(0.001, 0.01, (400, 18))  # light of all colours tells the channels apart
    counts = np.rint(light @ weights + 5.0)
    fit = fit_cell(light, counts, WAVELENGTHS, FLAT)
    path = tmp_path / "fit.json"
    save_fit(SavedFit(fit=fit, name="mine", signal="irradiance", calibration="desk", circuit=CIRCUIT), path)
    cell = find_cell(path)
    assert cell.quantity == "efficiency"
    assert cell.area_m2 == pytest.approx(36e-4)
    np.testing.assert_allclose(cell.efficiency.values, true, atol=0.05)
    assert "one kind of lamp" in cell.notes()[0]


def log_file(path: Path, light: np.ndarray, counts: np.ndarray, gain: int = 16) -> Path:
    frame = pd.DataFrame({"unix_s": 1.7e9 + np.arange(len(light)), "gain": gain, "integration_ms": 165.2})
    frame = frame.assign(**{f"count_{label}": light[:, c] for c, label in enumerate(CHANNEL_LABELS)}, cell_1=counts)
    frame.to_csv(path, index=False)
    return path


def call(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=True)
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


def test_from_a_log_to_a_file_and_to_currents_beside_another_log(tmp_path: Path) -> None:
    light, later = 20.0 * mixed_light(120, 1), 20.0 * mixed_light(80, 2)
    log = log_file(tmp_path / "log.csv", light, counted(light / 20.0, 20.0, 3))
    other = log_file(tmp_path / "other.csv", np.rint(later * 3.7 / 16.0), counted(later / 20.0, 20.0, 4))
    frame = pd.read_csv(other).assign(gain=3.7)
    frame.to_csv(other, index=False)
    fit = tmp_path / "cell.json"
    circuit = ("--reference", 1.1, "--shunt", 10, "--amplification", 20)
    told = call("fit", log, "--column", 1, "--out", fit, *circuit)
    assert "of irradiance" in told
    call("predict", other, "--cell", fit, "--out", tmp_path / "currents.csv")
    found = pd.read_csv(tmp_path / "currents.csv")
    # another gain of the sensor is no other light
    assert np.mean(np.abs(found["count"] - frame["cell_1"])) < 2.5
    assert np.mean(np.abs(found["count"] - frame["cell_1"]) <= 2.0 * found["SE_count"]) > 0.85
    np.testing.assert_allclose(found["current_A"], found["count"] * CIRCUIT.ampere_per_count, rtol=1e-6)
    assert "hours of light" in call("node", tmp_path / "currents.csv")
    assert "say little" not in call("node", tmp_path / "currents.csv")
    found.assign(SE_current_A=9.0 * found["current_A"]).to_csv(tmp_path / "hardly.csv", index=False)
    assert "uncertainty is 900 %: these hours say little" in " ".join(call("node", tmp_path / "hardly.csv").split())
    assert "Renewed with 3 readings" in call("fit", other, "--column", 1, "--renew", fit, "--count", 3)


def test_a_cell_that_is_not_in_the_log_and_what_would_have_no_effect_are_refused(tmp_path: Path) -> None:
    light = 20.0 * mixed_light(60, 1)
    log = log_file(tmp_path / "log.csv", light, counted(light / 20.0, 20.0, 3))
    with pytest.raises(ReadingError, match=r"counts of cell 3, found 1 cell\..*--column 1 to 1"):
        ahead_in_log(log, 3, cell=None, share=0.5)
    pd.read_csv(log).drop(columns="cell_1").to_csv(tmp_path / "bare.csv", index=False)
    with pytest.raises(ReadingError, match=r"a log without cells.*NAME=cell_1"):
        ahead_in_log(tmp_path / "bare.csv", 1, cell=None, share=0.5)
    circuit = ("--reference", "5", "--shunt", "100")
    for more in (circuit, ("--count", "5"), ("--renew", "fit.json", *circuit)):
        result = CliRunner().invoke(app, ["fit", str(log), "--column", "1", *more])
        assert result.exit_code == 2, result.output


def test_an_offset_that_no_light_explains_is_said_to_be_in_the_current(tmp_path: Path) -> None:
    light = mixed_light(120, 1)
    log = log_file(tmp_path / "log.csv", light, counted(light, 300.0, 3))
    fit, out = tmp_path / "cell.json", tmp_path / "currents.csv"
    circuit = ("--reference", 1.1, "--shunt", 10, "--amplification", 20)
    call("fit", log, "--column", 1, "--out", fit, *circuit)
    assert "as --dark" in call("predict", log, "--cell", fit, "--out", out)
    with_offset = pd.read_csv(out)["current_A"].mean()
    call("fit", log, "--column", 1, "--out", fit, *circuit, "--dark", 300)
    assert "as --dark" not in call("predict", log, "--cell", fit, "--out", out)
    taken_off = with_offset - pd.read_csv(out)["current_A"].mean()
    assert taken_off == pytest.approx(300.0 * CIRCUIT.ampere_per_count, rel=0.02)


def test_predict_takes_what_sensor_convert_writes(tmp_path: Path) -> None:
    from lidarspectra.cli.sensor import app as sensor

    light = mixed_light(30, 1)
    log = log_file(tmp_path / "log.csv", light, counted(light, 20.0, 3))
    result = CliRunner().invoke(sensor, ["convert", str(log), "--out", str(tmp_path / "table.csv")])
    assert result.exit_code == 0, result.exception
    call("predict", tmp_path / "table.csv", "--cell", "organic-green", "--out", tmp_path / "found.csv", "--area", 36)
    found = pd.read_csv(tmp_path / "found.csv")
    assert len(found) == 30
    assert found["unix_s"].iloc[0] == pytest.approx(1.7e9)
    assert found["current_A"].min() > 0
    assert nominal_responsivity()[0] > 0


def test_a_node_needs_its_charge_over_the_cells_current() -> None:
    node = NodeDay(sleep_ampere=1e-6, wake_ampere=5e-3, wake_s=0.1, send_ampere=2e-2, send_s=0.05, period_s=100.0,
                   volt=3.0, relative_error=0.1)  # fmt: skip
    assert node.charge_coulomb == pytest.approx(0.0864 + 864 * 1.5e-3)
    current, error = np.array([100e-6, 0.0]), np.array([0.1, 0.1])
    found = light_hours(node, current, error, cell_volt=2.0, efficiency=0.8, efficiency_error=0.08, lit_h=8.0)
    hours = 3.0 * node.charge_coulomb / (0.8 * 2.0 * 100e-6) / 3600.0
    assert found.hours[0] == pytest.approx(hours)
    assert np.isinf(found.hours[1])
    assert found.suffices[1] == 0.0
    # drawn at random instead: nine of ten lie between low and high
    generator = np.random.default_rng(1)
    drawn = hours * np.exp(generator.standard_normal((20_000, 3)) @ np.array([0.1, 0.1, 0.1]))
    assert np.mean((drawn > found.low[0]) & (drawn < found.high[0])) == pytest.approx(0.9, abs=0.01)
    assert np.mean(drawn < 8.0) == pytest.approx(found.suffices[0], abs=0.01)
    with pytest.raises(MapError, match="period"):
        NodeDay(sleep_ampere=0, wake_ampere=0, wake_s=9.0, send_ampere=0, send_s=9.0, period_s=10.0, volt=3.0)


def test_a_live_cell_is_kept_reading_by_reading(tmp_path: Path) -> None:
    from lidarspectra.hardware.incoming.arrivals import Arrival, Notice
    from lidarspectra.workflow.live.cells_beside import CellsBeside

    light = 1e-3 * mixed_light(100, 1)
    fit = fit_cell(light, counted(1e3 * light, 20.0, 3), WAVELENGTHS, FLAT)
    path = tmp_path / "fit.json"
    save_fit(SavedFit(fit=fit, name="mine", signal="irradiance", calibration="desk", circuit=CIRCUIT), path)
    told: list[Notice] = []
    beside = CellsBeside([f"{path}@desk, left"], ["desk, left", "door"], tmp_path)
    for row in (light[0], light[1], 9.0 * light[2] + 5.0 * (np.arange(18) == 3)):
        values = dict(zip(CHANNEL_LABELS, row.tolist(), strict=True))
        beside.take(Arrival(sensor="desk, left", values=values, unix_s=1.7e9), told.append)
        beside.take(Arrival(sensor="door", values=values, unix_s=1.7e9), told.append)
    beside.close()
    kept = pd.read_csv(tmp_path / "cells.csv")
    assert kept["sensor"].tolist() == ["desk, left"] * 3
    np.testing.assert_allclose(kept["count"][:2], fit.counts(light[:2])[0], rtol=1e-4)
    assert kept["outside"].tolist() == [0, 0, 1]
    assert len(told) == 1
    few = dict.fromkeys(CHANNEL_LABELS[:14], 1.0)
    for _ in range(2):  # a run of 14 channels may ask no more of its sensors
        beside.take(Arrival(sensor="desk, left", values=few, unix_s=1.7e9), told.append)
    assert len(told) == 2
    assert "810, 860, 900, 940" in told[1].text
    with (tmp_path / "cells.csv").open("a", encoding="utf-8") as file:
        file.write("1700000000.0,de")  # cut by a power failure
    later = CellsBeside([f"{path}@door"], ["door"], tmp_path)
    later.take(Arrival(sensor="door", values=values, unix_s=1.7e9 + 60.0), told.append)
    later.close()
    assert (tmp_path / "cells.csv").read_text(encoding="utf-8").splitlines()[-1].startswith("1700000060.000,door,mine,")
    with pytest.raises(LidarSpectraError, match="desk"):
        CellsBeside([f"{path}@lamp"], ["desk"], tmp_path)


def test_the_cells_of_a_replay_are_begun_anew_and_a_fit_that_wants_a_temperature_says_so(tmp_path: Path) -> None:
    from lidarspectra.hardware.incoming.arrivals import Arrival
    from lidarspectra.workflow.live.cells_beside import REPLAY_FILE, CellsBeside

    light = 1e-3 * mixed_light(100, 1)
    warm = {"cell_temperature_c": np.linspace(15.0, 40.0, 100)}
    fit = fit_cell(light, counted(1e3 * light, 20.0, 3), WAVELENGTHS, FLAT, extras=warm)
    path = tmp_path / "fit.json"
    save_fit(SavedFit(fit=fit, name="mine", signal="irradiance", calibration="desk", circuit=CIRCUIT), path)
    values = dict(zip(CHANNEL_LABELS, light[0].tolist(), strict=True))
    for _ in range(2):
        beside = CellsBeside([f"{path}@desk"], ["desk"], tmp_path / "live", is_recording=True)
        beside.take(Arrival(sensor="desk", values=values, unix_s=1.7e9), lambda notice: None)
        beside.close()
    assert len(pd.read_csv(tmp_path / "live" / REPLAY_FILE)) == 1
    assert "cell_temperature_c" in beside.notes()[0]


def test_readings_and_columns_that_are_not_fitted_are_said(tmp_path: Path) -> None:
    light = mixed_light(120, 1)
    counts = counted(light, 20.0, 3)
    counts[[5, 70]] = [0.0, -3.0]
    log = log_file(tmp_path / "log.csv", light, counts)
    lines = log.read_text(encoding="utf-8").splitlines()
    warm = ["cell_temperature_c", *(["25.5"] * 119), ""]
    log.write_text("\n".join(f"{line},{more}" for line, more in zip(lines, warm, strict=True)), encoding="utf-8")
    said = " ".join(call("fit", log, "--column", 1, "--out", tmp_path / "cell.json").split())
    assert "2 readings were left out, with counts of 0 or less" in said
    assert "The column cell_temperature_c is not used: 1 reading is without a number" in said
    said = " ".join(call("fit", log, "--column", 1, "--renew", tmp_path / "cell.json").split())
    assert "Renewed with 118 readings" in said
    assert "2 readings were left out, with counts of 0 or less" in said
