"""Names to choose from: those of the databases of the program that made the loaded run."""

from typing import Any

from .faults import ExtensionError
from .loaded import room_of_scene


def lamp_spectra(settings: Any, context: Any, typed: str) -> list[str]:
    """Spectra of lamps; Blender asks while one types."""
    return _named("lamp_spectra", context)


def reflectances(settings: Any, context: Any, typed: str) -> list[str]:
    """Reflectances of surfaces."""
    return _named("reflectances", context)


def _named(kind: str, context: Any) -> list[str]:
    try:
        room = room_of_scene(context.scene)
    except ExtensionError:
        return []
    return [] if room is None else list(getattr(room, kind))
