"""The line protocol of our sketches: frames, headers, sequence numbers."""

import numpy as np
import pytest

from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, SensorSettings
from lidarspectra.hardware.sensor.line_frames import DeviceClock, checksum, frame, frames_in
from lidarspectra.hardware.sensor.line_protocol import LineProtocolDriver
from lidarspectra.hardware.sensor.sensor_records import CellReading, Item, Moment, Note, Reading, Trouble
from lidarspectra.hardware.virtual.emulator import SketchBoard

HEADER = "H,1,as7265x,3,S,gain:1,integration:ms," + ",".join(
    f"{letter}:count" for letter in reversed(ASCENDING_LETTERS)
)


def at(seconds: float) -> Moment:
    return Moment(unix_s=1e9 + seconds, monotonic_s=seconds)


def data(sequence: int, *, boot: int = 3, ms: int | None = None, first: int = 100) -> bytes:
    counts = ",".join(str(first + i) for i in range(18))
    return frame(f"D,{boot},S,{sequence},{ms if ms is not None else 1000 * sequence},16,165.2,{counts}")


def driver() -> LineProtocolDriver:
    fresh = LineProtocolDriver(settings=None, period_s=1.0)
    fresh.connect(at(0))
    return fresh


def sequences(items: list[Item]) -> list[int | None]:
    return [item.sequence for item in items if isinstance(item, Reading)]


def reasons(items: list[Item]) -> list[str]:
    return [item.reason for item in items if isinstance(item, Trouble)]


def test_the_checksum_is_crc_16_ccitt_false() -> None:
    assert checksum(b"123456789") == 0x29B1  # its published check value


def test_a_damaged_byte_is_noticed_wherever_it_is() -> None:
    whole = data(1).rstrip()
    for place in range(len(whole)):
        for change in (0x01, 0x20, 0x80):
            spoiled = bytearray(whole)
            spoiled[place] ^= change
            assert (
                data(1).decode().strip()[1:-5] not in list(frames_in(bytes(spoiled)))
                or spoiled[-4:].upper() == whole[-4:]
            )


def test_whole_frames_are_found_between_remains_of_others() -> None:
    line = data(1)[:40] + data(2).rstrip() + b"\xff\x00$*" + data(3).rstrip() + data(4)[:10]
    assert [body.split(",")[3] for body in frames_in(line)] == ["2", "3"]


def test_channels_are_placed_by_the_headers_names() -> None:
    talk = driver()
    talk.receive(frame(HEADER), at(0))
    (reading,) = [item for item in talk.receive(data(0), at(0.1)) if isinstance(item, Reading)]
    # the header names L first, so the first number is that of 940 nm
    assert list(reading.counts) == [100.0 + i for i in reversed(range(18))]
    assert (reading.gain, reading.integration_ms) == (16.0, 165.2)


def test_lines_before_the_header_wait_for_it_and_are_not_guessed() -> None:
    talk = driver()
    assert sequences(talk.receive(data(5) + data(6), at(1))) == []
    talk.tick(at(2))
    assert b"?\n" in talk.outgoing()
    assert sequences(talk.receive(frame(HEADER), at(2))) == [5, 6]


def test_a_board_that_is_connected_again_is_asked_for_its_header_until_it_answers_and_no_longer() -> None:
    talk = driver()
    talk.receive(frame(HEADER) + frame("A,3,P,1000"), at(0))
    talk.outgoing()
    talk.connect(at(10))
    assert b"?" in talk.outgoing()
    talk.receive(frame(HEADER) + frame("A,3,P,1000"), at(10.5))  # the same as before: it had not restarted
    for second in range(12, 20):
        talk.tick(at(second))
    assert talk.outgoing() == b""


def test_lines_that_never_get_a_header_are_told_at_the_end() -> None:
    talk = driver()
    talk.receive(data(5) + data(6), at(1))
    (trouble,) = talk.finish(at(9))
    assert isinstance(trouble, Trouble)
    assert trouble.lost == 2


def test_missing_numbers_are_counted() -> None:
    talk = driver()
    talk.receive(frame(HEADER) + data(0), at(0))
    items = talk.receive(data(4), at(4))
    assert [item.lost for item in items if isinstance(item, Trouble)] == [3]


def test_a_repeated_line_is_one_reading() -> None:
    talk = driver()
    items = talk.receive(frame(HEADER) + data(0) + data(1) + data(1) + data(0) + data(2), at(2))
    assert sequences(items) == [0, 1, 2]
    assert reasons(items) == ["repeat", "repeat"]


