"""A Blender of its own for the tests: settings in a folder with a blank in its name, the extension from its zip.

`LIDARSPECTRA_PROGRAM` names the program; that of .venv if it is not set.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

_SETTINGS = tempfile.TemporaryDirectory(prefix="blender settings ")
os.environ["BLENDER_USER_RESOURCES"] = _SETTINGS.name  # read when bpy is loaded

import bpy  # noqa: E402

from blender.tests.made_room import GREEN, NAME, SHARES, WHITE, module  # noqa: E402

PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def zip_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from blender.build import EXTENSION, build

    return build(EXTENSION, tmp_path_factory.mktemp("a zip"))


@pytest.fixture(scope="session")
def installed(zip_file: Path) -> Iterator[str]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        filepath=str(zip_file), repo="user_default", enable_on_install=True, overwrite=True
    )
    yield NAME
    if NAME in bpy.context.preferences.addons:
        bpy.ops.preferences.addon_disable(module=NAME)


@pytest.fixture
def scene(installed: str) -> Any:
    """An empty scene of a Blender with the extension."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if NAME not in bpy.context.preferences.addons:
        bpy.ops.preferences.addon_enable(module=NAME)
    return bpy.context.scene


@pytest.fixture
def program(scene: Any) -> Path:
    """The program, named in the preferences."""
    usual = PROJECT / ".venv" / ("Scripts" if sys.platform == "win32" else "bin") / "lidarspectra"
    path = Path(os.environ.get("LIDARSPECTRA_PROGRAM", usual))
    assert path.is_file(), f"{path}: expected the program; 'make setup' makes it"
    bpy.context.preferences.addons[NAME].preferences.program = str(path)
    return path


@pytest.fixture
def wait(scene: Any) -> Callable[..., None]:
    """Look at the running program as Blender's timer does, until a condition holds or it has ended."""
    import time

    def until(
        condition: Callable[[], bool] = lambda: False, *, see: Callable[[], None] = lambda: None, limit_s: float = 300.0
    ) -> None:
        end = time.monotonic() + limit_s
        while module("running").look() and not condition():
            see()
            assert time.monotonic() < end, module("running").lines()
            time.sleep(0.05)

    return until


@pytest.fixture
def write_light(scene: Any, tmp_path: Path) -> Callable[..., Path]:
    """Write the light of a room of 3 m x 2 m: a floor of two triangles and a wall, two lamps, four points."""
    import json

    def write(**changes: Any) -> Path:
        about = {
            "format": 1,
            "version": "0",
            "run": "a room.run",
            "layers": [
                {"name": "illuminance_lx", "words": "illuminance", "unit": "lx"},
                {"name": "E_560", "words": "spectral irradiance, 560 nm", "unit": "W/m²/nm"},
            ],
            "lamps": [
                {"name": name, "shape": "panel", "center": [x, 1.0, 2.5], "normal": [0, 0, -1], "rotation_deg": 0.0,
                 "size": [0.6, 0.3], "beam_angle_deg": None, "luminous_flux_lm": 1790.0, "color": [1.0, 0.8, 0.6],
                 "dim": dim}
                for name, x, dim in (("west", 1.0, 0.5), ("east", 2.0, None))
            ],
            "materials": [
                {"name": name, "category": "painted", "source": source, "provenance": provenance, "specularity": 0.0,
                 "roughness": 0.0, "color": color}
                for name, source, provenance, color in (
                    ("green painted 1", "recovered (wiener), near builtin:x", "recovered", GREEN),
                    ("white", "builtin:white-wall", "assigned", WHITE),
                )
            ],
            "lamp_spectra": ["LED-B1", "LED-B3"],
            "reflectances": ["builtin:white-wall"],
        }  # fmt: skip
        arrays = {
            "vertices": [[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0], [0, 2, 2.5]],
            "faces": [[0, 1, 2], [0, 2, 3], [3, 2, 4]],
            "face_material": [0, 0, 1],
            "face_color": [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.9, 0.8, 0.7]],
            "points": [[1, 0.5, 0.5], [2, 0.5, 0.5], [2, 1.5, 0.5], [1, 1.5, 0.5]],
            "normals": [[0, 0, 1]] * 4,
            "triangles": [[0, 1, 2], [0, 2, 3]],
            "buried": [False, False, True, False],
            "shares": SHARES,
            "standard_error": np.ones((4, 2)),
            "scale": np.linspace([0, 0, 0], [1, 1, 0], 256),
        } | changes
        kinds = {"faces": "<i4", "face_material": "<i4", "triangles": "<i4", "buried": "?"}
        path = tmp_path / "a run" / "room.npz"
        path.parent.mkdir(exist_ok=True)
        typed = {name: np.array(value).astype(kinds.get(name, "<f4")) for name, value in arrays.items()}
        np.savez(path, about=np.array(json.dumps(about)), **typed)
        return path

    return write
