"""What frames tell of sources that nobody named: the lobes that they saw, and bounds of what they cut at white."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.geometry.appearance import LinearLight
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.light_objective import UPRIGHT_LOBES
from lidarspectra.material.delighting.unknown_light import UnknownSource, lobes_towards
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.seen_sources import (
    BEYOND_BOUND,
    BOUND_DEVIATION,
    TOLD_DEVIATION,
    sightings_of_sources,
)

SKY, GROUND = 3.0, 0.5  # [1] radiance of an even sky and of the ground
PLACES = 40


def pane() -> tuple[Scan, UnknownSource]:
    """A window of 1 m² in the plane x = 0, from 1 to 2 m above the floor, that looks into the room (+x)."""
    corners = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, 2.0], [0.0, 0.0, 2.0]])
    scan = bare_scan(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    return scan, UnknownSource(
        faces=np.arange(2), center=corners.mean(axis=0), normal=np.array([1.0, 0.0, 0.0]), area_m2=1.0
    )


def records_of(white: np.ndarray, cameras: np.ndarray) -> FrameRecords:
    """What frames with a (frame,) white see of the window from (frame, 3) places, and of a dark edge in it."""
    random = np.random.default_rng(3)
    points = np.column_stack([np.zeros(PLACES), random.uniform(0.1, 0.9, PLACES), random.uniform(1.1, 1.9, PLACES)])
    frame, place = (each.ravel() for each in np.meshgrid(np.arange(len(white)), np.arange(PLACES), indexing="ij"))
    light = np.where(points[place, 2] > cameras[frame, 2], SKY, GROUND)
    light[place == 0] = 0.05  # a bar across it
    clipped = light > white[frame]
    return FrameRecords(
        points=points, normals=np.tile([1.0, 0.0, 0.0], (PLACES, 1)), camera=cameras, place=place, frame=frame,
        light=np.where(clipped, white[frame], light).astype(np.float32),
        uneven=np.zeros(place.size, dtype=np.float32), clipped=clipped,
    )  # fmt: skip


CAMERAS = np.array([[2.0, 0.5, 1.0], [2.5, 0.2, 1.0], [2.0, 0.5, 2.0], [2.5, 0.8, 2.0]])  # two below, two above it


def test_a_window_is_told_by_the_lobes_that_frames_saw() -> None:
    scan, source = pane()
    found = sightings_of_sources(records_of(np.full(4, 10.0), CAMERAS), scan, RayCaster(scan), (source,))
    assert found is not None
    assert found.source.tolist() == [0, 0]
    up, down = found.lobes
    assert up[:2].sum() == pytest.approx(1.0)  # an even sky is as much of both
    assert up[1] > 0.6  # near the horizon
    assert up[2] == 0.0
    assert down.tolist() == [0.0, 0.0, 1.0]
    assert found.light == pytest.approx(np.repeat([[SKY], [GROUND]], 3, axis=1))
    assert found.log_deviation.tolist() == [TOLD_DEVIATION] * 2
    # What the sightings expect of a source of such lobes is what was seen: strengths are radiance times pi.
    assert found.lobes @ np.array([SKY, SKY, GROUND]) == pytest.approx(found.light[:, 0])


def test_what_is_left_below_white_in_a_frame_that_cuts_the_window_is_not_the_window() -> None:
    scan, source = pane()
    white = np.array([1.0, 10.0, 1.0, 10.0])  # two frames cut the sky, and show the bar alone
    found = sightings_of_sources(records_of(white, CAMERAS), scan, RayCaster(scan), (source,))
    assert found is not None
    assert found.light[0] == pytest.approx(np.full(3, SKY))


@pytest.mark.parametrize("white", [[0.2, 1.0, 0.2, 0.3], [1.0, 0.2, 0.3, 0.2]])
def test_what_all_frames_cut_has_the_highest_white_as_its_bound(white: list[float]) -> None:
    scan, source = pane()
    found = sightings_of_sources(records_of(np.array(white), CAMERAS), scan, RayCaster(scan), (source,))
    assert found is not None
    assert found.light[:, 0] == pytest.approx([BEYOND_BOUND * 1.0, BEYOND_BOUND * 0.3])
    assert found.log_deviation.tolist() == [BOUND_DEVIATION] * 2


def test_a_frame_that_cuts_the_brighter_part_of_a_window_tells_it_by_its_white() -> None:
    scan, source = pane()
    records = records_of(np.full(4, 0.9 * SKY), CAMERAS)
    darker = records.place % 3 == 0  # a cloud
    light = np.where(darker & records.clipped, 0.8 * SKY, records.light).astype(np.float32)
    found = sightings_of_sources(
        replace(records, light=light, clipped=records.clipped & ~darker), scan, RayCaster(scan), (source,)
    )
    assert found is not None
    assert found.light[0] == pytest.approx(np.full(3, 0.9 * SKY))
    assert found.log_deviation[0] == TOLD_DEVIATION


def with_bars(records: FrameRecords, share: float, light: float, frame: int | None = None) -> FrameRecords:
    """The same with a share of the places not cut at white, in one frame or in all, of some radiance."""
    bar = records.place < share * PLACES
    bar &= (records.frame == frame) if frame is not None else True
    return replace(
        records, light=np.where(bar, light, records.light).astype(np.float32), clipped=records.clipped & ~bar
    )


@pytest.mark.parametrize(
    ("share", "light"), [(0.3, 0.3), (0.05, 0.9)], ids=["many and dark", "few, as bright as a cut sky's edge"]
)
def test_bars_before_a_sky_that_all_frames_cut_do_not_tell_its_radiance(share: float, light: float) -> None:
    scan, source = pane()
    records = with_bars(records_of(np.full(4, 1.0), CAMERAS), share, light)
    found = sightings_of_sources(records, scan, RayCaster(scan), (source,))
    assert found is not None
    assert found.light[0] == pytest.approx(np.full(3, BEYOND_BOUND * 1.0))
    assert found.log_deviation[0] == BOUND_DEVIATION


def test_a_glint_on_a_bar_does_not_make_it_the_sky_that_all_frames_cut() -> None:
    scan, source = pane()
    records = with_bars(records_of(np.full(4, 1.0), CAMERAS), 0.3, 0.3)
    light = np.where(records.place == 5, 0.95, records.light).astype(np.float32)  # one place of twelve
    found = sightings_of_sources(replace(records, light=light), scan, RayCaster(scan), (source,))
    assert found is not None
    assert found.log_deviation[0] == BOUND_DEVIATION


@pytest.mark.parametrize(("white", "expected"), [(10.0, SKY), (1.0, BEYOND_BOUND)], ids=["told", "cut"])
def test_a_lamp_mirrored_in_a_corner_of_a_window_is_not_the_radiance_of_it(white: float, expected: float) -> None:
    scan, source = pane()
    records = records_of(np.full(4, white), CAMERAS)
    light = np.where(records.place < 4, 5.0 * records.light, records.light).astype(np.float32)
    found = sightings_of_sources(replace(records, light=light), scan, RayCaster(scan), (source,))
    assert found is not None
    assert found.light[0] == pytest.approx(np.full(3, expected))


def test_what_stands_a_hand_before_a_window_is_not_the_window() -> None:
    scan, source = pane()
    records = records_of(np.full(4, 10.0), CAMERAS)
    records = replace(records, points=records.points + [0.1, 0.0, 0.0])
    assert sightings_of_sources(records, scan, RayCaster(scan), (source,)) is None


def test_the_lobes_of_what_is_cut_are_those_of_the_views_that_are_cut() -> None:
    scan, source = pane()
    cameras = np.array([[2.5, 0.5, 1.0], [0.3, 0.5, 1.0]])  # one near the horizon, one steeply up
    records = with_bars(records_of(np.full(2, 1.0), cameras), 0.6, 0.05, frame=1)
    found = sightings_of_sources(records, scan, RayCaster(scan), (source,))
    assert found is not None
    way = records.points[records.place] - cameras[records.frame]
    cut = (way[:, 2] / np.linalg.norm(way, axis=1))[records.clipped]
    assert found.lobes[0] == pytest.approx([cut.mean(), 1.0 - cut.mean(), 0.0])


@pytest.mark.parametrize("white", [10.0, 1.0], ids=["told", "cut"])
def test_a_dozen_views_tell_of_a_source_and_fewer_do_not(white: float) -> None:
    scan, source = pane()
    records = records_of(np.full(4, white), CAMERAS)
    shown = np.flatnonzero((records.frame == 0) & (records.place > 0))  # not the bar
    for count, is_told in ((12, True), (11, False)):
        rows = {
            name: getattr(records, name)[shown[:count]] for name in ("place", "frame", "light", "uneven", "clipped")
        }
        found = sightings_of_sources(replace(records, **rows), scan, RayCaster(scan), (source,))
        assert (found is not None) == is_told


def test_a_window_has_the_hue_of_its_parts_that_some_frame_does_not_cut() -> None:
    scan, source = pane()
    color = np.array([[0.2, 0.3, 0.4], [0.9, 0.6, 0.3]])
    shown = replace(
        scan.appearance, corner_color=np.repeat(color[:, None], 3, axis=1),
        linear=LinearLight(
            power_deviation=0.0, shoulder_deviation=0.0, face_deviation=np.zeros(2), face_cut=np.array([0.0, 1.0])
        ),
    )  # fmt: skip
    scan = replace(scan, appearance=shown)
    found = sightings_of_sources(records_of(np.full(4, 10.0), CAMERAS), scan, RayCaster(scan), (source,))
    assert found is not None
    hue = scan.face_colors()[0] / scan.face_colors()[0].mean()
    assert found.light == pytest.approx(np.array([[SKY], [GROUND]]) * hue)


def test_places_a_centimetre_off_the_mesh_are_of_its_faces() -> None:
    scan, source = pane()
    records = records_of(np.full(4, 10.0), CAMERAS)
    for off_m in (-0.01, 0.01):
        moved = replace(records, points=records.points + [off_m, 0.0, 0.0])
        found = sightings_of_sources(moved, scan, RayCaster(scan), (source,))
        assert found is not None
        assert found.source.tolist() == [0, 0]


def test_what_is_cut_may_be_paper_just_at_its_bound_or_a_window_a_hundred_times_brighter() -> None:
    assert np.log(BEYOND_BOUND) < BOUND_DEVIATION
    assert np.log(100.0 / BEYOND_BOUND) < 2.5 * BOUND_DEVIATION


def test_frames_that_do_not_show_a_source_tell_nothing_of_it() -> None:
    scan = pane()[0]
    away = UnknownSource(faces=np.zeros(0, dtype=np.int64), center=np.zeros(3), normal=np.zeros(3), area_m2=0.0)
    assert sightings_of_sources(records_of(np.full(4, 10.0), CAMERAS), scan, RayCaster(scan), (away,)) is None


def test_an_upright_source_that_is_alike_all_over_sends_as_much_as_it_would_as_paint() -> None:
    assert UPRIGHT_LOBES.sum() == pytest.approx(1.0)
    # By the mean of the lobes over cosine-weighted directions of half a sphere about a horizontal axis.
    random = np.random.default_rng(1)
    ways = random.normal(size=(400_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    weight = np.maximum(ways[:, 0], 0.0)
    assert (lobes_towards(ways[:, 2]) * weight).sum(axis=1) / weight.sum() == pytest.approx(UPRIGHT_LOBES, abs=0.003)
