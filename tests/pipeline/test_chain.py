"""The whole chain on a small room: what a user sees from the first command to the last file."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.errors import LidarSpectraError
from lidarspectra.mapping.maps.map_files import load_map
from lidarspectra.progress import Progress, silent
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow import trace_notes
from lidarspectra.workflow.pipeline import plan, run
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName, StageResult, stage_folder
from tests.pipeline.conftest import RoomWriter, RunCopier


class Names:
    """Collects which stages were made and which were kept."""

    def __init__(self) -> None:
        self.made: list[str] = []

    def start(self, stage: StageName) -> Progress:
        return silent

    def finish(self, result: StageResult[object]) -> None:
        if not result.was_fresh:
            self.made.append(result.record.stage)

    def note(self, words: str) -> None:
        pass


def made_by(run_file: Path, **options: StageName) -> list[str]:
    names = Names()
    run(run_file, listener=names, **options)
    return names.made


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, copy_run: RunCopier) -> Path:
    """The run file of a finished run, in a folder whose name has a space."""
    run_file = copy_run(tmp_path_factory.mktemp("rooms") / "a room")
    assert made_by(run_file) == ["report"]
    return run_file


def test_a_run_leaves_maps_and_a_page_that_needs_nothing_else(finished: Path) -> None:
    folder = finished.with_suffix(".run")
    with xr.open_dataset(folder / "6-map" / "map.nc", engine="h5netcdf") as light:
        assert dict(light.sizes) == {"point": 9, "band": 14}
        assert light["irradiance"].attrs["units"] == "W m-2 nm-1"
        assert bool((light["irradiance"] > 0).all())
        assert bool((light["irradiance_se"] > 0).all())
    table = pd.read_csv(folder / "6-map" / "map.csv", comment="#")
    assert next(name for name in table.columns if name.startswith("E_")) == "E_410"
    page = (folder / "7-report" / "index.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|href)\s*=\s*["\']?(?:https?:)?//', page)
    assert "&quot;one&quot; !rm" in page  # the user's words, escaped
    assert (folder / "7-report" / "figures" / "maps.svg").stat().st_size > 10_000


def test_the_user_s_words_never_reach_a_radiance_file(finished: Path) -> None:
    for path in (finished.with_suffix(".run") / "4-scene").iterdir():
        if path.suffix in (".rad", ".obj", ".opt", ".rif"):
            assert b"!rm" not in path.read_bytes(), path.name


def test_a_second_run_makes_nothing(finished: Path) -> None:
    assert made_by(finished) == []
    assert set(plan(finished).values()) == {"up to date"}


def test_time_and_memory_of_every_stage_are_in_its_record(finished: Path) -> None:
    for number, stage in enumerate(STAGES, start=1):
        record = json.loads((finished.with_suffix(".run") / f"{number}-{stage}" / "stage.json").read_text("utf-8"))
        assert record["seconds"] > 0
        assert record["peak_memory_mib"] > 1


@pytest.mark.slow
def test_only_what_depends_on_a_change_is_made_again(tmp_path: Path, copy_run: RunCopier, room_text: str) -> None:
    run_file = copy_run(tmp_path / "room")
    run_file.write_text(room_text.replace("height = 0.5", "height = 0.6"), encoding="utf-8")
    assert plan(run_file) == {stage: "up to date" if i < 4 else "to be made" for i, stage in enumerate(STAGES)}
    assert made_by(run_file, last="map") == ["trace", "map"]
    assert made_by(run_file, first="trace", last="map") == ["trace", "map"]


@pytest.mark.slow
def test_an_interrupted_run_resumes_at_the_stage_that_was_cut(tmp_path: Path, copy_run: RunCopier) -> None:
    run_file = copy_run(tmp_path / "room")
    for stage in ("scene", "trace", "map"):  # as if they had not been made yet
        shutil.rmtree(stage_folder(run_file.with_suffix(".run"), stage))

    class Interrupter(Names):
        def start(self, stage: StageName) -> Progress:
            if stage != "scene":
                return silent

            def interrupt(fraction: float, message: str) -> None:
                raise KeyboardInterrupt

            return interrupt

    with pytest.raises(KeyboardInterrupt):
        run(run_file, listener=Interrupter())
    assert not (run_file.with_suffix(".run") / "4-scene").exists()
    assert made_by(run_file, last="map") == ["scene", "trace", "map"]


def test_relighting_is_the_sum_of_its_lamps(finished: Path, tmp_path: Path) -> None:
    from lidarspectra.workflow.scenarios.relighting import LampOrder, relight_run

    folder = finished.with_suffix(".run")
    first, second = 'lamp "one" !rm', "warm"
    parts = [
        relight_run(folder, [LampOrder(lamp=off, dim=0.0)], base=tmp_path)["irradiance"].to_numpy()
        for off in (first, second)
    ]
    whole = relight_run(folder, [LampOrder(lamp=first, dim=1.0)], base=tmp_path)["irradiance"].to_numpy()
    np.testing.assert_allclose(parts[0] + parts[1], whole, rtol=1e-6)  # single precision coefficients


@pytest.mark.usefixtures("undrawn_figures")
def test_a_relit_room_is_written_beside_the_run(finished: Path, tmp_path: Path) -> None:
    from lidarspectra.workflow.scenarios.relighting import LampOrder, relight_run

    words = ["relight", str(finished.with_suffix(".run")), "--out", str(tmp_path / "relit")]
    answer = CliRunner().invoke(app, [*words, "--lamp", "warm", "--spectrum", "FL11", "--dim", "0.4"])
    assert answer.exit_code == 0, answer.output
    assert (tmp_path / "relit" / "map.nc").is_file()
    assert "mean illuminance [lx]" in answer.output
    assert "change [%]" in answer.output
    other = [*words, "--lamp", "warm", "--dim", "0.3"]
    answer = CliRunner().invoke(app, other)  # would overwrite the first
    assert isinstance(answer.exception, LidarSpectraError)
    assert "--spectrum FL11" in str(answer.exception)
    assert CliRunner().invoke(app, [*other, "--replace"]).exit_code == 0
    answer = CliRunner().invoke(app, [*words, "--dim", "0.4"])
    assert answer.exit_code == 2
    answer = CliRunner().invoke(app, [*words, "--lamp", "warm", "--dim", "40"])
    assert answer.exit_code == 2  # the run file refuses it, too
    assert "from 0 to 1" in " ".join(answer.output.replace("│", " ").split())
    with pytest.raises(LidarSpectraError, match="from 0 to 1"):
        relight_run(finished.with_suffix(".run"), [LampOrder(lamp="warm", dim=40.0)], base=tmp_path)
    answer = CliRunner().invoke(app, [*words, "--lamp", "nobody"])
    assert isinstance(answer.exception, LidarSpectraError)


def test_what_is_no_run_is_exported_nowhere(tmp_path: Path) -> None:
    for kind in ("--vtk", "--blender"):
        answer = CliRunner().invoke(app, ["export", str(tmp_path / "none"), kind])
        assert isinstance(answer.exception, LidarSpectraError), answer.exception
    assert not list(tmp_path.iterdir())


def test_a_run_is_exported_for_other_programs(finished: Path, tmp_path: Path) -> None:
    words = ["export", str(finished.with_suffix(".run")), "--out", str(tmp_path)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    assert {path.name for path in tmp_path.iterdir()} == {"map.vtu", "room.vtu", "room-illuminance-lx.glb"}
    answer = CliRunner().invoke(app, [*words, "--glb", "--quantity", "560"])
    assert answer.exit_code == 0, answer.output
    assert (tmp_path / "room-560.glb").is_file()
    answer = CliRunner().invoke(app, [*words, "--quantity", "brightness"])
    assert isinstance(answer.exception, LidarSpectraError)
    assert "illuminance_lx" in str(answer.exception)


def test_the_lamps_shares_in_the_file_for_blender_sum_up_to_the_map(finished: Path, tmp_path: Path) -> None:
    from lidarspectra.workflow.scenarios.relighting import LampOrder, relight_run

    run_folder = finished.with_suffix(".run")
    answer = CliRunner().invoke(app, ["export", str(run_folder), "--blender", "--out", str(tmp_path)])
    assert answer.exit_code == 0, answer.output
    with np.load(tmp_path / "room.npz", allow_pickle=False) as held:
        about = json.loads(str(held["about"]))
        names = [layer["name"] for layer in about["layers"]]
        lamps = [lamp["name"] for lamp in about["lamps"]]
        shares, faces, face_material = held["shares"].astype(float), held["faces"], held["face_material"]
    light = load_map(run_folder / "6-map" / "map.nc")
    channels = [names.index(f"E_{label}") for label in light["band_label"].to_numpy()]
    # of single precision, 6e-8 a lamp
    assert shares.sum(axis=0)[:, channels] == pytest.approx(light["irradiance"].to_numpy(), rel=1e-6)
    assert shares.sum(axis=0)[:, names.index("illuminance_lx")] == pytest.approx(light["illuminance"], rel=1e-6)
    dimmed = relight_run(run_folder, [LampOrder(lamp="warm", dim=0.25)], base=tmp_path)
    factors = [0.25 if name == "warm" else 1.0 for name in lamps]
    assert np.einsum("l,lpk->pk", factors, shares)[:, channels] == pytest.approx(dimmed["irradiance"].data, rel=1e-6)
    assert len(faces) == len(face_material)
    assert face_material.max() < len(about["materials"])


def test_progress_is_told_in_lines_to_programs_that_ask_for_it(finished: Path) -> None:
    answer = CliRunner().invoke(app, ["run", str(finished), "--lines"])
    assert answer.exit_code == 0, answer.output
    assert "trace is up to date: " in answer.stderr
    assert "trace is up to date: " not in answer.stdout  # where the tables are


@pytest.mark.usefixtures("undrawn_figures")
def test_giving_what_was_assumed_traces_nothing_again_and_ends_the_note(
    finished: Path, tmp_path: Path, room_text: str
) -> None:
    shutil.copytree(finished.parent, tmp_path / "room")
    run_file = tmp_path / "room" / finished.name
    run_file.write_text(room_text.replace("= 800", "= 800\nassumed = true"), encoding="utf-8")
    assert made_by(run_file, last="map") == ["map"]  # its note, and its attribute
    summary = run(run_file, last="map")
    assert json.loads(summary.map.attrs["assumed"]) == {"flux and spectrum": ["warm"]}
    (note,) = [note for note in summary.results["map"].record.warnings if "guesses" in note]
    assert "1 of 2 lamps ('warm')" in note
    words = ["relight", str(summary.folder), "--lamp", "warm"]
    answer = CliRunner().invoke(app, [*words, "--dim", "0.5"])
    assert "rest on guesses: flux and spectrum of 1 lamp" in " ".join(answer.output.split())
    answer = CliRunner().invoke(app, [*words, "--lumens", "900"])
    assert "rest on guesses: spectrum of 1 lamp." in " ".join(answer.output.split())
    answer = CliRunner().invoke(app, [*words, "--spectrum", "FL11", "--lumens", "900"])
    assert answer.exit_code == 0
    assert "guesses" not in answer.output
    run_file.write_text(room_text, encoding="utf-8")
    assert made_by(run_file, last="map") == ["map"]
    assert json.loads(run(run_file, last="map").map.attrs["assumed"]) == {}


@pytest.mark.parametrize("last", ["views", "scene"])
def test_a_lamp_outside_of_the_scan_is_refused_once_the_scan_is_there(
    tmp_path: Path, write_room: RoomWriter, room_text: str, last: str
) -> None:
    """It would light nothing, and the map of zeros would have no error."""
    run_file = write_room(tmp_path, room_text.replace("[0.6, 1.6, 1.9]", "[0.6, 6.1, 1.9]"))
    with pytest.raises(LidarSpectraError, match=r"'warm' at \(0.60, 6.10, 1.90\) m") as refused:
        run(run_file, last=last)
    assert "y from 0.00 to 2.00 m" in str(refused.value)
    assert not run_file.with_suffix(".run").exists()


def test_a_lamp_that_lights_no_point_is_named() -> None:
    transport = xr.Dataset(
        {"coefficient": (("lamp", "point", "band"), np.array([[[0.0, 0.0]], [[0.0, 1.0]]]))},
        coords={"lamp": ["hidden", "seen"]},
        attrs={"achieved_relative_se": 0.0, "target_relative_se": 0.01, "truncated_share": 0.0},
    )
    points = SensorPoints(positions=[[0, 0, 0]], normals=[[0, 0, 1]], buried=[False])
    (warning,) = trace_notes.trace_warnings(transport, points)
    assert "'hidden'" in warning
    assert "'seen'" not in warning


def test_lamps_that_rays_of_a_restricted_view_must_meet_are_named() -> None:
    transport = xr.Dataset(
        {"coefficient": (("lamp", "point", "band"), np.ones((2, 1, 1)))},
        coords={"lamp": ["sun", "panel"]},
        attrs={"achieved_relative_se": 0.0, "target_relative_se": 0.01, "lamps_met_by_chance": "sun"},
    )
    points = SensorPoints(positions=[[0, 0, 0]], normals=[[0, 0, 1]], buried=[False])
    (warning,) = trace_notes.trace_warnings(transport, points)
    assert "straight from 'sun' as far as rays at random meet it" in warning


def test_sensors_that_read_no_irradiance_are_told_of_map_and_transport() -> None:
    transport = xr.Dataset(
        {"coefficient": (("lamp", "point", "band"), np.ones((1, 1, 1)))},
        coords={"lamp": ["panel"]},
        attrs={"achieved_relative_se": 0.0, "target_relative_se": 0.01, "seen_by": "a slit, which reads 5 %"},
    )
    points = SensorPoints(positions=[[0, 0, 0]], normals=[[0, 0, 1]], buried=[False])
    (warning,) = trace_notes.trace_warnings(transport, points)
    assert warning.startswith("The sensors see by a slit, which reads 5 %. Irradiance, lx and all that is computed")
    assert trace_notes.receptor_notes(transport.attrs) == (warning,)
    assert trace_notes.receptor_notes({}) == ()


def test_points_that_missed_a_target_of_their_own_are_counted() -> None:
    transport = xr.Dataset(
        {
            "coefficient": (("lamp", "point", "band"), np.ones((1, 3, 1))),
            "missed_target": ("point", np.array([True, False, True])),
        },
        coords={"lamp": ["seen"]},
        attrs={"achieved_relative_se": 0.001, "target_relative_se": 0.01, "truncated_share": 0.0},
    )
    points = SensorPoints(positions=np.zeros((3, 3)), normals=np.tile([0, 0, 1], (3, 1)), buried=np.zeros(3, bool))
    (warning,) = trace_notes.trace_warnings(transport, points)
    assert "At 2 of 3 sensor points the standard error is above 1.0 % of the light there" in warning


def test_mirrors_that_cost_the_target_are_named_with_their_rays_and_glass_with_what_it_loses() -> None:
    transport = xr.Dataset(
        {"coefficient": (("lamp", "point", "band"), np.ones((1, 3, 1)))},
        coords={"lamp": ["seen"]},
        attrs={"achieved_relative_se": 0.013, "target_relative_se": 0.005, "truncated_share": 0.0, "rays": 4_290_000},
    )
    points = SensorPoints(positions=np.zeros((3, 3)), normals=np.tile([0, 0, 1], (3, 1)), buried=np.zeros(3, bool))
    (warning,) = trace_notes.trace_warnings(transport, points, {"mirror": 2.0})
    assert "1.3 % of the mean, above the target of 0.5 %" in warning
    assert "4,290,000 rays: 2 m² of mirror" in warning
    assert trace_notes.glass_notes({"mirror": 2.0}) == ()
    (note,) = trace_notes.glass_notes({"glass": 1.5})
    assert note.startswith("1.5 m² of glass is curved")


def test_one_stage_s_command_stops_there(tmp_path: Path, write_room: RoomWriter) -> None:
    run_file = write_room(tmp_path)
    answer = CliRunner().invoke(app, ["scan", str(run_file)])
    assert answer.exit_code == 0, answer.output
    assert [path.name for path in sorted(run_file.with_suffix(".run").iterdir())] == ["1-scan", "lidarspectra-run.json"]


def test_a_run_by_plain_rtrace_goes_to_its_map_and_is_relit(
    tmp_path: Path, write_room: RoomWriter, room_text: str
) -> None:
    from lidarspectra.workflow.scenarios.relighting import LampOrder, relight_run

    text = room_text.replace("[trace]", '[trace]\nmethod = "rtrace"').replace("coverage = 0.5", 'method = "default"')
    run_file = write_room(tmp_path, text)
    summary = run(run_file, last="map")
    transport = summary.transport
    assert (transport.attrs["method"], "truncation" in transport) == ("rtrace", False)
    assert "by plain runs of rtrace" in {each.stage: each for each in summary.records}["trace"].summary
    relit = relight_run(run_file.with_suffix(".run"), [LampOrder(lamp="warm", dim=0.0)], base=tmp_path)
    assert float(relit["irradiance"].min()) > 0
