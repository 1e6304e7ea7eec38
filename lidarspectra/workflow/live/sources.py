"""The sources of readings that a file of sensors names."""

import hashlib
import platform
from collections.abc import Collection, Sequence
from pathlib import Path

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.arrivals import LUX, NODE_TIME, STATE, Source
from lidarspectra.hardware.incoming.channel_light import ChannelLight
from lidarspectra.hardware.incoming.growing_log import GrowingLog, names_sensors
from lidarspectra.hardware.incoming.mqtt_source import Broker, MqttSource, Topic
from lidarspectra.hardware.incoming.serial_source import SerialSource
from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_LABELS,
    DEFAULT_SETTINGS,
    GAUSSIAN_WIDTH_NM,
    UW_CM2_TO_W_M2,
    SensorSettings,
    settings_for,
)
from lidarspectra.hardware.sensor.calibration_files import calibration_by_label
from lidarspectra.hardware.sensor.identify import Wishes
from lidarspectra.hardware.sensor.serial_link import SerialPort
from lidarspectra.workflow.live.sensors_file import (
    CHANNEL_WORD,
    BrokerSection,
    SensorSection,
    SensorsFile,
    SwitchSection,
    password,
)


def sources_of(
    sensors: SensorsFile,
    labels: Sequence[str],
    *,
    base: Path,
    logs: Path,
    run: Path,
    replay: bool = False,
    beside_cells: Collection[str] = (),
) -> tuple[Source, ...]:
    """Make the sources; nothing is opened yet.

    Parameters
    ----------
    sensors : SensorsFile
    labels : sequence of str
        The run's channels.
    base : Path
        Where relative names of logs start.
    logs : Path
        Folder for the recorders' logs of serial ports.
    run : Path
        Its folder, by which the broker knows the session where the file gives no client_id.
    replay : bool
        Read logs from their start to their end, in place of what comes.
    beside_cells : collection of str
        Sensors all of whose channels are asked of the broker, whatever the run has: a fitted cell wants them.

    Returns
    -------
    sources : tuple of Source

    Raises
    ------
    ReadingError, DeviceError
        If a source cannot be what it is said to be, or needs something that is not installed.
    """
    found: list[Source] = []
    topics: list[Topic] = []
    names = {sensor.name for sensor in sensors.sensors}
    followed: dict[Path, str] = {}
    recorded: dict[str, str] = {}
    for sensor in sensors.sensors:
        if replay and sensor.log is None:
            raise ReadingError(
                expected="logs alone, for --replay",
                found="a source that has no past",
                where=f"sensor '{sensor.name}'",
                todo="Give a log, such as the one that 'live' itself keeps.",
            )
        if sensor.port is not None:
            log = logs / f"{_file_name(sensor.name)}.recorder.csv"
            other = recorded.setdefault(log.name.casefold(), sensor.name)  # one file, where capitals do not count
            if other != sensor.name:
                raise ReadingError(
                    expected="sensors whose names differ in more than capitals and signs, as those of their logs do",
                    found=f"'{other}' and '{sensor.name}', which would be recorded in one file, {log.name}",
                    where="sensors",
                    todo="Give one of them another name.",
                )
            wishes = Wishes(period_s=1.0 / sensor.rate, settings=settings_of_sensor(sensor))
            port = SerialPort(sensor.port)
            found.append(
                SerialSource(port, sensor=sensor.name, log=log, light=_light(sensor), wishes=wishes, baud=sensor.baud)
            )
        elif sensor.log is not None:
            path = base / sensor.log
            first = followed.setdefault(path.resolve(), sensor.name)
            if first == sensor.name:
                found.append(GrowingLog(path, sensor=sensor.name, light=_light(sensor), known=names))
            elif not names_sensors(path):
                raise ReadingError(
                    expected="a column 'sensor' in a log of several sensors",
                    found=f"none, though it is the log of '{first}' and '{sensor.name}'",
                    where=str(path),
                    todo="Give each sensor a log of its own, or name it in each row.",
                )
        else:
            wanted = CHANNEL_LABELS if sensor.name in beside_cells else labels
            topics += _topics(sensor, sensors.broker, wanted)
    topics += [_switch(switch, sensors.broker) for switch in sensors.switches if not replay]
    if topics:
        assert sensors.broker is not None  # since the file was checked
        found.append(MqttSource(_broker(sensors.broker, run), topics))
    return tuple(found)


def _topics(sensor: SensorSection, broker: BrokerSection | None, labels: Sequence[str]) -> list[Topic]:
    if sensor.topics:
        return [_channel(sensor, topic, label) for label, topic in sensor.topics.items()]
    prefix = broker.prefix if broker is not None else ""
    topic = sensor.topic or f"{prefix}/sensor/{sensor.object_id}/state"
    clock = (
        [] if sensor.time is None
        else [Topic(topic=topic, sensor=sensor.name, quantity=NODE_TIME, template=sensor.time)]
    )  # fmt: skip
    if "lux" in sensor.reads:
        return [*clock, Topic(topic=topic, sensor=sensor.name, quantity=LUX, template=sensor.value)]
    if sensor.value is None or CHANNEL_WORD not in sensor.value:
        raise ReadingError(
            expected=f"a value template with the word {CHANNEL_WORD}, for all channels of one topic",
            found="none" if sensor.value is None else f"'{sensor.value}'",
            where=f"sensor '{sensor.name}'",
            todo=f"Write value = '{{{{ value_json.E_{CHANNEL_WORD} }}}}', or give a topic a channel in topics.",
        )
    return [*clock, *(_channel(sensor, topic, label) for label in labels)]


def _channel(sensor: SensorSection, topic: str, label: str) -> Topic:
    template = None if sensor.value is None else sensor.value.replace(CHANNEL_WORD, label)
    factor = 1.0 if sensor.unit == "W/m2/nm" else UW_CM2_TO_W_M2 / GAUSSIAN_WIDTH_NM
    return Topic(topic=topic, sensor=sensor.name, quantity=label, template=template, factor=factor)


def _switch(switch: SwitchSection, broker: BrokerSection | None) -> Topic:
    prefix = broker.prefix if broker is not None else ""
    topic = switch.topic or f"{prefix}/light/{switch.object_id}/state"
    return Topic(topic=topic, sensor=switch.lamp, quantity=STATE, template=switch.value, factor=switch.factor)


def _broker(section: BrokerSection, run: Path) -> Broker:
    return Broker(
        host=section.host,
        port=section.port,
        username=section.username,
        password=password(),
        tls=section.tls,
        client_id=section.client_id or _client_id(run),
    )


def _client_id(run: Path) -> str:
    """The same at each start of a run, and another's for a run of its name in another folder or on another machine.

    A broker ends a session when another one of its name begins.
    """
    place = hashlib.sha256(f"{platform.node()} {run.resolve()}".encode()).hexdigest()
    return f"lidarspectra-live-{run.resolve().name}-{place[:8]}"


def _light(sensor: SensorSection) -> ChannelLight:
    if sensor.calibration is None:
        return ChannelLight(settings=settings_of_sensor(sensor))
    return ChannelLight(calibration_by_label(sensor.calibration), settings_of_sensor(sensor))


def settings_of_sensor(sensor: SensorSection) -> SensorSettings | None:
    """Gain and integration time that a file of sensors gives an AS7265x; None where it gives neither."""
    if sensor.gain is None and sensor.integration_ms is None:
        return None
    return settings_for(sensor.gain or DEFAULT_SETTINGS.gain, sensor.integration_ms or DEFAULT_SETTINGS.integration_ms)


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_ " else "_" for letter in name)