def test_a_restart_is_told_by_its_number_and_settings_are_ordered_again() -> None:
    talk = LineProtocolDriver(settings=SensorSettings(gain_code=3, integration_steps=100), period_s=0.5)
    talk.connect(at(0))
    talk.outgoing()
    talk.receive(frame(HEADER) + data(0) + frame("A,3,P,500") + frame("A,3,G,3") + frame("A,3,I,100"), at(0))
    talk.tick(at(5))
    assert talk.outgoing() == b""  # all is answered
    items = talk.receive(frame(HEADER.replace(",3,S", ",4,S")) + data(2, boot=4), at(9))
    assert reasons(items) == ["reset", "lost"]
    assert sum(item.lost for item in items if isinstance(item, Trouble)) == 2  # readings 0 and 1 of the new start
    talk.tick(at(10))
    assert set(talk.outgoing().split()) == {b"P=500", b"G=3", b"I=100"}


def test_a_board_that_counts_anew_without_a_new_start_is_a_restart() -> None:
    talk = driver()
    talk.receive(frame(HEADER) + data(7, ms=70000), at(0))
    items = talk.receive(data(0, ms=1000), at(1))
    assert reasons(items) == ["reset"]
    assert sequences(items) == [0]


def test_a_header_of_another_version_is_not_believed() -> None:
    talk = driver()
    items = talk.receive(frame(HEADER.replace("H,1", "H,2")) + data(0), at(0))
    assert sequences(items) == []
    assert "damaged" in reasons(items)


def test_a_line_that_was_held_up_is_dated_back() -> None:
    clock = DeviceClock()
    for second in range(10):
        assert clock.date(1000 * second, at(second + 0.010)).monotonic_s == second + 0.010
    late = clock.date(10000, at(14.0))
    assert abs(late.monotonic_s - 10.0) < 0.02  # 0.01 s of the way, and the rate of a clock that is not known yet


@pytest.mark.parametrize("on_s", [0.0, 3e6])  # how long the board has been on
@pytest.mark.parametrize("rate", [5e-3, 1e-3, 0.0, -5e-3])
def test_a_board_whose_clock_is_slow_or_fast_is_not_dated_back_and_a_line_that_was_held_up_is(
    rate: float, on_s: float
) -> None:
    clock, ways = DeviceClock(), np.random.default_rng(0).exponential(0.005, 7200)
    for second in range(7200):
        arrived = second + 0.01 + float(ways[second])
        measured = clock.date(round(1000 * (on_s + (1.0 - rate) * second)), at(arrived)).monotonic_s
        assert second - 0.001 <= measured <= arrived, second
    late = clock.date(round(1000 * (on_s + (1.0 - rate) * 7200)), at(7210.0))
    assert abs(late.monotonic_s - 7200.0) < 0.03


@pytest.mark.parametrize("is_late", [False, True])
def test_a_board_that_counts_milliseconds_from_0_again_goes_on_in_time(is_late: bool) -> None:
    talk, begin = driver(), 2**32 - 5000
    talk.receive(frame(HEADER), at(0.5))
    readings = []
    for second in range(1, 11):
        line = data(second, ms=(begin + 1000 * second) % 2**32)
        arrived = second + 3.0 if is_late and second == 10 else second + 0.01
        readings += [item for item in talk.receive(line, at(arrived)) if isinstance(item, Reading)]
    assert [reading.sequence for reading in readings] == list(range(1, 11))
    assert [reading.moment.unix_s - 1e9 for reading in readings] == pytest.approx(range(1, 11), abs=0.05)


def test_cells_and_spectrum_come_over_one_wire() -> None:
    board = SketchBoard(cells=lambda now_s: (110, 99, 8))
    talk = driver()
    items: list[Item] = []
    for message in board.advance(10.0):
        items += talk.receive(message.data, at(10.0))
    cells = [item for item in items if isinstance(item, CellReading)]
    assert cells[0].counts == (110.0, 99.0, 8.0)
    assert len(cells) == len(sequences(items)) > 5
    assert not [item for item in items if isinstance(item, Trouble)]
    assert any(isinstance(item, Note) and "reference" not in item.text for item in items)
    assert any("reference_mV = 5000" in line for line in talk.describe())


def test_module_values_may_be_missing_without_counts_being_so() -> None:
    names = ",".join(
        [f"{letter}:count" for letter in ASCENDING_LETTERS] + [f"{letter}:module" for letter in ASCENDING_LETTERS]
    )
    talk = driver()
    counts = ",".join(["7"] * 17 + ["65535"])
    values = ",".join(["nan"] + ["3.50"] * 16 + ["4294967296.00"])
    items = talk.receive(frame(f"H,1,x,3,S,{names}") + frame(f"D,3,S,0,10,{counts},{values}"), at(0))
    (reading,) = [item for item in items if isinstance(item, Reading)]
    assert np.array_equal(np.isnan(reading.counts), [False] * 17 + [True])
    assert np.array_equal(np.isnan(reading.module_values), [True] + [False] * 16 + [True])
    assert list(reading.flags) == [0] * 17 + [1]
