"""Values as TOML writes them are read back as they were."""

import tomllib
from datetime import UTC, datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarspectra.errors import RunFileError
from lidarspectra.io.toml_text import toml_value


@settings(deadline=None)  # a busy machine is no fault
@given(st.text())
def test_every_text_survives_as_a_toml_value(text: str) -> None:
    try:
        written = toml_value(text)
    except RunFileError:
        assert any(0xD800 <= ord(character) <= 0xDFFF for character in text)
        return
    assert "\n" not in written
    assert tomllib.loads(f"key = {written}")["key"] == text


def test_a_name_that_is_no_unicode_is_refused() -> None:
    with pytest.raises(RunFileError, match="Rename"):
        toml_value("room\udcff.glb")


@pytest.mark.parametrize(
    "value",
    [
        True,
        3,
        0.1,
        1e-9,
        ["a", "b"],
        [[1.0, 2.0], []],
        {"kind": "grid", "count": 4},
        datetime(2026, 1, 2, 3, tzinfo=UTC),
    ],
)
def test_a_value_is_read_back_as_it_was(value: object) -> None:
    assert tomllib.loads(f"key = {toml_value(value)}")["key"] == value


def test_what_is_none_in_a_table_is_left_out() -> None:
    assert tomllib.loads(f"key = {toml_value({'here': 1, 'gone': None})}")["key"] == {"here": 1}
