"""docs/results-localization.md out of the tables and figures that the experiment left."""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

from lidarspectra.spectrum_files import write_whole
from lidarspectra.workspace import versions

READING = "reading.md"  # written by hand: what the numbers say
PARTS: tuple[tuple[str, str, tuple[str, ...], tuple[str, ...]], ...] = (
    (
        "Table 4 and Figure 14: learned from a simulation, tested in the true room",
        "Fingerprints are traced in the virtual phone's scan with estimated materials, at most 2 (low), 8 (medium) and "
        "14 (high) reflections, of people by lot at each place. The test is of other people in the room as it "
        "truly is, read in whole counts by virtual sensors whose gains, dies and drift nobody told. 'measured' learns "
        "from such readings of other people in the true room. On the map of errors (high, network) a line leads from "
        "each place to where its readings are put on the average.",
        ("table-4", "paper-table-4", "table-4-all", "person-effect"),
        ("figure-14", "error-map-*"),
    ),
    (
        "How old the reference may be",
        "The virtual sensors' dies drift by 1 % an hour (standard deviation, each for itself) after the empty room was "
        "read; Table 4 lets up to two hours pass. A running median, as `localize live` takes it, is minutes old.",
        ("reference-age",),
        (),
    ),
    (
        "Table 5 and Figures 15 and 16: the room has changed",
        "The apartment. Between T1 and T2 a coffee table, a bookshelf and the dining table with its chairs moved, the "
        "television, a night table and a plant went, the rug is another; the living room's four lamps got another "
        "spectrum and half as much flux again, one of them and one in the bedroom moved, three others were changed. "
        "'raw' compares readings at T2 with the empty room of T1, as fingerprints without a reference do; 'ratio' "
        "takes the empty room anew at T2, which costs one minute with nobody in the room.",
        ("table-5",),
        ("figure-15", "figure-16"),
    ),
    (
        "How many sensors suffice",
        "Sensors added one by one, the one that gains most first (`lidarspectra localize place`).",
        ("placement-*",),
        (),
    ),
    (
        "A measured night",
        "27 sensors of the paper's authors, 3008 readings of one person at 43 places; it is not part of the package.",
        ("nights",),
        (),
    ),
)


def write_page(folder: Path, page: Path) -> Path:
    """Compose the page from what lies in a folder.

    Parameters
    ----------
    folder : Path
        Holds NAME.md of the tables and NAME.png of the figures, and reading.md, what a person wrote about them.
    page : Path
        Beside the folder.

    Returns
    -------
    page : Path
    """
    lines = ["# Results: localization", "", _who_and_where(), ""]
    reading = folder / READING
    if reading.is_file():
        lines += [reading.read_text(encoding="utf-8").strip(), ""]
    for title, words, table_names, figure_names in PARTS:
        tables = [path for name in table_names for path in sorted(folder.glob(f"{name}.md"))]
        figures = [path for name in figure_names for path in sorted(folder.glob(f"{name}.png"))]
        if not tables and not figures:
            continue
        lines += [f"## {title}", "", words, ""]
        for path in tables:
            lines += [path.read_text(encoding="utf-8").strip(), ""]
        for path in figures:
            lines += [f"![{path.stem.replace('-', ' ')}]({folder.name}/{path.name})", ""]
    write_whole(page, "\n".join(lines).rstrip() + "\n")
    return page


def _who_and_where() -> str:
    known = versions()
    shown = ", ".join(f"{name} {known[name]}" for name in ("lidarspectra", "python", "pyradiance", "numpy"))
    return (
        f"Written by `python -m benchmarks.localization` on {datetime.now(UTC):%Y-%m-%d}, {os.cpu_count()} cores, "
        f"{platform.machine()} {platform.system()}. {shown}. Every table is beside this page as CSV and every figure "
        "as PDF, in `results-localization/`."
    )
