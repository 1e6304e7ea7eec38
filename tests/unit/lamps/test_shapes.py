"""Lamp shapes are records: each knows its surfaces, and all that others ask follows from these."""

from dataclasses import dataclass
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest

from lidarspectra.config import LampSection
from lidarspectra.errors import LampError
from lidarspectra.lamps.lamp_file import SKIES_FILE, load_lamps, save_lamps
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import GivenShape
from lidarspectra.lamps.patterns import CosinePower, Lambertian, Opening, SkyLight
from lidarspectra.lamps.shapes import (
    SHAPES,
    TWO_FACES_APART_M,
    Bulb,
    Disc,
    Luminaire,
    Panel,
    Point,
    Shape,
    Spot,
    Strip,
    Sun,
    Window,
    shape_of,
)
from lidarspectra.lamps.surfaces import Circle, Place, Surface
from lidarspectra.radiance.engine.bands import band_groups
from lidarspectra.radiance.scene.daylight import openings_of
from lidarspectra.radiance.scene.lamp_text import lamp_geometry_text, lamp_material_text
from lidarspectra.radiance.scene.primitives import Color
from lidarspectra.radiance.scene.sky import ALTITUDES_DEG, AZIMUTHS_DEG, SKY_WAVELENGTHS_NM
from lidarspectra.spectra.spectrum import Spectrum

FLAT = Spectrum(wavelengths_nm=[400, 700], values=[1.0, 1.0])
BOTH_WAYS = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0.3 1.2 0\n1 1 0\n0 90 180\n0\n100 10 50\n"
IN_THE_ROOM: list[Shape] = [
    Panel(0.6, 0.3),
    Strip(1.2, 0.05),
    Window(1.0, 1.5),
    Disc(0.3),
    Spot(0.1, beam_angle_deg=40.0),
    Bulb(),
    Point(),
    Luminaire(BOTH_WAYS),
    Luminaire(BOTH_WAYS, (0.2,)),
]


def lamp(shape: Shape) -> Lamp:
    return Lamp(name="one", shape=shape, center=(1.0, 2.0, 2.5), normal=(0.3, -0.5, -0.8), rotation_deg=25.0, flux=FLAT)


def test_a_user_may_write_every_shape_but_the_sun() -> None:
    assert set(get_args(get_type_hints(LampSection)["shape"])) | {"sun"} == SHAPES.keys()
    assert set(get_args(GivenShape)) | {"sun"} == SHAPES.keys()


@pytest.mark.parametrize("shape", IN_THE_ROOM, ids=lambda shape: shape.word)
def test_points_of_a_lamp_lie_on_its_surfaces_spread_evenly(shape: Shape) -> None:
    one = lamp(shape)
    places, normals = one.sample(np.random.default_rng(1), 4000)
    np.testing.assert_allclose(one.distance(places), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    # Their mean is the centre within five standard errors: a size over √(12 · 4000), here taken as the whole size.
    np.testing.assert_allclose(places.mean(axis=0), one.center, atol=5 * max(one.size) / np.sqrt(12 * 4000))
    np.testing.assert_array_less(-1e-12, ((places - one.center) * normals).sum(axis=1))  # outward


@pytest.mark.parametrize("shape", IN_THE_ROOM, ids=lambda shape: shape.word)
def test_the_distance_is_that_to_the_nearest_of_many_points(shape: Shape) -> None:
    one = lamp(shape)
    places, _ = one.sample(np.random.default_rng(2), 20_000)
    far = one.center + np.random.default_rng(3).normal(0.0, 1.0, (20, 3))
    nearest = np.linalg.norm(far[:, None] - places, axis=2).min(axis=1)
    # 20,000 points on at most 1.5 m² lie 1 cm apart: the nearest is at most some cm from the foot of the distance.
    np.testing.assert_array_less(one.distance(far) - 1e-9, nearest)
    np.testing.assert_allclose(nearest, one.distance(far), atol=0.05)


@pytest.mark.parametrize("shape", IN_THE_ROOM, ids=lambda shape: shape.word)
def test_a_flat_surface_is_as_large_as_its_outline(shape: Shape) -> None:
    for surface in lamp(shape).surfaces:
        if surface.normal is not None:
            corners = surface.outline(720)
            around = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0) @ surface.normal
            assert 0.5 * around == pytest.approx(surface.area, rel=2e-5)  # a polygon of 720 sides lacks 1.3e-5


def test_a_luminaire_that_shines_both_ways_has_two_openings_that_lie_on_each_other() -> None:
    down, up = lamp(Luminaire(BOTH_WAYS)).surfaces
    assert down.normal is not None
    np.testing.assert_allclose(up.normal, -down.normal)
    assert np.ptp(np.array([down.outline(), up.outline()]) @ down.normal) == pytest.approx(TWO_FACES_APART_M)
    assert lamp(Luminaire(BOTH_WAYS)).shape.area == pytest.approx(0.36)  # of one


