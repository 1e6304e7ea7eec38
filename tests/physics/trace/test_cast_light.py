"""Ray casting against the engine: every lamp's light, straight and reflected, where each could differ."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.radiance.engine.options import BOUNCES
from lidarspectra.radiance.sampling.arrivals import Surfaces, load_surfaces
from lidarspectra.radiance.sampling.cast_light import SHARED_RAYS, CastLight
from lidarspectra.radiance.sampling.receptors import cosine_receptor
from lidarspectra.radiance.sampling.sensor_rays import Sensors
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import load_scene

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)
ASYMMETRIC = """IESNA:LM-63-2002
TILT=NONE
1 1000 1 5 5 1 2 0.3 0.2 0
1 1 20
0 45 90 135 180
0 90 180 270 360
400 300 100 60 20
400 150 30 10 20
400 80 10 5 20
400 200 60 30 20
400 300 100 60 20
"""
FROM_THE_ENGINE = 0.008  # [1] by which the mean of a lamp's map may differ: some five standard errors of both


def furnished(rooms):
    """Four kinds of lamps in a room with a table, one of them before another."""
    lamps = [
        rooms.lamp("panel", (1.0, 1.5, 2.9), (0.9, 0.3), name="panel"),
        rooms.lamp("disc", (1.0, 1.5, 2.4), 0.4, name="disc before it"),
        rooms.lamp("bulb", (2.3, 1.0, 2.0), 0.25, name="bulb"),
        rooms.lamp("spot", (2.2, 2.3, 2.8), 0.1, name="spot", beam_angle_deg=40.0, normal=(0.0, -0.6, -0.8)),
        rooms.lamp("ies", (0.5, 2.4, 2.2), (0.3, 0.2), name="both ways", candela_text=ASYMMETRIC, rotation_deg=30.0),
    ]
    table = trimesh.creation.box(bounds=[[0.6, 0.8, 0.7], [1.9, 1.6, 0.74]])
    floor = trimesh.creation.box(bounds=[[0.0, 0.0, -0.1], [3.0, 3.0, 0.01]])
    return lamps, [(rooms.room(3.0), 0.6), (table, 0.3), (floor, rooms.wall(0.4, specularity=0.08, roughness=0.1))]


@pytest.fixture
def points(sensors):
    """On the table and under it, facing all ways."""
    x, y = np.meshgrid([0.4, 1.2, 2.0, 2.7], [0.5, 1.2, 2.0, 2.6])
    places = np.stack([x.ravel(), y.ravel(), np.tile([0.4, 1.1], 8)], axis=1)
    turn = np.linspace(0.0, 2 * np.pi, len(places))
    normals = np.stack([np.cos(turn), np.sin(turn), np.where(np.arange(len(places)) % 3, 1.0, -1.0)], axis=1)
    return sensors(places, normals / np.linalg.norm(normals, axis=1, keepdims=True))


@BY_ITS_ERROR
@pytest.mark.slow  # a room traced twice by each way, for the means of five lamps
def test_every_lamp_sends_what_the_engine_finds(rooms, points, section) -> None:
    lamps, surfaces = furnished(rooms)
    scene = rooms.scene(lamps, surfaces)
    assert {each.lamp for each in scene.shining} == set(range(len(lamps)))
    assert len(load_scene(scene.folder).shining) == 6  # the luminaire has two faces
    ways = {"cast": load_scene(scene.folder), "engine": replace(scene, shining=())}
    light, error = {}, {}
    for name, tried in ways.items():
        runs = [trace(tried, points, **section("medium", "fine"), seed=seed) for seed in (1, 2)]
        light[name] = np.mean([run["coefficient"].to_numpy() for run in runs], axis=0)[..., 0]  # (lamp, point)
        error[name] = np.sqrt(np.mean([run["coefficient_se"].to_numpy() ** 2 for run in runs], axis=0) / 2)[..., 0]
    off = light["cast"].mean(axis=1) / light["engine"].mean(axis=1) - 1.0
    assert np.abs(off).max() < FROM_THE_ENGINE, off
    both = np.hypot(error["cast"], error["engine"])
    within = np.abs(light["cast"] - light["engine"]) <= 2.5 * both + 1e-3 * light["engine"].mean(axis=1, keepdims=True)
    assert within.mean() > 0.9, within.mean(axis=1)


def test_a_lamp_in_the_way_shades_in_its_true_outline(rooms, sensors, section) -> None:
    # A disc right below a small panel hides it from below; past the corners of its enclosing square the light passes.
    lamps = [
        rooms.lamp("panel", (0, 0, 1.0), (0.02, 0.02), name="hidden"),
        rooms.lamp("disc", (0, 0, 0.5), 0.4, name="disc"),
    ]
    scene = rooms.scene(lamps)
    corner = 0.19  # of the square, beyond the circle
    points = sensors([[0.0, 0, 0], [2 * corner, 2 * corner, 0], [2 * 0.13, 2 * 0.13, 0]], [0.0, 0, 1])
    found = trace(scene, points, **section(), seed=1)["coefficient"].to_numpy()[0, :, 0]
    assert found[0] == 0.0
    assert found[2] == 0.0
    assert found[1] == pytest.approx(1.0 / (np.pi * (1 + 8 * corner**2) ** 2), rel=0.01)


def test_rays_pass_beside_a_disc_in_its_enclosing_square(rooms) -> None:
    scene = rooms.scene(
        [rooms.lamp("disc", (0, 0, 1.0), 0.4)], [(rooms.room(1.0).apply_translation([-0.5, -0.5, 0.3]), 0.5)]
    )
    (surfaces,) = load_surfaces(scene).values()
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    rays = np.hstack([[[0.19, 0.19, 0.5], [0.1, 0.1, 0.5]], up])
    hits = surfaces.arrivals(rays)
    assert hits.places[:, 2] == pytest.approx([1.3, 1.0], abs=1e-5)
    assert surfaces.are_dark(hits).tolist() == [False, True]


@pytest.mark.parametrize(("lamps", "rays"), [(2, 16), (24, 2)])
def test_all_lamps_together_are_sent_so_many_rays_in_however_many_passes(
    rooms, lamps: int, rays: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Four lamps make a pass; a sample of one pass alone would send 16 rays to each of its four, 384 to all 24.
    places = [(0.2 + 0.1 * number, 1.5, 2.9) for number in range(lamps)]
    scene = rooms.scene(
        [rooms.lamp("panel", place, (0.05, 0.05), name=f"{place[0]:.1f}") for place in places], [(rooms.room(3.0), 0.6)]
    )
    sent = []
    through = Surfaces.light_through

    def counted(self: Surfaces, origins: np.ndarray, ways: np.ndarray, *, to_lamp: int) -> np.ndarray:
        sent.append(len(origins))
        return through(self, origins, ways, to_lamp=to_lamp)

    monkeypatch.setattr(Surfaces, "light_through", counted)
    surfaces = load_surfaces(scene)
    sensor = Sensors(
        positions=np.array([[1.5, 1.5, 0.5]]), normals=np.array([[0.0, 0.0, 1.0]]), receptor=cosine_receptor()
    )
    for scene_pass in scene.passes:
        cast = CastLight.of(scene, scene_pass, surfaces)
        assert cast is not None
        found = cast.direct(sensor, np.array([0]), sets=1, size=1, generator=np.random.default_rng(1))
        assert (found > 0).all()
    assert sum(sent) == lamps * rays <= SHARED_RAYS


def test_scenes_of_before_are_left_to_the_engine(rooms, sensors, section) -> None:
    scene = replace(rooms.scene([rooms.lamp("panel", (0, 0, 1.0), (0.4, 0.4))]), shining=())
    commands = trace(scene, sensors([0, 0, 0], [0, 0, 1.0]), **section("low", "draft"), seed=1).attrs["commands"]
    assert "-I+" in commands
    cast = trace(load_scene(scene.folder), sensors([0, 0, 0], [0, 0, 1.0]), **section("low", "draft"), seed=1)
    assert not cast.attrs["commands"]  # there is nothing that reflects
    assert cast["coefficient"].to_numpy().min() > 0


@BY_ITS_ERROR
def test_lamps_of_one_pass_may_be_cast_and_left_to_the_engine(rooms, sensors, section) -> None:
    lamps = [rooms.lamp("panel", (x, 0.0, 1.0), (0.4, 0.4), name=f"lamp {x}") for x in (-0.5, 0.5)]
    whole = rooms.scene(lamps)
    scene = replace(whole, shining=tuple(each for each in whole.shining if each.lamp == 0))
    assert [each.lamps for each in scene.passes] == [(0, 1)]
    found = trace(scene, sensors([0, 0, 0], [0, 0, 1.0]), **section("low", "standard"), seed=1)
    assert "-I+" in found.attrs["commands"]
    cast, engine = found["coefficient"].to_numpy().mean(axis=(1, 2))
    assert cast == pytest.approx(engine, rel=0.02)  # alike by symmetry; two standard errors of the noise asked for


def test_in_a_matt_room_the_engine_is_asked_for_what_is_reflected_more_than_once_alone(rooms, sensors, section) -> None:
    # And for that in one way: a path that goes on from a surface has two reflections less than the light may have.
    scene = rooms.scene([rooms.lamp("panel", (0.5, 0.5, 0.9), (0.4, 0.4))], [(rooms.room(), 0.6)])
    points = sensors([[x, 0.5, 0.2] for x in (0.2, 0.4, 0.6, 0.8)], [0.0, 0, 1])
    (command,) = trace(scene, points, **section("medium", "draft"), seed=1).attrs["commands"].splitlines()
    assert f"-ab {BOUNCES['medium'] - 2} " in command
