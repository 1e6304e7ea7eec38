"""What every command prints: lines that can be copied, tables in their formats."""

import pandas as pd
import pytest

from lidarspectra.cli.terminal import say, shown
from lidarspectra.mapping.figures.tables import Table


def test_a_long_path_is_printed_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    words = "Report: /" + "folder/" * 40 + "[1]/index.html"
    say(words)
    assert capsys.readouterr().out == words + "\n"


def test_a_number_is_shown_in_its_column_s_format_and_a_missing_one_as_a_dash() -> None:
    frame = pd.DataFrame({"lamp": ["north", "south"], "share [%]": [12.345, float("nan")], "flux [W]": [1.23456, 2.0]})
    drawn = shown(Table(name="lamps", caption="Lamps.", frame=frame, formats={"share [%]": ".1f"}))
    assert [[str(cell) for cell in column.cells] for column in drawn.columns] == [
        ["north", "south"],
        ["12.3", "–"],
        ["1.235", "2"],
    ]
    assert [column.justify for column in drawn.columns] == ["left", "right", "right"]
