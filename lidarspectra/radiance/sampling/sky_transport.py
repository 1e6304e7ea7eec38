"""The transport of a sky in patches, and where the sun of a year falls: what every hour's light is made of.

It is a transport as any other (`transport`), whose lamps are patches of the sky, and has besides

    direct_coefficient  (lamp, point)        [m-2]   part of the coefficient that comes straight from the patch
    patch               (lamp,)                      number of the patch, 0 the ground (`sky_patches`)
    geometry            (lamp,)              [m2 sr] flux through the windows per unit of the patch's radiance
    sunlit              (hour, point)        [1]     irradiance straight from the sun over that facing it outside
    sun_area            (hour, lamp)         [m2]    the sun's flux through the windows over that irradiance, by patch
"""

import numpy as np
import xarray as xr

from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.engine.options import Accuracy, Noise
from lidarspectra.radiance.sampling.arrivals import load_surfaces
from lidarspectra.radiance.sampling.trace import trace_reflected
from lidarspectra.radiance.sampling.window_light import direct_sky, sunlit
from lidarspectra.radiance.scene.sky_patches import sun_areas
from lidarspectra.radiance.scene.sky_scene import SkyScene
from lidarspectra.radiance.scene.year_sky import YearSky
from lidarspectra.room.sensor_points import SensorPoints

DIRECT_SHARE = 0.1  # of the time, for the light straight through the windows


def trace_sky(
    sky_scene: SkyScene,
    points: SensorPoints,
    year: YearSky,
    *,
    accuracy: Accuracy = "high",
    noise: Noise = "standard",
    seed: int = 0,
    workers: int | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Trace every patch's light to sensor points, and cast rays to the sun of every hour.

    Light straight through the windows is found by ray casting, what the room reflects by `trace_reflected`.

    Parameters
    ----------
    sky_scene : SkyScene
    points : SensorPoints
    year : YearSky
        Where the sun stands.
    accuracy, noise, seed, workers, engine, progress
        As in `trace`; the target of noise is that of the scene's own sky, a year's mean.

    Returns
    -------
    transport : xarray.Dataset
        See the module's text.

    Raises
    ------
    EngineError, SceneError
        As `trace`.
    """
    caster = next(iter(load_surfaces(sky_scene.scene).values())).caster
    progress(0.0, "light straight through the windows")
    direct = direct_sky(sky_scene, points, caster)
    shone = sunlit(sky_scene.windows, points, caster, year.sun_direction, sky_scene.north_deg)
    areas = sun_areas(sky_scene.patches, sky_scene.windows, sky_scene.north_deg, year.sun_direction)
    transport = trace_reflected(
        sky_scene.scene,
        points,
        direct,
        accuracy=accuracy,
        noise=noise,
        seed=seed,
        workers=workers,
        engine=engine,
        progress=part_of(progress, DIRECT_SHARE, 1.0),
    )
    variables = {
        "direct_coefficient": (("lamp", "point"), direct, "m-2", "part straight from the patch"),
        "patch": (("lamp",), sky_scene.lit, "1", "number of the patch of the sky, 0 the ground"),
        "geometry": (("lamp",), sky_scene.geometry, "m2 sr", "flux through the windows per radiance of the patch"),
        "sunlit": (("hour", "point"), shone, "1", "irradiance straight from the sun over that facing it outside"),
        "sun_area": (("hour", "lamp"), areas[:, sky_scene.lit], "m2", "flux of the sun through the windows, by patch"),
    }
    for name, (dims, values, unit, words) in variables.items():
        kept = values if values.dtype.kind == "i" else values.astype(np.float32)
        transport[name] = (dims, kept, {"units": unit, "long_name": words})
    transport.attrs["sky_subdivision"] = sky_scene.patches.subdivision
    return transport
