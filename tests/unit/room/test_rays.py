"""Rays: what they meet, where, and how exactly."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.errors import ArrayError
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import bare_scan, some_faces, with_record


def test_a_ray_meets_the_nearest_face_at_the_point_that_its_weights_name(builder) -> None:
    room = builder(noise_m=0.01)
    room.box([0, 0, 0], [3, 4, 2.5], inward=True)
    scan = room.scan()
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(500, 3))
    origins = np.tile([1.5, 2.0, 1.2], (500, 1))
    hits = RayCaster(scan).nearest(origins, directions)
    along = origins + directions * hits.distance[:, None]
    on_face = np.einsum("ij,ijk->ik", hits.barycentric, scan.corners[hits.face])
    assert hits.met.all()
    # Single precision over 4 m: 24 bits leave 0.3 µm, and a few such steps add up.
    np.testing.assert_allclose(along, on_face, atol=1e-5)


def test_a_scan_far_from_the_origin_keeps_its_precision(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [3, 3, 3], inward=True)
    far = np.array([500_000.0, 4_000_000.0, 100.0])  # map coordinates
    hits = RayCaster(room.scan(shift=far)).nearest(far + [[1.0, 1.0, 1.0]], [0.0, 0.0, 1.0])
    assert hits.distance[0] == pytest.approx(2.0, abs=1e-4)


def test_a_ray_that_meets_nothing_says_so(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [1, 1, 1])
    hits = RayCaster(room.scan()).nearest([[5.0, 0.5, 0.5], [5.0, 0.5, 0.5]], [[1.0, 0, 0], [-1.0, 0, 0]])
    assert hits.met.tolist() == [False, True]
    assert np.isinf(hits.distance[0])
    assert (hits.barycentric[0] == 0).all()


def test_faces_beyond_the_longest_distance_are_not_met(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [1, 1, 1])
    caster = RayCaster(room.scan())
    assert not caster.nearest([[3.0, 0.51, 0.52]], [-1.0, 0, 0], max_distance=1.9).met[0]
    assert caster.nearest([[3.0, 0.51, 0.52]], [-1.0, 0, 0], max_distance=2.1).met[0]


@pytest.mark.parametrize("max_distance", [None, 0.7])
def test_a_ray_is_blocked_where_it_meets_a_face_from_either_side(builder, max_distance) -> None:
    room = builder()
    room.box([0, 0, 0], [3, 4, 2.5], inward=True)
    room.box([1, 1, 0], [2, 2, 0.8])
    scan = room.scan()
    scan = bare_scan(scan.vertices, scan.faces[4:])  # open on a side
    rng = np.random.default_rng(1)
    origins, directions = rng.uniform(-1.0, 5.0, (3000, 3)), rng.normal(size=(3000, 3))
    caster = RayCaster(scan)
    met = caster.nearest(origins, directions, max_distance=max_distance).met
    assert 0.1 < met.mean() < 0.9
    np.testing.assert_array_equal(caster.blocked(origins, directions, max_distance=max_distance), met)


def test_no_rays_give_no_hits(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [1, 1, 1])
    assert RayCaster(room.scan()).nearest(np.zeros((0, 3)), [0, 0, 1.0]).face.size == 0
    assert RayCaster(room.scan()).blocked(np.zeros((0, 3)), [0, 0, 1.0]).size == 0


@pytest.mark.parametrize("origin", [[[np.nan, 0, 0]], [[0.0, 0.0]]])
def test_origins_that_are_no_points_are_refused(builder, origin) -> None:
    room = builder()
    room.box([0, 0, 0], [1, 1, 1])
    with pytest.raises(ArrayError):
        RayCaster(room.scan()).nearest(origin, [0, 0, 1.0])


def test_a_scan_is_loaded_once_and_its_rays_go_with_it(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [1, 1, 1])
    scan, moved = room.scan(), room.scan(shift=np.array([9.0, 0.0, 0.0]))
    towards = [[5.0, 0.5, 0.5]], [[-1.0, 0.0, 0.0]]
    assert caster_of(scan).blocked(*towards).all()
    assert not caster_of(moved).blocked(*towards).any()  # its own triangles, not the first's
    caster = weakref.ref(caster_of(scan))
    assert caster_of(scan) is caster()
    del scan
    gc.collect()
    assert caster() is None


def test_a_scan_with_another_record_keeps_its_caster_and_one_with_another_mesh_does_not(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [1, 1, 1])
    scan = room.scan()
    assert caster_of(with_record(scan, replace(scan.record, holes_open=1))) is caster_of(scan)
    towards = [[5.0, 0.5, 0.5]], [[-1.0, 0.0, 0.0]]
    moved = replace(scan, vertices=scan.vertices + np.array([0.0, 9.0, 0.0]))
    assert caster_of(scan).blocked(*towards).all()
    assert not caster_of(moved).blocked(*towards).any()
    behind = np.flatnonzero(scan.centers[:, 0] < 0.9)
    np.testing.assert_allclose(caster_of(some_faces(scan, behind)).nearest(*towards).distance, 5.0)
