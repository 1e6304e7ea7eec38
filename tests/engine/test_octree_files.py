"""Compiling with the real programs, in folders and with names of all kinds."""

from pathlib import Path

import pytest

from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.engine import MAX_SPECTRAL_SLOTS, engine_info, find_engine, float_rows
from lidarspectra.radiance.engine.octree import OCTREE_END, check_octree, compile_mesh, compile_octree

LAMP = "void light lamp\n0\n0\n3 1 1 1\nlamp sphere ball\n0\n0\n4 0 0 2 0.1\n"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl grey\nf 1 2 3\n"
GREY = "void plastic grey\n0\n0\n5 0.5 0.5 0.5 0 0\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene folder that a shell or an octree header would choke on."""
    path = tmp_path / "my room; $HOME 'é'"
    path.mkdir()
    (path / "lamp.rad").write_text(LAMP, encoding="utf-8", newline="\n")
    return path


def test_the_engine_is_whole_and_renders_spectra() -> None:
    info = engine_info(find_engine())
    assert info.fault == ""
    assert info.version.startswith("RADIANCE")
    assert info.slots == MAX_SPECTRAL_SLOTS


def test_an_octree_works_in_any_folder(folder: Path) -> None:
    engine = find_engine()
    run = compile_octree(engine, folder, ["lamp.rad"], "room.oct")
    assert run.argv == ("oconv", "-f", "lamp.rad")
    rays = b"0 0 0 0 0 1\n"
    traced = engine.run("rtrace", ["-h-", "-faf", "-I", "-ab", "0", "room.oct"], folder=folder, stdin=rays)
    assert float_rows(traced, rows=1, columns=3).min() > 0


def test_an_octree_needs_its_scene_files_no_more(folder: Path) -> None:
    engine = find_engine()
    compile_octree(engine, folder, ["lamp.rad"], "room.oct")
    (folder / "lamp.rad").unlink()
    traced = engine.run("rtrace", ["-h-", "-faf", "-I", "room.oct"], folder=folder, stdin=b"0 0 0 0 0 1\n")
    assert float_rows(traced, rows=1, columns=3).min() > 0


def test_a_mesh_is_compiled_with_its_materials(folder: Path) -> None:
    (folder / "room.obj").write_text(TRIANGLE, encoding="utf-8", newline="\n")
    (folder / "grey.rad").write_text(GREY, encoding="utf-8", newline="\n")
    compile_mesh(find_engine(), folder, "room.obj", "grey.rad", "room.rtm")
    assert (folder / "room.rtm").stat().st_size > 100


def test_an_octree_ends_with_the_mark_that_tells_a_whole_one_and_not_before(folder: Path) -> None:
    compile_octree(find_engine(), folder, ["lamp.rad"], "room.oct")
    octree = (folder / "room.oct").read_bytes()
    assert octree.endswith(OCTREE_END)
    assert not octree[:-1].endswith(OCTREE_END)


def test_the_engine_refuses_an_octree_whose_mesh_is_cut_off(folder: Path) -> None:
    engine = find_engine()
    (folder / "room.obj").write_text(TRIANGLE, encoding="utf-8", newline="\n")
    (folder / "grey.rad").write_text(GREY, encoding="utf-8", newline="\n")
    (folder / "room.rad").write_text("void mesh room\n1 room.rtm\n0\n0\n", encoding="utf-8", newline="\n")
    compile_mesh(engine, folder, "room.obj", "grey.rad", "room.rtm")
    compile_octree(engine, folder, ["room.rad", "lamp.rad"], "room.oct")
    check_octree(engine, folder, "room.oct")
    mesh = folder / "room.rtm"
    mesh.write_bytes(mesh.read_bytes()[:-1])
    with pytest.raises(SceneError, match="truncated"):
        check_octree(engine, folder, "room.oct")


@pytest.mark.parametrize("text", ["void plastic\n", "nonsense here\n", "grey polygon p\n0\n0\n9 0 0 0 1 0 0 0 1 0\n"])
def test_a_malformed_scene_is_refused_with_nothing_left_behind(folder: Path, text: str) -> None:
    (folder / "bad.rad").write_text(text, encoding="utf-8", newline="\n")
    with pytest.raises(SceneError, match="scene that oconv accepts"):
        compile_octree(find_engine(), folder, ["bad.rad"], "room.oct")
    assert not list(folder.glob("room*"))


def test_a_mesh_without_faces_is_refused(folder: Path) -> None:
    (folder / "room.obj").write_text("v 0 0 0\n", encoding="utf-8", newline="\n")
    with pytest.raises(SceneError, match="scene that obj2mesh accepts"):
        compile_mesh(find_engine(), folder, "room.obj", None, "room.rtm")


@pytest.mark.parametrize(
    "name", ["!touch x", "-f", "/etc/passwd", "../a.rad", "a b.rad", "a;b", "", ".hidden", "é.rad"]
)
def test_names_that_programs_could_misread_are_refused(folder: Path, name: str) -> None:
    with pytest.raises(SceneError, match="plain relative file name"):
        compile_octree(find_engine(), folder, [name], "room.oct")


def test_no_scene_files_are_no_scene(folder: Path) -> None:
    with pytest.raises(SceneError, match="one or more scene files"):
        compile_octree(find_engine(), folder, [], "room.oct")
