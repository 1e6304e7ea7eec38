"""Patches: who may share paths on the surfaces of two rooms."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.radiance.sampling.arrivals import Arrivals, LampBodies, Scattering, Surfaces
from lidarspectra.radiance.sampling.patches import Patches, find_patches
from lidarspectra.radiance.sampling.receptors import cosine_receptor
from lidarspectra.radiance.sampling.sensor_rays import Sensors

WALL_M = 4.05  # [m] between two rooms of 4 m x 4 m: a single sheet at the middle of a cell, which it cuts in two
DOOR = (1.5, 2.5, 2.0)  # [m] from, to, height


def surfaces(*walls: tuple[float, float, float, float]) -> Surfaces:
    """A space of 8.1 m x 4 m x 2.7 m, with sheets (from y, to y, from z, to z) across it."""
    mesh = trimesh.creation.box(bounds=[[0, 0, 0], [8.1, 4, 2.7]])
    mesh.invert()
    sheets = [
        trimesh.Trimesh(
            [[WALL_M, y0, z0], [WALL_M, y1, z0], [WALL_M, y1, z1], [WALL_M, y0, z1]],
            [[0, 1, 2], [0, 2, 3]],
            process=False,
        )
        for y0, y1, z0, z1 in walls
    ]
    whole = trimesh.util.concatenate([mesh, *sheets])
    assert isinstance(whole, trimesh.Trimesh)
    scan = bare_scan(np.array(whole.vertices), np.array(whole.faces))
    return Surfaces(
        caster=RayCaster(scan),
        face_material=np.zeros(len(scan.faces), dtype=np.int64),
        scattering=Scattering(
            is_matt=np.array([True, True]),
            is_diffuse=np.array([True, False]),
            reflectance=np.array([[0.7], [0.0]]),
            diffuse_part=np.array([[0.7], [0.0]]),
            transmissivity=np.zeros(2),
        ),
        cell_m=0.75,
        diffuse_share=1.0,
        bounds=scan.bounds,
        shading_normals=np.repeat(scan.normals[:, None], 3, axis=1).astype(np.float32),
        face_body=np.empty(0, dtype=np.int64),
        bodies=LampBodies.of([], []),
    )


CLOSED = ((-0.01, 4.01, -0.01, 2.71),)
OPEN = ((-0.01, DOOR[0], -0.01, 2.71), (DOOR[1], 4.01, -0.01, 2.71), (DOOR[0], DOOR[1], DOOR[2], 2.71))


def sensors() -> Sensors:
    """Above the floors of both rooms, facing up and down in turn."""
    x, y = np.meshgrid(np.linspace(0.3, 7.8, 12), np.linspace(0.3, 3.7, 6))
    places = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.5)], axis=1)
    up = np.where(np.arange(len(places)) % 2, 1.0, -1.0)
    return Sensors(positions=places, normals=up[:, None] * np.array([[0.0, 0.0, 1.0]]), receptor=cosine_receptor())


def patches(space: Surfaces) -> Patches:
    return find_patches(space, sensors(), generator=np.random.default_rng(1))


def looks(space: Surfaces) -> Arrivals:
    given = sensors()
    count = np.arange(len(given.positions))
    return space.arrivals(given.draw_rays(count, sets=1, count=34, generator=np.random.default_rng(2)).reshape(-1, 6))


def lit(found: Patches, *, near: float, far: float) -> np.ndarray:
    """Groups where the room of x < WALL_M and the other get so much direct light everywhere."""
    level = [np.where(x < WALL_M, near, far)[None] for x in (found.positions[:, 0], sensors().positions[:, 0])]
    return found.groups(level[0], level[1][:, found.watchers], target=0.01)


def test_nobody_shares_across_a_closed_sheet_however_alike_its_sides_are_lit() -> None:
    space = surfaces(*CLOSED)
    found = patches(space)
    group = lit(found, near=1.0, far=1.0)
    beside = np.abs(found.positions[:, 0] - WALL_M) > 1e-3  # not on the sheet itself, whose sides differ by kind
    for number in np.unique(group[(group >= 0) & beside]):
        assert len(set(found.positions[(group == number) & beside, 0] < WALL_M)) == 1
    seen = looks(space)
    place = found.place_of(seen)
    held = (place >= 0) & (np.abs(seen.places[:, 0] - WALL_M) > 1e-3)
    assert np.mean(place >= 0) > 0.95
    assert np.array_equal(seen.places[held, 0] < WALL_M, found.positions[place[held], 0] < WALL_M)


@pytest.mark.parametrize("walls", [(), CLOSED])
def test_nearly_all_share_in_convex_rooms_that_are_lit_evenly(walls) -> None:
    space = surfaces(*walls)
    found = patches(space)
    place = found.place_of(looks(space))
    group = np.where(place >= 0, lit(found, near=1.0, far=1.0)[place], -1)
    assert np.mean(group >= 0) > 0.9


def test_in_a_dark_room_nobody_shares_the_floor_behind_the_door_and_most_share_where_the_door_is_out_of_sight() -> None:
    found = patches(surfaces(*OPEN))
    group = lit(found, near=1.0, far=0.0)
    x, y, z = found.positions.T
    behind = (z < 0.01) & (np.abs(x - WALL_M - 0.4) < 0.4) & (np.abs(y - 2.0) < 1.0)
    assert np.mean(group[behind] < 0) > 0.8
    bright = (z < 0.01) & (x < 3.0)
    assert np.mean(group[bright] < 0) < 0.2


def test_light_that_falls_evenly_along_a_hall_is_shared_and_the_more_the_more_noise_is_wanted() -> None:
    # Below a lamp at one end: from box to box the light of the rest of the hall falls by more than it may be missed by,
    # but along a slope that the functions of the rough light have.
    found = patches(surfaces())
    x, _, z = found.positions.T
    direct = np.where(z < 0.01, np.exp(-x / 0.5), 0.0)[None]
    looks_there = np.asarray(found.looks.sum(axis=0)).ravel()
    own = {}
    for target in (0.01, 0.03):
        group = found.groups(direct, np.zeros((1, len(found.watchers))), target=target)
        own[target] = float(looks_there[group < 0].sum() / looks_there.sum())
    assert own[0.01] < 0.07
    assert own[0.03] < 0.5 * own[0.01]


def test_groups_stay_within_a_cell() -> None:
    found = patches(surfaces())
    group = lit(found, near=1.0, far=1.0)
    for number in np.unique(group[group >= 0]):
        assert np.ptp(found.positions[group == number], axis=0).max() <= 0.75 + 1e-9


@pytest.mark.parametrize("walls", [(), CLOSED])
def test_rough_light_of_an_evenly_lit_enclosure_is_the_geometric_series(walls) -> None:
    # In an enclosure of one reflectance every reflection of light that is 1 everywhere is so much of the one before.
    room = surfaces(*walls)
    reflectance, diffuse = np.array([[0.7, 0.5, 0.2], [0.0] * 3]), np.array([[0.6, 0.3, 0.1], [0.0] * 3])
    painted = replace(room.scattering, reflectance=reflectance, diffuse_part=diffuse)
    found = patches(replace(room, scattering=painted))
    direct, bounces = np.array([2.0, 5.0]), 5
    rough = found.sent_on(found.reflected(np.broadcast_to(direct[:, None], (len(found), 2, 3)), bounces).whole)
    level, slopes = rough.functions[::4], rough.functions.reshape(len(found), 4, -1)[:, 1:]
    series = diffuse[0] * sum(reflectance[0] ** times for times in range(1, bounces)) / np.pi
    expected = np.outer(direct, series).ravel()  # lamp by lamp
    assert level == pytest.approx(np.broadcast_to(expected, level.shape), rel=1e-5)
    assert np.abs(slopes).max() < 1e-4


def test_rough_light_is_exactly_nothing_behind_a_closed_sheet() -> None:
    found = patches(surfaces(*CLOSED))
    x = found.positions[:, 0]
    lit = x < WALL_M - 1e-3
    rough = found.sent_on(found.reflected(lit[:, None, None].astype(float), 8).whole).functions.reshape(len(found), -1)
    assert np.all(rough[x > WALL_M + 1e-3] == 0.0)
    assert np.all(rough[lit, 0] > 0.0)


def test_sensors_that_were_not_asked_have_the_watcher_nearest_in_place_and_direction() -> None:
    """Of a pair at one place, one looks up and one to the side: each has its like as watcher."""
    x = np.repeat(np.linspace(0.5, 3.5, 4), 2)
    all_of_them = Sensors(
        positions=np.stack([x, np.full(8, 1.0), np.full(8, 0.5)], axis=1),
        normals=np.tile([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], (4, 1)),
        receptor=cosine_receptor(),
    )
    found = replace(patches(surfaces((0.0, 0.0, 4.0, 0.0))), watchers=np.array([0, 1, 6, 7]))
    # row of the watcher of sensors 0 to 7: the first pair's for the left half, the last one's for the right
    assert found.nearest_watcher(all_of_them).tolist() == [0, 1, 0, 1, 2, 3, 2, 3]
