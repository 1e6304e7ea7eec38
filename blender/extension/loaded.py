"""Which run a scene shows."""

from pathlib import Path
from typing import Any

import bpy

from .room_file import RoomFile, read_room


def room_of_scene(scene: Any) -> RoomFile | None:
    """The run's light; None where none is loaded.

    Raises
    ------
    ExtensionError
        If its file is gone or damaged.
    """
    name = scene.lidarspectra.room_npz
    return read_room(Path(bpy.path.abspath(name))) if name else None


def run_file_of_scene(scene: Any) -> Path | None:
    """The run file; None where none was opened or written."""
    name = scene.lidarspectra.run_file
    return Path(bpy.path.abspath(name)) if name else None


def run_folder_of(run_file: Path) -> Path:
    """Where a run file's results are."""
    return run_file.with_suffix(".run")
