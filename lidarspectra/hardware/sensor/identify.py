"""Finds out what is at the other end of a link: which protocol it speaks, and in which order it sends channels."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from lidarspectra.errors import DeviceError, ReadingError
from lidarspectra.hardware.sensor.as7265x import DEFAULT_SETTINGS, ChannelOrder, SensorSettings, order_from_header
from lidarspectra.hardware.sensor.at_firmware import AtDriver
from lidarspectra.hardware.sensor.drivers import Driver, LineSplitter, printable
from lidarspectra.hardware.sensor.line_frames import frames_in, parse_header
from lidarspectra.hardware.sensor.line_protocol import LineProtocolDriver
from lidarspectra.hardware.sensor.sensor_records import Moment
from lidarspectra.hardware.sensor.serial_link import Clock, Link
from lidarspectra.hardware.sensor.sketch_text import SketchTextDriver, is_complete, split_row

QUESTIONS = ((0.1, b"AT\n"), (0.9, b"?\n"), (1.8, b"AT\n"), (2.7, b"?\n"), (4.0, b"AT\n"), (5.0, b"?\n"))
"""Times [s] and questions: an Arduino takes two seconds to start, during which it ignores input."""
LISTEN_S = 8.0  # [s] how long one baud rate is listened to
RESET_AFTER_S = 6.0  # [s] rows without a header, after which the board is restarted to make it print its header
AFTER_RESET_S = 6.0  # [s] listened for that header
SAMPLE_BYTES = 4096  # of what was heard, kept to describe it

_OK = re.compile(rb"(?:^|[\r\n ])OK[\r\n ]*$")


class UnheardError(DeviceError):
    """Silence, or bytes that are not text: another baud rate may be the right one."""


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What the user asks of the device.

    Parameters
    ----------
    period_s : float
        Time between readings. [s]
    settings : SensorSettings or None
        Gain and integration time; None is the device's own (the AT firmware: gain 16, 165 ms).
    order : ChannelOrder or None
        The order in which a sketch prints, given by the user in place of its header.
    """

    period_s: float = 1.0
    settings: SensorSettings | None = None
    order: ChannelOrder | None = None


@dataclass(frozen=True, kw_only=True)
class Identified:
    """A device that was recognised.

    Parameters
    ----------
    driver : Driver
        For it.
    heard : tuple of (bytes, Moment)
        What it said meanwhile, and when; the driver has not seen it.
    """

    driver: Driver
    heard: tuple[tuple[bytes, Moment], ...]


@dataclass
class _Heard:
    """What has come so far, and what it may mean."""

    chunks: list[tuple[bytes, Moment]] = field(default_factory=list)
    data: bytes = b""
    order: ChannelOrder | None = None
    rows: int = 0
    sample: str = ""


def identify(
    link: Link, clock: Clock, wishes: Wishes, *, where: str, stop: Callable[[], bool] = lambda: False
) -> Identified:
    """Recognise the device on a link.

    Parameters
    ----------
    link : Link
        Open.
    clock : Clock
        Its time.
    wishes : Wishes
        Passed to the driver.
    where : str
        Name of the port, for errors.
    stop : callable
        True to give up.

    Returns
    -------
    identified : Identified

    Raises
    ------
    DeviceError
        If nothing arrives, or nothing that states the order of the channels; after at most about 15 seconds.
    LinkLostError
        If the link breaks.
    """
    heard = _Heard()
    lines = LineSplitter()
    start = clock.now().monotonic_s
    asked = 0
    end, was_reset = start + LISTEN_S, False
    while (now := clock.now().monotonic_s) < end and not stop():
        if asked < len(QUESTIONS) and now - start >= QUESTIONS[asked][0]:
            link.write(QUESTIONS[asked][1])
            asked += 1
        data = link.read(0.05)
        if data:
            heard.chunks.append((data, clock.now()))
            heard.data = (heard.data + data)[-SAMPLE_BYTES:]
        found = _look(lines.feed(data), heard, wishes)
        if found is not None:
            # the AT firmware only answers, so all that it said were answers to our questions here
            return Identified(driver=found, heard=() if isinstance(found, AtDriver) else tuple(heard.chunks))
        if heard.rows and not was_reset and now - start >= RESET_AFTER_S and link.reset_device():
            was_reset = True
            end = now + AFTER_RESET_S
    raise _unknown(heard, where)


