"""Numbers of the room that the tests make, and the way to the installed extension."""

import importlib
from typing import Any

NAME = "bl_ext.user_default.lidarspectra"
GREEN, WHITE = [0.1, 0.6, 0.2], [0.8, 0.8, 0.8]
SHARES = [  # lamp, point, layer
    [[100.0, 1e-3], [50.0, 5e-4], [10.0, 1e-4], [30.0, 3e-4]],
    [[20.0, 2e-4], [150.0, 8e-4], [10.0, 1e-4], [50.0, 2e-4]],
]


def module(name: str) -> Any:
    """A module of the installed extension."""
    return importlib.import_module(f"{NAME}.{name}")
