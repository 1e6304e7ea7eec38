"""Lamps reflected in panes of glass and in mirrors, and seen through glass, against closed forms.

A sensor gets from a flat mirror what a lamp of its reflectance would send from behind it; from a pane of glass the
share that Fresnel's equations give for the angle, of both surfaces together.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.scan import bare_scan
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.panes import find_panes
from lidarspectra.radiance.scene.scene_record import load_scene

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)

INDEX = 1.52
WITHIN = 0.01  # [1] what is promised
CLEAR = 0.9179  # [1] transmittance at normal incidence of glass that absorbs nothing
LAMP_M = 0.02  # [m] side: its middle stands for it within 1e-4
LAMP = np.array([0.8, 0.0, 1.2])
PLACES = np.array([[0.8, 0.3, 0.0], [0.2, 0.0, 0.0], [1.5, 0.5, 0.3], [0.5, 0.0, 0.0], [0.7, -0.6, 0.2]])
NORMALS = np.array([[0, 0, 1], [0, 0, 1], [-0.8, 0, 0.6], [-1, 0, 0], [-0.6, 0, 0.8]])


def pane(x: float = 0.0, half: float = 3.0) -> trimesh.Trimesh:
    """A square across the x axis, of eight triangles."""
    mesh = trimesh.Trimesh(
        vertices=[[x, y, z] for y in (-half, 0, half) for z in (-half, 0, half)],
        faces=[[3 * i + j, 3 * i + j + 4, 3 * i + j + 3] for i in (0, 1) for j in (0, 1)]
        + [[3 * i + j, 3 * i + j + 1, 3 * i + j + 4] for i in (0, 1) for j in (0, 1)],
    )
    return mesh


def fresnel(cosine, inner: float = 1.0):
    """Reflected and transmitted share of a pane, by summing what goes to and fro in it; `inner` of each passage."""
    sine = np.sqrt(1.0 - cosine**2) / INDEX
    within = np.sqrt(1.0 - sine**2)
    absorbed = inner ** (1.0 / within)
    back, through = np.zeros_like(cosine), np.zeros_like(cosine)
    for one in (
        ((cosine - INDEX * within) / (cosine + INDEX * within)) ** 2,
        ((INDEX * cosine - within) / (INDEX * cosine + within)) ** 2,
    ):
        back = back + 0.5 * one
        light = (1.0 - one) * absorbed
        for turn in range(40):
            if turn % 2 == 0:
                through = through + 0.5 * light * (1.0 - one)
            else:
                back = back + 0.5 * light * (1.0 - one)
            light = light * one * absorbed
    return back, through


def from_lamp(lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficient [m⁻²] of a small level panel at `lamp` at the places, and cosine of the way to the x axis."""
    away = lamp - PLACES
    distance = np.linalg.norm(away, axis=1)
    unit = away / distance[:, None]
    sensor = np.maximum(np.einsum("ij,ij->i", unit, NORMALS), 0.0)
    return sensor * np.maximum(unit[:, 2], 0.0) / (np.pi * distance**2), np.abs(unit[:, 0])


@BY_ITS_ERROR
@pytest.mark.parametrize("transmittance", [CLEAR, 0.5])
def test_a_lamp_is_seen_reflected_in_a_pane_of_glass(rooms, sensors, section, check, transmittance: float) -> None:
    glass = rooms.wall(0.08, kind="glass", transmittance=transmittance)
    scene = rooms.scene([rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(pane(), glass)])
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    inner = {CLEAR: 1.0, 0.5: 0.5463}[transmittance]  # with both surfaces' reflections it lets .5 through
    direct, _ = from_lamp(LAMP)
    image, cosine = from_lamp(LAMP * [-1, 1, 1])
    expected = direct + image * fresnel(cosine, inner)[0]
    assert np.max(expected / np.maximum(direct, 1e-30)) > 1.5  # there is something to see
    check(transport, expected[:, None], shape=2e-3)


@BY_ITS_ERROR
def test_plain_rtrace_sees_a_lamp_reflected_in_a_pane_of_glass(rooms, sensors, check) -> None:
    glass = rooms.wall(0.08, kind="glass", transmittance=CLEAR)
    scene = rooms.scene([rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(pane(), glass)])
    transport = trace_plain(scene, sensors(PLACES, NORMALS), accuracy="low", noise="standard", workers=2)
    image, cosine = from_lamp(LAMP * [-1, 1, 1])
    check(transport, (from_lamp(LAMP)[0] + image * fresnel(cosine)[0])[:, None], shape=2e-3)


