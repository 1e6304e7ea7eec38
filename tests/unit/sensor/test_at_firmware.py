"""The module's AT firmware: every reply is held against what was asked."""

import numpy as np
import pytest

from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_LABELS,
    FLAG_DISAGREES,
    FLAG_SATURATED,
    UART_LETTERS,
    SensorSettings,
)
from lidarspectra.hardware.sensor.at_firmware import AtDriver, decimals, integers
from lidarspectra.hardware.sensor.sensor_records import Item, Moment, Reading, Trouble
from lidarspectra.hardware.virtual.emulator import AtModule, office_light

SETTINGS = SensorSettings(gain_code=2, integration_steps=59)


def at(seconds: float) -> Moment:
    return Moment(unix_s=1e9 + seconds, monotonic_s=seconds)


class Talk:
    """A driver and a module, wired together, with a hand on the wire."""

    def __init__(self, module: AtModule | None = None) -> None:
        self.module = module if module is not None else AtModule()
        self.driver = AtDriver(settings=SETTINGS, period_s=1.0)
        self.now = 1.0
        self.items: list[Item] = list(self.driver.connect(at(self.now)))
        self.asked: list[bytes] = []

    def run(self, seconds: float, spoil: dict[bytes, bytes] | None = None) -> list[Item]:
        """Let both talk; replies to the commands in `spoil` are replaced, once each."""
        spoil = dict(spoil or {})
        before = len(self.items)
        end = self.now + seconds
        asked = b""
        while self.now < end:
            self.now += 0.005
            self.items += self.driver.tick(at(self.now))
            out = self.driver.outgoing()
            if out:
                asked = out.strip().split(b"\n")[-1]
                self.asked.append(asked)
                self.module.receive(out, self.now)
            for message in self.module.advance(self.now):
                data = spoil.pop(asked, message.data)
                self.items += self.driver.receive(data, at(self.now))
        return self.items[before:]


def readings(items: list[Item]) -> list[Reading]:
    return [item for item in items if isinstance(item, Reading)]


def reasons(items: list[Item]) -> list[str]:
    return [item.reason for item in items if isinstance(item, Trouble)]


def test_counts_are_placed_by_the_order_of_the_uart() -> None:
    light = np.zeros(18)
    light[CHANNEL_LABELS.index("610")] = 0.5  # only R, which is sent first
    items = Talk(AtModule(lambda now_s: light)).run(3.0)
    assert UART_LETTERS[0] == "R"
    reading = readings(items)[0]
    assert reading.counts[CHANNEL_LABELS.index("610")] == pytest.approx(0.5 * 16 * 165.2, rel=0.02)  # its noise: 0.4 %
    assert reading.counts[CHANNEL_LABELS.index("410")] == 0.0


def test_a_module_in_the_cold_tells_its_temperatures() -> None:
    items = Talk().run(2.0, {b"ATTEMP": b"-3 -2 0 OK\r\n"})
    assert readings(items)[0].temperatures_c == (-3.0, -2.0, 0.0)
    assert not reasons(items)


def test_settings_are_set_read_back_and_stand_with_every_reading() -> None:
    talk = Talk()
    items = talk.run(5.0)
    assert {b"ATGAIN=2", b"ATINTTIME=59", b"ATGAIN", b"ATINTTIME"} <= set(talk.asked)
    assert [(reading.gain, reading.integration_ms) for reading in readings(items)] == [(16.0, 165.2)] * len(
        readings(items)
    )
    assert len(readings(items)) == 5  # one a second, the first after half a second to settle


def test_a_module_that_restarts_is_noticed_and_set_again() -> None:
    talk = Talk()
    talk.run(3.0)
    talk.module.restart(talk.now)
    items = talk.run(4.0)
    assert "settings lost" in reasons(items)
    unsure = [reading for reading in readings(items) if np.isnan(reading.gain)]
    assert len(unsure) == 1  # that one was measured with gain 1, or not: it is not known
    assert readings(items)[-1].gain == 16.0


def test_a_wrong_setting_that_is_a_damaged_reply_is_asked_again() -> None:
    items = Talk().run(3.0, {b"ATGAIN": b"0 OK\n"})
    assert "settings lost" not in reasons(items)
    assert all(reading.gain == 16.0 for reading in readings(items))


@pytest.mark.parametrize(
    "reply",
    [b"", b"1 2 3 OK\n", b"ERROR\n", b"1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 99999 OK\n", b"\xff\x00OK\n",
     b"1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 1x OK\n", b"1.0 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 OK\n"],
)  # fmt: skip
def test_a_damaged_reply_is_asked_for_again_within_its_second(reply: bytes) -> None:
    talk = Talk()
    talk.run(2.0)
    items = talk.run(2.0, {b"ATDATA": reply})
    assert len(readings(items)) == 2
    assert reasons(items)


def test_saturated_channels_are_masked() -> None:
    items = Talk(AtModule(lambda now_s: np.full(18, 1e3))).run(2.0)
    reading = readings(items)[0]
    assert np.isnan(reading.counts).all()
    assert (reading.flags == FLAG_SATURATED).all()


def test_a_nan_of_the_module_stays_missing() -> None:
    module = AtModule()
    module.nan_channels = (4,)
    reading = readings(Talk(module).run(2.0))[0]
    assert np.isnan(reading.module_values[4])
    assert np.isfinite(np.delete(reading.module_values, 4)).all()
    assert np.isfinite(reading.counts).all()


def test_a_digit_that_became_another_shows_in_the_modules_own_value() -> None:
    talk = Talk()
    talk.run(10.0)
    good = talk.module.advance(talk.now)
    assert good == []
    counts = [round(float(n)) for n in office_light(0.0) * 16 * 165.2]
    counts[5] = counts[5] + 600  # 704 became 1304
    order = ["ABCDEFGHRISJTUVWKL".index(letter) for letter in UART_LETTERS]
    spoiled = " ".join(str(counts[i]) for i in order).encode() + b" OK\n"
    items = talk.run(1.0, {b"ATDATA": spoiled})
    (reading,) = readings(items)
    assert list(np.flatnonzero(reading.flags & FLAG_DISAGREES)) == [5]
    assert np.isnan(reading.counts[5])


def test_an_unasked_reading_is_a_repeat() -> None:
    talk = Talk()
    talk.run(3.0)
    reply = b" ".join(str(i).encode() for i in range(18)) + b" OK\n"
    assert reasons(talk.driver.receive(reply, at(talk.now))) == ["repeat"]


def test_silence_is_told_and_the_module_is_set_again_when_it_answers() -> None:
    talk = Talk()
    talk.run(3.0)
    module, talk.module = talk.module, AtModule()
    talk.module.receive = lambda data, now_s: None  # type: ignore[method-assign]
    items = talk.run(5.0)
    assert set(reasons(items)) == {"silence"}
    assert readings(items) == []
    talk.module = module
    talk.module.restart(talk.now)
    assert readings(talk.run(5.0))[-1].gain == 16.0


@pytest.mark.parametrize("words", [["65536"] * 18, ["-1"] * 18, ["1"] * 17, ["1e3"] * 18, ["\u0661"] * 18])
def test_only_eighteen_numbers_of_sixteen_bits_are_counts(words: list[str]) -> None:
    assert integers(words, 18) is None


def test_calibrated_values_have_a_point_or_are_nan() -> None:
    assert decimals(["1.5", "nan", "-0.25"], 3) is not None
    assert decimals(["1", "2.0", "3.0"], 3) is None
