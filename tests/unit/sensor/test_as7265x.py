"""Channels, orders, settings and counts of the AS7265x."""

import itertools

import numpy as np
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_LABELS,
    DIE_INDEX,
    DIES,
    FLAG_MISSING,
    FLAG_SATURATED,
    UART_ORDER,
    ChannelOrder,
    SensorSettings,
    basic_counts,
    channel_letter,
    count_uncertainty,
    mask_counts,
    nominal_responsivity,
    order_from_header,
    settings_for,
)


def test_the_uart_sends_die_by_die_and_is_put_by_wavelength() -> None:
    sent = np.arange(18.0)  # R is sent first, F last
    placed = UART_ORDER.ascending(sent)
    assert dict(zip(ASCENDING_LETTERS, placed, strict=True))["R"] == 0.0
    assert dict(zip(ASCENDING_LETTERS, placed, strict=True))["A"] == 12.0
    assert dict(zip(ASCENDING_LETTERS, placed, strict=True))["F"] == 17.0
    assert dict(zip(CHANNEL_LABELS, placed, strict=True))["610"] == 0.0  # R is 610 nm


def test_each_die_has_six_channels() -> None:
    assert [np.count_nonzero(die == DIE_INDEX) for die in range(len(DIES))] == [6, 6, 6]
    assert DIES[DIE_INDEX[CHANNEL_LABELS.index("610")]] == "AS72651"
    assert DIES[DIE_INDEX[CHANNEL_LABELS.index("585")]] == "AS72652"


@pytest.mark.parametrize(
    ("name", "letter"),
    [
        ("A", "A"), ("w", "W"), ("410", "A"), ("610nm", "R"), ("610 nm", "R"), ("E_410", "A"), ("R_610", "R"),
        ("A (410 nm)", "A"), ("count_940", "L"), ("module_940", "L"), ("Q", None), ("M", None), ("solar1", None),
        ("date", None), ("12.76", None), ("wavelength1", None), ("611", None), ("A_610", None), ("", None),
    ],
)  # fmt: skip
def test_a_column_name_means_one_channel_or_none(name: str, letter: str | None) -> None:
    assert channel_letter(name) == letter


def test_any_permutation_in_a_header_is_understood() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        letters = tuple(rng.permutation(list(ASCENDING_LETTERS)))
        order = order_from_header([*letters, ""], where="test")
        assert order is not None
        values = np.array([ASCENDING_LETTERS.index(letter) for letter in letters], dtype=float)
        assert np.array_equal(order.ascending(values), np.arange(18.0))


@pytest.mark.parametrize(
    "fields",
    [["A", "B", "C", "D", "E"], ["A"] * 18, ["A", "B", "C", "D", "E", "F", "x"], ["1.0"] * 18, [""] * 18, []],
)
def test_what_is_no_header_is_no_order(fields: list[str]) -> None:
    assert order_from_header(fields, where="test") is None


def test_an_order_of_six_channels_leaves_the_others_unknown() -> None:
    order = order_from_header(["R", "S", "T", "U", "V", "W"], where="test")
    assert order is not None
    assert int(np.isfinite(order.ascending(np.ones(6))).sum()) == 6


def test_an_order_names_each_channel_once() -> None:
    with pytest.raises(ReadingError):
        ChannelOrder(letters=("A", "A"), said_by="test")
    with pytest.raises(ReadingError):
        ChannelOrder(letters=("M",), said_by="test")


def test_basic_counts_do_not_depend_on_the_settings() -> None:
    light = 0.37  # counts a millisecond at gain 1
    for code, steps in itertools.product(range(4), (1, 59, 255)):
        settings = SensorSettings(gain_code=code, integration_steps=steps)
        counts = np.full((1, 18), light * settings.gain * settings.integration_ms)
        assert np.allclose(basic_counts(counts, [settings.gain], [settings.integration_ms]), light, rtol=1e-12)


def test_saturated_and_missing_counts_are_masked_and_flagged() -> None:
    counts, flags = mask_counts([0.0, 65534.0, 65535.0, np.nan, -1.0])
    assert np.array_equal(np.isnan(counts), [False, False, True, True, True])
    assert list(flags) == [0, 0, FLAG_SATURATED, FLAG_MISSING, FLAG_MISSING]


def test_uncertainty_of_a_count_is_rounding_for_few_and_repeatability_for_many() -> None:
    few, many = count_uncertainty([0.0, 10000.0])
    assert few == pytest.approx(1 / np.sqrt(12))
    assert many == pytest.approx(40.0, rel=1e-3)


def test_the_data_sheets_responsivity_by_hand() -> None:
    # 35 counts per uW/cm2 at gain 16 and 166 ms; 1 W/m2/nm over 21.29 nm is 2129 uW/cm2
    responsivity, relative = nominal_responsivity()
    assert responsivity == pytest.approx(35 * 2129 / (16 * 166), rel=1e-3)  # the width is rounded here
    assert 0.069 < relative < 0.08


def test_settings_are_the_devices_own_steps() -> None:
    assert settings_for(16, 166).integration_steps == 59
    assert settings_for(3.7, 2.8) == SensorSettings(gain_code=1, integration_steps=1)
    for gain, time_ms in ((2, 166), (16, 0.1), (16, 800)):
        with pytest.raises(ReadingError):
            settings_for(gain, time_ms)