@BY_ITS_ERROR
def test_plain_rtrace_has_the_light_that_panes_of_glass_send_to_walls(rooms, sensors) -> None:
    # A lamp close to a glass wall sends a tenth of its light, and more at a slant, back into a bright room.
    glass = rooms.wall(0.08, kind="glass", transmittance=CLEAR)
    wall = pane(0.0, half=1.0)
    wall.apply_translation([0.02, 1.0, 1.0])
    lamp = rooms.lamp("panel", [0.4, 1.0, 1.2], (0.3, 0.3), normal=(-0.8, 0.0, 0.6))
    scene = rooms.scene([lamp], [(wall, glass), (rooms.room(2.0), 0.6)])
    points = sensors([[x, y, 0.5] for x in (0.9, 1.4, 1.8) for y in (0.3, 1.0, 1.7)], [0, 0, 1])
    options = {"accuracy": "medium", "noise": "standard", "workers": 2}
    without = replace(scene, passes=tuple(replace(each, has_glass=False) for each in scene.passes))
    split = trace(scene, points, **options, seed=1)
    mean = float(split["coefficient"].mean())
    apart = {}
    for name, plain in (
        ("with", trace_plain(scene, points, **options)),
        ("without", trace_plain(without, points, **options)),
    ):
        error = np.hypot(plain["irradiance_se"], split["irradiance_se"]).to_numpy() / mean
        assert error.max() < 0.06  # else the next would hold of anything
        apart[name] = ((plain["coefficient"] - split["coefficient"]).sum("lamp") / mean).to_numpy()
        assert name == "without" or np.all(np.abs(apart[name]) <= 8.0 * error + 2e-3), apart[name] / error
    assert abs(apart["with"].mean()) < 0.03 < -apart["without"].mean()  # of the whole room's light


@BY_ITS_ERROR
def test_a_lamp_is_seen_through_a_pane_of_glass(rooms, sensors, section, check) -> None:
    glass = rooms.wall(0.08, kind="glass", transmittance=CLEAR)
    behind = LAMP * [-1, 1, 1]
    scene = rooms.scene([rooms.lamp("panel", behind, (LAMP_M, LAMP_M))], [(pane(), glass)])
    image, cosine = from_lamp(behind)
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    check(transport, (image * fresnel(cosine)[1])[:, None], shape=2e-3)


@BY_ITS_ERROR
def test_a_lamp_is_seen_in_a_mirror(rooms, sensors, section, check) -> None:
    mirror = rooms.wall(0.9, kind="mirror")
    scene = rooms.scene([rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(pane(), mirror)])
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    check(transport, (from_lamp(LAMP)[0] + 0.9 * from_lamp(LAMP * [-1, 1, 1])[0])[:, None], shape=2e-3)


@BY_ITS_ERROR
def test_lamps_between_two_mirrors_have_images_without_end(rooms, sensors, section, check) -> None:
    # Mirrors at 0 and 2 m: images at ±x + 4k, each reflected as often as there are mirrors between it and the lamp.
    mirror = rooms.wall(0.8, kind="mirror")
    scene = rooms.scene([rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(pane(), mirror), (pane(2.0), mirror)])
    expected = from_lamp(LAMP)[0]
    for times in range(1, 40):
        for first in (0, 1):  # the mirror that the light meets last
            x, wall = LAMP[0], first if times % 2 else 1 - first  # seen from the lamp: the first one that it meets
            for _ in range(times):
                x, wall = (-x if wall == 0 else 4.0 - x), 1 - wall
            expected = expected + 0.8**times * from_lamp(np.array([x, *LAMP[1:]]))[0]
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    check(transport, expected[:, None], shape=WITHIN)  # what is left after eight reflections is below .1 %


def test_panes_of_one_plane_are_one_with_holes_and_noise(rooms) -> None:
    generator = np.random.default_rng(1)
    ticks = np.linspace(0.0, 2.0, 21)
    y, z = np.meshgrid(ticks, ticks, indexing="ij")
    number = np.arange(y.size).reshape(y.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]))
    middle = np.stack([y[:-1, :-1].ravel(), z[:-1, :-1].ravel()], axis=1) + 0.05
    solid = ~((middle > 0.8) & (middle < 1.2)).all(axis=1) & ~((middle[:, 0] > 1.6) & (middle[:, 0] < 1.7))
    faces = np.concatenate([np.stack([a, b, d], axis=1)[solid], np.stack([a, d, c], axis=1)[solid]])
    off = generator.normal(0.0, 0.004, y.size)
    scan = bare_scan(np.stack([off, y.ravel(), z.ravel()], axis=1), faces)
    glass = MaterialMap(
        materials=(rooms.wall(0.08, kind="glass", transmittance=0.8),),
        face_material=np.zeros(len(faces), dtype=np.int64),
        face_color=np.full((len(faces), 3), 0.5),
        face_seen=np.ones(len(faces)),
    )
    found = find_panes(scan, glass)
    (only,) = found.panes
    assert not found.left_out_m2
    assert abs(only.normal[0]) > 0.9999
    # Radiance counts crossings of the outline, whose seams are run along twice: its area is that of the two pieces.
    flat = only.outline[:, 1:]
    area = 0.5 * np.sum(flat[:, 0] * np.roll(flat[:, 1], -1) - flat[:, 1] * np.roll(flat[:, 0], -1))
    assert abs(area) == pytest.approx(4.0 - 0.16 - 0.2, abs=0.01)
    ahead = (only.sides()[0] - only.center) @ only.normal
    assert ahead.min() > ((scan.vertices - only.center) @ only.normal)[np.unique(faces)].max()


def test_curved_glass_is_left_out_and_its_area_said(rooms) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    scene = rooms.scene(
        [rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(ball, rooms.wall(0.08, kind="glass", transmittance=0.8))]
    )
    assert scene.left_out_m2["glass"] == pytest.approx(ball.area, rel=1e-6)
    assert not scene.passes[0].has_glass
    assert load_scene(scene.folder).left_out_m2 == scene.left_out_m2
