"""An emulated sensor on a real port: its light arrives, and a port that goes and comes back is said once."""

import time
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.hardware.incoming import serial_source
from lidarspectra.hardware.incoming.arrivals import BACK_OFF_S
from lidarspectra.hardware.incoming.channel_light import ChannelLight
from lidarspectra.hardware.incoming.serial_source import SerialSource
from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, CHANNEL_LABELS, ChannelOrder, settings_for
from lidarspectra.hardware.sensor.identify import Wishes
from lidarspectra.hardware.sensor.reading_log import read_rows
from lidarspectra.hardware.sensor.serial_link import SerialPort
from lidarspectra.hardware.virtual.emulator import SketchBoard, SparkfunBoard
from lidarspectra.hardware.virtual.emulator_ports import EmulatorServer
from lidarspectra.hardware.virtual.faults import FaultPlan, FaultyWire

BY_A_DEVICE = pytest.mark.chance("an emulated device on a real port lives twenty times faster, and must answer in time")
SPEED = 20.0


@BY_A_DEVICE
def test_readings_arrive_as_light_and_stay_in_the_log(tmp_path: Path, running) -> None:
    log = tmp_path / "desk.csv"
    with EmulatorServer(FaultyWire(SketchBoard()), speed=SPEED) as server:
        source = SerialSource(SerialPort(server.address), sensor="desk", log=log, wishes=Wishes(period_s=0.5))
        with running(source) as heard:
            heard.until(lambda heard: len(heard.arrivals) >= 4)
    assert set(heard.arrivals[0].values) <= set(CHANNEL_LABELS)
    assert len(heard.arrivals[0].values) > 10
    assert ["'desk' has no calibration" in notice.text for notice in heard.notices] == [True]  # once
    assert sum(row["kind"] == "reading" for row in read_rows(log)[0]) >= 4


@BY_A_DEVICE
def test_a_sketch_that_tells_no_gain_gives_light_by_the_one_that_is_given_and_else_that_is_said(
    tmp_path: Path, running
) -> None:
    order = ChannelOrder(letters=ASCENDING_LETTERS, said_by="test")
    for settings in (None, settings_for(64.0, 140.0)):
        with EmulatorServer(FaultyWire(SparkfunBoard()), speed=SPEED) as server:
            source = SerialSource(
                SerialPort(server.address), sensor="desk", log=tmp_path / f"{settings is None}.csv",
                light=ChannelLight(settings=settings), wishes=Wishes(settings=settings, order=order),
            )  # fmt: skip
            with running(source) as heard:
                if settings is None:
                    heard.until(lambda heard: len(heard.notices) >= 2)
                    assert not heard.arrivals
                    assert "gives no light: it tells neither gain nor integration time" in heard.notices[1].text
                else:
                    heard.until(lambda heard: len(heard.arrivals) >= 2)  # of the module's values, as `sensor convert`
                    assert len(heard.arrivals[0].values) > 10


@BY_A_DEVICE
def test_a_sensor_that_is_saturated_throughout_is_told_of(tmp_path: Path, running) -> None:
    with EmulatorServer(FaultyWire(SketchBoard(lambda now_s: np.full(18, 1e6))), speed=SPEED) as server:
        source = SerialSource(SerialPort(server.address), sensor="desk", log=tmp_path / "log.csv")
        with running(source) as heard:
            heard.until(lambda heard: len(heard.notices) >= 2)
    assert not heard.arrivals
    assert "gives no light: every channel is saturated" in heard.notices[1].text


@BY_A_DEVICE
@pytest.mark.slow
def test_a_sensor_that_is_unplugged_is_told_of_once_and_read_again_when_it_is_back(tmp_path: Path, running) -> None:
    plan = FaultPlan(kinds=("disconnect",), rate=0.1, disconnect_s=100.0, seed=1)  # up to five seconds of ours
    wire = FaultyWire(SketchBoard(), plan)
    with EmulatorServer(wire, speed=SPEED) as server:
        source = SerialSource(
            SerialPort(server.address), sensor="desk", log=tmp_path / "desk.csv", wishes=Wishes(period_s=1.0)
        )
        with running(source) as heard:
            heard.until(lambda heard: len(heard.notices) >= 3 and len(heard.arrivals) > 3)
    assert wire.met["disconnect"] >= 1
    assert "gives no readings: disconnected" in heard.notices[1].text
    assert "gives readings again" in heard.notices[2].text


def test_a_port_that_is_not_there_is_said_once_while_it_is_tried_again(
    tmp_path: Path, running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_source, "BACK_OFF_S", tuple(0.1 * wait_s for wait_s in BACK_OFF_S))
    source = SerialSource(SerialPort("/dev/no-such-port"), sensor="desk", log=tmp_path / "desk.csv")
    with running(source) as heard:
        heard.until(lambda heard: heard.notices)
        time.sleep(0.5)  # the next attempts are after .1 and .2 s
    assert len(heard.notices) == 1
    assert "tried again until it answers" in heard.notices[0].text
