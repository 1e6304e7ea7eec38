"""The report's section of a calibrated run: shown for just that calibration, refused where its tables are broken."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lidarspectra.config import CalibrationSection
from lidarspectra.errors import WorkspaceError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.mapping.calibration.figures import places_of, readings_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.calibration.report import calibration_sections

SECTION = CalibrationSection.model_validate({"measured": "readings.csv", "lamps": {"panel": 1.2}})
PLAN = FloorPlan(outline=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]), furniture=())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Tables as `save_calibration` writes them."""
    place = {"x [m]": [1.0, 1.0, 3.0], "y [m]": [1.0, 1.0, 2.0], "z [m]": [0.8, 0.8, 0.8]}
    unknowns = {"factor on": ["lamp flux", "reflectance"], "name": ["panel", "walls"], "factor [1]": [1.2, 1.0]}
    pd.DataFrame({**unknowns, "determined by the readings": ["yes", "no"]}).to_csv(
        tmp_path / "unknowns.csv", index=False
    )
    readings = {"reading": ["a", "b", "c"], **place, "off before [%]": 9.0, "probability [1]": 0.5}
    pd.DataFrame(readings).to_csv(tmp_path / "readings.csv", index=False)
    light = {"before [lx]": [400.0, 400.0, 90.0], "after [lx]": [480.0, 480.0, 110.0]}
    pd.DataFrame({**place, **light}).to_csv(tmp_path / "points.csv", index=False)
    summary = {
        "factors": SECTION.model_dump(), "chi_square": 4.2, "numbers": 3, "local_sd": 0.031, "map_sd": [0.16, 0.034],
        "notes": ["Look at that place."],
    }  # fmt: skip
    (tmp_path / "calibration.json").write_text(json.dumps(summary), encoding="utf-8")
    return tmp_path


def test_the_section_says_what_was_determined_and_what_was_not(folder: Path) -> None:
    (section,) = calibration_sections(SECTION, folder, PLAN)
    words = " ".join(section.words)
    assert "16.0 % before, 3.4 % after" in words
    assert "Chi-square is 4.2 of 3 numbers" in words
    assert "No reading determines walls" in words
    assert "Look at that place." in words
    assert [table.name for table in section.tables] == ["calibration-factors", "calibration-readings"]
    assert len(section.figures) == 1


@pytest.mark.parametrize("name", ["NA", "None", "1"])
def test_a_lamp_and_a_reading_are_called_as_the_user_called_them(name: str, folder: Path) -> None:
    for file, column in (("unknowns", "name"), ("readings", "reading")):
        table = pd.read_csv(folder / f"{file}.csv")
        table.assign(**{column: [name] * len(table)}).to_csv(folder / f"{file}.csv", index=False)
    (section,) = calibration_sections(SECTION, folder, PLAN)
    assert f"No reading determines {name}" in " ".join(section.words)
    assert section.tables[1].frame["reading"].tolist() == [name] * 3


def test_tables_of_another_calibration_are_not_shown(folder: Path) -> None:
    by_hand = CalibrationSection.model_validate({"measured": "readings.csv", "lamps": {"panel": 1.1}})
    assert calibration_sections(by_hand, folder, PLAN) == ()
    assert calibration_sections(None, folder, PLAN) == ()
    assert calibration_sections(SECTION, folder / "absent", PLAN) == ()


def test_broken_tables_are_refused_by_name(folder: Path) -> None:
    (folder / "points.csv").unlink()
    with pytest.raises(WorkspaceError, match=r"points\.csv"):
        calibration_sections(SECTION, folder, PLAN)


def test_the_plan_has_a_letter_for_a_place_and_a_number_for_a_reading() -> None:
    positions = np.array([[1.0, 1.0, 1.2], [3.0, 2.0, 1.2], [1.0, 1.0, 1.2]])
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    assert [here.tolist() for _, here in places_of(positions)] == [[0, 2], [1]]
    flux = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.ones(2))
    lamp = Lamp(name="panel", shape=Panel(0.6, 0.6), center=np.array([2.0, 1.5, 2.6]), flux=flux)
    axes = readings_figure(positions, normals, PLAN, (lamp,)).axes[0]
    words = [text.get_text() for text in axes.texts]
    assert {"A", "B", "1 up", "2", "3", "L1"} <= set(words)
    assert any("1 up, 3 -y" in text and "2 +x" in text for text in words)
