"""A room photographed by day: its window's light is taken out with the lamps', or alone."""

from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.albedo import fit_light
from lidarspectra.material.delighting.light_exchange import cosine_directions
from lidarspectra.material.delighting.unknown_light import PANE_REFLECTANCE, find_unknown_sources
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials import light_rounds, picture_evidence
from lidarspectra.workflow.materials.delighting import Delighting, take_light_out

from .lit_rooms import OFF_M, all_light, exchange, joined, lamp_light, painted, plane

pytestmark = pytest.mark.slow  # rooms photographed by radiosity and de-lit, each some seconds

LENGTH_M, WIDTH_M, HEIGHT_M = 4.4, 3.2, 2.6
EDGE_M = 0.2
FLOOR, WALLS, CEILING, DESK, DARK = 0.25, 0.5, 0.8, 0.85, 0.12
WINDOW = (1.0, 2.2, 0.9, 2.1)  # [m] from y to y, from z to z, in the wall at x = 0
GROUND = 0.15  # [1] radiance of the ground over the sky's
RAYS = 512


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """A scan, what is true of it, and where its window is."""

    scan: Scan
    reflectance: FloatArray
    window: BoolArray
    desk: BoolArray
    lamps: list[Lamp]


@dataclass(frozen=True, kw_only=True, eq=False)
class Unlit:
    """The room before anything shines: which faces get how much of one lumen of each light, and send it on to which."""

    room: Room
    of_lamps: FloatArray
    of_sky: FloatArray
    shares: FloatArray


@pytest.fixture(scope="module")
def unlit(tmp_path_factory: pytest.TempPathFactory) -> Unlit:
    x, y, z = np.diag([LENGTH_M, WIDTH_M, HEIGHT_M])
    zero = np.zeros(3)
    scan, member, reflectance = joined(
        [
            (FLOOR, plane(zero, x, y, EDGE_M)),
            (CEILING, plane(z, y, x, EDGE_M)),
            (WALLS, plane(zero, y, z, EDGE_M)),
            (WALLS, plane(x, z, y, EDGE_M)),
            (WALLS, plane(y, x, z, EDGE_M)),
            (WALLS, plane(zero, z, x, EDGE_M)),
            (DESK, plane(np.array([0.3, 1.0, 0.75]), np.array([0.8, 0, 0]), np.array([0, 1.2, 0]), EDGE_M)),
            (DESK, plane(np.array([0.3, 1.0, 0.72]), np.array([0, 1.2, 0]), np.array([0.8, 0, 0]), EDGE_M)),
            (DARK, plane(np.array([3.6, 0.1, 1.1]), np.array([0, 0, 1.0]), np.array([0.7, 0, 0]), EDGE_M)),
        ]
    )
    at = scan.centers
    window = (
        (member == 2)
        & (at[:, 1] > WINDOW[0])
        & (at[:, 1] < WINDOW[1])
        & (at[:, 2] > WINDOW[2])
        & (at[:, 2] < WINDOW[3])
    )
    reflectance[window] = 0.01  # glass before the night is not black to the last level: it mirrors a little of the room
    lamps = [
        ls.make_lamp("panel", (at_x, 1.6, 2.5), name=f"{at_x}", size=0.6, spectrum="LED-B3", luminous_flux_lm=3000)
        for at_x in (1.4, 3.0)
    ]
    ways = cosine_directions(scan.normals, RAYS, np.random.default_rng(2))
    hits = RayCaster(scan).nearest(np.repeat(at + OFF_M * scan.normals, RAYS, axis=0), ways.reshape(-1, 3))
    radiance = np.where(ways[..., 2] > 0, 1.0, GROUND) * (window[hits.face] & hits.met).reshape(len(at), RAYS)
    sky = radiance.mean(axis=1)
    flux_of_sky = scan.areas[window].sum() * 0.5 * (1.0 + GROUND)
    return Unlit(
        room=Room(scan=scan, reflectance=reflectance, window=window, desk=(member == 6), lamps=lamps),
        of_lamps=lamp_light(scan, lamps, tmp_path_factory.mktemp("lamps")),
        of_sky=len(lamps) * sky / flux_of_sky,
        shares=exchange(scan),
    )


def lit_room(unlit: Unlit, *, day: float, lit: float, bright: float = 0.85) -> Room:
    """A room lit by its lamps and `day` times their flux from a window; .8 shows the quantile `bright` of its light."""
    room = unlit.room
    light = all_light(unlit.shares, room.reflectance, lit * unlit.of_lamps + day * unlit.of_sky)
    seen = room.reflectance * light
    exposed = seen / np.quantile(seen, bright)
    return replace(room, scan=painted(room.scan, 0.8 * exposed, room.window if day > 0 else None))


