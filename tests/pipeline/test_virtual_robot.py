"""From unpacking to the measured map beside the simulated one, without the hardware: docs/howto-sensor.md, walked."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from lidarspectra.cli.app import app as whole_app
from lidarspectra.cli.sensor import app
from lidarspectra.hardware.robot.poses import read_poses
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log
from lidarspectra.hardware.sensor.photocell import CellCircuit
from lidarspectra.hardware.virtual.robot import CLOCK_OFFSET_S, drive_past, rehearse
from lidarspectra.hardware.virtual.solar_cell import draw_cell
from lidarspectra.mapping.maps.map_files import read_map_table
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands

LABELS = CHANNEL_LABELS[:14]
ENERGY = [f"E_{label}" for label in LABELS]


def done(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


@pytest.fixture
def office_map(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A map of scenes/office in closed form: its 176 points, and its panels as small Lambert lamps in a grey room."""
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path / "data"))
    scene = project / "scenes" / "office"
    points = pd.read_csv(scene / "truth" / "points.csv")
    plan = tomllib.loads((scene / "room.toml").read_text(encoding="utf-8"))
    places = points[["x", "y", "z"]].to_numpy()
    shape = np.zeros(len(points))
    for lamp in plan["lamps"]:
        way = np.array(lamp["center"]) - places
        distance = np.linalg.norm(way, axis=1)
        shape += (way[:, 2] / distance) ** 2 / (np.pi * distance**2) + 0.05
    spectrum = lamp_spectrum(plan["lamps"][0]["spectrum"]).spectrum
    colour = sensor_bands("as7265x-14").band_values(spectrum, outside="zero")
    light = 0.02 * shape[:, None] * colour / colour.max()
    for c, label in enumerate(LABELS):
        points[f"E_{label}"] = light[:, c]
    path = tmp_path / "map.csv"
    points.to_csv(path, index=False)
    return path


def test_a_rehearsed_day_gives_the_map_that_it_was_made_from(office_map: Path, tmp_path: Path) -> None:
    day = tmp_path / "day"
    done("rehearse", office_map, day, "--faults", 0.05)
    done("calibrate", "device", "--lamp", f"{day / 'lamp-log.csv'}={day / 'lamp.csv'}", "--dark", day / "dark-log.csv",
         "--uncertainty", 0.01)  # fmt: skip
    told = done("join", day / "log.csv", "--poses", day / "poses.csv", "--align", day / "points.csv", "--calibration",
                "device", "--map", office_map, "--locations", office_map, "--out", day / "placed.csv",
                "--measured", day / "measured.csv")  # fmt: skip
    assert "residual" in told
    offset = float(told.split("time offset ")[1].split(" s")[0])
    assert abs(offset - CLOCK_OFFSET_S) < 0.3  # 4 cm of the drive
    measured = pd.read_csv(day / "measured.csv")
    simulated = pd.read_csv(office_map)
    assert len(measured) > 150  # of 176: gaps of some seconds take a location each
    nearest = [
        int(((simulated[["x", "y", "z"]] - row) ** 2).sum(axis=1).to_numpy().argmin())
        for row in measured[["x", "y", "z"]].to_numpy()
    ]
    comparison = compare_maps(simulated[ENERGY].to_numpy()[nearest], measured[ENERGY].to_numpy())
    # 0.4 % noise, up to 10 cm from a location, counts of 10 in the darkest channels
    assert comparison.nrmse_mean < 0.06
    ratio = measured[ENERGY].to_numpy() / simulated[ENERGY].to_numpy()[nearest]
    assert (
        np.abs(np.median(ratio, axis=0)[1:] - 1.0).max() < 0.03
    )  # 410 nm: counts of 10, and a dark one of half a count
    deviation = (measured[ENERGY].to_numpy() - simulated[ENERGY].to_numpy()[nearest]) / measured[
        [f"SE_{label}" for label in LABELS]
    ].to_numpy()
    assert np.mean(np.abs(deviation) < 2.0) > 0.8  # what lies between a location and its readings is not in their error


