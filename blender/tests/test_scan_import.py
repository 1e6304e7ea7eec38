"""Scans of every kind stand where LiDARSpectra has them: metres, z up."""

import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender.tests.made_room import NAME, module

PROJECT = Path(__file__).resolve().parents[2]
OFFICE = PROJECT / "scenes" / "office" / "scan.glb"
SAME_M = 1e-4


def bounds(scene) -> np.ndarray:
    bpy.context.view_layer.update()
    places = [
        thing.matrix_world @ vertex.co
        for thing in bpy.data.collections["Room"].objects
        if thing.type == "MESH"
        for vertex in thing.data.vertices
    ]
    return np.array([np.min(places, axis=0), np.max(places, axis=0)])


@pytest.fixture
def corner() -> tuple[np.ndarray, np.ndarray]:
    """A tetrahedron 1 m wide, 2 m deep, 3 m high, metres and z up."""
    return np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3.0]]), np.array(
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    )


def test_the_demos_scan_is_where_its_run_file_places_lamps(scene) -> None:
    bpy.ops.lidarspectra.import_scan(filepath=str(OFFICE), with_run_file=False)
    low, high = bounds(scene)
    assert high - low == pytest.approx([3.1, 3.1, 2.7], abs=0.15)
    assert low[2] == pytest.approx(0.0, abs=0.05)  # the floor


def test_a_run_file_beside_the_scan_is_opened_with_it(scene, tmp_path: Path) -> None:
    shutil.copy(OFFICE, tmp_path)
    shutil.copy(OFFICE.with_name("room.toml"), tmp_path / "scan.toml")
    bpy.ops.lidarspectra.import_scan(filepath=str(tmp_path / "scan.glb"))
    assert scene.lidarspectra.run_file == str(tmp_path / "scan.toml")
    low, high = bounds(scene)
    for name in ("panel west", "panel east"):
        lamp = bpy.data.objects[name]
        assert (np.array(lamp.location) > low).all()
        assert (np.array(lamp.location) < high).all()


def test_without_the_program_the_scan_is_imported_all_the_same(scene, tmp_path: Path) -> None:
    bpy.context.preferences.addons[NAME].preferences.program = str(tmp_path / "no program")
    shutil.copy(OFFICE, tmp_path)
    bpy.ops.lidarspectra.import_scan(filepath=str(tmp_path / "scan.glb"))
    assert bounds(scene)[1, 2] > 2.5
    assert "preferences" in scene.lidarspectra.message


@pytest.mark.parametrize("kind", ["obj", "ply", "stl"])
@pytest.mark.parametrize(("unit", "up"), [("m", "+z"), ("mm", "+y"), ("ft", "-x"), ("in", "-y")])
def test_units_and_axes_are_brought_to_metres_and_z_up(
    scene, corner, tmp_path: Path, kind: str, unit: str, up: str
) -> None:
    vertices, faces = corner
    frames = module("frames")
    filed = vertices @ np.array(frames.UPRIGHT[up]) / frames.METRES[unit]  # the inverse of a rotation is its transpose
    path = tmp_path / f"a scan.{kind}"
    write(path, filed, faces)
    bpy.ops.lidarspectra.import_scan(filepath=str(path), unit=unit, up=up, with_run_file=False)
    assert bounds(scene) == pytest.approx(np.array([[0, 0, 0], [1, 2, 3]]), abs=SAME_M)


def write(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    rows = [" ".join(f"{value:.9g}" for value in row) for row in vertices]
    if path.suffix == ".obj":
        text = "\n".join([*(f"v {row}" for row in rows), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces)])
    elif path.suffix == ".ply":
        head = f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n"
        head += "".join(f"property float {axis}\n" for axis in "xyz")
        head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        text = head + "\n".join([*rows, *(f"3 {a} {b} {c}" for a, b, c in faces)])
    else:
        loops = "".join(
            "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {rows[k]}\n" for k in face) + "endloop\nendfacet\n"
            for face in faces
        )
        text = f"solid a\n{loops}endsolid a"
    path.write_text(text + "\n", encoding="utf-8")
