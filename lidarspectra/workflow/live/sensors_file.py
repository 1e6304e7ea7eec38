"""Which sensor stands where, and what it is read from: the file that `lidarspectra live RUN --source` takes."""

import os
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from lidarspectra.config import Name, Positive, Vector
from lidarspectra.errors import ReadingError
from lidarspectra.io.toml_sections import Section, check_sections, parse_sections

PASSWORD = "LIDARSPECTRA_MQTT_PASSWORD"  # variable of the environment, so that no password stands in a file
CHANNEL_WORD = "CHANNEL"  # in a value template: stands for the label of each channel
HOME_ASSISTANT = "homeassistant"

Quantity = Literal["lux", "channels"]
LOG_SUFFIXES = (".csv", ".log", ".txt")  # of what is no port


class BrokerSection(Section):
    """`[broker]`: the MQTT broker."""

    host: str = Field(min_length=1)
    port: Annotated[int, Field(ge=1, le=65535)] = 1883
    username: str | None = None
    tls: bool = False
    client_id: str | None = None
    """By which the broker knows the session again; the run's name and place by default."""
    prefix: str = HOME_ASSISTANT
    """Of the topics of sensors that are given by their `object_id`."""


class SensorSection(Section):
    """`[[sensors]]`: a fixed sensor."""

    name: Name
    point: Annotated[int, Field(ge=1)] | None = None
    """Number of the run's point at which it stands, as the report shows it."""
    position: Vector | None = None
    """Or its own place, traced at the start. [m]"""
    direction: Vector = (0.0, 0.0, 1.0)
    """In which it looks there."""
    port: str | None = None
    """Serial port or URL of an AS7265x."""
    log: str | None = None
    """A CSV that grows."""
    object_id: str | None = None
    """Home Assistant's: its topic is PREFIX/sensor/OBJECT_ID/state."""
    topic: str | None = None
    topics: dict[str, str] = Field(default_factory=dict)
    """A topic a channel, by label."""
    value: str | None = None
    """Value template; None where the payload is the number. The word CHANNEL in it stands for each channel's label."""
    time: str | None = None
    """Value template of the node's own clock in the same payload, in seconds from any origin: its drift is reported."""
    quantity: Quantity | None = None
    unit: Literal["W/m2/nm", "uW/cm2"] = "W/m2/nm"
    """Of channels that come by MQTT."""
    factor: Positive = 1.0
    """On its readings, as `lidarspectra calibrate` tells it of a meter. [1]"""
    sd: Positive | None = None
    """Relative deviation of a single number; 3 % of lux and 5 % of a channel by default. [1]"""
    calibration: str | None = None
    """NAME or NAME@VERSION of an AS7265x."""
    gain: Positive | None = None
    integration_ms: Positive | None = None
    rate: Positive = 1.0
    """Readings a second that a device at a port is asked for. [1/s]"""
    baud: int | None = None

    @model_validator(mode="after")
    def _one_place_one_source(self) -> Self:
        if self.point is not None and self.position is not None:
            raise ValueError("give either point, a number of the run's points, or position, in metres")
        given = [self.port, self.log, self.object_id, self.topic, self.topics or None]
        if sum(each is not None for each in given) != 1:
            raise ValueError("give one of port, log, object_id, topic and topics")
        if self.topics and self.quantity == "lux":
            raise ValueError("topics are of channels: give topic for lux")
        if self.port is not None and self.quantity == "lux":
            raise ValueError("an AS7265x at a port gives channels, no lux")
        return self

    @property
    def has_place(self) -> bool:
        """Whether it says where it stands."""
        return self.point is not None or self.position is not None

    @property
    def reads(self) -> tuple[Quantity, ...]:
        """What it may give: of a log both, as it has them."""
        if self.quantity is not None:
            return (self.quantity,)
        if self.log is not None:
            return ("lux", "channels")
        return ("channels",) if self.port is not None or self.topics else ("lux",)

    @property
    def is_mqtt(self) -> bool:
        """Whether a broker has it."""
        return self.port is None and self.log is None


class SwitchSection(Section):
    """`[[switches]]`: what says whether a lamp is on: 1, 0, ON, OFF, or a dimming level between."""

    lamp: Name
    topic: str | None = None
    object_id: str | None = None
    """Home Assistant's: its topic is PREFIX/light/OBJECT_ID/state."""
    value: str | None = None
    factor: Positive = 1.0

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.topic is None) == (self.object_id is None):
            raise ValueError("give either topic or object_id")
        return self


