"""A card of known reflectance sets the level where nothing else in the picture tells it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.cards import Card, look_at_cards
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials.delighting import take_light_out

from .lit_rooms import all_light, exchange, joined, lamp_light, painted, plane

pytestmark = [
    pytest.mark.slow,  # a room photographed by radiosity and de-lit, twice
    pytest.mark.usefixtures("half_samples"),
]

LENGTH_M, WIDTH_M, HEIGHT_M = 4.0, 3.2, 2.6
FLOOR, WALLS, CEILING, CARD, LIGHT_CARD = 0.15, 0.3, 0.5, 0.18, 0.6  # a ceiling far darker than most
CENTER, LIGHT_CENTER = (2.0, 1.6, 0.0), (2.4, 1.6, 0.0)
POWER = 0.7  # of a tone curve, far from 1 about which it is believed to be


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """A scan in lamps' light, and what is true of it."""

    scan: Scan
    reflectance: FloatArray
    is_card: np.ndarray
    lamps: list[Lamp]


@pytest.fixture(scope="module")
def dim_room(tmp_path_factory: pytest.TempPathFactory) -> Room:
    x, y, z = np.diag([LENGTH_M, WIDTH_M, HEIGHT_M])
    zero = np.zeros(3)
    scan, member, reflectance = joined(
        [
            (FLOOR, plane(zero, x, y, 0.2)),
            (CEILING, plane(z, y, x, 0.2)),
            (WALLS, plane(zero, y, z, 0.2)),
            (WALLS, plane(x, z, y, 0.2)),
            (WALLS, plane(y, x, z, 0.2)),
            (WALLS, plane(zero, z, x, 0.2)),
            (CARD, plane(np.array([1.85, 1.45, 0.01]), np.array([0.3, 0, 0]), np.array([0, 0.3, 0]), 0.1)),
            (LIGHT_CARD, plane(np.array([2.25, 1.45, 0.01]), np.array([0.3, 0, 0]), np.array([0, 0.3, 0]), 0.1)),
        ]
    )
    lamps = [
        ls.make_lamp("panel", (at_x, 1.6, 2.3), name=f"{at_x}", size=0.5, spectrum="LED-B3", luminous_flux_lm=3000)
        for at_x in (1.2, 2.8)
    ]
    direct = lamp_light(scan, lamps, tmp_path_factory.mktemp("light"))
    seen = reflectance * all_light(exchange(scan), reflectance, direct)
    return Room(
        scan=painted(scan, 0.7 * seen / np.quantile(seen, 0.98)),
        reflectance=reflectance,
        is_card=member >= 6,
        lamps=lamps,
    )


def levels(room: Room, *cards: Card) -> tuple[float, float]:
    """Mean of the estimated reflectance over the true one, and its stated deviation."""
    found = take_light_out(room.scan, find_room(room.scan), room.lamps, cards=cards, workers=2)
    assert found.face_color is not None
    assert found.face_deviation is not None
    counts = ~room.is_card
    ratio = found.face_color.mean(axis=1)[counts] / room.reflectance[counts]
    return float(np.median(ratio)), float(np.median(found.face_deviation[counts]))


def card(reflectance: float = CARD, *, center: tuple[float, float, float] = CENTER) -> Card:
    return Card(center=np.array(center), size_m=0.3, reflectance=reflectance)


def test_a_card_fixes_the_level_and_narrows_the_deviation(dim_room: Room) -> None:
    _, unsure = levels(dim_room)  # its level may be right all the same, for luck
    with_card, sure = levels(dim_room, card())
    assert with_card == pytest.approx(1.0, abs=0.04)
    assert sure < unsure


def powers(room: Room, *cards: Card) -> tuple[float, float]:
    """Found power of the tone curve, and its stated deviation."""
    found = take_light_out(room.scan, find_room(room.scan), room.lamps, cards=cards, workers=2)
    assert found.fit is not None
    return found.fit.tone.power, float(found.fit.deviations[0])


def test_two_cards_tell_the_power_of_the_tone_curve_as_well(dim_room: Room) -> None:
    lifted = replace(dim_room, scan=painted(dim_room.scan, dim_room.scan.face_colors().mean(axis=1) ** POWER))
    without, unsure = powers(lifted)
    both, sure = powers(lifted, card(), card(LIGHT_CARD, center=LIGHT_CENTER))
    assert abs(both - POWER) < 0.7 * abs(without - POWER)  # not all: two greys leave power and shoulder one freedom
    assert sure < 0.85 * unsure


def test_a_card_that_is_cut_at_white_is_left_out_and_told(dim_room: Room) -> None:
    shown = dim_room.scan.face_colors().mean(axis=1)
    shown[dim_room.is_card] = 1.0
    white = painted(dim_room.scan, shown)
    seen = look_at_cards(white, RayCaster(white), [card()])
    assert seen.card.size == 0
    assert "cut at white" in seen.notes[0]
    assert "[[materials.cards]]" in seen.notes[0]


def test_points_of_a_card_are_its_own(dim_room: Room) -> None:
    seen = look_at_cards(dim_room.scan, RayCaster(dim_room.scan), [card()])
    assert seen.card.size >= 25
    assert dim_room.is_card[seen.face].all()
    assert np.ptp(seen.positions[:, 0]) < 0.3
    np.testing.assert_allclose(seen.positions[:, 2], 0.01, atol=1e-6)


def test_a_card_of_another_reflectance_does_not_draw_the_room_with_it(dim_room: Room) -> None:
    room = find_room(dim_room.scan)
    wrong = card(0.85)  # a grey card that was taken for paper
    lights = [
        take_light_out(dim_room.scan, room, dim_room.lamps, cards=cards, workers=2)
        for cards in ((), (wrong,), (wrong, card(LIGHT_CARD, center=LIGHT_CENTER)))
    ]
    levels = [float(np.median(each.face_color)) for each in lights if each.face_color is not None]
    assert levels[1] == pytest.approx(levels[0], rel=0.01)
    assert levels[2] == pytest.approx(levels[0], rel=0.05)  # the right one beside it counts
    for each in lights[1:]:
        (note,) = [words for words in each.warnings if "does not count" in words]
        assert "to reflect 0.85" in note
        assert "(2.00, 1.60, 0.00)" in note
    assert not any("card" in words for words in lights[0].warnings)


def test_a_card_in_the_air_is_refused(dim_room: Room) -> None:
    with pytest.raises(MaterialError, match="surface within 15 cm"):
        look_at_cards(dim_room.scan, RayCaster(dim_room.scan), [card(center=(2.0, 1.6, 1.3))])
