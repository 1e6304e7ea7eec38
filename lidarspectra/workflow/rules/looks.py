"""What people see who look along the rules' looks: fisheyes, and the glare of their luminaires in every state."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp, are_one_shape, is_daylight
from lidarspectra.mapping.calibration.model import STEEPEST
from lidarspectra.mapping.rules.chances import picked
from lidarspectra.mapping.rules.limits import WORK_PLACES, Criterion
from lidarspectra.progress import Progress
from lidarspectra.radiance.pictures.glare import LEAST_UGR, Glare, Luminaires, evalglare, luminaires_of, ugr_of
from lidarspectra.radiance.pictures.render import Picture, render
from lidarspectra.radiance.pictures.view import View
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.rules.criteria import EN, UGR, criterion
from lidarspectra.workflow.rules.light import LUX, RuleLight
from lidarspectra.workflow.rules.points import AreaPoints
from lidarspectra.workflow.scenarios.picture_of_run import observer_scene

GLARE_PIXELS = 360  # of a side of a fisheye: 1e-4 sr a pixel in the middle


@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """What a person sees who looks one way.

    Parameters
    ----------
    area : str
        Where they are.
    angle_deg : float
        Of the look, counter-clockwise from the x axis. [deg]
    picture : Picture
        A fisheye.
    luminaires : Luminaires
    glare : Glare
        By evalglare.
    """

    area: str
    angle_deg: float
    picture: Picture
    luminaires: Luminaires
    glare: Glare


def looks_of_run(room: RunRoom, light: RuleLight, *, workers: int | None, progress: Progress) -> tuple[Look, ...]:
    """Render what people see, and judge its glare."""
    points = light.points.points
    people = [area for area in light.points.areas if area.area.activity in WORK_PLACES]
    places = [(area.area.name, int(eye)) for area in people for eye in area.eyes]
    views = [
        View(
            eye=points.positions[eye],
            direction=points.normals[eye],
            projection="fisheye",
            angle_deg=180.0,
            pixels=(GLARE_PIXELS, GLARE_PIXELS),
        )
        for _, eye in places
    ]
    daylight = [number for number, lamp in enumerate(room.lamps) if is_daylight(lamp)]
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = observer_scene(room, room.lamps, Path(name))
        pictures = render(scene, views, smooth=False, fine_lamps=True, workers=workers, progress=progress)
    return tuple(
        Look(
            area=area,
            angle_deg=round(float(np.degrees(np.arctan2(*points.normals[eye][1::-1]))), 1) % 360.0,
            picture=picture,
            luminaires=luminaires_of(picture, daylight=daylight),
            glare=evalglare(picture),
        )
        for (area, eye), picture in zip(places, pictures, strict=True)
    )


def ugr_criteria(points: AreaPoints, light: RuleLight, looks: Sequence[Look]) -> Iterator[Criterion]:
    """UGR of the look that is worst; none where no lamp is lit, or a look has luminaires before no background."""
    pairs = list(zip(looks, points.eyes, strict=True)) if looks and light.electric.any() else []
    if not pairs or any(without_background(light, look, eye) for look, eye in pairs):
        return
    drawn, reflected = np.stack([_ugr_draws(light, look, eye) for look, eye in pairs], axis=-1)
    limit = WORK_PLACES[points.area.activity].ugr if points.area.ugr is None else points.area.ugr
    value = max(max(look.luminaires.ugr, LEAST_UGR) for look in looks)
    parts = value, picked(drawn, reflected, np.argmax)
    yield criterion(EN, UGR, points.area.name, "", limit, parts, sense="at most")


def without_background(light: RuleLight, look: Look, eye: int) -> bool:
    """Whether luminaires are seen, and all light at the eye comes straight from them: UGR has no meaning then."""
    seen = look.luminaires
    traced = float(light.model(LUX, np.array([eye])).light.sum())
    return bool(seen.lamp.size) and (seen.indirect_lx <= 0 or float(seen.direct_lx.sum()) >= traced)


def shares_of_luminaires(lamps: Sequence[Lamp], seen: IntArray) -> FloatArray:
    """(source, lamp) share of each lamp in the light of the sources that are seen: lamps of one shape are one source.

    Parameters
    ----------
    lamps : sequence of Lamp
    seen : (source,) int
        The first lamp of each source.
    """
    lumens = np.array([luminous_flux_lm(lamp.flux) for lamp in lamps])
    one = [[lamp is lamps[first] or are_one_shape(lamps[first], lamp) for lamp in lamps] for first in seen.tolist()]
    of_source = np.array(one, dtype=np.float64).reshape(len(one), len(lamps)) * lumens
    return np.asarray(of_source / np.maximum(of_source.sum(axis=1, keepdims=True), 1e-300), dtype=np.float64)


def _ugr_draws(light: RuleLight, look: Look, eye: int) -> FloatArray:
    """(2, draw) UGR of a look with the trace's noise as drawn, and reflected; see `DrawnLight.least`.

    Luminances go with their lamps' fluxes, the background with all light and reflectances.
    """
    seen, model = look.luminaires, light.model(LUX, np.array([eye]))
    by_lamp = model.light[0]
    share = shares_of_luminaires(light.room.lamps, seen.lamp)
    direct = seen.direct_lx @ share
    indirect = np.maximum(by_lamp - direct, 0.0)
    of_reflected = np.divide(by_lamp, indirect, out=np.ones_like(by_lamp), where=indirect > 0)
    slope = np.minimum(model.slope[0] * of_reflected[:, None], STEEPEST)
    factors = np.exp(light.draws.flux + light.draws.reflectance @ slope.T)
    background = (factors @ indirect) / max(float(indirect.sum()), 1e-300) * seen.indirect_lx
    background = background * light.draws.level * light.own_error[:, eye]
    noise = np.stack([light.noise[:, eye], 2.0 - light.noise[:, eye]])
    weight = seen.weight * (np.exp(light.draws.flux) @ share.T) ** 2
    return np.maximum(ugr_of(weight, background * noise), LEAST_UGR)
