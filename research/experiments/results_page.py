"""docs/results.md out of the tables and figures that the experiments left."""

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from lidarspectra.io.files import write_whole
from lidarspectra.workflow.run_folder.workspace import versions
from research.experiments.provenance import made_by

READING = "reading.md"  # written by hand: what the numbers say
CONTEXT_ROOM = "one room of the authors, measured there with a real sensor, which we cannot measure again"


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the page; it is left out where none of its tables and figures is there.

    Parameters
    ----------
    title, words : str
    tables, figures : tuple of str
        File names without ending; '*' stands for the scenes.
    """

    title: str
    words: str
    tables: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()


PARTS = (
    Part(
        title="The truth, and who checked it",
        words="Truth is computed from the plan of each room, not from a scan: exact surfaces, true reflectances, true "
        "lamps, traced at 81 single wavelengths and weighed with the sensor's channels at the end "
        "(`python -m research.scenes.true_light SCENE`). Another engine, Mitsuba, computes "
        "the same rooms at 14 wavelengths.",
        tables=("truth",),
    ),
    Part(
        title="Laws of light (the paper's Figures 8 to 11)",
        words="The experiments of the paper's Section 3.2, with an answer by another route for the spectrometer.",
        tables=("microbenchmarks",),
        figures=(
            "figure-8-inverse-square",
            "figure-9-superposition-setup",
            "figure-10-superposition",
            "figure-11-reflectance",
        ),
    ),
    Part(
        title="Table 1: error by accuracy, with and without material estimation",
        words="Runs of the scenes' own run files on their virtual phone's scans, lamps known, against the truth. "
        "'abs' compares W/m²/nm as they are; '0-1' divides every channel's map by its own maximum first, as the paper "
        "does. NRMSE is the paper's Eq. 8 over the channels of each point, MAPE its Eq. 9. Time is that of the trace.",
        tables=("table-1", "goals", "goal-draws", "error-origin"),
        figures=("table-1",),
    ),
    Part(
        title="For context: the paper's own Table 1",
        words=f"Not to be compared number by number: it is of {CONTEXT_ROOM}.",
        tables=("paper-table-1",),
    ),
    Part(
        title="Figures 1 and 13: the maps",
        words="Truth, estimated materials, and white plastic everywhere; ultra. White dots are sensors.",
        figures=("maps-*",),
    ),
    Part(
        title="Table 2: five default materials",
        words="The paper's MAPE stands in the last columns as context.",
        tables=("table-2",),
    ),
    Part(
        title="Which input matters most",
        words="One input is off at a time. The bars start at the error of the run with nothing changed.",
        tables=("sensitivity-*",),
        figures=("tornado-*",),
    ),
    Part(
        title="Scan after scan: by night, by day, with six readings",
        words="Each scene is scanned anew three times, with other noise and another camera (plain sRGB, shadows "
        "lifted a little, and more; exposure and white balance of its own), by night, its blinds drawn, and by day, "
        "with as much light by its windows as by its lamps (in the apartment twice as much). The map is of the lamps "
        "alone. In the last columns each lamp's flux is off by 20 % besides, and a lux meter is read six times where "
        "the plan says in the true room, with 3 % of noise.",
        tables=("scan-after-scan",),
    ),
    Part(
        title="What measuring itself costs",
        words="A virtual AS7265x and virtual cells stand in the true light; what they read is set beside it. A map "
        "cannot be shown to be better than the instrument that checks it.",
        tables=("instrument-*",),
    ),
)


def write_results_page(
    folder: Path, page: Path, *, title: str = "Results", parts: Sequence[Part] = PARTS, script: str = "make experiments"
) -> Path:
    """Compose a page from what lies in a folder.

    Parameters
    ----------
    folder : Path
        Holds NAME.md of the tables and NAME.png of the figures, and reading.md, what a person wrote about them.
    page : Path
        Beside the folder.
    title : str
    parts : sequence of Part
        In the order of the page.
    script : str
        What it is written by, as a reader would call it.

    Returns
    -------
    page : Path
    """
    lines = [f"# {title}", "", _who_and_where(script, folder.name), ""]
    reading = folder / READING
    if reading.is_file():
        lines += [reading.read_text(encoding="utf-8").strip(), ""]
    for part in parts:
        tables = [path for name in part.tables for path in sorted(folder.glob(f"{name}.md"))]
        figures = [path for name in part.figures for path in sorted(folder.glob(f"{name}.png"))]
        if not tables and not figures:
            continue
        made = [path.stem for path in tables] or [path.stem for path in figures]
        lines += [f"## {part.title}", "", part.words, "", made_by(folder, made), ""]
        for path in tables:
            lines += [path.read_text(encoding="utf-8").strip(), ""]
        for path in figures:
            words = path.stem.replace("-", " ")
            lines += [f"![{words}]({folder.name}/{path.name})", ""]
    write_whole(page, "\n".join(lines).rstrip() + "\n")
    return page


def _who_and_where(script: str, folder: str) -> str:
    known = versions()
    shown = ", ".join(f"{name} {known[name]}" for name in ("lidarspectra", "python", "pyradiance", "numpy"))
    return (
        f"Composed by `{script}` on {datetime.now(UTC):%Y-%m-%d}; under each heading stands "
        f"which revision made its tables. {os.cpu_count()} cores, {platform.machine()} "
        f"{platform.system()}, with other work beside it: processor time tells more than time. {shown}. Every table "
        f"is beside this page as CSV, in `{folder}/`."
    )
