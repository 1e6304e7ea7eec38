"""A run of an app's raw data, from frames to the report: what it keeps and shows of them, and what it finds matt."""

import csv
import json
import re
from pathlib import Path
from unittest.mock import patch

import pytest

from lidarspectra.material.frames import frame_colors
from lidarspectra.material.frames.gloss import GlossOfPart
from lidarspectra.material.material_map import load_materials
from lidarspectra.workflow import stages
from lidarspectra.workflow.pipeline import run
from tests.unit.scan.capture_layouts import box_room, gray_shots, write_3dscanner

RUN_FILE = """
[scan]
file = "scan"
up = "+y"
unit = "m"
[[lamps]]
name = "panel"
shape = "panel"
center = [0.0, 0.0, 1.2]
size = [0.6, 0.6]
spectrum = "LED-B3"
luminous_flux_lm = 2000
[materials]
coverage = 0.3
model = "none"
[sensors.grid]
count = 4
height = 0.5
[trace]
accuracy = "low"
noise = "draft"
"""


@pytest.mark.slow
def test_a_run_of_frames_draws_them_in_its_report_and_takes_gray_walls_for_matt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frame_colors, "ATLAS_PX", (256, 256))  # texels of 4 cm; these frames' pixels are 3 cm wide
    room = box_room()
    write_3dscanner(tmp_path / "scan", room, gray_shots(room, 8))
    (tmp_path / "room.toml").write_text(RUN_FILE, encoding="utf-8")
    summary = run(tmp_path / "room.toml")
    assert (summary.folder / "1-scan" / "frame-views.npz").is_file()
    with (summary.folder / "3-materials" / "materials.csv").open(encoding="utf-8", newline="") as file:
        materials = list(csv.DictReader(file))
    assert materials
    assert all(float(row["specularity"]) == 0.0 for row in materials)
    gloss = summary.folder / "3-materials" / "gloss.json"
    if gloss.is_file():  # only if the light could be taken out
        assert all(each["matt"] for each in json.loads(gloss.read_text(encoding="utf-8")))
    (report,) = summary.folder.glob("7-report/index.html")
    assert 'id="figure-frames"' in report.read_text(encoding="utf-8")
    assert (report.parent / "figures" / "frames.svg").is_file()
    # What frames tell of gloss is in the scene, and said; here all materials are told to be glossy.
    told = GlossOfPart(
        specularity=0.07, specularity_deviation=0.01, roughness=0.11, roughness_deviation=0.01, gain=20.0
    )
    with patch.object(
        stages, "gloss_of_materials", side_effect=lambda _, __, found, ___: (told,) * len(found.materials)
    ):
        again = run(tmp_path / "room.toml", first="materials", last="scene")
    kept = json.loads(gloss.read_text(encoding="utf-8"))
    assert [each["roughness"] for each in kept] == [0.11] * len(kept)
    found = load_materials(again.folder / "3-materials").materials
    assert {each.specularity for each in found if each.kind == "plastic"} == {0.07}
    scene = "\n".join(path.read_text(encoding="utf-8") for path in (again.folder / "4-scene").rglob("*.rad"))
    assert re.search(r" 0?\.07 0?\.11\b", scene)
