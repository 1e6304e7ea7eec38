"""Daylight of the virtual rooms, against an integral by quadrature and the closed form of a closed room."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import dblquad

from lidarspectra.arrays import FloatArray
from research.virtual_rooms.day_light import (
    Opening,
    Sun,
    flux_per_zenith,
    reflected_light,
    relative_radiance,
    straight_light,
    sunlight,
)
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

LENGTH_M, WIDTH_M, HEIGHT_M = 3.0, 2.4, 2.5
SILL_M, HEAD_M, LEFT_M, RIGHT_M = 0.9, 2.0, 0.7, 1.7
RADIANCE = 5.0  # [W/m²/sr/nm] of the zenith


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory, plan_file: Path) -> TrueRoom:
    """A room with nothing in it but a screen on the floor."""
    head, parts = plan_file.read_text(encoding="utf-8").split("[[parts]]", maxsplit=1)
    kept = parts[parts.index("[[lamps]]") :]
    screen = (
        '[[parts]]\nname = "screen"\nshape = "box"\nlow = [1.0, 0.4, -0.1]\nhigh = [1.1, 2.0, 2.3]\nmaterial = "red"\n'
    )
    text = (head + screen + kept).replace("1.6, 1.2, 1.4", f"{LENGTH_M}, {WIDTH_M}, {HEIGHT_M}")
    path = tmp_path_factory.mktemp("empty") / "plan.toml"
    (path.parent / "reflectances.csv").write_bytes((plan_file.parent / "reflectances.csv").read_bytes())
    path.write_text(text, encoding="utf-8")
    return true_room(read_plan(path))


@pytest.fixture(scope="module")
def window() -> Opening:
    """In the wall at x = 0."""
    return Opening(
        corner=np.array([0.0, LEFT_M, SILL_M]),
        along=np.array([0.0, RIGHT_M - LEFT_M, 0.0]),
        up=np.array([0.0, 0.0, HEAD_M - SILL_M]),
        normal=np.array([1.0, 0.0, 0.0]),
        radiance=np.array([RADIANCE, 2 * RADIANCE]),
    )


def by_quadrature(at: FloatArray, normal: FloatArray) -> float:
    """Irradiance at a point that sees the whole window."""

    def light(z: float, y: float) -> float:
        way = np.array([0.0, y, z]) - at
        distance = np.linalg.norm(way)
        toward = way / distance
        return float(
            RADIANCE * relative_radiance(toward[2]) * max(toward @ normal, 0.0) * max(-toward[0], 0.0) / distance**2
        )

    return float(dblquad(light, LEFT_M, RIGHT_M, SILL_M, HEAD_M)[0])


@pytest.mark.parametrize(
    ("at", "normal"),
    [
        ((0.7, 1.2, 0.0), (0.0, 0.0, 1.0)),  # floor: sky alone
        ((0.6, 0.9, 2.5), (0.0, 0.0, -1.0)),  # ceiling: ground alone
        ((0.8, 0.0, 1.3), (0.0, 1.0, 0.0)),  # a wall beside it: both
    ],
)
def test_straight_light_is_the_integral_over_the_window(
    empty: TrueRoom, window: Opening, at: tuple[float, ...], normal: tuple[float, ...]
) -> None:
    light = straight_light(empty, [window], np.array([at]), np.array([normal]))[0]
    assert light[0] == pytest.approx(by_quadrature(np.array(at), np.array(normal)), rel=0.03)  # a row is sky or ground
    assert light[1] == pytest.approx(2 * light[0])


def test_behind_a_screen_there_is_none_straight(empty: TrueRoom, window: Opening) -> None:
    behind, beside = np.array([[1.2, 1.2, 0.3], [0.9, 1.2, 0.3]])
    light = straight_light(empty, [window], np.array([behind, beside]), np.array([[0.0, 0, 1.0]] * 2))
    assert light[0] == pytest.approx(0.0)
    assert (light[1] > 0).all()


def test_the_flux_of_a_window_is_what_falls_on_a_sheet_before_it(window: Opening) -> None:
    """Sky and ground, by quadrature over the half of all directions that the window faces."""

    def sent(sine: float, azimuth: float) -> float:
        cosine = np.sqrt(1 - sine**2) * np.cos(azimuth)
        return float(relative_radiance(np.array(sine)) * cosine)

    hemisphere = sum(dblquad(sent, -np.pi / 2, np.pi / 2, *ends)[0] for ends in ((-1.0, 0.0), (0.0, 1.0)))
    assert flux_per_zenith(window) == pytest.approx(window.area * hemisphere, rel=0.02)


def test_an_evenly_bright_window_is_a_lambertian_sheet(empty: TrueRoom, window: Opening) -> None:
    """E = π L times its form factor, here small: A cos cos / distance²."""
    far = np.array([[0.9, 1.2, 0.1]])
    even = replace(window, even=True)
    middle = np.array([0.0, 0.5 * (LEFT_M + RIGHT_M), 0.5 * (SILL_M + HEAD_M)])
    way = middle - far[0]
    distance = np.linalg.norm(way)
    expected = RADIANCE * window.area * (way[2] / distance) * (-way[0] / distance) / distance**2
    light = straight_light(empty, [even], far, np.array([[0.0, 0.0, 1.0]]))
    assert light[0, 0] == pytest.approx(expected, rel=0.12)  # the window is as wide as it is far


def test_the_sun_lights_the_floor_as_far_as_its_height_says(empty: TrueRoom) -> None:
    """Through the whole wall at x = 0: as far as that wall's head throws its shadow, with E sin h."""
    height = np.radians(50.0)
    sun = Sun(toward=np.array([-np.cos(height), 0.0, np.sin(height)]), irradiance=np.array([100.0, 50.0]))
    window = (empty.scan.centers[:, 0] < 1e-6) & (empty.normals[:, 0] > 0.9)
    x = np.array([0.2, 0.6, 0.9, 2.5, 2.9])
    positions = np.column_stack([x, np.full(5, 2.2), np.zeros(5)])
    light = sunlight(empty, sun, window, positions, np.tile([0.0, 0.0, 1.0], (5, 1)))
    lit = x * np.tan(height) < HEIGHT_M
    assert light[:, 0] == pytest.approx(np.where(lit, 100.0 * np.sin(height), 0.0))
    assert light[:, 1] == pytest.approx(0.5 * light[:, 0])
    away = sunlight(empty, sun, window, positions, np.tile([1.0, 0.0, 0.0], (5, 1)))
    assert not away.any()


@pytest.mark.parametrize("reflectance", [0.3, 0.8])
def test_reflected_light_in_an_evenly_lit_room_is_the_closed_form(empty: TrueRoom, reflectance: float) -> None:
    """E_reflected = E ρ/(1 - ρ) where every surface has the same reflectance and the same direct light E."""
    rng = np.random.default_rng(3)
    positions, faces = empty.sample(0.2, rng)
    direct = np.full((len(positions), 1), 7.0)
    light = reflected_light(empty, positions, empty.normals[faces], np.full_like(direct, reflectance), direct, rng)
    assert light == pytest.approx(np.full_like(direct, 7.0 * reflectance / (1 - reflectance)), rel=0.01)
