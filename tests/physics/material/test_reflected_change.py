"""What light gains where a part reflects more: closed forms, and a room behind a wall."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import lidarspectra as ls
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.mapping.maps.reflected_change import Surfaces, reflectance_effects
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.room.light_samples import samples_of
from lidarspectra.room.surface_parts import surface_parts
from lidarspectra.workflow.calibration.unknowns_of_run import reflected_effects

from .lit_rooms import all_light, exchange, joined, lamp_light, plane

LENGTH_M, WIDTH_M, HEIGHT_M = 3.0, 2.4, 2.2
SAMPLES = 400


def closed_box(edge_m: float, *, middle: bool = False):
    """Six walls, each a part; with `middle` a closed wall between two halves, a part on each side."""
    x, y, z = np.diag([LENGTH_M, WIDTH_M, HEIGHT_M])
    zero = np.zeros(3)
    planes = [
        plane(zero, x, y, edge_m), plane(z, y, x, edge_m),
        plane(zero, y, z, edge_m), plane(x, z, y, edge_m), plane(y, x, z, edge_m), plane(zero, z, x, edge_m),
    ]  # fmt: skip
    if middle:
        planes += [plane(0.52 * x, y, z, edge_m), plane(0.48 * x, z, y, edge_m)]
    return joined([(0.5, each) for each in planes])


@pytest.mark.parametrize("reflectance", [0.3, 0.8])
def test_in_an_evenly_lit_closed_room_all_parts_together_give_the_closed_form(reflectance: float) -> None:
    """E = D/(1 - ρ), so dE/d ln ρ = D ρ/(1 - ρ)²."""
    scan, part, _ = closed_box(0.2)
    rng = np.random.default_rng(4)
    caster = RayCaster(scan)
    samples = samples_of(scan, caster, rng, count=SAMPLES)
    surfaces = Surfaces(part=part, material=part, reflectance=np.full((6, 1), reflectance), part_count=6)
    inside = np.array([[1.0, 1.0, 1.0], [2.5, 0.4, 0.3]])
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    found = reflectance_effects(caster, surfaces, samples, np.full((len(samples.face), 1), 2.0), inside, up, rng)
    np.testing.assert_allclose(found.sum(axis=0)[:, 0], 2.0 * reflectance / (1 - reflectance) ** 2, rtol=0.01)
    assert (found > 0).all()


def test_sensors_that_lie_on_a_surface_see_the_room_and_not_that_surface() -> None:
    scan, part, _ = closed_box(0.2)
    caster = RayCaster(scan)
    samples = samples_of(scan, caster, np.random.default_rng(4), count=SAMPLES)
    surfaces = Surfaces(part=part, material=part, reflectance=np.full((6, 1), 0.5), part_count=6)
    places = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.1], [LENGTH_M, 1.3, 1.1], [1.0, 1.3, HEIGHT_M]])
    facing = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    direct = np.full((len(samples.face), 1), 2.0)
    on, off = (
        reflectance_effects(caster, surfaces, samples, direct, places + lift * facing, facing, np.random.default_rng(5))
        for lift in (0.0, 1e-3)
    )
    np.testing.assert_allclose(on, off, atol=0.02)
    own = np.array([0, 2, 3, 1]), np.arange(4)  # floor, two walls and the ceiling, as `closed_box` has them
    assert (off[own] < 0.7 * off.mean(axis=0)[np.arange(4)]).all()


def test_walls_of_two_triangles_have_the_effect_of_finely_meshed_ones() -> None:
    """Taken at four places a triangle, the effect of a part came out wrong by up to a quarter."""
    box = ls.RoomModel.from_box(4.0, 3.0, 2.7, floor=0.3, walls=0.6, ceiling=0.8)
    lamp = ls.make_lamp(
        "spot", (1.0, 1.0, 2.6), beam_angle_deg=50.0, spectrum="LED-B3", luminous_flux_lm=1.0
    )  # uneven light: places count
    fine_mesh = trimesh.remesh.subdivide_to_size(box.scan.vertices, box.scan.faces, max_edge=0.3)
    places = np.array([[x, y, 0.75] for x in (0.5, 2.0, 3.5) for y in (0.5, 1.5, 2.5)])
    up = np.tile([0.0, 0.0, 1.0], (9, 1))
    found = []
    for scan in (box.scan, bare_scan(*fine_mesh)):
        part = surface_parts(scan, box.room)
        materials = MaterialMap(
            materials=box.materials.materials[:1],
            face_material=np.zeros(len(scan.faces), dtype=np.int64),
            face_color=np.full((len(scan.faces), 3), 0.5),
            face_seen=np.ones(len(scan.faces)),
        )
        effect = reflected_effects(
            scan, part, materials, [lamp], np.ones((1, 1)), np.array([[0.6]]), places, up, workers=1
        )
        found.append(effect[:3, :, 0])
    np.testing.assert_allclose(found[0], found[1], rtol=0.06)
    np.testing.assert_allclose(found[0].mean(axis=1), found[1].mean(axis=1), rtol=0.03)


def test_a_lit_room_gains_what_a_radiosity_solution_with_that_part_changed_gains(tmp_path: Path) -> None:
    scan, part, reflectance = closed_box(0.25)
    lamp = ls.make_lamp("panel", (0.9, 1.2, 2.1), name="panel", size=0.6, spectrum="LED-B3", luminous_flux_lm=1.0)
    direct = lamp_light(scan, [lamp], tmp_path)
    step, ceiling, shares = 0.02, part == 1, exchange(scan)
    lower, higher = (
        all_light(shares, np.where(ceiling, reflectance * np.exp(by), reflectance), direct) for by in (-step, step)
    )
    expected = (higher - lower) / (2 * step)
    rng = np.random.default_rng(4)
    caster = RayCaster(scan)
    samples = samples_of(scan, caster, rng, count=SAMPLES)
    surfaces = Surfaces(part=part, material=np.zeros_like(part), reflectance=np.full((1, 1), 0.5), part_count=6)
    at, facing = scan.centers + 1e-3 * scan.normals, scan.normals
    found = reflectance_effects(caster, surfaces, samples, direct[samples.face][:, None], at, facing, rng)[1, :, 0]
    floor = part == 0
    np.testing.assert_allclose(found[floor].mean(), expected[floor].mean(), rtol=0.06)  # so few samples
    np.testing.assert_allclose(found.mean(), expected.mean(), rtol=0.06)


def test_behind_a_closed_wall_the_other_room_s_walls_count_nothing(tmp_path: Path) -> None:
    scan, part, _ = closed_box(0.25, middle=True)
    rng = np.random.default_rng(4)
    caster = RayCaster(scan)
    samples = samples_of(scan, caster, rng, count=SAMPLES)
    surfaces = Surfaces(part=part, material=np.zeros_like(part), reflectance=np.full((1, 1), 0.5), part_count=8)
    direct = np.where(samples.positions[:, 0] < 0.5 * LENGTH_M, 1.0, 0.0)[:, None]
    at = np.array([[0.7, 1.2, 0.8], [2.3, 1.2, 0.8]])
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    here, behind = reflectance_effects(caster, surfaces, samples, direct, at, up, rng)[:, :, 0].T
    # Where a ray ends at the foot of the wall, the nearest sample may be that of the other side.
    assert behind.sum() < 0.03 * here.sum()
    assert here[2] > 0.1 * here.sum()
    assert here[3] < 0.01 * here.sum()
