"""Lamps that hang or stand free: found where they are white all around, and white paint not."""

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb
from lidarspectra.material.lit_lamps.lit_lamps import LitLamp, search_lit_lamps
from lidarspectra.radiance.scene.placement import placement_notes
from lidarspectra.room.room import find_room
from lidarspectra.spectra.spectrum import Spectrum

WHITE, GRAY = (255, 255, 255), (110, 110, 110)
SHADE = ([1.85, 1.35, 1.3], [2.15, 1.65, 1.6])
STEM = ([1.98, 1.48, 0.0], [2.02, 1.52, 1.3])


def scan_with(builder, *bodies, room=GRAY, pictures=None, leave_out=(), noise_m: float = 0.003) -> Scan:
    made = builder(step_m=0.1, noise_m=noise_m)
    made.box([0, 0, 0], [4, 3, 2.5], inward=True, color=room)
    for low, high, color in bodies:
        made.box(low, high, color=color, pictures=pictures if color == WHITE else None, leave_out=leave_out)
    return made.scan()


def bulbs_in(scan: Scan) -> list[LitLamp]:
    return [lamp for lamp in search_lit_lamps(scan, find_room(scan)).lamps if isinstance(lamp.shape, Bulb)]


@pytest.mark.parametrize("stem", [(), ((*STEM, GRAY),), ((*STEM, WHITE),)], ids=["hung", "grey stem", "white stem"])
def test_a_shade_that_is_white_all_around_is_a_globe_that_holds_it(builder, stem) -> None:
    scan = scan_with(builder, (*SHADE, WHITE), *stem)
    (lamp,) = bulbs_in(scan)
    np.testing.assert_allclose(lamp.center, [2.0, 1.5, 1.45], atol=0.1 if stem else 0.01)
    corner_m = 0.15 * np.sqrt(3.0)
    assert corner_m < 0.5 * lamp.shape.size[0] < corner_m + (0.12 if stem else 0.03)
    assert lamp.confidence > 0.7


def test_a_shade_whose_underside_is_seen_with_the_ceiling_is_one_lamp(builder) -> None:
    scan = scan_with(builder, ([1.9, 1.4, 1.9], [2.1, 1.6, 2.1], WHITE))
    (lamp,) = search_lit_lamps(scan, find_room(scan)).lamps
    assert isinstance(lamp.shape, Bulb)


def test_a_warm_shade_is_a_lamp(builder) -> None:
    assert len(bulbs_in(scan_with(builder, (*SHADE, (255, 235, 170))))) == 1


def test_no_note_says_that_the_shade_hides_the_globe_around_it(builder) -> None:
    scan = scan_with(builder, (*SHADE, WHITE))
    (found,) = bulbs_in(scan)
    flux = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.ones(2))
    lamp = Lamp(name="shade", shape=found.shape, center=found.center, normal=found.normal, flux=flux)
    assert placement_notes([lamp], scan) == ()


def test_two_shades_are_two_globes(builder) -> None:
    bodies = [([x, 1.4, 1.6], [x + 0.2, 1.6, 1.8], WHITE) for x in (1.2, 1.55)]
    centers = sorted(lamp.center[0] for lamp in bulbs_in(scan_with(builder, *bodies)))
    np.testing.assert_allclose(centers, [1.3, 1.65], atol=0.02)


@pytest.mark.parametrize(
    "bodies",
    [
        [([1.7, 1.2, 0.0], [2.3, 1.8, 1.8], WHITE)],
        [(*SHADE, (225, 225, 225))],
        [(*SHADE, (40, 60, 255))],
        [(*SHADE, (255, 240, 60))],
        [([1.85, 1.35, 0.75], [2.15, 1.65, 1.05], WHITE), ([1.2, 0.9, 0.7], [2.8, 2.1, 0.74], GRAY)],
        [([3.68, 1.35, 1.3], [3.98, 1.65, 1.6], WHITE)],
        [([1.99, 1.49, 1.5], [2.02, 1.52, 1.53], WHITE)],
        [([1.2, 1.45, 1.9], [2.8, 1.55, 1.98], WHITE)],
    ],
    ids=[
        "a fridge",
        "grey paint",
        "a blue screen",
        "yellow paint",
        "a box on a table",
        "a cupboard on a wall",
        "a speck",
        "a tube",
    ],
)
def test_what_is_white_and_no_lamp_that_stands_free(builder, bodies) -> None:
    assert bulbs_in(scan_with(builder, *bodies)) == []


@pytest.mark.parametrize("sides", [("south", "west", "bottom"), ("south", "north")])
def test_white_paint_is_dark_on_sides_that_look_away_from_the_light(builder, sides: tuple[str, ...]) -> None:
    dark = {side: np.full((40, 40, 3), 120.0) for side in sides}
    assert bulbs_in(scan_with(builder, (*SHADE, WHITE), pictures=dark)) == []


def test_white_that_was_seen_from_one_side_only_is_none(builder) -> None:
    assert bulbs_in(scan_with(builder, (*SHADE, WHITE), leave_out=("north", "east", "bottom"))) == []


def test_in_a_picture_that_is_white_all_over_nothing_is_told(builder) -> None:
    assert bulbs_in(scan_with(builder, (*SHADE, WHITE), room=(235, 235, 235))) == []


def test_a_globe_beyond_the_walls_is_none_of_the_rooms(builder) -> None:
    """The ghost of one behind a mirror, or one that was seen through a window."""
    assert bulbs_in(scan_with(builder, ([4.6, 1.35, 1.3], [4.9, 1.65, 1.6], WHITE))) == []


def test_a_room_without_white_has_no_bodies(builder) -> None:
    assert bulbs_in(scan_with(builder)) == []
