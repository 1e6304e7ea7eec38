"""One DataFrame, three forms; nothing in a user's words gets out of its cell."""

import csv
import io
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.tables import Table, save_table, table_csv, table_html, table_markdown

HOSTILE = "<script>alert(\"1\")</script> & 'a' | b\n# c `d` [e](f) =1+1"


@pytest.fixture
def table() -> Table:
    frame = pd.DataFrame(
        {
            "name": ["plain", HOSTILE],
            "area [m²]": [1.23456789012, -2.0],
            "count [1]": [3, 4],
            "seen": [True, False],
            "colour": ["#a0b1c2", "#no"],
        }
    )
    return Table(name="test-1", caption="Some <things>.", frame=frame, formats={"area [m²]": ".2f"})


class _Cells(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.cells: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_data(self, data: str) -> None:
        if self.cells:
            self.cells[-1] += data


def test_csv_gives_back_words_as_they_were_and_numbers_to_nine_digits(table):
    rows = list(csv.reader(io.StringIO(table_csv(table))))
    assert rows[0] == ["name", "area [m²]", "count [1]", "seen", "colour"]
    assert rows[2][0] == HOSTILE
    assert rows[1][1] == "1.23456789"


def test_markdown_has_one_line_a_row_and_as_many_cells_as_headings(table):
    lines = table_markdown(table).splitlines()
    assert len(lines) == 4
    for line in lines:
        bars = line.replace("\\\\", "").replace("\\|", "").count("|")
        assert bars == 6
    assert "<script>" not in table_markdown(table)
    assert "| 1.23 |" in lines[2]


def test_html_shows_words_and_runs_none_of_them(table):
    element = table_html(table)
    parser = _Cells()
    parser.feed(element)
    assert "script" not in parser.tags
    assert HOSTILE in parser.cells
    assert "<things>" in element.replace("&lt;", "<").replace("&gt;", ">")
    assert "<things>" not in element


def test_numbers_are_formatted_for_reading_and_kept_for_sorting(table):
    element = table_html(table)
    assert 'data-value="1.23456789012">1.23<' in element
    assert ">−2.00<" in element


def test_only_a_true_colour_becomes_a_style(table):
    element = table_html(table)
    assert element.count("style=") == 1
    assert 'style="background:#a0b1c2"' in element


def test_rows_beyond_the_limit_are_left_out_of_html_only(table):
    assert table_html(table, max_rows=1).count("<tr>") == 2
    assert len(table_csv(table).splitlines()) > 2


def test_a_table_is_saved_in_three_forms(table, tmp_path):
    paths = save_table(table, tmp_path)
    assert [path.name for path in paths] == ["test-1.csv", "test-1.md", "test-1.html"]
    assert paths[2].read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    with pytest.raises(MapError, match="can be written"):
        save_table(table, tmp_path / "nowhere")


@pytest.mark.parametrize("name", ["", "../escape", "Upper", "a/b", "a.b", "CON:"])
def test_a_file_name_is_ours_and_plain(name):
    with pytest.raises(MapError, match="file name"):
        Table(name=name, caption="", frame=pd.DataFrame({"a": [1]}))


def test_two_columns_of_one_name_are_refused():
    with pytest.raises(MapError, match="a heading twice"):
        Table(name="twice", caption="", frame=pd.DataFrame([[1, 2]], columns=["a", "a"]))


def test_a_missing_number_is_a_dash_and_an_empty_table_is_a_table():
    element = table_html(Table(name="gap", caption="", frame=pd.DataFrame({"a": [np.nan]})))
    assert ">–<" in element
    empty = Table(name="empty", caption="None.", frame=pd.DataFrame({"a": [], "b": []}))
    assert table_markdown(empty).splitlines()[0] == "| a | b |"
    assert "<tbody></tbody>" in table_html(empty)


def test_a_long_table_is_whole_in_csv_and_says_elsewhere_that_it_was_cut(tmp_path):
    long = Table(name="long", caption="Many.", frame=pd.DataFrame({"a": np.arange(2500)}))
    paths = save_table(long, tmp_path)
    assert len(paths[0].read_text(encoding="utf-8").splitlines()) == 2501
    assert len(paths[1].read_text(encoding="utf-8").splitlines()) == 2002
    assert "The first 2000 of 2500 rows; long.csv has all." in paths[2].read_text(encoding="utf-8")
