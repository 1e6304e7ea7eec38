"""The page on the run file names every key that the program takes, and no other."""

import re
from pathlib import Path

from pydantic import BaseModel

from lidarspectra import config

PAGES = {
    "## `[scan]`": config.ScanSection,
    "## `[[lamps]]`": config.LampSection,
    "## `[lamps_from_scan]`": config.LampsFromScanSection,
    "## `[daylight]`": config.DaylightSection,
    "`[[daylight.windows]]`:": config.WindowSection,
    "## `[[panes]]`": config.PaneSection,
    "## `[materials]`": config.MaterialsSection,
    "## `[[materials.cards]]`": config.CardSection,
    "## `[sensors]`": config.SensorsSection,
    "`[sensors.grid]`:": config.GridSection,
    "## `[trace]`": config.TraceSection,
    "## `[people_and_plants]`": config.PeopleAndPlantsSection,
    "## `[[cells]]`": config.CellSection,
    "## `[rules]`": config.RulesSection,
    "`[[rules.areas]]`:": config.AreaSection,
    "## `[report]`": config.ReportSection,
    "## `[calibration]`": config.CalibrationSection,
    "`[calibration.reflectance]`:": config.ReflectanceFactors,
}


def keys_on_page(text: str) -> set[str]:
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}


def test_every_key_is_on_the_page_and_every_key_on_the_page_exists(project: Path) -> None:
    page = (project / "docs" / "run-file.md").read_text(encoding="utf-8")
    starts = {heading: page.index("\n" + heading) for heading in PAGES}
    ends = [*sorted(starts.values()), len(page)]
    for heading, section in PAGES.items():
        end = ends[ends.index(starts[heading]) + 1]
        assert issubclass(section, BaseModel)
        known = set(section.model_fields) - {"grid", "cards", "areas"}  # tables of their own
        assert keys_on_page(page[starts[heading] : end]) == known, heading
