"""What a user finds after `lidarspectra materials`: tables, pictures, meshes; and what the scene takes from there."""

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
