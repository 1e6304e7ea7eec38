"""Text that the SparkFun examples print: recognised by form, believed by header."""

import numpy as np
import pytest

from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, ASCENDING_ORDER, FLAG_DAMAGED, FLAG_SATURATED
from lidarspectra.hardware.sensor.sensor_records import Item, Moment, Note, Reading, Trouble
from lidarspectra.hardware.sensor.sketch_text import SketchTextDriver, split_row

ROW = ",".join(f"{10 + i}.25" for i in range(18)) + ","


def at(seconds: float) -> Moment:
    return Moment(unix_s=1e9 + seconds, monotonic_s=seconds)


def talk(*lines: str, order: object = None) -> list[Item]:
    driver = SketchTextDriver(order=ASCENDING_ORDER, period_s=1.0, settings=None)
    items: list[Item] = []
    for second, line in enumerate(lines):
        items += driver.receive(f"{line}\r\n".encode("latin-1"), at(second))
    return items


def readings(items: list[Item]) -> list[Reading]:
    return [item for item in items if isinstance(item, Reading)]


def test_rows_with_decimals_are_module_values_and_whole_ones_are_counts() -> None:
    (module,) = readings(talk(ROW))
    assert np.isfinite(module.module_values).all()
    assert np.isnan(module.counts).all()
    (counts,) = readings(talk(",".join(str(i) for i in range(18)) + ","))
    assert list(counts.counts) == list(range(18))
    assert np.isnan(counts.module_values).all()


def test_a_saturated_value_prints_as_ovf_and_is_masked() -> None:
    (reading,) = readings(talk("ovf," + ROW.split(",", 1)[1]))
    assert np.isnan(reading.module_values[0])
    assert reading.flags[0] == FLAG_SATURATED


@pytest.mark.parametrize("front", ["12.50Hz,", "14:36:08.123 -> ", "14:36:08.123 -> 12.50Hz,"])
def test_the_read_rate_and_the_monitors_time_stamp_are_no_channel(front: str) -> None:
    (reading,) = readings(talk(front + ROW))
    assert reading.module_values[0] == 10.25
    assert not reading.flags.any()


@pytest.mark.parametrize("cut", range(0, len(ROW) - 1, 7))
def test_a_cut_row_is_no_reading(cut: int) -> None:
    items = talk(ROW, ROW, ROW, ROW[:cut] or "x", ROW)
    assert len(readings(items)) == 4


@pytest.mark.parametrize("cut", [3, 5, 9, 12, 40, 80])
def test_a_row_that_ran_into_the_next_loses_at_most_the_nexts_first_number(cut: int) -> None:
    items = talk(ROW, ROW, ROW, ROW[:cut] + ROW)
    *_, last = readings(items)
    assert len(readings(items)) == 4
    assert np.isnan(last.module_values[0])
    assert last.flags[0] == FLAG_DAMAGED
    assert list(last.module_values[1:]) == [10.25 + i for i in range(1, 18)]


def test_a_row_whose_start_came_long_before_its_end_is_not_trusted_at_its_start() -> None:
    driver = SketchTextDriver(order=ASCENDING_ORDER, period_s=1.0, settings=None)
    for second in range(4):
        driver.receive(f"{ROW}\r\n".encode(), at(second))
    driver.receive(b"73", at(4))  # the rest of that row was lost, and the next row follows it: 7310.25 looks whole
    (reading,) = readings(driver.receive(f"{ROW}\r\n".encode(), at(5)))
    assert np.isnan(reading.module_values[0])
    assert reading.flags[0] == FLAG_DAMAGED


def test_a_damaged_character_is_noticed_unless_it_became_a_digit() -> None:
    for place in range(8, len(ROW) - 1):
        spoiled = ROW[:place] + "x" + ROW[place + 1 :]
        assert len(readings(talk(ROW, ROW, ROW, spoiled))) == 3


def test_a_cut_header_does_not_change_the_order() -> None:
    whole = ",".join(ASCENDING_LETTERS)
    for length in range(11, len(whole), 4):
        items = talk(ROW, whole[:length].rstrip(","), ROW, ROW)
        for reading in readings(items):
            assert list(reading.module_values) == [10.25 + i for i in range(18)]


def test_a_whole_header_of_another_order_does() -> None:
    items = talk(ROW, ",".join(reversed(ASCENDING_LETTERS)), ROW)
    first, second = readings(items)
    assert list(second.module_values) == list(reversed(first.module_values))
    assert any(isinstance(item, Note) for item in items)


def test_a_shorter_header_is_believed_when_its_rows_are_as_short() -> None:
    items = talk(ROW, "R,S,T,U,V,W", "1.00,2.00,3.00,4.00,5.00,6.00,")
    *_, last = readings(items)
    assert int(np.isfinite(last.module_values).sum()) == 6


def test_the_same_row_at_once_again_is_one_reading_but_not_after_a_hold_up() -> None:
    driver = SketchTextDriver(order=ASCENDING_ORDER, period_s=1.0, settings=None)
    line = f"{ROW}\r\n".encode()
    for second in range(5):
        driver.receive(line, at(second))
    repeated = driver.receive(line, at(4.01))
    assert [item.reason for item in repeated if isinstance(item, Trouble)] == ["repeat"]
    held_up = driver.receive(line * 4, at(8.0))  # four seconds passed: these are four readings
    assert len(readings(held_up)) == 4


def test_a_flood_without_line_ends_is_told_and_forgotten() -> None:
    driver = SketchTextDriver(order=ASCENDING_ORDER, period_s=1.0, settings=None)
    items = driver.receive(b"A" * 1_000_000, at(0))
    assert [item.reason for item in items if isinstance(item, Trouble)] == ["flood"]


@pytest.mark.parametrize("text", ["", "hello", "1.0", ",", "a,b,c", "\x00\x01"])
def test_what_is_no_row_is_none(text: str) -> None:
    assert split_row(text) is None