def _look(lines: list[bytes], heard: _Heard, wishes: Wishes) -> Driver | None:
    for line in lines:
        for body in frames_in(line):
            if body.startswith("H,"):
                parse_header(body.split(","))  # a header of another version is an error that says so
                return LineProtocolDriver(settings=wishes.settings, period_s=wishes.period_s)
        text = line.decode("ascii", errors="replace").strip()
        order = order_from_header(text.split(","), where=f"line '{text[:60]}'")
        row = split_row(text)
        if order is not None:
            heard.order = order
        # a header of fewer channels may be a cut one: a row with as many numbers confirms it
        said = heard.order or wishes.order
        fits_row = said is not None and row is not None and len(row.fields) == len(said)
        if said is not None and (fits_row or (order is not None and is_complete(order))):
            return SketchTextDriver(order=said, period_s=wishes.period_s, settings=wishes.settings)
        if row is not None and len(row.fields) >= 6:
            heard.rows += 1
            heard.sample = printable(line)
    # an "OK" that ends what was heard, and no echo of our own question before it
    if _OK.search(heard.data[-64:]) and not heard.rows:
        return AtDriver(settings=wishes.settings or DEFAULT_SETTINGS, period_s=wishes.period_s)
    return None


def _unknown(heard: _Heard, where: str) -> DeviceError:
    if heard.rows:
        return DeviceError(
            expected="a header line that names the channels, such as 'A,B,C,D,E,F,G,H,R,I,S,J,T,U,V,W,K,L'",
            found=f"rows of numbers without one ('{heard.sample}')",
            where=where,
            todo="The order of the numbers cannot be known from the numbers. Press the board's reset button while"
            " recording starts, so that it prints its header; or look into its sketch and give the letters in the order"
            " in which it prints them, as --header A,B,C,...; or upload this package's sketch"
            " ('lidarspectra sensor firmware DIR'), which names its columns.",
        )
    if not heard.data:
        return UnheardError(
            expected="an AS7265x module or an Arduino that sends data",
            found="silence",
            where=where,
            todo="Check power, that the module's TX goes to the converter's RX and the other way round, the baud rate"
            " (--baud: 115200 for the module and this package's sketches, 9600 for the SparkFun examples), and that the"
            " module's jumper selects its UART.",
        )
    questions = {part for _, part in QUESTIONS}
    if set(heard.data.splitlines(keepends=True)) <= questions:
        return DeviceError(
            expected="an AS7265x module or an Arduino that answers",
            found="only an echo of the questions sent",
            where=where,
            todo="RX and TX are joined, or this is a loopback: connect the device.",
        )
    readable = sum(32 <= byte < 127 or byte in (9, 10, 13) for byte in heard.data)
    if readable < 0.8 * len(heard.data):
        return UnheardError(
            expected="text",
            found=f"{len(heard.data)} bytes, most of them unprintable",
            where=where,
            todo="The baud rate is probably wrong: give --baud 9600, or the rate in the sketch's Serial.begin.",
        )
    return DeviceError(
        expected="the module's AT firmware, a sketch of this package, or a sketch that prints a header of channels",
        found=f"'{printable(heard.data.strip())}'",
        where=where,
        todo="Upload the sketch of this package to the board ('lidarspectra sensor firmware DIR').",
    )


def order_by_user(text: str) -> ChannelOrder:
    """Channel order from what the user gave as --header.

    Raises
    ------
    ReadingError
        If it does not name six or more channels, each once.
    """
    order = order_from_header(text.replace(" ", ",").replace(",,", ",").split(","), where="given by the user")
    if order is None:
        raise ReadingError(
            expected="six or more channel letters (A to L, R to W) or wavelengths in nm, each once",
            found=f"'{text}'",
            where="--header",
            todo="List them in the order in which the sketch prints them, as A,B,C,D,E,F,G,H,R,I,S,J,T,U,V,W,K,L.",
        )
    return order
