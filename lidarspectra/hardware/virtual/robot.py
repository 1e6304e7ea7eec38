"""A rehearsal: a virtual robot drives a virtual sensor through the light of a simulated map.

It produces the files of a real measurement: the sensor's log with its gaps, logs under a lamp and in the dark, the
robot's poses by its own clock and in its own frame, and a few points known in both frames. All data pass through
the same recorder as with real devices.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import DeviceError, ReadingError
from lidarspectra.hardware.robot.reference_files import map_light, read_map
from lidarspectra.hardware.robot.robot import median_spacing
from lidarspectra.hardware.robot.time_offset import ExpectedLight
from lidarspectra.hardware.robot.trajectory import Trajectory
from lidarspectra.hardware.sensor.as7265x import CHANNEL_COUNT
from lidarspectra.hardware.sensor.calibration import reference_bands
from lidarspectra.hardware.sensor.reading_log import LogWriter
from lidarspectra.hardware.sensor.recorder import RecordOptions, RecordSummary, record
from lidarspectra.hardware.virtual.emulator import Light, SketchBoard
from lidarspectra.hardware.virtual.faults import START_UNIX_S, FaultPlan, FaultyWire, VirtualClock, VirtualPort
from lidarspectra.hardware.virtual.solar_cell import VirtualCell, cell_counts, cell_current_in
from lidarspectra.hardware.virtual.spectral_sensor import VirtualSensor, draw_sensor
from lidarspectra.io.files import write_whole, writing
from lidarspectra.progress import Progress, silent
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, Spectrum

LOG, LAMP_LOG, DARK_LOG = "log.csv", "lamp-log.csv", "dark-log.csv"
SPEED_M_S = 0.15  # [m/s] a TurtleBot3 Waffle Pi reaches 0.26 m/s (its manual); slower gives a finer map
POSES_HZ = 10.0  # [Hz] of the robot's log
CLOCK_OFFSET_S = 2.3  # [s] the robot's clock is ahead
TURN_RAD = 0.6  # [rad] of the robot's frame against the scan's
SHIFT_M = (-1.2, 0.7, 0.0)  # [m] of the robot's frame against the scan's
ODOMETRY_NOISE_M = 0.005  # [m] standard deviation of each pose
LAMP_READINGS = 30  # readings under the reference lamp
WAIT_S = 10.0  # [s] that the robot stands before it drives, while the recorder starts


@dataclass(frozen=True, kw_only=True)
class Rehearsal:
    """Files of a rehearsal.

    Parameters
    ----------
    log, lamp_log, dark_log : Path
        Logs of the drive, under the lamp and in the dark.
    lamp : Path
        Spectrum of the lamp. [W/m²/nm]
    poses, points : Path
        Of the robot, in its frame; points known in both frames.
    summary : RecordSummary
        Of the drive's log.
    """

    log: Path
    lamp_log: Path
    dark_log: Path
    lamp: Path
    poses: Path
    points: Path
    summary: RecordSummary


def drive_past(locations: FloatArray, *, start_unix_s: float, speed_m_s: float = SPEED_M_S) -> Trajectory:
    """A drive over locations, row by row, to and fro.

    Parameters
    ----------
    locations : (location, 3) float
        [m]
    start_unix_s : float
        When it begins. [s]
    speed_m_s : float
        [m/s]

    Returns
    -------
    trajectory : Trajectory
        On the floor of the locations' frame.
    """
    if locations.shape[0] < 2:
        raise ReadingError(expected="two locations or more", found=f"{locations.shape[0]}", where="drive")
    rows = np.round((locations[:, 1] - locations[:, 1].min()) / max(median_spacing(locations), 1e-3)).astype(int)
    order = np.lexsort((np.where(rows % 2 == 0, locations[:, 0], -locations[:, 0]), rows))
    way = locations[order] * (1.0, 1.0, 0.0)
    moves = np.linalg.norm(np.diff(way, axis=0), axis=1)
    way = way[np.append(True, moves > 1e-6)]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    times = np.arange(0.0, along[-1] / speed_m_s + 2 * WAIT_S, 1.0 / POSES_HZ)
    place = np.stack([np.interp((times - WAIT_S) * speed_m_s, along, way[:, i]) for i in range(3)], axis=1)
    ahead = np.stack([np.interp((times - WAIT_S) * speed_m_s + 0.05, along, way[:, i]) for i in (0, 1)], axis=1)
    step = ahead - place[:, :2]
    heading = np.arctan2(step[:, 1], step[:, 0])
    return Trajectory(unix_s=start_unix_s + times, positions=place, headings=heading, frame="scan")


def _record(
    light: Light,
    path: Path,
    *,
    duration_s: float,
    readings: int | None,
    seed: int,
    plan: FaultPlan | None,
    cells: Callable[[float], tuple[int, ...]] | None = None,
) -> RecordSummary:
    clock = VirtualClock()
    port = VirtualPort(FaultyWire(SketchBoard(light, cells=cells, seed=seed), plan), clock)
    with LogWriter(path, sync=_no_sync) as log:
        return record(port, log, options=RecordOptions(duration_s=duration_s, readings=readings), clock=clock)


def _no_sync(descriptor: int) -> None:
    """Do not synchronise: a rehearsal is faster than any disk, and its log can be made again."""


def rehearse(
    map_table: Path,
    folder: Path,
    *,
    fault_rate: float = 0.05,
    seed: int = 0,
    cells: Sequence[VirtualCell] = (),
    progress: Progress = silent,
) -> Rehearsal:
    """Rehearse a day of measuring in the room of a simulated map.

    The sensor's dies and channels are off from the data sheet and drift while it drives (`spectral_sensor`).

    Parameters
    ----------
    map_table : Path
        Map of a run, as CSV.
    folder : Path
        Where the files go; made if it is not there.
    fault_rate : float
        Share of the sensor's messages that get a fault. [0-1]
    seed : int
        Of the sensor, faults and noise.
    cells : sequence of VirtualCell
        Cells mounted beside the sensor, in the same log.
    progress : callable
        See `lidarspectra.progress`.

    Returns
    -------
    rehearsal : Rehearsal

    Raises
    ------
    ReadingError
        If the map cannot be read.
    DeviceError
        If the folder has another rehearsal's logs, or cannot be written.
    """
    locations, _ = read_map(map_table)
    expected = map_light(map_table)
    _check_is_new(folder)
    sensor = draw_sensor(seed)
    with writing(folder, error=DeviceError):
        folder.mkdir(parents=True, exist_ok=True)
        _record_references(sensor, folder, seed)
    drive = drive_past(locations, start_unix_s=START_UNIX_S)
    progress(0.2, "driving")
    light_at = _light_past(drive, expected)
    noise = np.random.default_rng(seed)

    def falling(now_s: float) -> FloatArray:
        drifted = sensor.responsivity * (1.0 + sensor.drift_per_hour * now_s / 3600.0)
        return np.asarray(drifted * light_at(now_s) + sensor.dark_per_ms)

    def cell_readings(now_s: float) -> tuple[int, ...]:
        spectrum = light_at(now_s)[None, :]
        currents = [cell_current_in(cell, np.array(AS7265X_CENTERS_NM), spectrum) for cell in cells]
        return tuple(int(cell_counts(cell, current, noise)[0]) for cell, current in zip(cells, currents, strict=True))

    summary = _record(
        falling,
        folder / LOG,
        duration_s=float(drive.unix_s[-1] - START_UNIX_S),
        readings=None,
        seed=seed,
        plan=FaultPlan(rate=fault_rate, seed=seed, pause_s=4.0, disconnect_s=4.0) if fault_rate else None,
        cells=cell_readings if cells else None,
    )
    with writing(folder, error=DeviceError):
        _write_robot(drive, folder, seed)
    progress(1.0, "driven")
    return Rehearsal(
        log=folder / LOG,
        lamp_log=folder / LAMP_LOG,
        dark_log=folder / DARK_LOG,
        lamp=folder / "lamp.csv",
        poses=folder / "poses.csv",
        points=folder / "points.csv",
        summary=summary,
    )


def _check_is_new(folder: Path) -> None:
    """Refuse a folder with the files of another rehearsal."""
    old = [name for name in (LOG, LAMP_LOG, DARK_LOG) if (folder / name).exists()]
    if old:
        raise DeviceError(
            expected="a folder without another rehearsal",
            found=f"{', '.join(old)} in it",
            where=str(folder),
            todo="Name another folder.",
        )


def _record_references(sensor: VirtualSensor, folder: Path, seed: int) -> None:
    """Record a lamp of known spectrum, and the dark; the spectrum is written beside their logs."""
    wavelengths = np.arange(350.0, 1001.0, 5.0)
    lamp = Spectrum(wavelengths_nm=wavelengths, values=2e-3 * (0.2 + (wavelengths - 350.0) / 650.0))
    rows = "".join(f"{w:g},{v:.9g}\n" for w, v in zip(lamp.wavelengths_nm, lamp.values, strict=True))
    write_whole(folder / "lamp.csv", "wavelength_nm,irradiance W/m2/nm\n" + rows)
    dark = np.full(CHANNEL_COUNT, sensor.dark_per_ms)
    for name, level in ((LAMP_LOG, sensor.responsivity * reference_bands(lamp) + dark), (DARK_LOG, dark)):
        _record(_steady(level), folder / name, duration_s=600.0, readings=LAMP_READINGS, seed=seed, plan=None)


def _steady(level: FloatArray) -> Light:
    return lambda now_s: level


def _light_past(drive: Trajectory, expected: ExpectedLight) -> Light:
    """Irradiance on a sensor that drives through a map's light; zero where the map has no value [W/m²/nm]."""

    def light_at(now_s: float) -> FloatArray:
        moment = np.clip(START_UNIX_S + now_s, drive.unix_s[0], drive.unix_s[-1])
        place, _ = drive.at([moment], longest_gap_s=math.inf)
        return np.asarray(np.nan_to_num(expected(place)[0]))

    return light_at


