"""Tables of the experiments hold what was compared, and say which goals are missed."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import MapError
from research.benchmarks.scan_after_scan import ScanResult, keep_result, kept_result, scans_table
from research.experiments.accuracy import (
    GOALS,
    accuracy_table,
    defaults_table,
    goal_draws_table,
    goals_table,
    map_deviation,
    paper_table,
)
from research.experiments.results_page import write_results_page
from research.experiments.sensitivity import Change, Influence, influence_table

TRUTH = np.outer(np.linspace(1.0, 2.0, 9), [1.0, 2.0, 3.0])
KEPT = np.arange(9) != 8
Floats = tuple[float, ...]


def deviation(factor: float, materials: str = "estimated"):
    return map_deviation(factor * TRUTH, TRUTH, KEPT, scene="office", materials=materials, accuracy="ultra")


def test_a_wrong_level_shows_in_watts_and_hides_behind_the_normalisation() -> None:
    error = deviation(1.3)
    assert error.absolute.mape_mean == pytest.approx(30.0)
    assert error.normalised.mape_mean == pytest.approx(0.0, abs=1e-9)  # rounding
    assert error.absolute.points == 8  # the point that is left out is out


def test_goals_are_met_by_the_truth_and_missed_by_a_third_too_much() -> None:
    assert set(goals_table([deviation(1.0)]).frame["verdict"]) == {"met"}
    missed = goals_table([deviation(1.3)]).frame
    verdicts = dict(zip(missed["goal"], missed["verdict"], strict=True))
    assert verdicts == {goal: "missed" if goal.startswith("absolute") else "met" for goal in GOALS}


def test_draws_say_how_many_of_them_meet_a_goal_and_how_far_they_spread() -> None:
    frame = goal_draws_table([deviation(1.0), deviation(1.05), deviation(1.3)]).frame.set_index("goal")
    level = frame.loc["absolute median error [%]"]  # at most 3.5
    assert level["traces that meet it"] == "1 of 3"
    assert level[["smallest", "mean", "largest"]].tolist() == pytest.approx([0.0, 35.0 / 3.0, 30.0], abs=1e-9)
    assert frame.loc["normalised MAPE [%]", "traces that meet it"] == "3 of 3"


def test_every_table_has_mean_and_median_and_both_normalisations() -> None:
    columns = list(accuracy_table([deviation(1.1)], name="t", caption="c").frame)
    for kind in ("abs", "0-1"):
        assert {f"{kind} NRMSE mean [1]", f"{kind} NRMSE median [1]", f"{kind} MAPE mean [%]"} <= set(columns)
        assert f"{kind} median error [%]" in columns


def test_default_materials_stand_beside_the_paper_s() -> None:
    frame = defaults_table([deviation(1.5, "white-wall")], [deviation(1.0)], name="t", caption="c").frame
    assert frame["paper MAPE w/o ME [%]"].tolist() == [62.3]
    assert frame["abs MAPE w/o ME [%]"].tolist() == pytest.approx([50.0])
    assert paper_table().frame["MAPE [%]"].tolist() == [18.6, 14.4, 12.64, 12.74]


def test_influences_are_listed_with_the_worst_first() -> None:
    small = Influence(words="small", changes=(Change(words="a", error=deviation(1.01)),))
    large = Influence(words="large", changes=(Change(words="b", error=deviation(0.8)),))
    assert influence_table(deviation(1.0), [small, large]).frame["input"].tolist() == ["nothing", "large", "small"]
    with pytest.raises(MapError):
        Influence(words="none", changes=())


def test_the_page_holds_the_tables_that_are_there_and_no_others(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "table-2.md").write_text("caption\n\n| a |\n| --: |\n| 1 |\n", encoding="utf-8")
    (folder / "reading.md").write_text("What it says.\n", encoding="utf-8")
    page = write_results_page(folder, tmp_path / "results.md").read_text(encoding="utf-8")
    assert "| 1 |" in page
    assert "What it says." in page
    assert "Table 1: error" not in page


def scan_results(scene: str, light: str, *, nrmse: Floats, median: Floats, read: Floats) -> list[ScanResult]:
    """Three scans of a scene."""
    rows = enumerate(zip(nrmse, median, read, strict=True), start=1)
    same = {"scene": scene, "light": light, "reflectance": 0.02, "guessed": 0.2}
    return [ScanResult(**same, seed=n, nrmse=first, median=second, read=last) for n, (first, second, last) in rows]


def test_scans_are_judged_by_their_mean_and_their_spread_is_told() -> None:
    # By day .06 and 3.5 % are allowed, by night .05 and 2.5 %, and .04 after six readings.
    by_day = scan_results("office", "day", nrmse=(0.01, 0.03, 0.08), median=(1.0, 2.0, 4.8), read=(0.01, 0.03, 0.05))
    one_good = scan_results("office", "night", nrmse=(0.01, 0.06, 0.11), median=(1, 2, 3), read=(0.02, 0.05, 0.08))
    median = scan_results("apartment", "night", nrmse=(0.01, 0.03, 0.05), median=(2, 2, 5), read=(0.01, 0.02, 0.03))
    rows = scans_table([*by_day, *one_good, *median]).frame.to_dict("records")
    assert [(row["scene"], row["scanned by"], row["scans"]) for row in rows] == [
        ("office", "day", 3), ("office", "night", 3), ("apartment", "night", 3)
    ]  # fmt: skip
    assert [row["NRMSE [1]"] for row in rows] == pytest.approx([0.04, 0.06, 0.03])
    assert [row["median [%]"] for row in rows] == pytest.approx([2.6, 2.0, 3.0])
    assert [row["after six readings [1]"] for row in rows] == pytest.approx([0.03, 0.05, 0.02])
    assert [row["of scans"] for row in rows] == ["0.010 to 0.080", "0.010 to 0.110", "0.010 to 0.050"]
    assert [row["of scans, after"] for row in rows] == ["0.010 to 0.050", "0.020 to 0.080", "0.010 to 0.030"]
    assert [row["goals"].rpartition(": ")[2] for row in rows] == ["met", "missed", "missed"]
    assert [row["goal, after"].rpartition(": ")[2] for row in rows] == ["met", "missed", "met"]
    # How much was luck: which scans would have met the goals alone
    assert [row["scans that meet them alone"] for row in rows] == ["2 of 3", "1 of 3", "2 of 3"]
    assert [row["scans that meet it alone"] for row in rows] == ["2 of 3", "1 of 3", "3 of 3"]
    assert [row["rooms"] for row in rows] == ["1", "1", "2, joined by a doorway"]


def test_what_is_kept_of_a_scan_is_what_was_found(tmp_path: Path) -> None:
    result = scan_results("office", "day", nrmse=(0.01,), median=(2.0,), read=(0.03,))[0]
    keep_result(result, tmp_path / "result.json")
    assert kept_result(tmp_path / "result.json") == result
