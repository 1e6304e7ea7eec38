"""Rules and pictures of a small room, by command and in the report."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.errors import RunFileError
from lidarspectra.radiance.pictures.glare import LEAST_UGR
from lidarspectra.workflow.calibration.light import run_room
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.rules.points import rule_points
from lidarspectra.workflow.scenarios import picture_of_run

AREAS = """
[rules]
glare = true
photoperiod_h = 10
[[rules.areas]]
name = "desk"
polygon = [[0.4, 0.4], [1.6, 0.4], [1.6, 1.2], [0.4, 1.2]]
illuminance_lx = {limit}
looks_deg = [0]
dli_mol_m2 = 0.01
[[rules.areas]]
name = "herbs"
polygon = [[1.6, 1.2], [2.0, 1.2], [2.0, 1.6], [1.6, 1.6]]
activity = "plants"
dli_mol_m2 = 1000
"""
LOWEST, HIGHEST = 1.0, 100_000.0  # [lx] limits that no uncertainty leaves in doubt
PANEL, BULB = (1.2, 1.0, 2.3, 2000.0), (0.6, 1.6, 1.9, 800.0)  # [m, lm] of the room's run file
WHITEST = 0.75  # [1] reflectance that no part of the room exceeds
INTEGRATING_SPHERE_LX = 2800.0 / 31.6 * WHITEST / (1.0 - WHITEST)  # [lx] reflected, of all lumens in so many m²


def straight_lx() -> float:
    """Mean illuminance straight from panel and bulb on the desk."""
    x, y = np.meshgrid(np.linspace(0.4, 1.6, 25), np.linspace(0.4, 1.2, 17))
    total = np.zeros_like(x)
    for part_x, part_y in np.stack(np.meshgrid(*2 * [np.linspace(-0.2, 0.2, 5)]), axis=-1).reshape(-1, 2):
        up = PANEL[2] - 0.75
        squared = (x - PANEL[0] - part_x) ** 2 + (y - PANEL[1] - part_y) ** 2 + up**2
        total += PANEL[3] / 25.0 / np.pi * up**2 / squared**2  # a Lambertian part of the panel
    up = BULB[2] - 0.75
    total += BULB[3] / (4.0 * np.pi) * up / ((x - BULB[0]) ** 2 + (y - BULB[1]) ** 2 + up**2) ** 1.5
    return float(total.mean())


def told(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "300"})
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


def with_areas(run_file: Path, limit: float) -> Path:
    """The run file with areas, and the run with it up to the map."""
    run_file.write_text(run_file.read_text(encoding="utf-8") + AREAS.format(limit=limit), encoding="utf-8")
    run(run_file, last="map")
    return run_file


@pytest.mark.slow  # a trace, renderings and a report
@pytest.mark.usefixtures("coarse_pictures", "undrawn_figures")
def test_rules_by_command_stand_in_the_report_until_the_rules_change(
    tmp_path: Path, copy_run: Callable[[Path], Path]
) -> None:
    run_file = with_areas(copy_run(tmp_path / "room"), LOWEST)
    folder = run_file.with_suffix(".run")
    printed = told("rules", folder)
    assert "maintained cylindrical illuminance" in printed
    found = json.loads((folder / "rules" / "rules.json").read_text(encoding="utf-8"))
    rows = {(row["rule"], row["what"], row["where"]): row for row in found["rows"]}
    light = rows["EN 12464-1", "maintained illuminance", "desk"]
    assert light["probability"] > 0.999
    assert light["low"] < light["value"] < light["high"]
    assert rows["plants", "daily light integral of the lamps in 10 h", "desk"]["probability"] > 0.999
    assert rows["plants", "daily light integral of the lamps in 10 h", "herbs"]["probability"] < 0.001
    assert {rule for rule, _, where in rows if where == "herbs"} == {"plants"}
    (look,) = found["looks"]
    # evalglare finds the panel by its luminance, and puts a source of 30 degrees across elsewhere by a degree or two
    assert look["ugr"] == pytest.approx(look["evalglare_ugr"], abs=1.0)
    assert rows["EN 12464-1", "UGR of luminaires", "desk"]["traced"] == pytest.approx(max(look["ugr"], LEAST_UGR))
    straight = straight_lx()
    assert straight < light["traced"] / 0.8 < straight + INTEGRATING_SPHERE_LX  # 0.8: maintenance
    assert look["angle_deg"] == 0.0
    assert (folder / "rules" / look["picture"]).is_file()
    page = run(run_file).report.read_text(encoding="utf-8")
    assert 'id="rules"' in page
    run_file.write_text(run_file.read_text(encoding="utf-8").replace(f"= {LOWEST}", f"= {HIGHEST}"), encoding="utf-8")
    assert 'id="rules"' not in run(run_file).report.read_text(encoding="utf-8")


def test_an_area_outside_the_room_is_refused_by_name(tmp_path: Path, copy_run: Callable[[Path], Path]) -> None:
    run_file = copy_run(tmp_path / "room")
    text = run_file.read_text(encoding="utf-8") + AREAS.format(limit=500.0).replace("[0.4, 0.4]", "[9.4, 9.4]")
    text = text.replace("[1.6, 0.4], [1.6, 1.2], [0.4, 1.2]", "[9.6, 9.4], [9.6, 9.6]")
    run_file.write_text(text, encoding="utf-8")
    run(run_file, last="map")
    room = run_room(run_file.with_suffix(".run"))
    assert room.run_file.rules is not None
    with pytest.raises(RunFileError, match="'desk'"):
        rule_points(room, room.run_file.rules.areas)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_pictures")
def test_a_picture_of_a_dimmed_room_is_darker_and_keeps_its_name(
    tmp_path: Path, copy_run: Callable[[Path], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copy_run(tmp_path / "room").with_suffix(".run")
    view = ("--from", "2.0,0.3,1.6", "--to", "0.5,1.5,1.0", "--size", "24x18", "--fast")
    told("picture", folder, *view, "--name", "full")
    told(
        "picture",
        folder,
        *view,
        "--name",
        "dim",
        "--lamp",
        'lamp "one" !rm',
        "--dim",
        "0",
        "--lamp",
        "warm",
        "--dim",
        "0.1",
    )
    full, dim = ((folder / "pictures" / name / "picture.hdr").read_bytes() for name in ("full", "dim"))
    exponents = [np.frombuffer(each[-24 * 18 * 4 :], dtype=np.uint8)[3::4].astype(float) for each in (full, dim)]
    assert (exponents[0] - exponents[1]).mean() > 3.0  # less than an eighth of the light
    with Image.open(folder / "pictures" / "dim" / "picture.png") as picture:
        assert picture.size == (24, 18)
    monkeypatch.setattr(picture_of_run, "render", pytest.fail)  # not before it is known that the picture has a place
    taken = CliRunner().invoke(app, ["picture", str(folder), *view, "--name", "full", "--lamp", "warm", "--dim", "0"])
    assert "--replace" in str(taken.exception)
    refused = CliRunner().invoke(app, ["picture", str(folder), "--from", "20,0,1"])
    assert refused.exit_code == 1
    assert "an eye in the room" in str(refused.exception)