class SensorsFile(Section):
    """The whole file."""

    sensors: tuple[SensorSection, ...] = Field(min_length=1)
    switches: tuple[SwitchSection, ...] = ()
    broker: BrokerSection | None = None
    max_age_s: Positive = 60.0
    """Older readings count no more. [s]"""

    @model_validator(mode="after")
    def _whole(self) -> Self:
        names = [sensor.name for sensor in self.sensors]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two sensors have the name {twice[0]!r}")
        if self.broker is None and (self.switches or any(sensor.is_mqtt for sensor in self.sensors)):
            raise ValueError("topics need a table [broker] with its host")
        return self


def password() -> str | None:
    """The broker's, from the environment."""
    return os.environ.get(PASSWORD)


def read_sensors(sources: list[str], *, need_places: bool = True) -> tuple[SensorsFile, Path]:
    """The sensors that `--source` names.

    Parameters
    ----------
    sources : list of str
        One TOML file, or for each sensor NAME@POINT=PORT or NAME@POINT=LOG.csv, where POINT is the number of a point
        of the run, or X,Y,Z in metres.
    need_places : bool
        Whether each must say where it stands; a recording takes NAME=PORT too.

    Returns
    -------
    sensors : SensorsFile
    folder : Path
        Where relative names of logs start.

    Raises
    ------
    ReadingError
        If a source cannot be read or understood.
    """
    name = "NAME@POINT" if need_places else "NAME"
    if need_places:
        files = [source for source in sources if "@" not in source.partition("=")[0]]
    else:
        files = [source for source in sources if "=" not in source]
    if len(files) > 1 or (files and len(sources) > 1):
        raise ReadingError(
            expected=f"one file of sensors, or {name}=SOURCE for each sensor",
            found=", ".join(sources),
            where="--source",
            todo="Write all sensors into one file.",
        )
    if not files:
        sections = {"sensors": [_short(source) for source in sources]}
        return _placed(_checked(sections, "--source"), "--source", need_places), Path()
    path = Path(files[0])
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors of Windows may begin a text with a mark
    except (OSError, UnicodeDecodeError) as cause:
        raise ReadingError(
            expected=f"a file of sensors (TOML), or {name}=PORT or {name}=LOG.csv",
            found=str(cause),
            where=files[0],
            todo="docs/howto-live.md has an example.",
        ) from cause
    page = "docs/howto-live.md"
    found = parse_sections(SensorsFile, text, kind="file of sensors", where=str(path), error=ReadingError, page=page)
    return _placed(found, str(path), need_places), path.parent


def _placed(sensors: SensorsFile, where: str, need_places: bool) -> SensorsFile:
    """The same, where every sensor has a place or needs none."""
    for sensor in sensors.sensors:
        if need_places and not sensor.has_place:
            raise ReadingError(
                expected="either point, a number of the run's points, or position, in metres",
                found="neither",
                where=f"{where}, sensor '{sensor.name}'",
                todo="Say where each sensor stands.",
            )
    return sensors


def _checked(content: dict[str, Any], where: str) -> SensorsFile:
    return check_sections(
        SensorsFile, content, kind="source", where=where, error=ReadingError, page="docs/howto-live.md"
    )


def _short(source: str) -> dict[str, object]:
    """NAME@POINT=PORT or NAME@POINT=LOG.csv as a table."""
    place, _, given = source.partition("=")
    if "@" not in place and place and given:
        return {"name": place, "log" if given.lower().endswith(LOG_SUFFIXES) else "port": given}
    name, _, point = place.rpartition("@")
    words = point.split(",")
    if not name or not given or len(words) not in (1, 3):
        raise ReadingError(
            expected="NAME@POINT=PORT or NAME@POINT=LOG.csv, as desk@12=/dev/ttyUSB0 or desk@1.2,3.4,0.75=desk.csv",
            found=f"'{source}'",
            where="--source",
        )
    try:
        where = {"point": int(point)} if len(words) == 1 else {"position": [float(word) for word in words]}
    except ValueError as cause:
        raise ReadingError(
            expected="the number of a point of the run, or x,y,z in metres", found=f"'{point}'", where=f"'{source}'"
        ) from cause
    return {"name": name, **where, "log" if given.lower().endswith(LOG_SUFFIXES) else "port": given}