@pytest.mark.parametrize("shape", IN_THE_ROOM, ids=lambda shape: shape.word)
def test_lamps_come_back_from_their_file(shape: Shape, tmp_path: Path) -> None:
    save_lamps([lamp(shape)], tmp_path)
    (one,) = load_lamps(tmp_path)
    assert type(one.shape) is type(shape)
    assert one.size == shape.size
    assert one.shape.pattern.__class__ is shape.pattern.__class__
    np.testing.assert_allclose(one.outline(), lamp(shape).outline())


def test_a_window_comes_back_with_the_sky_behind_it_and_beside_one_without(tmp_path: Path) -> None:
    incoming = np.random.default_rng(3).random((AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size))
    given = [lamp(Panel(0.6, 0.6)), lamp(Window(1.2, 1.0)), lamp(Window(1.2, 1.0, incoming))]
    save_lamps(given, tmp_path)
    _, plain, daylit = load_lamps(tmp_path)
    assert plain.shape.pattern == Lambertian()
    assert isinstance(daylit.shape.pattern, SkyLight)
    np.testing.assert_allclose(daylit.shape.pattern.incoming, incoming, rtol=1e-6)  # single precision
    (tmp_path / SKIES_FILE).unlink()
    with pytest.raises(LampError, match="Make the scene again"):
        load_lamps(tmp_path)


def test_the_sun_is_no_part_of_the_room_and_comes_back_with_its_windows(tmp_path: Path) -> None:
    opening = Opening(corners=np.eye(4)[:, :3], inward=np.array([0.0, 0.0, 1.0]), transmittance=0.8)
    sun = lamp(Sun((opening,)))
    assert not sun.is_in_room
    assert sun.surfaces == ()
    assert np.all(np.isinf(sun.distance(np.zeros((2, 3)))))
    with pytest.raises(LampError, match="sun"):
        sun.sample(np.random.default_rng(1), 3)
    save_lamps([sun], tmp_path)
    (back,) = load_lamps(tmp_path)
    np.testing.assert_allclose(back.outline(), sun.outline())
    (again,) = openings_of(back)
    np.testing.assert_array_equal(again.corners, opening.corners)
    np.testing.assert_array_equal(again.inward, opening.inward)
    assert again.transmittance == opening.transmittance


@pytest.mark.parametrize(
    ("word", "size", "options", "says"),
    [
        ("panel", None, {}, "Measure the lamp"),
        ("disc", (0.1, 0.1), {}, "1 positive size"),
        ("strip", (1.0,), {}, "2 positive size"),
        ("bulb", (-0.1,), {}, "positive"),
        ("panel", (0.6, float("nan")), {}, "positive"),
        ("ies", (1.0, 1.0, 1.0), {"candela_text": BOTH_WAYS}, "1 or 2"),
        ("spot", (0.1,), {"beam_angle_deg": 150.0}, "120"),
        ("spot", (0.1,), {}, "beam_angle_deg"),
        ("disc", (0.1,), {"beam_angle_deg": 30.0}, "beam_angle_deg"),
        ("tube", (1.0,), {}, "panel"),
    ],
)
def test_what_is_no_shape_is_refused_with_its_lamp(word: str, size: object, options: object, says: str) -> None:
    with pytest.raises(LampError, match=says) as caught:
        shape_of(word, size, where="lamp 'one'", **options)
    assert caught.value.where == "lamp 'one'"


def test_a_word_for_a_shape_is_refused_with_the_way_out() -> None:
    with pytest.raises(LampError, match=r"Panel\(0.6, 0.6\)"):
        Lamp(name="one", shape="panel", center=np.zeros(3), flux=FLAT)


@dataclass(frozen=True)
class Lantern(Shape):
    """Two beams back to back: a shape that the package does not have."""

    diameter: float

    word = "lantern"
    size_names = ("diameter",)

    @property
    def pattern(self) -> CosinePower:
        """A beam of 66 degrees."""
        return CosinePower(4.0)

    def surfaces(self, place: Place) -> tuple[Surface, ...]:
        """A disc each way."""
        return Circle(place.moved(0.1), self.diameter), Circle(place.moved(-0.1).turned_over(), self.diameter)


def test_a_new_shape_of_known_surfaces_is_written_as_it_is() -> None:
    lantern = Lamp(name="new", shape=Lantern(0.2), center=(0.0, 0.0, 1.0), flux=FLAT)
    assert lamp_geometry_text("lamp0", lantern) == (
        "lamp0 ring lamp0_shape\n0\n0\n8 0 0 0.9 0 0 -1 0 0.1\nlamp0 ring lamp0_shape1\n0\n0\n8 0 0 1.1 0 0 1 0 0.1\n"
    )
    (group,) = band_groups(3, "rgb")
    text = lamp_material_text("lamp0", lantern, Color(group=group, slots=np.ones(3)))
    radiance = 5.0 / (2.0 * np.pi * 2.0 * np.pi * 0.01)  # (n + 1)Φ/(2πA), A of both
    assert text.endswith(f"light lamp0\n0\n0\n3 {radiance:.9g} {radiance:.9g} {radiance:.9g}\n")