def test_a_measured_map_is_read_as_a_map(office_map: Path, tmp_path: Path) -> None:
    day = rehearse(office_map, tmp_path / "day", fault_rate=0.0)
    done("calibrate", "device", "--lamp", f"{day.lamp_log}={day.lamp}", "--dark", day.dark_log)
    done("join", day.log, "--poses", day.poses, "--align", day.points, "--calibration", "device", "--map", office_map,
         "--locations", office_map, "--out", tmp_path / "placed.csv",
         "--measured", tmp_path / "measured.csv")  # fmt: skip
    measured = read_map_table(tmp_path / "measured.csv", bands=sensor_bands("as7265x-14"))
    assert measured.sizes["point"] > 170
    assert not measured["buried"].any()


def test_the_faults_of_a_rehearsal_are_in_its_log(office_map: Path, tmp_path: Path) -> None:
    day = rehearse(office_map, tmp_path / "day", fault_rate=0.2, seed=1)
    assert day.summary.gaps > 3
    assert len(read_sensor_log(day.log).gaps) == day.summary.gaps
    poses = read_poses(day.poses)
    assert poses.unix_s[0] == pytest.approx(1.7e9 + CLOCK_OFFSET_S, abs=1e-3)


def test_the_drive_comes_past_every_location(project: Path) -> None:
    points = pd.read_csv(project / "scenes" / "office" / "truth" / "points.csv")[["x", "y", "z"]].to_numpy()
    drive = drive_past(points, start_unix_s=0.0)
    distance = np.linalg.norm(points[:, None, :2] - drive.positions[None, :, :2], axis=2).min(axis=1)
    assert distance.max() < 0.01  # a hundredth of a second's way


OFFICE = """
[scan]
file = '{scan}'
[[lamps]]
name = "panel west"
shape = "panel"
center = [0.85, 1.5, 2.61]
size = [0.6, 0.6]
spectrum = "LED-B3"
luminous_flux_lm = 3400.0
[materials]
method = "default"
coverage = 0.3
[sensors.grid]
height = 0.3
count = 176
[trace]
accuracy = "low"
noise = "draft"
"""


@pytest.mark.slow
def test_the_traced_office_is_measured_and_evaluated(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path / "data"))
    room = tmp_path / "office.toml"
    room.write_text(OFFICE.format(scan=project / "scenes" / "office" / "scan.glb"), encoding="utf-8")
    run = tmp_path / "office.run"
    result = CliRunner().invoke(whole_app, ["map", str(room), "--out", str(run)])
    assert result.exit_code == 0, result.output
    table = run / "6-map" / "map.csv"
    day = rehearse(table, tmp_path / "day")
    done("calibrate", "device", "--lamp", f"{day.lamp_log}={day.lamp}", "--dark", day.dark_log)
    measured = tmp_path / "measured.csv"
    done("join", day.log, "--poses", day.poses, "--align", day.points, "--calibration", "device", "--map", table,
         "--locations", table, "--out", tmp_path / "placed.csv", "--measured", measured)  # fmt: skip
    assert len(pd.read_csv(measured)) > 150
    result = CliRunner().invoke(whole_app, ["evaluate", str(run), "--measured", str(measured)])
    assert result.exit_code == 0, (result.output, result.exception)
    assert "NRMSE" in result.output
    result = CliRunner().invoke(whole_app, ["evaluate", str(run), "--measured", str(table)])  # its own channels and lux
    assert result.exit_code == 0, (result.output, result.exception)
    assert "within 2 SD" in result.output
    (own,) = pd.read_csv(run / "evaluation" / "evaluation-illuminance.csv").to_dict("records")
    assert (own["APE median [%]"], own["within 1 SD [%]"]) == (pytest.approx(0.0, abs=1e-4), 100.0)
    assert (run / "evaluation" / "evaluation-illuminance.png").stat().st_size > 10_000


def test_cells_ride_with_the_robot_and_are_in_its_log(office_map: Path, tmp_path: Path) -> None:
    circuit = CellCircuit(reference_volt=1.1, shunt_ohm=100.0, area_cm2=36.0)
    flat = Spectrum(wavelengths_nm=np.array([400.0, 800.0]), values=np.array([0.2, 0.2]))
    cells = [draw_cell(flat, circuit, 1), draw_cell(flat.scaled(0.5), circuit, 2)]
    day = rehearse(office_map, tmp_path / "day", fault_rate=0.0, cells=cells)
    readings = read_sensor_log(day.log).readings
    assert readings.adc is not None
    assert readings.adc.shape[1] == 2
    first, second = np.nanmedian(readings.adc, axis=0)
    assert first > 20
    # Half as much, but for its own error of some per cent and the converter's whole counts.
    assert second / first == pytest.approx(0.5, rel=0.25)
