"""Table of what frames buy over textures: scan by scan, means of the seeds, and whether the goal is met.

    python -m research.benchmarks.frames_table FOLDER

Of the rows that `research.benchmarks.frames` left in FOLDER, as Markdown. Each cell has the numbers of textures that
an app blends of these frames, as they are and with gains evened, of one exposure, and of the frames. Goal: a bias of
reflectance within ±.015 of white, and a reflectance error of at most two thirds of the texture's.
"""

import argparse
import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

ROWS = "by-frames.csv"
TEXTURES, FRAMES = ("blended", "evened", "texture"), "frames"
SHOWN = (*TEXTURES, FRAMES)  # in each cell
NAMES = {"texture": "one exposure"}
MAX_BIAS, MAX_RATIO = 0.015, 2.0 / 3.0  # [1] of white; of the texture's error


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What a run makes of one scan by one kind of colours.

    Parameters
    ----------
    kind : str
        One of `SHOWN`, or "true".
    error, bias : float
        Area-weighted mean absolute and signed error of reflectance where frames saw, linear sRGB. [1]
    within_one, within_two : float
        Shares of area, where frames saw, and wavelengths whose truth lies within so many stated deviations. [1]
    nrmse, map_bias_percent : float
        Of the map by the lamps alone against the true room's; NaN where none was made. [1], [%]
    flux_error : float
        Root mean square of the logs of the lamps' relative fluxes over the true ones, if they are not stated, of the
        lamps whose flux is identifiable; NaN where none is. [1]
    fluxes, lamps : int
        Lamps whose flux is identifiable, and all.
    """

    kind: str
    error: float
    bias: float
    within_one: float
    within_two: float
    nrmse: float
    map_bias_percent: float
    flux_error: float
    fluxes: int
    lamps: int


def save_rows(rows: Sequence[Measured], folder: Path) -> None:
    """Write a scan's rows into its folder."""
    with (folder / ROWS).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Measured)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def read_rows(folder: Path) -> dict[str, Measured]:
    """Read a scan's rows, by their kind."""
    with (folder / ROWS).open(newline="", encoding="utf-8") as file:
        return {row["kind"]: _measured(row) for row in csv.DictReader(file)}


def _measured(row: dict[str, str]) -> Measured:
    """A row of a scan's file."""
    return Measured(
        kind=row["kind"], fluxes=int(row["fluxes"]), lamps=int(row["lamps"]),
        **{name: float(text) for name, text in row.items() if name not in ("kind", "fluxes", "lamps")},
    )  # fmt: skip


def group_of(scan: str) -> str:
    """Scene and light of a scan's folder, `SCENE-CASE-SEED[-lamps]`, without its seed."""
    return "-".join(part for part in scan.split("-") if not part.isdigit())


@dataclass(frozen=True, kw_only=True)
class Column:
    """A number of each kind of colours, as the table has it."""

    heading: str
    of: Callable[[Measured], float]
    form: str = "{:.3f}"


COLUMNS = (
    Column(heading="reflectance error", of=lambda row: row.error),
    Column(heading="bias", of=lambda row: row.bias, form="{:+.3f}"),
    Column(heading="map's NRMSE", of=lambda row: row.nrmse),
    Column(heading="map's bias, %", of=lambda row: row.map_bias_percent, form="{:+.1f}"),
    Column(heading="lamps' fluxes off by, %", of=lambda row: 100.0 * row.flux_error, form="{:.1f}"),
    Column(heading="within one deviation, %", of=lambda row: 100.0 * row.within_one, form="{:.0f}"),
    Column(heading="within two, %", of=lambda row: 100.0 * row.within_two, form="{:.0f}"),
)


def in_words(value: float, form: str) -> str:
    """A number without the zero before its point; a dash for none."""
    if np.isnan(value):
        return "-"
    text = form.format(value)
    return text.replace("0.", ".", 1) if text.lstrip("+-").startswith("0.") else text


def scan_line(scan: str, rows: dict[str, Measured]) -> str:
    """A scan's line: in each cell the numbers of the textures, and of the frames."""
    cells = [
        ", ".join(in_words(column.of(rows[kind]), column.form) for kind in SHOWN if kind in rows) for column in COLUMNS
    ]
    return f"| {scan} | {' | '.join(cells)} | {'' if 'true' not in rows else in_words(rows['true'].error, '{:.3f}')} |"


def mean_line(group: str, scans: Sequence[dict[str, Measured]]) -> str:
    """The means of some seeds, and their standard deviations."""
    cells = []
    for column in COLUMNS:
        words = []
        for kind in SHOWN:
            values = [column.of(rows[kind]) for rows in scans if kind in rows]
            if np.isnan(values).any():
                words.append("-")
            elif values:
                deviation = float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
                spread = in_words(deviation, column.form.replace("+", ""))
                words.append(f"{in_words(float(np.mean(values)), column.form)} ± {spread}")
        cells.append(", ".join(words))
    true = [rows["true"].error for rows in scans if "true" in rows]
    return f"| **{group}** | {' | '.join(cells)} | {in_words(float(np.mean(true)), '{:.3f}') if true else ''} |"


def goal_line(group: str, scans: Sequence[dict[str, Measured]]) -> str:
    """Whether each seed meets the goal against each texture."""
    frames = [rows[FRAMES] for rows in scans]
    worst = max((row.bias for row in frames), key=abs)
    cells = [f"{in_words(worst, '{:+.3f}')}: {'met' if abs(worst) <= MAX_BIAS else 'missed'}"]
    for kind in TEXTURES:
        ratios = [rows[FRAMES].error / rows[kind].error for rows in scans if kind in rows]
        met = sum(ratio <= MAX_RATIO for ratio in ratios)
        words = ", ".join(in_words(ratio, "{:.2f}") for ratio in ratios)
        cells.append(f"{words}: {'met' if met == len(ratios) else f'met in {met} of {len(ratios)}'}" if ratios else "")
    return f"| {group} | {' | '.join(cells)} |"


def headings(*cells: str) -> str:
    """The first two lines of a table."""
    return f"| {' | '.join(cells)} |\n|{'---|' * len(cells)}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    given = parser.parse_args(arguments)
    scans = {each.parent.name: read_rows(each.parent) for each in sorted(given.folder.glob(f"*/{ROWS}"))}
    groups: dict[str, dict[str, dict[str, Measured]]] = {}
    for name, rows in scans.items():
        groups.setdefault(group_of(name), {})[name] = rows
    print(headings("scan", *(column.heading for column in COLUMNS), "true radiance: error"))
    for group, some in groups.items():
        print("\n".join(scan_line(name, rows) for name, rows in some.items()))
        print(mean_line(group, list(some.values())))
    print()
    print(headings("scans", "largest bias", *(f"error over {NAMES.get(kind, kind)}" for kind in TEXTURES)))
    for group, some in groups.items():
        print(goal_line(group, list(some.values())))


if __name__ == "__main__":
    main()
