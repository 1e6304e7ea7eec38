"""What every command prints: lines that can be copied, tables in their formats."""

from io import StringIO

import pandas as pd
import pytest

from lidarspectra.cli.terminal import PipeFriendlyConsole, console, say, shown
from lidarspectra.mapping.figures.tables import Table


def test_a_long_path_is_printed_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    words = "Report: /" + "folder/" * 40 + "[1]/index.html"
    say(words)
    assert capsys.readouterr().out == words + "\n"


def test_a_piped_table_and_a_piped_sentence_keep_one_line_each_whatever_their_length(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sentence = "A sentence of many words. " * 40
    frame = pd.DataFrame({"name": ["floor"], "what it is": ["oak, oiled, " * 30], "mean [lx]": [214.0]})
    console.print(sentence)
    console.print(shown(Table(name="surfaces", caption="A caption of several words.", frame=frame)))
    console.print(shown(Table(name="few", caption=sentence, frame=frame[["name"]])))
    *printed, caption, _, narrow = capsys.readouterr().out.splitlines()
    assert printed[0] == sentence
    assert caption.strip() == sentence.strip()
    assert narrow.split() == ["floor"]
    assert [line.split()[0] for line in printed[1:]] == ["A", "name", "floor"]
    assert "oak, oiled, " * 30 in printed[3]


def test_on_a_terminal_a_sentence_is_broken_at_its_width() -> None:
    drawn = PipeFriendlyConsole(file=StringIO(), force_terminal=True, width=40, height=25)
    assert drawn.width == 40


def test_a_number_is_shown_in_its_column_s_format_and_a_missing_one_as_a_dash() -> None:
    frame = pd.DataFrame({"lamp": ["north", "south"], "share [%]": [12.345, float("nan")], "flux [W]": [1.23456, 2.0]})
    drawn = shown(Table(name="lamps", caption="Lamps.", frame=frame, formats={"share [%]": ".1f"}))
    assert [[str(cell) for cell in column.cells] for column in drawn.columns] == [
        ["north", "south"],
        ["12.3", "–"],
        ["1.235", "2"],
    ]
    assert [column.justify for column in drawn.columns] == ["left", "right", "right"]
