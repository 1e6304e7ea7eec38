"""How much places send over the light that falls there: in rooms whose light is known by hand."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.appearance import NO_COLOR, PHOTOGRAPHED, LinearLight
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.screen_views import MIN_FRAMES
from lidarspectra.material.frames.shining_places import (
    ShiningPlaces,
    _cut_factors,
    _gathered,
    _scatter,
    _upper_levels,
    shining_places,
)
from lidarspectra.spectra.colorimetry import encode_srgb


def room(light: FloatArray, *, cut: FloatArray | None = None) -> Scan:
    """A cube of 3 m seen from inside, whose (12,) triangles send so much; -x, +x, and so on, two each."""
    solid = trimesh.creation.box((3.0, 3.0, 3.0))
    order = np.lexsort((solid.face_normals @ [4.0, 2.0, 1.0],))
    scan = bare_scan(np.asarray(solid.vertices), np.asarray(solid.faces)[order][:, ::-1])
    linear = LinearLight(
        power_deviation=0.0, shoulder_deviation=0.0, face_deviation=np.zeros(12),
        face_cut=np.zeros(12) if cut is None else cut,
    )  # fmt: skip
    color = np.repeat(np.repeat(encode_srgb(light)[:, None, None], 3, axis=1), 3, axis=2)
    shown = replace(scan.appearance, corner_color=color, color_source=np.full(12, PHOTOGRAPHED), linear=linear)
    return replace(scan, appearance=shown)


def records_of(scan: Scan, light: FloatArray, *, frames: int = 8, each: int = 30) -> FrameRecords:
    """Places all over the cube's faces, in frames that show all of them with so much light, (face, frame)."""
    generator = np.random.default_rng(2)
    weights = generator.dirichlet((1.0, 1.0, 1.0), (12, each))
    points = np.einsum("fnk,fkc->fnc", weights, scan.corners).reshape(-1, 3)
    count = len(points)
    place, frame = (found.ravel() for found in np.meshgrid(np.arange(count), np.arange(frames), indexing="ij"))
    return FrameRecords(
        points=points, normals=np.repeat(scan.normals, each, axis=0), camera=np.zeros((frames, 3)), place=place,
        frame=frame, light=light[place // each, frame].astype(np.float32),
        uneven=np.zeros(place.size, dtype=np.float32), clipped=np.zeros(place.size, dtype=np.bool_),
    )  # fmt: skip


def shining(scan: Scan, records: FrameRecords) -> ShiningPlaces:
    return shining_places(records, scan, caster_of(scan), np.random.default_rng(0))


def test_in_a_furnace_every_upright_place_sends_what_falls_there() -> None:
    scan = room(np.full(12, 0.4))
    found = shining(scan, records_of(scan, np.full((12, 8), 0.4)))
    upright = np.abs(scan.normals[:, 2]) < 0.5
    assert set(found.place // 30) == set(np.flatnonzero(upright))
    assert found.light == pytest.approx(0.4, rel=1e-3)
    assert found.level == pytest.approx(1.0, rel=1e-3)
    assert found.moves == pytest.approx(0.0, abs=1e-6)
    assert not found.is_candidate.any()


def test_what_sends_more_than_falls_there_or_changes_is_a_candidate() -> None:
    scan = room(np.full(12, 0.4))
    sent = np.full((12, 8), 0.4)
    left, right, behind = scan.normals[:, 0] > 0.5, scan.normals[:, 0] < -0.5, scan.normals[:, 1] > 0.5
    sent[left], sent[right] = 0.6, 0.4 * np.exp(0.5 * (-1.0) ** np.arange(8))
    found = shining(scan, records_of(scan, sent))
    shines, moves, paint = (side[found.place // 30] for side in (left, right, behind))
    assert np.median(found.level[shines]) == pytest.approx(1.5, rel=0.02)
    assert found.is_candidate[shines].all()
    assert np.median(found.moves[moves]) == pytest.approx(1.25 * 0.5, rel=0.02)
    assert found.is_candidate[moves].all()
    assert np.median(found.moves[paint]) == pytest.approx(0.0, abs=1e-6)
    assert found.level[paint] == pytest.approx(1.0, rel=1e-3)


def test_places_that_few_frames_show_are_not_looked_at() -> None:
    scan = room(np.full(12, 0.4))
    records = records_of(scan, np.full((12, MIN_FRAMES - 1), 0.4), frames=MIN_FRAMES - 1)
    assert shining(scan, records).place.size == 0


def test_the_light_is_that_of_the_half_that_a_place_sees() -> None:
    """A bright ceiling: walls see it in a quarter of their directions or so, by its form factor of a fifth."""
    scan = room(np.full(12, 0.2))
    ceiling = scan.centers[:, 2] > 1.4
    light = np.where(ceiling, 1.0, 0.2)
    scan = room(light)
    found = shining(scan, records_of(scan, np.repeat(light[:, None], 8, axis=1)))
    # Of each square face of a cube, the adjacent ones have form factors of .2000.
    assert found.light.mean() == pytest.approx(0.2 + 0.2 * 0.8, rel=0.03)


@pytest.mark.parametrize("walls", [0.3, 0.1])
def test_light_of_what_is_cut_is_gathered_apart_and_what_no_frame_saw_is_as_bright_as_is_usual(walls: float) -> None:
    scan = room(np.full(12, 0.2))
    ceiling, floor = scan.centers[:, 2] > 1.4, scan.centers[:, 2] < -1.4
    scan = room(np.where(ceiling, 1.0, np.where(floor, 0.9, walls)), cut=ceiling.astype(np.float64))
    source = np.where(floor, NO_COLOR, PHOTOGRAPHED)
    scan = replace(scan, appearance=replace(scan.appearance, color_source=source))
    records = records_of(scan, np.full((12, 8), 0.4), each=60)
    upright = np.flatnonzero(np.abs(records.normals[:, 2]) < 0.5)

    def gathered(place: IntArray, scan: Scan) -> tuple[FloatArray, FloatArray]:
        found = _gathered(place, records, scan, caster_of(scan), np.random.default_rng(0))
        return found[:, 0], found[:, 1:].sum(axis=1)  # each of the ceiling's triangles is a source

    known, cut = gathered(upright, scan)
    assert known.mean() == pytest.approx(0.8 * walls, rel=0.05)  # form factors of .2: three walls and the floor
    assert cut.mean() == pytest.approx(0.2, rel=0.1)  # places are drawn, and see it by up to a half
    below = np.flatnonzero(records.normals[:, 2] > 0.5)
    assert gathered(below, scan)[1].mean() == pytest.approx(0.2, rel=0.1)
    kept = ~floor  # nothing comes from where the scan is open, and no light through its back
    part = bare_scan(scan.vertices, scan.faces[kept])
    part = replace(part, appearance=scan.appearance.select(kept))
    known, cut = gathered(upright, part)
    assert known.mean() == pytest.approx(0.6 * walls, rel=0.05)
    assert cut.mean() == pytest.approx(0.2, rel=0.1)  # places are drawn, and see it by up to a half


def test_what_all_frames_cut_sends_as_much_more_as_makes_planes_one_paint() -> None:
    """Planes of paint .5 in the light of a window, whose share differs over them, and of the rest."""
    generator, count = np.random.default_rng(5), 400
    points, normals = generator.uniform(0, 3, (count, 3)), np.repeat(np.eye(3)[:2], count // 2, axis=0)
    points[: count // 2, 0], points[count // 2 :, 1] = 0.0, 0.0
    known, window = generator.uniform(0.1, 0.3, count), generator.uniform(0.0, 0.2, count)
    for factor in (2.0, 8.0, 40.0):
        level = 0.5 * (known + factor * window) * np.exp(0.03 * generator.normal(size=count))
        level[::17] *= 3.0  # a screen
        gathered = np.column_stack([known, window])
        found = _cut_factors(level, points, normals, gathered)
        assert found == pytest.approx([1.0, factor], rel=0.05)
    assert _cut_factors(level, points, normals, gathered[:, :1]).tolist() == [1.0]
    assert _cut_factors(level[:20], points[:20], normals[:20], gathered[:20]).tolist() == [1.0, 1.0]


def test_upper_levels_and_scatter_are_those_of_each_places_own_frames() -> None:
    scan = room(np.full(12, 0.4))
    records = records_of(scan, np.full((12, 9), 0.4), frames=9, each=1)
    light = np.linspace(0.1, 0.9, 9)[records.frame] * (1.0 + records.place)
    records = replace(records, light=light.astype(np.float32))
    level, count = _upper_levels(records)
    assert level == pytest.approx(0.7 * (1.0 + np.arange(12)))  # two of nine are brighter
    assert (count == 9).all()
    logs = np.log(np.linspace(0.1, 0.9, 9))
    assert _scatter(records) == pytest.approx(np.full(12, 1.25 * np.abs(logs - logs.mean()).mean()), rel=1e-5)
    some = replace(records, clipped=records.frame > 3)  # four frames are left
    assert (_scatter(some) == 0.0).all()
    seen = records.place > 0
    rows = {name: getattr(records, name)[seen] for name in ("place", "frame", "light", "uneven", "clipped")}
    level, count = _upper_levels(replace(records, **rows))
    assert (level[0], count[0]) == (0.0, 0)
    assert level[1:] == pytest.approx(0.7 * (2.0 + np.arange(11)))
