"""The scenes that are shipped, as they lie in the repository."""

import csv
import gzip
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.config import read_run_file
from lidarspectra.spectra.spectrum_files import read_table, write_table
from research.scenes import build, by_day, drawn_rooms, reflectances
from research.virtual_rooms.room_plan import RoomPlan, read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

SCENES = ("office", "apartment", "large-office", "box")
MAX_GLB_BYTES = 2_000_000  # [B] small enough to live in the repository


def scan_of(folder: Path) -> trimesh.Trimesh:
    run_file = read_run_file(folder / "room.toml")
    loaded = trimesh.load_scene(folder / run_file.scan.file, process=False)
    (mesh,) = loaded.geometry.values()
    return mesh


def true_labels(folder: Path) -> list[dict[str, str]]:
    with gzip.open(folder / "truth" / "faces.csv.gz", "rt", encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("scene", SCENES)
def test_plan_and_run_file_name_the_same_lamps_and_sensors(project: Path, scene: str) -> None:
    plan = read_plan(project / "scenes" / scene / "plan.toml")
    run_file = read_run_file(project / "scenes" / scene / "room.toml")
    assert run_file.lamps == plan.file.lamps
    assert run_file.sensors == plan.file.sensors


@pytest.mark.parametrize("scene", SCENES)
def test_truth_has_a_material_for_every_triangle_of_the_scan(project: Path, scene: str) -> None:
    folder = project / "scenes" / scene
    labels = true_labels(folder)
    assert len(labels) == len(scan_of(folder).faces)
    known = {row.id for row in read_table(folder / "truth" / "materials.csv")}
    assert {label["material"] for label in labels} <= known


@pytest.mark.parametrize("scene", SCENES)
def test_true_materials_and_lamps_are_at_full_spectral_resolution(project: Path, scene: str) -> None:
    folder = project / "scenes" / scene
    for row in read_table(folder / "truth" / "materials.csv"):
        assert np.diff(row.spectrum.wavelengths_nm).max() <= 5.0
        assert row.spectrum.range_nm[0] <= 380.0
        assert row.spectrum.range_nm[1] >= 780.0
        assert row.spectrum.values.min() > 0.0
        assert row.spectrum.values.max() < 0.95
        assert row.properties["provenance"] == "modelled"
    lamps = read_table(folder / "truth" / "lamps.csv")
    assert [row.name for row in lamps] == [lamp.name for lamp in read_plan(folder / "plan.toml").file.lamps]


@pytest.mark.parametrize("scene", ["office", "apartment", "large-office"])
def test_the_scan_lies_on_the_true_room_and_is_small(project: Path, scene: str) -> None:
    folder = project / "scenes" / scene
    assert (folder / "scan.glb").stat().st_size <= MAX_GLB_BYTES
    room = true_room(read_plan(folder / "plan.toml"))
    scanned = np.asarray(scan_of(folder).vertices)
    z_up = np.stack([scanned[:, 0], -scanned[:, 2], scanned[:, 1]], axis=1)
    # Drift of 3 mm in each direction and noise of 1.5 mm: nothing is off by 2 cm; in the large office, twice that.
    limit = 0.04 if scene == "large-office" else 0.02
    assert z_up.min(axis=0) == pytest.approx(room.vertices.min(axis=0), abs=limit)
    assert z_up.max(axis=0) == pytest.approx(room.vertices.max(axis=0), abs=limit)


def test_lamps_show_white_in_the_texture_and_the_walls_do_not(project: Path) -> None:
    folder = project / "scenes" / "office"
    mesh = scan_of(folder)
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"))
    uv = np.asarray(mesh.visual.uv)[np.asarray(mesh.faces)].mean(axis=1)
    height, width = image.shape[:2]
    shown = image[((1 - uv[:, 1]) * height).astype(int), (uv[:, 0] * width).astype(int)]
    part = np.array([label["part"] for label in true_labels(folder)])
    plates = np.char.startswith(part, "plate") & (np.asarray(mesh.face_normals)[:, 1] < -0.95)
    walls = np.char.endswith(part, "wall")
    assert (shown[plates].min(axis=1) >= 250).mean() > 0.9
    red, green, blue = shown[walls].mean(axis=0)
    assert red > 1.3 * green > 1.3 * 1.3 * blue


def test_the_plan_of_the_office_is_the_paper_s_room(project: Path) -> None:
    plan = read_plan(project / "scenes" / "office" / "plan.toml").file
    (room,) = plan.rooms
    assert np.subtract(room.high, room.low) == pytest.approx([3.0, 3.0, 2.7], abs=0.15)
    assert [lamp.shape for lamp in plan.lamps] == ["panel", "panel"]
    assert plan.sensors.grid is not None
    assert (plan.sensors.grid.count, plan.sensors.grid.height) == (176, 0.3)


def test_the_apartment_has_25_m2_11_downlights_and_17_sensors(project: Path) -> None:
    folder = project / "scenes" / "apartment"
    plan = read_plan(folder / "plan.toml").file
    area = sum((room.high[0] - room.low[0]) * (room.high[1] - room.low[1]) for room in plan.rooms)
    assert area == pytest.approx(25.0, abs=0.5)
    assert len(plan.lamps) == 11
    with (folder / "points.csv").open(encoding="utf-8") as stream:
        assert len(list(csv.DictReader(stream))) == 17


def test_the_large_office_has_108_m2_3_strips_and_27_sensors_in_the_air(project: Path) -> None:
    folder = project / "scenes" / "large-office"
    plan = read_plan(folder / "plan.toml")
    (room,) = plan.file.rooms
    assert np.prod(np.subtract(room.high, room.low)[:2]) == pytest.approx(108.0)
    assert [lamp.shape for lamp in plan.file.lamps] == ["strip", "strip", "strip"]
    places = np.loadtxt(folder / "points.csv", delimiter=",", skiprows=1)[:, :3]
    assert len(places) == 27
    assert true_room(plan).in_air(places).all()


def test_the_table_of_reflectances_is_what_its_script_writes(project: Path, tmp_path: Path) -> None:
    for table, models in (
        (project / "scenes" / "reflectances.csv", reflectances.MODELS),
        (by_day.OTHER_ROOMS / "reflectances.csv", reflectances.MODELS + reflectances.OTHER_MODELS),
        (by_day.HELD_OUT_ROOMS / "reflectances.csv", reflectances.MODELS + reflectances.HELD_OUT_MODELS),
    ):
        write_table(tmp_path / "again.csv", reflectances.rows(models))
        assert (tmp_path / "again.csv").read_bytes() == table.read_bytes()


@pytest.mark.parametrize("scene", [*by_day.OTHER_WINDOWS, *by_day.HELD_OUT_WINDOWS])
def test_the_other_rooms_have_lamps_and_sensors_in_the_air_and_windows_in_a_wall(tmp_path: Path, scene: str) -> None:
    plan = by_day.plan_by_day(by_day.room_by_day(scene, seed=1), by_day.CASES["day"], tmp_path)
    room = true_room(plan)
    if scene in by_day.OTHER_WINDOWS:  # the rooms held out have a grid
        points = np.loadtxt(by_day.plan_folder(scene) / "points.csv", delimiter=",", skiprows=1)[:, :3]
        assert room.in_air(points).all()
    check_lamps_and_windows(room, plan, (by_day.OTHER_WINDOWS | by_day.HELD_OUT_WINDOWS)[scene])


def check_lamps_and_windows(room: TrueRoom, plan: RoomPlan, windows: Sequence[drawn_rooms.Corners]) -> None:
    """Lamps hang in the air, and windows are flush in a wall but for 1 cm of their rims, with nothing before them."""
    assert room.in_air(np.array([lamp.center for lamp in plan.file.lamps])).all()
    area = room.scan.areas[by_day.window_faces(room)].sum()
    sides = [np.sort(np.subtract(high, low)) for low, high in windows]
    assert area == pytest.approx(sum(np.prod(side[1:]) for side in sides), rel=0.05)


@pytest.mark.parametrize("seed", [2, 9, 12, 20])  # a wing, a filmic camera, a wing with two windows, nine parts
def test_a_drawn_room_has_lamps_in_the_air_and_windows_in_a_wall(tmp_path: Path, seed: int) -> None:
    drawn = drawn_rooms.draw_room(seed)
    plan = by_day.plan_by_day(drawn, by_day.CASES["day"], tmp_path)
    check_lamps_and_windows(true_room(plan), plan, drawn.windows)


def test_a_seed_draws_one_room_and_another_seed_another() -> None:
    assert drawn_rooms.draw_room(5) == drawn_rooms.draw_room(5)
    assert drawn_rooms.draw_room(5).plan != drawn_rooms.draw_room(6).plan


def test_the_other_rooms_have_only_the_cases_that_were_made_for_them(tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        by_day.main([str(tmp_path), "--scene", "other", "--case", "sun"])
    with pytest.raises(SystemExit):
        by_day.main([str(tmp_path), "--scene", "held-out", "--case", "cards"])


def test_the_second_camera_of_the_rooms_held_out_is_filmic_and_the_known_rooms_have_none(tmp_path: Path) -> None:
    def curve(scene: str, seed: int) -> str:
        room = by_day.room_by_day(scene, seed)
        return by_day.plan_by_day(room, by_day.CASES["night"], tmp_path).file.camera.curve

    assert [curve("dark-room", seed) for seed in (1, 2)] == ["lifted", "filmic"]
    assert [curve("office", seed) for seed in (1, 2, 3)] == ["lifted"] * 3


def test_wall_points_of_the_box_stand_for_equal_shares_and_look_inwards(project: Path, tmp_path: Path) -> None:
    (room,) = read_plan(project / "scenes" / "box" / "plan.toml").file.rooms
    build.write_wall_points(tmp_path / "points.csv", room)
    assert (tmp_path / "points.csv").read_bytes() == (project / "scenes" / "box" / "points.csv").read_bytes()
    table = np.loadtxt(tmp_path / "points.csv", delimiter=",", skiprows=1)
    assert table.shape == (600, 6)
    towards = np.einsum("nc,nc->n", table[:, 3:], np.array([1.5, 1.5, 1.5]) - table[:, :3])
    assert towards == pytest.approx(1.5)
