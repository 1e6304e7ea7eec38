"""Lamps' shapes: their radiance integrates to their flux, and they stand as they were told."""

import numpy as np
import pytest
from scipy.integrate import quad

from lidarspectra.errors import LampError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import beam_exponent
from lidarspectra.lamps.shapes import shape_of
from lidarspectra.lamps.surfaces import Rectangle
from lidarspectra.radiance.scene.lamp_text import lamp_geometry_text
from lidarspectra.spectra.spectrum import Spectrum

FLAT = Spectrum(wavelengths_nm=[400, 700], values=[1.0, 1.0])


def lamp(shape: str = "panel", size: tuple[float, ...] = (0.6, 0.3), **settings: object) -> Lamp:
    fields = {"center": np.array([1.0, 2.0, 2.5]), "normal": np.array([0.0, 0.0, -1.0])} | settings
    options = {name: fields.pop(name) for name in ("beam_angle_deg",) if name in fields}
    return Lamp(name="one", shape=shape_of(shape, size, **options), flux=FLAT, **fields)


def radiance_per_flux(one: Lamp) -> float:
    return one.shape.pattern.radiance_per_flux(one.shape.area)


@pytest.mark.parametrize("beam", [5.0, 24.0, 60.0, 90.0, 120.0])
def test_a_spot_halves_its_intensity_at_half_the_beam_angle(beam: float) -> None:
    exponent = beam_exponent(beam)
    assert np.cos(np.radians(beam / 2)) ** exponent == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("beam", [5.0, 24.0, 60.0, 120.0])
def test_a_spots_radiance_integrates_to_its_flux(beam: float) -> None:
    spot = lamp("spot", (0.08,), beam_angle_deg=beam)
    exponent = beam_exponent(beam)

    def intensity(angle: float) -> float:
        radiance = radiance_per_flux(spot) * np.cos(angle) ** (exponent - 1)
        return radiance * spot.shape.area * np.cos(angle)

    flux, _ = quad(lambda angle: 2 * np.pi * intensity(angle) * np.sin(angle), 0, np.pi / 2, epsabs=1e-12)
    assert flux == pytest.approx(1.0, rel=1e-9)


def test_a_spot_of_120_degrees_is_a_disc() -> None:
    assert radiance_per_flux(lamp("spot", (0.2,), beam_angle_deg=120.0)) == pytest.approx(
        radiance_per_flux(lamp("disc", (0.2,)))
    )


@pytest.mark.parametrize("beam", [0.0, 121.0, 179.0])
def test_a_beam_that_no_flat_lamp_has_is_refused(beam: float) -> None:
    with pytest.raises(LampError, match="120"):
        beam_exponent(beam)


@pytest.mark.parametrize(
    ("shape", "size", "area"),
    [
        ("panel", (0.6, 0.3), 0.18),
        ("strip", (1.2, 0.05), 0.06),
        ("window", (1.0, 2.0), 2.0),
        ("disc", (0.2,), np.pi * 0.01),
        ("bulb", (0.06,), np.pi * 0.0036),
        ("point", (0.01,), np.pi * 1e-4),
    ],
)
def test_diffuse_lamps_send_flux_over_pi_area(shape: str, size: tuple[float, ...], area: float) -> None:
    assert radiance_per_flux(lamp(shape, size)) == pytest.approx(1 / (np.pi * area))


@pytest.mark.parametrize("normal", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (1, 2, -3), (1, 1e-6, 0)])
@pytest.mark.parametrize("rotation", [0.0, 30.0, 90.0, -200.0])
def test_a_rectangle_faces_its_normal_with_its_own_size(normal: tuple[float, ...], rotation: float) -> None:
    panel = lamp(normal=np.array(normal, dtype=float), rotation_deg=rotation)
    (surface,) = panel.surfaces
    assert isinstance(surface, Rectangle)
    corners = surface.corners()
    edges = np.roll(corners, -1, axis=0) - corners
    np.testing.assert_allclose(np.linalg.norm(edges, axis=1), [0.6, 0.3, 0.6, 0.3], rtol=1e-12)
    np.testing.assert_allclose(np.cross(edges[0], edges[1]), 0.18 * panel.normal, atol=1e-12)  # counter-clockwise
    np.testing.assert_allclose(corners.mean(axis=0), panel.center, atol=1e-12)


def test_the_length_lies_along_x_and_turns_about_the_normal() -> None:
    place = lamp().place
    np.testing.assert_allclose([place.length, place.width], [[1, 0, 0], [0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(lamp(rotation_deg=90.0).place.length, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(lamp(normal=np.array([1.0, 0, 0])).place.length, [0, 1, 0], atol=1e-12)


def test_geometry_names_only_what_we_chose() -> None:
    text = lamp_geometry_text("lamp0", lamp())
    assert text == ("lamp0 polygon lamp0_shape\n0\n0\n12 0.7 2.15 2.5\n1.3 2.15 2.5\n1.3 1.85 2.5\n0.7 1.85 2.5\n")


@pytest.mark.parametrize(
    ("shape", "size", "place", "distance"),
    [
        ("strip", (9.0, 0.3), (5.4, 2.1, 2.5), 0.0),  # in its opening, near an end
        ("strip", (9.0, 0.3), (5.8, 2.0, 2.1), 0.5),  # 0.3 m beyond the end, 0.4 m below
        ("strip", (9.0, 0.3), (1.0, 2.0, 0.7), 1.8),  # a desk under its middle
        ("disc", (0.2,), (1.4, 2.0, 2.1), 0.5),
        ("bulb", (0.2,), (1.0, 2.0, 2.0), 0.4),
        ("bulb", (0.2,), (1.0, 2.05, 2.5), 0.0),
    ],
)
def test_distance_from_a_lamp_is_that_from_the_surface_that_shines(shape, size, place, distance: float) -> None:
    assert lamp(shape, size).distance(np.array([place])) == pytest.approx([distance])


def test_a_lamp_that_is_turned_is_as_near_as_it_reaches_there() -> None:
    turned = lamp("strip", (2.0, 0.2), rotation_deg=90.0)
    places = np.array([[1.0, 2.9, 2.5], [1.9, 2.0, 2.5]])
    assert turned.distance(places) == pytest.approx([0.0, 0.8])
