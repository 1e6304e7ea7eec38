"""Solar cells and light for people and plants, from a run file to the report, and by command."""

from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pandas as pd
import pytest
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.config import parse_run_file
from lidarspectra.errors import LidarSpectraError, MapError, RunFileError
from lidarspectra.mapping.report import report_writer
from lidarspectra.workflow.pipeline import run
from tests.pipeline.conftest import EMPTY

ASKED = """
[people_and_plants]
rendering = false
[[cells]]
cell = "silicon"
area_cm2 = 25.0
hours = "9-17"
[[cells]]
cell = "organic-green"
"""


def told(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "300"})
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, write_room: Callable[[Path, str], Path], room_text: str) -> Path:
    """The run of a small room whose report is asked for cells, people and plants."""
    quick = room_text.replace("[materials]", '[materials]\nmethod = "default"').replace("count = 9", "count = 4")
    with patch.object(report_writer, "svg_text", return_value=EMPTY[".svg"].decode()):  # as `undrawn_figures`
        return run(write_room(tmp_path_factory.mktemp("asked"), quick + ASKED)).folder


@pytest.mark.slow
def test_a_report_tells_of_the_cells_that_the_run_file_names(finished: Path) -> None:
    page = (finished / "7-report" / "index.html").read_text(encoding="utf-8")
    for words in ("People and plants", "melanopic EDI", "Solar cell 1: silicon", "Solar cell 2: organic-green",
                  "energy of a day"):  # fmt: skip
        assert words in page
    assert (finished / "7-report" / "figures" / "cell-1-silicon.svg").is_file()
    assert not list((finished / "2-views").glob("*.png"))  # all surfaces are given one material
    assert (finished / "7-report" / "tables" / "people-and-plants.csv").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn_figures")
def test_the_light_of_a_run_is_told_for_people_and_plants(finished: Path, tmp_path: Path) -> None:
    assert "YPFD" in told("photometry", finished, "--out", tmp_path / "all")
    dark = told("photometry", finished, "--dim", "warm=0", "--out", tmp_path / "dim")
    assert "melanopic EDI" in dark
    both, one = (pd.read_csv(tmp_path / name / "points.csv") for name in ("all", "dim"))
    assert (one["illuminance_lx"] < both["illuminance_lx"]).all()
    assert (one["cct_K"] > both["cct_K"]).all()  # the incandescent lamp is gone
    assert both["cri_Ra"].between(60.0, 100.0).all()  # an LED of Ra 84 and a black body
    # the same points as a sensor would have measured them, by learned weights: no lamp is known
    told("photometry", finished, "--measured", finished / "6-map" / "map.csv", "--out", tmp_path / "measured")
    measured = pd.read_csv(tmp_path / "measured" / "points.csv")
    assert (measured["illuminance_lx"] / both["illuminance_lx"] - 1.0).abs().max() < 0.1  # 95 % of LEDs: 5 %
    assert measured["cri_Ra"].isna().all()


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn_figures")
def test_a_cell_s_current_is_mapped_and_its_channels_tell_the_same(finished: Path, tmp_path: Path) -> None:
    words = told("photocurrent", finished, "--cell", "organic-blue", "--hours", "8-18", "--volt", 0.4,
                 "--out", tmp_path / "blue")  # fmt: skip
    assert "known only up to a factor" in words
    assert "energy of a day" in words
    assert "The light is known to ±" in words
    table = finished / "6-map" / "map.csv"
    told("cells", "predict", table, "--cell", "organic-blue", "--lamps", "led", "--out", tmp_path / "told.csv")
    by_lamps, by_channels = pd.read_csv(tmp_path / "blue" / "points.csv"), pd.read_csv(tmp_path / "told.csv")
    ratio = by_channels["current_A"] / by_lamps["current_A"]
    assert (ratio - 1.0).abs().max() < 0.1  # 95 % of LEDs: 8 %
    assert "model-gaas" in told("cells", "list")


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn_figures", "coarse_traces")
def test_the_best_place_faces_the_lamps(finished: Path, tmp_path: Path) -> None:
    answer = told("cells", "place", finished, "--cell", "silicon", "--size", 4, 2, "--tilt", 0, "--tilt", 180,
                 "--count", 3, "--wall", 2.0, "--out", tmp_path / "places")  # fmt: skip
    assert "The light is known to ±" in answer
    places = pd.read_csv(tmp_path / "places" / "cell-places.csv")
    assert len(places) == 3
    assert places["current [µA]"].is_monotonic_decreasing
    assert not places["tilt [deg]"].eq(180.0).any()  # nothing shines from the floor
    assert (places["lowest/mean over the cell"] <= 1.0).all()
    for words, complaint in (
        (("--wall", 1.0, "--wall", 9.0), "9 m"),
        (("--size", 0, 2), "above 0"),
    ):
        result = CliRunner().invoke(app, ["cells", "place", str(finished), "--cell", "silicon", *map(str, words)])
        assert isinstance(result.exception, MapError), result.output
        assert complaint in str(result.exception)
    # Releases of typer differ in who refuses this: they, with status 2, or we.
    nothing = CliRunner().invoke(app, ["cells", "place", str(finished), "--cell", "silicon", "--tilt", "nan"])
    assert nothing.exit_code != 0


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ('cell = "germanium"', "organic-green"),
        ('cell = "silicon"', "area_cm2"),
        ('cell = "silicon"\narea_cm2 = 1\nhours = "9"', "8:30-17"),
    ],
)
def test_a_cell_that_no_report_could_tell_of_is_refused_before_anything_is_made(
    write_room: Callable[[Path, str], Path], room_text: str, tmp_path: Path, cell: str, words: str
) -> None:
    run_file = write_room(tmp_path, f"{room_text}\n[[cells]]\n{cell}\n")
    with pytest.raises(LidarSpectraError, match=words):
        run(run_file)
    assert not run_file.with_suffix(".run").exists()


def test_commands_refuse_what_they_cannot_do(tmp_path: Path) -> None:
    for words in (
        ("photocurrent", "run", "--cell", "silicon", "--hours", "8-18", "--schedule", "day.csv"),
        ("photometry", "run", "--dim", "lamp"),
        ("photometry", "run", "--dim", "lamp=40"),
        ("photometry", "run", "--dim", "lamp=0.5", "--measured", "measured.csv"),
        ("cells", "predict", "measured.csv", "--cell", "silicon", "--lamps", "candle"),
    ):
        assert CliRunner().invoke(app, list(words)).exit_code == 2  # of usage: nothing was looked for
    with pytest.raises(RunFileError, match=r"cells\.1\.area_cm2"):
        parse_run_file(
            '[scan]\nfile = "a.glb"\n[lamps_from_scan]\ncct_k = 4000\n[[cells]]\ncell = "silicon"\narea_cm2 = -1\n',
            where="here",
        )