def _write_robot(drive: Trajectory, folder: Path, seed: int) -> None:
    """The robot's poses by its clock in its frame, and three corners of the drive in both frames."""
    c, s = math.cos(TURN_RAD), math.sin(TURN_RAD)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    own = drive.moved(turn, np.array(SHIFT_M), frame="odom")
    noise = ODOMETRY_NOISE_M * np.random.default_rng(seed).standard_normal((len(drive), 2))
    with (folder / "poses.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["unix_s", "x", "y", "z", "yaw"])
        for time_s, place, off, yaw in zip(own.unix_s, own.positions, noise, own.headings, strict=True):
            x, y = place[:2] + off
            writer.writerow([f"{time_s + CLOCK_OFFSET_S:.3f}", f"{x:.4f}", f"{y:.4f}", "0", f"{yaw:.4f}"])
    low, high = drive.positions.min(axis=0), drive.positions.max(axis=0)
    corners = {"south-west": (low[0], low[1]), "south-east": (high[0], low[1]), "north-east": (high[0], high[1])}
    with (folder / "points.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["name", "robot_x", "robot_y", "scan_x", "scan_y"])
        for name, (x, y) in corners.items():
            robot = turn @ np.array([x, y, 0.0]) + SHIFT_M
            writer.writerow([name, f"{robot[0]:.4f}", f"{robot[1]:.4f}", f"{x:.4f}", f"{y:.4f}"])
