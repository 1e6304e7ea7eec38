"""What an obstacle does to sensors' light: closed forms, and the difference of two whole traces."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import SensorError
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.engine.options import BOUNCES
from lidarspectra.radiance.obstacles.obstacle_effect import EffectRequest, ObstacleEffect, trace_effects
from lidarspectra.radiance.obstacles.obstacles import Obstacle
from lidarspectra.radiance.sampling.receptors import cone_receptor, cosine_receptor
from lidarspectra.radiance.sampling.trace import trace_irradiance
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)

RAMP = Spectrum(wavelengths_nm=np.array([380.0, 480.0, 620.0, 780.0]), values=np.array([0.2, 0.2, 0.75, 0.75]))


def grey(value: float) -> Spectrum:
    return Spectrum(wavelengths_nm=np.array([380.0, 780.0]), values=np.full(2, value))


CLOTH = Material(
    name="cloth",
    category="fabric",
    reflectance=grey(0.5),
    source="test",
    provenance="assigned",
    confidence=1.0,
    measured_range_nm=(380.0, 780.0),
    color=(0.5, 0.5, 0.5),
)


def obstacle(mesh: trimesh.Trimesh, reflectance: Spectrum) -> Obstacle:
    return Obstacle(
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=np.zeros(len(mesh.faces)),
        materials=(replace(CLOTH, reflectance=reflectance),),
    )


def box(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


@pytest.fixture
def effects(tmp_path: Path) -> Callable[..., list[ObstacleEffect]]:
    """Effects of obstacles with fixed numbers of walks."""

    def make(
        scene: RadianceScene,
        lamps: Sequence[Lamp],
        points: SensorPoints,
        obstacles: Sequence[Obstacle],
        accuracy: str = "low",
        **more: object,
    ) -> list[ObstacleEffect]:
        request = EffectRequest(
            bounces=BOUNCES[accuracy], walks=377, looks=8, receptor=cosine_receptor(), engine=find_engine(), workers=2
        )
        return list(trace_effects(scene, lamps, points, obstacles, replace(request, **more), tmp_path / "work", seed=5))

    return make


def irradiance(
    scene: RadianceScene, points: SensorPoints, accuracy: str, error: float
) -> tuple[np.ndarray, np.ndarray]:
    return trace_irradiance(
        scene, points.positions, points.normals, relative_se=error, accuracy=accuracy, seed=4, workers=2
    )


@BY_ITS_ERROR
def test_a_black_board_that_hides_half_of_a_panel_takes_half_of_its_light(rooms, sensors, effects) -> None:
    lamps = [rooms.lamp("panel", (1.0, 1.0, 1.9), (0.4, 0.4))]
    scene = rooms.scene(lamps, [(rooms.room(2.0), 0.0)])
    points = sensors([[1.0, 1.0, 0.3]], [0.0, 0.0, 1.0])
    empty, _ = irradiance(scene, points, "low", 0.005)
    board = obstacle(box((1.0, 0.5, 1.85), (1.5, 1.5, 1.86)), grey(0.0))
    (found,) = effects(scene, lamps, points, [board])
    # The edge is straight above the sensor. Looks at the panel: 8 x 8 at each of its 64 parts, so 1 % at the edge.
    np.testing.assert_allclose(found.effect, -0.5 * empty, rtol=0.03)


@BY_ITS_ERROR
def test_a_white_board_sends_what_configuration_factors_say(rooms, sensors, effects) -> None:
    size, height, albedo = 0.5, 1.0, 0.8
    lamps = [rooms.lamp("panel", (2.0, 2.0, 0.05), (0.05, 0.05), normal=(0.0, 0.0, 1.0))]
    scene = rooms.scene(lamps, [(rooms.room(4.0), 0.0)])
    points = sensors([[2.0, 2.0, 2.0 - height]], [0.0, 0.0, 1.0])  # looks away from the lamp
    low, high = (2 - size / 2, 2 - size / 2, 2.0), (2 + size / 2, 2 + size / 2, 2.05)
    (found,) = effects(scene, lamps, points, [obstacle(box(low, high), grey(albedo))], walks=2584)
    # The lamp of 1 W/nm sends 1/π along its axis; over the board that falls by cos⁴ (5 % at its corners).
    ticks = (np.arange(40) + 0.5) / 40 * size - size / 2
    x, y = np.meshgrid(ticks, ticks)
    lamp_m, sensor_m = 1.95, height
    lit = lamp_m**2 / (x**2 + y**2 + lamp_m**2) ** 2 / np.pi
    seen = sensor_m**2 / (x**2 + y**2 + sensor_m**2) ** 2
    expected = albedo / np.pi * (lit * seen).sum() * (size / 40) ** 2
    assert np.all(np.abs(found.effect - expected) <= 8.0 * found.effect_se + 2e-3 * expected)
    assert np.all(found.effect_se <= 0.02 * expected)


@pytest.fixture
def office(rooms) -> tuple[RadianceScene, list[Lamp], Callable[..., RadianceScene]]:
    """A room with a table under two unlike lamps, and a way to build it with more in it."""
    table = box((0.3, 0.4, 0.7), (1.5, 1.1, 0.74))
    lamps = [
        rooms.lamp("panel", (0.8, 1.5, 2.9), (0.6, 0.6), name="one"),
        rooms.lamp("panel", (2.2, 1.5, 2.9), (0.6, 0.3), name="two", flux=RAMP),
    ]

    def make(*more: object, walls: Spectrum = RAMP) -> RadianceScene:
        return rooms.scene(lamps, [(rooms.room(3.0), walls), (table, 0.5), *more])

    return make(), lamps, make


@BY_ITS_ERROR
@pytest.mark.parametrize(
    ("accuracy", "walls"), [("low", grey(0.9)), pytest.param("high", RAMP, marks=pytest.mark.slow)]
)
def test_the_difference_is_that_of_two_whole_traces(office, sensors, effects, accuracy: str, walls: Spectrum) -> None:
    _, lamps, make = office
    scene = make(walls=walls)  # bright ones, where the reflections that no longer count would show
    points = sensors(
        [[0.02, 1.5, 1.5], [1.5, 0.02, 2.0], [2.98, 2.0, 1.0], [1.5, 1.5, 2.8], [2.5, 2.5, 0.02], [0.4, 1.9, 0.02]],
        [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, -1], [0, 0, 1], [0, 0, 1]],
    )
    block = box((1.0, 1.2, 0.1), (2.0, 2.0, 1.7))
    wearing = Spectrum(wavelengths_nm=np.array([380.0, 780.0]), values=np.array([0.1, 0.95]))
    (found,) = effects(scene, lamps, points, [obstacle(block, wearing)], accuracy, walks=1597)
    empty, empty_se = irradiance(scene, points, accuracy, 0.003)
    full, full_se = irradiance(make((block, wearing), walls=walls), points, accuracy, 0.003)
    error = np.sqrt(found.effect_se**2 + empty_se**2 + full_se**2)
    difference = found.effect - (full - empty)
    # Eight of the combined error, as in `check`: chance passes it less than once in a million runs.
    assert np.all(np.abs(difference) <= 8.0 * error), difference / error
    assert np.abs(found.effect / empty).max() > 0.2  # there is something to see,
    assert np.sqrt(np.mean((found.effect_se / empty) ** 2)) < 0.006  # and it is seen
    # A bias shows in the mean over sensors and bands, whose error is no larger than that of one.
    assert abs(np.mean(difference / empty)) <= 8.0 * 0.0015, difference / empty


@BY_ITS_ERROR
@pytest.mark.slow
def test_gloss_and_glass_are_no_exception(rooms, sensors, effects, tmp_path: Path) -> None:
    lamps = [rooms.lamp("panel", (0.8, 1.5, 2.9), (0.6, 0.6))]
    room = rooms.room(3.0)
    block = box((1.0, 1.2, 0.1), (2.0, 2.0, 1.7))
    parts = [
        (room, replace(CLOTH, reflectance=grey(0.7), specularity=0.15, roughness=0.1)),
        (box((0.3, 1.0, 1.5), (1.2, 1.01, 2.8)), replace(CLOTH, kind="glass", transmittance=0.85)),
        (box((2.2, 2.2, 0.0), (2.8, 2.8, 1.0)), replace(CLOTH, kind="metal", specularity=0.8, roughness=0.1)),
        (block, CLOTH),
    ]

    def scene(count: int) -> RadianceScene:
        mesh = trimesh.util.concatenate([part for part, _ in parts[:count]])
        assert isinstance(mesh, trimesh.Trimesh)
        faces = np.concatenate([np.full(len(part.faces), index) for index, (part, _) in enumerate(parts[:count])])
        materials = MaterialMap(
            materials=tuple(material for _, material in parts[:count]),
            face_material=faces,
            face_color=np.full((len(faces), 3), 0.5),
            face_seen=np.ones(len(faces)),
        )
        scan = bare_scan(mesh.vertices, mesh.faces)
        return write_scene(scan, materials, lamps, rooms.bands, tmp_path / f"{count}", crease_deg=0.0)

    points = sensors([[0.02, 1.5, 1.5], [1.5, 0.02, 2.0], [2.5, 0.5, 0.02]], [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    (found,) = effects(scene(3), lamps, points, [obstacle(block, CLOTH.reflectance)], "medium", walks=1597)
    empty, empty_se = irradiance(scene(3), points, "medium", 0.005)
    full, full_se = irradiance(scene(4), points, "medium", 0.005)
    error = np.sqrt(found.effect_se**2 + empty_se**2 + full_se**2)
    assert np.all(np.abs(found.effect - (full - empty)) <= 8.0 * error)
    assert np.all(error < 0.02 * empty)
    assert np.all(found.effect < -0.05 * empty)


@BY_ITS_ERROR
def test_a_narrow_view_that_sees_lamps_and_walls_loses_what_an_obstacle_hides(office, sensors, effects) -> None:
    scene, lamps, _ = office
    points = sensors([[0.8, 1.5, 0.02]], [[0.0, 0.0, 1.0]])
    receptor = cone_receptor(15.0)
    board = obstacle(box((0.3, 1.0, 1.0), (1.3, 2.0, 1.02)), grey(0.0))
    (found,) = effects(scene, lamps, points, [board], "high", receptor=receptor)
    empty, empty_se = trace_irradiance(
        scene, points.positions, points.normals, relative_se=0.01, accuracy="high", receptor=receptor, workers=2
    )
    left = empty + found.effect  # the board fills the view and is black
    error = np.sqrt(found.effect_se**2 + empty_se**2)
    assert np.all(np.abs(left) <= 8.0 * error), left / error
    assert np.all(error < 0.05 * empty)


@BY_ITS_ERROR
def test_a_black_box_around_a_sensor_takes_all_its_light_and_no_more(office, sensors, effects) -> None:
    scene, lamps, _ = office
    points = sensors([[1.5, 1.5, 1.0]], [[0.0, 0.0, 1.0]])
    walls = box((0.8, 0.8, 0.8), (2.2, 2.2, 2.2)), box((0.85, 0.85, 0.85), (2.15, 2.15, 2.15))
    walls[1].invert()  # the hollow: walks cross its walls again and again, and count once
    (found,) = effects(scene, lamps, points, [obstacle(trimesh.util.concatenate(walls), grey(0.0))], walks=1597)
    empty, empty_se = irradiance(scene, points, "low", 0.005)
    error = np.sqrt(found.effect_se**2 + empty_se**2)
    assert np.all(np.abs(empty + found.effect) <= 8.0 * error), (empty + found.effect) / error
    assert np.all(error < 0.015 * empty)


def test_an_obstacle_out_of_reach_of_all_light_changes_nothing_at_all(rooms, sensors, effects) -> None:
    lamps = [rooms.lamp("panel", (1.0, 1.0, 1.9), (0.4, 0.4))]
    cover = box((0.2, 0.2, 0.2), (1.8, 1.8, 0.25))
    scene = rooms.scene(lamps, [(rooms.room(2.0), 0.0), (cover, 0.5)])
    points = sensors([[1.0, 1.0, 1.0]], [0.0, 0.0, 1.0])
    (found,) = effects(scene, lamps, points, [obstacle(box((0.8, 0.8, 0.05), (1.2, 1.2, 0.15)), grey(0.5))])
    assert np.all(found.effect == 0.0)


@BY_ITS_ERROR
def test_obstacles_do_not_know_of_one_another(office, sensors, effects) -> None:
    scene, lamps, _ = office
    points = sensors([[1.5, 1.5, 2.8]], [[0.0, 0.0, -1.0]])
    near, far = (
        obstacle(box((1.3, 1.3, 1.5), (1.7, 1.7, 2.0)), grey(0.0)),
        obstacle(box((0, 0, 0), (0.1, 0.1, 0.1)), RAMP),
    )
    both = effects(scene, lamps, points, [near, far])
    (alone,) = effects(scene, lamps, points, [near])
    error = np.sqrt(both[0].effect_se ** 2 + alone.effect_se**2)
    assert [each.number for each in both] == [0, 1]
    assert np.all(np.abs(both[0].effect - alone.effect) <= 8.0 * error)
    assert np.all(np.abs(both[1].effect) < 0.1 * np.abs(both[0].effect))


def test_a_sensor_inside_of_an_obstacle_is_refused(office, sensors, effects) -> None:
    scene, lamps, _ = office
    points = sensors([[1.5, 1.5, 1.0]], [[0.0, 0.0, 1.0]])
    with pytest.raises(SensorError, match="sensor 1 inside"):
        effects(scene, lamps, points, [obstacle(box((1, 1, 0.5), (2, 2, 1.5)), RAMP)])
