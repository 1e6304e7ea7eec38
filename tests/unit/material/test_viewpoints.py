"""The loop of Algorithm 1 covers what can be seen, stops where nothing is gained, and its buffers are true."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.errors import MaterialError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.surface_samples import coarse_cells, surface_samples
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.material.views.projection import camera_towards, pixel_grid, reverse_project
from lidarspectra.material.views.viewpoints import (
    FIRST_SHARE,
    ViewSettings,
    free_candidates,
    render_views,
    visible,
)
from lidarspectra.material.views.views import MIN_CONTRAST, capture_image, load_views, save_views
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import decode_srgb
from lidarspectra.spectra.databases import scenes_folder

from .conftest import COLORS, SIZE_M, box_scan

SMALL = ViewSettings(width=32, height=32, samples=2, sample_spacing_m=0.2)


@pytest.fixture(scope="module")
def box():
    return box_scan()[0]


@pytest.fixture(scope="module")
def views(box):
    return render_views(box, settings=SMALL)


def with_plate(scan: Scan) -> Scan:
    """The box with a level plate under its middle, facing up: what lies below it v0 cannot see."""
    low, high = np.array([1.0, 0.7, 0.8]), np.array([3.0, 2.3, 0.8])
    a, b, c, d = (np.array([x, y, 0.8]) for x, y in ((low[0], low[1]), (high[0], low[1]), high[:2], (low[0], high[1])))
    top = np.array([[a, b, c], [a, c, d]])
    bottom = np.array([[a, c, b], [a, d, c]]) - np.array([0, 0, 0.03])
    return extended(scan, np.concatenate([top, bottom]))


def extended(scan: Scan, triangles: np.ndarray) -> Scan:
    count = len(triangles)
    look = scan.appearance
    appearance = type(look)(
        images=(),
        face_image=np.concatenate([look.face_image, np.full(count, -1)]),
        corner_uv=np.concatenate([look.corner_uv, np.zeros((count, 3, 2))]),
        corner_color=np.concatenate([look.corner_color, np.full((count, 3, 3), 0.5)]),
    )
    return Scan(
        vertices=np.concatenate([scan.vertices, triangles.reshape(-1, 3)]),
        faces=np.concatenate([scan.faces, len(scan.vertices) + np.arange(3 * count).reshape(-1, 3)]),
        appearance=appearance,
        record=scan.record,
    )


def test_six_views_from_the_centre_see_the_whole_of_an_empty_box(box, views):
    assert [view.name for view in views.views] == [f"v0 {d}" for d in ("east", "west", "north", "south", "up", "down")]
    # v0 is the free candidate nearest to the centre of the plan, at half height
    assert np.allclose(views.viewpoints[0], SIZE_M / 2, atol=0.05)
    # not one: a surface seen at less than 10 degrees does not count
    assert views.area_coverage > 0.99
    assert views.point_coverage > 0.99
    assert views.stopped.startswith("95%")


def test_depth_and_face_of_a_pixel_lie_on_that_face(box, views):
    for view in views.views:
        positions = reverse_project(view.camera, pixel_grid(view.camera), view.depth.ravel())
        face = view.face.ravel()
        assert (face >= 0).all()
        away = np.einsum("ij,ij->i", positions - box.centers[face], box.normals[face])
        # 1e-5 m: single precision of the ray caster over metres
        assert np.abs(away).max() < 1e-5


def test_a_views_colors_are_the_surfaces(views):
    up = views.views[4].image.reshape(-1, 3)
    # half a code of 255, in linear light at most 0.5 %
    assert np.allclose(decode_srgb(up / 255.0).mean(axis=0), COLORS["ceiling"], atol=0.005)


def test_antialiasing_averages_light_and_not_codes(box):
    # A camera so far off that floor and wall share pixels sees mixtures between both colours only.
    scan, _ = box_scan(cells=2)
    caster = RayCaster(scan)
    towards = camera_towards(SIZE_M / 2, np.array([1.0, 0, -0.5]), width=3, height=2, field_of_view_deg=120.0)
    coarse = capture_image(scan, towards, name="coarse", caster=caster, samples=1)
    fine = capture_image(scan, towards, name="fine", caster=caster, samples=8)
    finer = capture_image(scan, towards, name="finer", caster=caster, samples=32)
    error = [
        np.abs(decode_srgb(view.image / 255.0) - decode_srgb(finer.image / 255.0)).max() for view in (coarse, fine)
    ]
    # 64 samples leave at most the share of one row of them, an eighth, of the difference of 0.45 between the colours
    assert error[1] < 0.06
    assert error[1] < error[0]


def test_pixels_of_one_ray_look_as_if_they_had_several(monkeypatch):
    # Smooth waves and noise on the box's sides: the first are seen with few rays, the second with all.
    scan, _ = box_scan(cells=2)
    x, y = np.meshgrid(np.arange(256), np.arange(256))
    waves = np.rint(128 + 40 * np.sin(x / 40) * np.cos(y / 30))
    waves[128:] = np.random.default_rng(3).integers(90, 160, (128, 256))
    appearance = replace(
        scan.appearance,
        images=(np.repeat(waves.astype(np.uint8)[..., None], 3, axis=2),),
        face_image=np.zeros(len(scan.faces), dtype=np.int64),
        corner_uv=np.random.default_rng(4).random((len(scan.faces), 3, 2)),
    )
    textured = replace(scan, appearance=appearance)
    caster = RayCaster(textured)
    camera = camera_towards(SIZE_M / 2, np.array([1.0, 0, -0.5]), width=128, height=128, field_of_view_deg=90.0)
    few = capture_image(textured, camera, name="few", caster=caster).image.astype(np.int64)
    monkeypatch.setattr("lidarspectra.material.views.views.MIN_CONTRAST", -1)  # every pixel has several
    all_rays = capture_image(textured, camera, name="all", caster=caster).image.astype(np.int64)
    single = capture_image(textured, camera, name="single", caster=caster, samples=1).image.astype(np.int64)
    apart, without = np.abs(few - all_rays), np.abs(single - all_rays)
    assert 0.1 < (few == all_rays).all(axis=2).mean() < 1.0
    assert apart.max() <= 2 * MIN_CONTRAST
    assert apart.mean() < 0.5 < without.mean()


def test_the_loop_goes_where_the_uncovered_area_is(box):
    scan = with_plate(box)
    found = render_views(scan, coverage=0.99, settings=SMALL)
    assert len(found.viewpoints) > 1
    # what v0 cannot see lies under the plate: one of the next viewpoints stands below it
    assert (found.viewpoints[1:, 2] < 0.8).any()
    assert np.all(np.diff(found.history) > 0)
    first = render_views(scan, coverage=0.99, settings=ViewSettings(**{**vars(SMALL), "max_viewpoints": 1}))
    assert first.area_coverage < found.area_coverage
    assert first.stopped.startswith("1 viewpoints")
    assert len(first.views) == 6


def test_later_viewpoints_give_one_view_each_and_none_is_taken_twice():
    # Behind a scan's furniture some of a cell stays hidden from the view that shows it: a plain box would not tell.
    office = repair_scan(read_scan(scenes_folder() / "office" / "scan.glb"))
    found = render_views(office, coverage=1.0, settings=replace(SMALL, sample_spacing_m=0.1))
    assert len(found.viewpoints) > 10
    assert len(found.views) == 6 + len(found.viewpoints) - 1
    later = [(*view.camera.position, view.name.split()[1]) for view in found.views[6:]]
    assert len(set(later)) == len(later)


def test_the_cells_of_the_search_share_out_all_samples_and_no_cell_has_two_sides(box):
    samples = surface_samples(with_plate(box), spacing_m=0.05)
    cell, first = coarse_cells(samples, 0.12)
    assert set(cell) == set(range(len(first)))
    assert np.array_equal(cell[first], np.arange(len(first)))
    assert np.linalg.norm(samples.positions - samples.positions[first[cell]], axis=1).max() <= 0.12 * 3**0.5
    assert np.einsum("sc,sc->s", samples.normals, samples.normals[first[cell]]).min() > 0  # the plate is 3 cm thick
    assert len(first) < len(cell) / 4


def test_the_viewpoints_to_come_are_counted_ahead(box):
    told: list[float] = []
    scan = with_plate(box)
    found = render_views(scan, coverage=0.99, settings=SMALL, progress=lambda fraction, words: told.append(fraction))
    later = len(found.viewpoints) - 1
    assert later > 0
    assert told[1] == pytest.approx(FIRST_SHARE)
    assert told[2] == pytest.approx(FIRST_SHARE + (1.0 - FIRST_SHARE) / later)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_a_back_is_never_seen_and_the_loop_ends_without_it(box):
    inward = Scan(vertices=box.vertices, faces=box.faces, appearance=box.appearance, record=box.record)
    # a flake whose front faces the wall it lies on, 5 mm away: no place in the room sees its front
    flake = np.array([[[0.005, 1.0, 1.0], [0.005, 2.0, 2.0], [0.005, 2.0, 1.0]]])
    scan = extended(inward, flake if np.cross(*(flake[0, 1:] - flake[0, 0]))[0] < 0 else flake[:, ::-1])
    found = render_views(scan, coverage=1.0, settings=SMALL)
    assert found.face_seen[-1] == 0
    assert found.area_coverage < 1
    assert "no other view" in found.stopped


def test_samples_share_out_the_area_of_their_faces(box):
    samples = surface_samples(box, spacing_m=0.1)
    assert np.isclose(samples.area.sum(), box.areas.sum())
    again = np.einsum("sc,scd->sd", samples.barycentric, box.corners[samples.face])
    assert np.allclose(again, samples.positions)


def test_visibility_knows_what_stands_between(box):
    scan = with_plate(box)
    samples = surface_samples(scan, spacing_m=0.3)
    above, below = visible(samples, np.array([[2.0, 1.5, 2.0], [2.0, 1.5, 0.4]]), RayCaster(scan), SMALL)
    middle = (np.abs(samples.positions[:, :2] - [2.0, 1.5]) < 0.3).all(axis=1) & (samples.positions[:, 2] < 0.01)
    assert middle.any()
    assert not above[middle].any()
    assert below[middle].all()


def test_candidates_are_free_and_the_first_is_nearest_to_the_centre(box):
    scan = with_plate(box)
    candidates = free_candidates(scan, find_room(scan), RayCaster(scan))
    assert ((candidates > 0.14) & (candidates < SIZE_M - 0.14)).all()
    assert not ((candidates[:, 2] > 0.62) & (candidates[:, 2] < 0.93) & in_plate(candidates)).any()
    away = np.linalg.norm(candidates - SIZE_M / 2, axis=1)
    assert away[0] == away.min()


def in_plate(points: np.ndarray) -> np.ndarray:
    return (points[:, 0] > 1.0) & (points[:, 0] < 3.0) & (points[:, 1] > 0.7) & (points[:, 1] < 2.3)


def test_a_room_turned_inside_out_has_no_place_to_look_from(box):
    room = find_room(box)
    outside = Scan(vertices=box.vertices, faces=box.faces[:, ::-1], appearance=box.appearance, record=box.record)
    with pytest.raises(MaterialError, match="normals"):
        render_views(outside, room, settings=SMALL)


def test_the_same_scan_gives_the_same_views(box, views):
    again = render_views(box, settings=SMALL)
    assert np.array_equal(again.viewpoints, views.viewpoints)
    for one, other in zip(again.views, views.views, strict=True):
        assert np.array_equal(one.image, other.image)


def test_views_are_kept_and_read_back_to_the_bit(views, tmp_path):  # a run's later stages are given either
    save_views(views, tmp_path)
    again = load_views(tmp_path)
    assert [view.name for view in again.views] == [view.name for view in views.views]
    for one, other in zip(again.views, views.views, strict=True):
        assert np.array_equal(one.image, other.image)
        assert np.array_equal(one.face, other.face)
        assert np.array_equal(one.depth, other.depth)
        assert np.array_equal(one.camera.axes, other.camera.axes)
        assert np.array_equal(one.camera.position, other.camera.position)
        assert one.camera.focal_px == other.camera.focal_px
    assert np.array_equal(again.face_seen, views.face_seen)
    assert again.stopped == views.stopped


@pytest.mark.parametrize("name", ["views.json", "seen.npz", "view-00.png", "view-03.npz"])
def test_missing_or_damaged_views_are_our_error(views, tmp_path, name):
    save_views(views, tmp_path)
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: len(data) // 2])
    with pytest.raises(MaterialError, match="views stage"):
        load_views(tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(MaterialError, match="views stage"):
        load_views(tmp_path)


@pytest.mark.slow  # a real scan: some seconds
def test_the_real_meeting_room_is_covered(shared):
    scan = read_scan(shared / "scans" / "meeting-room" / "poly.glb")
    found = render_views(scan, settings=ViewSettings(width=64, height=64, samples=1))
    assert found.area_coverage >= 0.95
    assert len(found.views) < 20