def error(made: Room, found: Delighting) -> float:
    """Mean absolute error of reflectance over the area that shows a surface."""
    assert found.face_color is not None
    counts = ~made.window & (made.scan.face_colors().max(axis=1) < 0.97)
    apart = np.abs(found.face_color.mean(axis=1) - made.reflectance)
    return float(np.average(apart[counts], weights=made.scan.areas[counts]))


def de_lit(made: Room, lamps: list[Lamp]) -> Delighting:
    return take_light_out(made.scan, find_room(made.scan), lamps, workers=2)


@pytest.mark.parametrize(("day", "lit"), [(2.0, 1.0), (0.7, 1.0)])
def test_a_window_beside_lamps_leaves_the_reflectances_right(unlit: Unlit, day: float, lit: float) -> None:
    made = lit_room(unlit, day=day, lit=lit)
    found = de_lit(made, made.lamps)
    assert error(made, found) < 0.05
    assert found.face_color is not None
    assert found.face_deviation is not None
    assert found.face_color[made.window] == pytest.approx(PANE_REFLECTANCE)
    assert (found.face_deviation[made.window] >= 1.0).all()  # a blind may be drawn, or the night be bright
    assert any("no lamp of the run file" in warning for warning in found.warnings)


def test_what_a_window_lights_has_no_skys_prior(unlit: Unlit) -> None:
    """A reveal that is cut at white beside a window stands as windows do, and sends its light anywhere."""
    made = lit_room(unlit, day=2.0, lit=1.0)
    told = []
    for is_beside in (False, True):
        found = [replace(each, is_beside=is_beside) for each in find_unknown_sources(made.scan, made.window)]
        with (
            patch.object(picture_evidence, "find_unknown_sources", return_value=tuple(found)),
            patch.object(light_rounds, "fit_light", side_effect=InterruptedError) as fit,
            pytest.raises(InterruptedError),
        ):
            de_lit(made, made.lamps)
        told.append(fit.call_args.args[0].other_upright.tolist())
    assert told == [[True], [False]]


def test_a_room_in_which_all_lamps_were_off_is_lit_by_its_window(unlit: Unlit) -> None:
    made = lit_room(unlit, day=1.0, lit=0.0)
    found = de_lit(made, [])
    assert error(made, found) < 0.05
    assert found.fit is not None
    assert found.fit.other == pytest.approx(found.fit.straight)


def test_white_paint_that_is_cut_at_white_stays_paint(unlit: Unlit) -> None:
    """The desk below the window, and much of the ceiling, are as white in the picture as the window."""
    made = lit_room(unlit, day=2.0, lit=1.0, bright=0.55)
    assert (made.scan.face_colors()[made.desk].min(axis=1) > 0.97).all()
    found = de_lit(made, made.lamps)
    assert found.face_color is not None
    assert (found.face_color[made.desk] > 2 * PANE_REFLECTANCE).all()
    assert found.face_color[made.window] == pytest.approx(PANE_REFLECTANCE)


@pytest.mark.parametrize(("bright", "is_paint"), [(0.88, True), (0.7, False)])
def test_by_night_a_little_paint_that_is_cut_at_white_is_no_source_of_the_fit(
    unlit: Unlit, bright: float, is_paint: bool
) -> None:
    """Its free strengths would take up other errors; much of it needs them."""
    made = lit_room(unlit, day=0.0, lit=1.0, bright=bright)
    assert find_unknown_sources(made.scan, made.scan.face_colors().min(axis=1) > 0.97)
    with patch.object(light_rounds, "fit_light", wraps=fit_light) as fit:
        found = de_lit(made, made.lamps)
    assert found.fit is not None
    assert found.face_color is not None
    assert not found.warnings
    white = made.scan.face_colors().min(axis=1) > 0.97  # ceiling and desk: where something might have shone
    assert white.any()
    assert (found.face_color[white] > 4 * PANE_REFLECTANCE).all()
    assert (found.fit.other is None) == is_paint
    # The source is known for paint after the first fit, from which the others start.
    sources = [call.args[0].sources for call in fit.call_args_list]
    assert sources == [sources[0], *(0 if is_paint else sources[0],) * (light_rounds.ROUNDS - 1)]
    assert [call.kwargs.get("start") is None for call in fit.call_args_list] == [True, *(False,) * (len(sources) - 1)]
    assert error(made, found) < (0.03 if is_paint else 0.05)
