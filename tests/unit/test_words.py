import pytest

from lidarspectra.words import counted, were


@pytest.mark.parametrize(
    ("number", "noun", "words"),
    [(0, "gap", "0 gaps"), (1, "gap", "1 gap"), (2, "gap", "2 gaps"), (1, "pass", "1 pass"), (14, "pass", "14 passes")],
)
def test_a_noun_agrees_with_its_number(number: int, noun: str, words: str) -> None:
    assert counted(number, noun) == words


def test_a_verb_agrees_with_its_number() -> None:
    assert were(1, "row") == "1 row was"
    assert were(2, "row", ("is", "are")) == "2 rows are"
