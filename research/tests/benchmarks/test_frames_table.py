"""The table of frames and textures: rows as they were measured, means of the seeds, and the goal by its worst seed."""

import math
from pathlib import Path

from research.benchmarks.frames_table import Measured, goal_line, group_of, main, mean_line, read_rows, save_rows


def measured(kind: str, error: float, bias: float = 0.0) -> Measured:
    return Measured(
        kind=kind, error=error, bias=bias, within_one=0.7, within_two=0.95, nrmse=math.nan, map_bias_percent=math.nan,
        flux_error=0.02, fluxes=3, lamps=11,
    )  # fmt: skip


def test_rows_are_read_as_they_were_saved(tmp_path: Path) -> None:
    row = measured("frames", 0.0123, -0.004)
    save_rows([row], tmp_path)
    again = read_rows(tmp_path)["frames"]
    assert math.isnan(again.nrmse)
    assert (again.error, again.bias, again.fluxes, again.lamps) == (row.error, row.bias, row.fluxes, row.lamps)


def test_seeds_of_a_room_and_its_light_are_one_group() -> None:
    assert {group_of(f"large-office-night-{seed}") for seed in (1, 2, 13)} == {"large-office-night"}
    assert group_of("office-night-2-lamps") == "office-night-lamps"


def test_the_goal_is_held_by_every_seed_and_the_ratio_is_each_scans_own() -> None:
    scans = [
        {"evened": measured("evened", 0.03), "frames": measured("frames", 0.01, 0.014)},
        {"evened": measured("evened", 0.01), "frames": measured("frames", 0.01, -0.016)},
    ]
    assert cells(mean_line("office-night", scans))[:3] == [
        "**office-night**", ".020 ± .014, .010 ± .000", "+.000 ± .000, -.001 ± .021",
    ]  # fmt: skip
    assert cells(mean_line("office-night", scans))[3] == "-, -"  # no map was made
    assert cells(goal_line("office-night", scans)) == [
        "office-night",
        "-.016: missed",
        "",
        ".33, 1.00: met in 1 of 2",
        "",
    ]


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_all_scans_of_a_folder_are_in_the_table(tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    for seed in (1, 2):
        (tmp_path / f"office-day-{seed}").mkdir()
        save_rows([measured("evened", 0.03), measured("frames", 0.01)], tmp_path / f"office-day-{seed}")
    main([str(tmp_path)])
    text = capsys.readouterr().out
    assert text.count("| office-day-") == 2  # beside their mean
    assert ".33, .33: met" in text
