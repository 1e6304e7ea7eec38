"""The zip is one that Blender takes, and it leaves nothing behind."""

import subprocess
import sys
from pathlib import Path

import addon_utils
import bpy
import pytest

from blender.tests.made_room import NAME

KINDS = ("Scene", "Object", "Material")


def names() -> set[str]:
    return {name for name in dir(bpy.types) if "lidarspectra" in name.lower()} | {
        f"ops.{name}" for name in dir(bpy.ops.lidarspectra)
    }


def test_blenders_own_check_finds_nothing_wrong_with_the_zip(zip_file: Path) -> None:
    tool = Path(bpy.utils.system_resource("SCRIPTS"), "addons_core", "bl_pkg", "cli", "blender_ext.py")
    answer = subprocess.run([sys.executable, tool, "validate", zip_file], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr


def test_it_is_enabled_disabled_and_enabled_again_and_leaves_nothing(scene) -> None:
    assert any(each.__name__ == NAME for each in addon_utils.modules())
    enabled = names()
    assert "LIDARSPECTRA_PT_room" in enabled
    assert "ops.run" in enabled
    assert bpy.ops.preferences.addon_disable(module=NAME) == {"FINISHED"}
    assert not names()
    assert not any(hasattr(getattr(bpy.types, kind), "lidarspectra") for kind in KINDS)
    assert bpy.ops.preferences.addon_enable(module=NAME) == {"FINISHED"}
    assert names() == enabled
    assert all(hasattr(getattr(bpy.types, kind), "lidarspectra") for kind in KINDS)


def test_a_program_that_is_not_there_is_said_with_what_to_do(scene, tmp_path: Path) -> None:
    bpy.context.preferences.addons[NAME].preferences.program = str(tmp_path / "no program")
    scene.lidarspectra.run_file = str(tmp_path / "room.toml")
    with pytest.raises(RuntimeError, match="whole path in the extension's preferences"):
        bpy.ops.lidarspectra.run()
    assert "preferences" in scene.lidarspectra.message


def test_what_is_missing_is_said_and_nothing_is_written(scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="finished run"):
        bpy.ops.lidarspectra.load_run(filepath=str(tmp_path))
    with pytest.raises(RuntimeError, match="Import the scan"):
        bpy.ops.lidarspectra.write_run_file(filepath=str(tmp_path / "a.toml"))
    (tmp_path / "broken.toml").write_text("lamps = [", encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"broken\.toml: expected a run file"):
        bpy.ops.lidarspectra.open_run_file(filepath=str(tmp_path / "broken.toml"))
    with pytest.raises(RuntimeError, match="expected a scan"):
        bpy.ops.lidarspectra.import_scan(filepath=str(tmp_path / "broken.toml"), with_run_file=False)
    assert {path.name for path in tmp_path.iterdir()} == {"broken.toml"}
