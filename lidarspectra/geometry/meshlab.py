"""pymeshlab, of the extras `decimate` and `localize`: it is large, needs OpenGL's library, and few decimate a mesh."""

import contextlib
import importlib
from typing import Any

INSTALL_MESHLAB = (
    "Install it: pip install 'lidarspectra[{extra}]'; on Linux it needs OpenGL's library, too "
    "(Debian: apt-get install libgl1 libopengl0)."
)


def load_pymeshlab() -> Any:
    """Module pymeshlab.

    Python's SQLite is loaded before it. The wheel of 2023.12 brings an older SQLite of its own; where that comes first,
    Python's module `sqlite3` finds no `sqlite3_deserialize` in it, and no ROS 2 bag can be read afterwards.

    Raises
    ------
    ImportError
        If pymeshlab or a library that it needs is not there.
    """
    with contextlib.suppress(ImportError):  # a Python built without SQLite decimates all the same
        importlib.import_module("sqlite3")
    return importlib.import_module("pymeshlab")
