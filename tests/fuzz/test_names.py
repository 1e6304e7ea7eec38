"""Names that a user or a file gives work or are refused, and never reach a Radiance file, a path or a command."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.config import parse_run_file
from lidarspectra.errors import RunFileError
from lidarspectra.radiance.scene.scene import load_scene
from lidarspectra.workflow.pipeline import run

sys.path.insert(0, str(Path(__file__).parent))
from mutations import HOSTILE_NAMES

LAMP = """
[[lamps]]
name = {name}
shape = "bulb"
center = [{x:.3f}, 1.0, 2.0]
size = 0.02
spectrum = "A"
luminous_flux_lm = 100
"""
REST = """
[scan]
file = "room.glb"
[materials]
method = "file"
file = "assigned.csv"
model = "none"
delight = false
coverage = 0.5
[sensors]
device = "three.csv"
[sensors.grid]
count = 2
height = 0.5
[trace]
accuracy = "low"
noise = "draft"
"""
CONTROL = re.compile(r"[\x00-\x1f\x7f]")
HARMLESS = {"", " ", ".", "..", "{}"}  # found in any text


def run_file_text(names: list[str]) -> str:
    lamps = (
        LAMP.format(
            name=json.dumps(name, ensure_ascii=False).replace(chr(127), "\\u007f"), x=0.2 + 2.0 * i / len(names)
        )
        for i, name in enumerate(names)
    )
    return "".join(lamps) + REST


@pytest.mark.slow
def test_lamps_materials_and_meshes_may_have_any_name_and_none_reaches_radiance(tmp_path: Path) -> None:
    names = [name for name in HOSTILE_NAMES if 0 < len(name) <= 200 and not CONTROL.search(name)]
    mesh = trimesh.creation.box(extents=(2.4, 2.0, 2.5)).subdivide().subdivide()
    mesh.apply_translation((1.2, 1.0, 1.25))
    mesh.invert()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))  # glTF is y up
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="!rm -rf #x", geom_name='a "b"\n!id')
    (tmp_path / "room.glb").write_bytes(scene.export(file_type="glb"))
    (tmp_path / "three.csv").write_text("center_nm,fwhm_nm\n460,20\n560,20\n610,20\n", encoding="utf-8")
    (tmp_path / "assigned.csv").write_text(
        'group,name,reflectance\n*,"!rm ""x"" # 😀 ../..\n$(id)",white-plastic\n', encoding="utf-8"
    )
    (tmp_path / "room.toml").write_text(run_file_text(names), encoding="utf-8")
    run(tmp_path / "room.toml", last="map")
    folder = tmp_path / "room.run"
    assert load_scene(folder / "4-scene").lamp_names == tuple(names)
    texts = [path for part in ("4-scene", "5-trace/model") for path in (folder / part).iterdir()]
    for path in texts:
        if path.suffix in (".json", ".oct", ".rtm", ".npz", ".dat"):
            continue  # our own records, and what is compiled from the texts
        text = path.read_text(encoding="ascii")  # no other letter is there
        lines = text.splitlines()
        assert not any(line.startswith("!") for line in lines), path
        assert not [name for name in names if name not in HARMLESS and len(name) > 2 and name in text], path
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "assigned.csv", "room.glb", "room.run", "room.toml", "three.csv",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["", *(name for name in HOSTILE_NAMES if len(name) > 200 or CONTROL.search(name))])
def test_a_lamp_without_a_name_of_control_characters_or_of_a_novel_is_refused_in_a_paragraph(name: str) -> None:
    with pytest.raises(RunFileError) as caught:
        parse_run_file(run_file_text([name]), where="room.toml")
    assert "lamps.1.name" in str(caught.value)
    assert len(str(caught.value)) < 3000
