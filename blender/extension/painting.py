"""The map, its points and the legend, in the light of the lamps as they are dimmed now."""

from typing import Any

import numpy as np

from .collections_of_scene import found
from .color_scale import Scale, Summary, prefixed, scale_of, summary_of
from .faults import ExtensionError
from .loaded import room_of_scene
from .meshes import LIGHT, set_colors, set_values
from .room_file import Floats, RoomFile

MAP, POINTS = "Map", "Points"
ROLE = "lidarspectra_role"  # custom property of objects


def object_of(scene: Any, role: str) -> Any:
    """The object of a role in the collection Light; None where there is none."""
    part = found(scene, "Light")
    return None if part is None else next((each for each in part.objects if each.get(ROLE) == role), None)


def factors(scene: Any) -> dict[str, float]:
    """Factor of each lamp's present dimming on its light in the run, by name."""
    part = found(scene, "Lamps")
    lamps = [] if part is None else [thing for thing in part.objects if thing.lidarspectra.is_lamp]
    found_factors: dict[str, float] = {}
    for thing in sorted(lamps, key=lambda thing: thing.name != thing.lidarspectra.name_of_object):  # copies come last
        settings = thing.lidarspectra
        if settings.name_in_run and settings.dim_of_run > 0:
            found_factors.setdefault(settings.name_in_run, settings.dim / settings.dim_of_run)
    return found_factors


def shown_values(room: RoomFile, scene: Any) -> tuple[Floats, Scale, Summary]:
    """(point,) values of the shown layer, their scale and their summary, in the unit of the layer."""
    layer = min(scene.lidarspectra.layer, len(room.layers) - 1)
    values = room.light(factors(scene), layer)
    kept = ~room.arrays["buried"] if not room.arrays["buried"].all() else np.ones(len(values), dtype=bool)
    of_run = values if scene.lidarspectra.fit_scale else room.light({}, layer)
    return values, scale_of(of_run[kept]), summary_of(values[kept])


def repaint(scene: Any) -> None:
    """Show the present light; a run that cannot be read any more is said in the panel."""
    from . import legend

    settings = scene.lidarspectra
    try:
        room = room_of_scene(scene)
    except ExtensionError as fault:
        settings.message = str(fault)
        return
    if room is None:
        return
    values, scale, _ = shown_values(room, scene)
    colors = scale.colors(values, room.arrays["scale"])
    light = room.light(factors(scene))
    for role in (MAP, POINTS):
        thing = object_of(scene, role)
        if thing is None:
            continue
        times = len(thing.data.vertices) // len(values)  # corners of a point's mark
        set_colors(thing.data, LIGHT, "POINT", np.repeat(colors, times, axis=0))
        for number, layer in enumerate(room.layers):
            set_values(
                thing.data, layer["name"], "FLOAT", "POINT", np.repeat(light[:, number], times).astype(np.float32)
            )
    layer = room.layers[min(settings.layer, len(room.layers) - 1)]
    factor, unit = prefixed(scale.high, layer["unit"])
    legend.update(scene, scale, factor, f"{layer['words']} [{unit}]")
