import pytest

from lidarspectra.words import counted, digits, duration_words, two_digits, were


@pytest.mark.parametrize(
    ("number", "noun", "words"),
    [(0, "gap", "0 gaps"), (1, "gap", "1 gap"), (2, "gap", "2 gaps"), (1, "pass", "1 pass"), (14, "pass", "14 passes")],
)
def test_a_noun_agrees_with_its_number(number: int, noun: str, words: str) -> None:
    assert counted(number, noun) == words


@pytest.mark.parametrize(
    ("value", "spec", "words"),
    [
        (1012.3, ".3g", "1010"),
        (-123_456.0, "+.4g", "-123500"),
        (4812.0, "+.2g", "+4800"),
        (234.6, ".3g", "235"),
        (0.0001234, ".2e", "1.23e-04"),
        (1234.0, ".2e", "1.23e+03"),
        (2e12, ".3g", "2e+12"),
        (1234.5, ".1f", "1234.5"),
    ],
)
def test_a_large_number_is_written_in_its_digits(value: float, spec: str, words: str) -> None:
    assert digits(value, spec) == words


@pytest.mark.parametrize(
    ("value", "words"),
    [(177.8, "180"), (98.7, "99"), (99.6, "100"), (2.04, "2"), (0.123, "0.12"), (-340.0, "-340"), (23_456.0, "23,000")],
)
def test_a_rounded_number_has_no_exponent(value: float, words: str) -> None:
    assert two_digits(value) == words


@pytest.mark.parametrize(
    ("seconds", "words"), [(438.0, "7.3 minutes"), (3 * 3600.0, "3.0 hours"), (1_946_694.0, "22.5 days")]
)
def test_a_span_is_told_in_a_unit_that_fits_it(seconds: float, words: str) -> None:
    assert duration_words(seconds) == words


def test_a_verb_agrees_with_its_number() -> None:
    assert were(1, "row") == "1 row was"
    assert were(2, "row", ("is", "are")) == "2 rows are"
