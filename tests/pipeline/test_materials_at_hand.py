"""What a user finds after `lidarspectra materials`: tables, pictures, meshes; and what the scene takes from there."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.material.lit_lamps.fluxes import LampFlux, save_lamp_fluxes
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.inputs import read_inputs
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps, with_estimated_fluxes

RoomWriter = Callable[..., Path]


@pytest.fixture(scope="module")
def folder(write_room: RoomWriter, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run of a small room, stopped after its materials."""
    return run(write_room(tmp_path_factory.mktemp("room")), last="materials").folder


@pytest.mark.slow
def test_after_the_materials_their_table_pictures_and_meshes_lie_there_and_no_later_stage(folder: Path) -> None:
    names = {path.name for path in (folder / "3-materials").iterdir()}
    assert {"materials.csv", "segmentation.svg", "materials.ply", "materials.glb"} <= names
    assert not list(folder.glob("4-*/*"))


@pytest.mark.slow
def test_the_meshes_of_the_materials_have_the_rooms_size(folder: Path) -> None:
    ply = trimesh.load_mesh(folder / "3-materials" / "materials.ply")
    np.testing.assert_allclose(ply.extents, [2.4, 2.0, 2.5], atol=1e-3)
    glb = trimesh.load_scene(folder / "3-materials" / "materials.glb")
    np.testing.assert_allclose(glb.extents, [2.4, 2.5, 2.0], atol=1e-3)


def test_the_scene_takes_the_fluxes_that_the_walls_told(write_room: RoomWriter, tmp_path: Path) -> None:
    lamps = resolve_lamps(read_inputs(write_room(tmp_path)).run_file.lamps, tmp_path)
    assert with_estimated_fluxes(lamps, tmp_path) == lamps
    told = [
        LampFlux(lamp=lamp.name, factor=factor, log_deviation=0.05, identifiable=True)
        for lamp, factor in zip(lamps, (2.0, 0.5), strict=True)
    ]
    save_lamp_fluxes(told, tmp_path)
    before, after = (
        np.array([lamp.flux.integral() for lamp in each]) for each in (lamps, with_estimated_fluxes(lamps, tmp_path))
    )
    assert after.sum() == pytest.approx(before.sum())
    assert (after[0] / after[1]) / (before[0] / before[1]) == pytest.approx(4.0)


def test_the_groups_of_a_runs_table_are_those_that_a_file_names_where_panes_have_taken_others(
    write_room: RoomWriter, room_text: str, tmp_path: Path
) -> None:
    """A screen takes all faces of its dark group, and the orange that comes after it is one number less."""
    light = room_text.replace("[materials]\n", "[materials]\ndelight = false\nmodel = 'none'\n")
    screen = '[[panes]]\nname = "tv"\nkind = "screen"\ncenter = [1.2, 0, 1.25]\nsize = [1.3, 1.3]\nnormal = [0, 1, 0]\n'
    path = write_room(tmp_path, light + screen)
    paint_wall(tmp_path / "room scan.glb")
    table = run(path, last="materials").folder / "3-materials" / "materials.csv"
    groups = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert groups[-1]["reflectance"] == "pane:screen"
    orange = next(group for group in groups if group["name"].endswith("orange"))
    orange["reflectance"] = "builtin:cc-blue"
    with (tmp_path / "mine.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(groups[0]))
        writer.writeheader()
        writer.writerows(groups)
    path.write_text(
        (light + screen).replace("[materials]\n", '[materials]\nmethod = "file"\nfile = "mine.csv"\n'), encoding="utf-8"
    )
    run(path, last="materials")
    found = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [group["color"] for group in found] == [group["color"] for group in groups]
    assert [group["reflectance"] for group in found] == [group["reflectance"] for group in groups]


def paint_wall(path: Path) -> None:
    """Colour the room's faces: the middle of a wall dark, a spot of another wall orange, all else grey."""
    mesh = trimesh.load_mesh(path)
    assert isinstance(mesh, trimesh.Trimesh)
    x, y, z = mesh.triangles_center.T  # y up, z towards -y of the room
    colors = np.full((len(mesh.faces), 4), (180, 180, 180, 255), dtype=np.uint8)
    colors[(np.abs(z) < 1e-6) & (np.abs(x - 1.2) < 0.6) & (np.abs(y - 1.25) < 0.6)] = (20, 20, 22, 255)
    colors[(np.abs(z + 2.0) < 1e-6) & (np.abs(x - 1.2) < 0.3) & (np.abs(y - 1.25) < 0.32)] = (210, 120, 40, 255)
    loose = trimesh.Trimesh(
        vertices=mesh.triangles.reshape(-1, 3), faces=np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False
    )
    loose.visual.vertex_colors = np.repeat(colors, 3, axis=0)
    loose.export(path)
