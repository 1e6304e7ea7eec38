"""Gloss from frames: found where a lamp is mirrored, with deviations that cover the truth, and nowhere else."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.appearance import PHOTOGRAPHED
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.io.array_files import read_arrays, write_arrays
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.frames.gloss import (
    MIN_GAIN,
    MIN_RATIO,
    MIN_SPECULARITY,
    NO_HIGHLIGHT,
    NOT_TOLD,
    ROUGHNESS,
    TOO_FEW,
    GlossOfPart,
    Mirrored,
    ShownLamps,
    _rest_of_room,
    gloss_of_parts,
    smoothed,
)  # fmt: skip
from lidarspectra.material.frames.gloss_lobe import LampPieces, half_vectors, highlight
from lidarspectra.material.frames.records import RECORDS_FILE, FrameRecords, Recorder
from lidarspectra.material.material_map import MAX_REFLECTANCE, Material, MaterialMap
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials.gloss_of_run import gloss_in_words, mirrored_in, with_gloss

WHITE = Spectrum(wavelengths_nm=[380.0, 780.0], values=[1.0, 1.0])
PANEL = Lamp(name="panel", shape=Panel(0.6, 0.6), center=np.array([1.5, 1.5, 2.6]), flux=WHITE)
LAMPS = ShownLamps(lamps=(PANEL,), radiosity=np.array([20.0]), log_deviation=0.05)
FLOOR = bare_scan(np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
MATT_LEVEL, WHITE_LEVEL = 0.3, 2.0  # [1] of the floor; at which frames are cut


def walk(
    specularity: float, roughness: float, *, white: float = WHITE_LEVEL, gain: float = 0.02, seed: int = 3
) -> FrameRecords:
    """A floor of 3 m x 3 m under the panel, in 40 frames along a ring, each off by a gain, each view by 2 %."""
    generator = np.random.default_rng(seed)
    points = np.column_stack([generator.uniform(0, 3, (400, 2)), np.zeros(400)])
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    camera = np.column_stack([1.5 + np.cos(turn), 1.5 + np.sin(turn), np.full(40, 1.45)])
    frame, place = (each.ravel() for each in np.meshgrid(np.arange(40), np.arange(400)))
    toward = camera[frame] - points[place]
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    normals = np.tile([0.0, 0.0, 1.0], (400, 1))
    lobe = highlight(points[place], normals[place], toward, np.array([[max(roughness, 0.02)]]), LampPieces.of(PANEL))[0]
    matt = MATT_LEVEL * (1.0 + 0.3 * generator.random(400))
    light = matt[place] + specularity * lobe * LAMPS.radiosity[0]
    light *= np.exp(gain * generator.normal(size=40))[frame] * (1.0 + 0.02 * generator.normal(size=light.size))
    return FrameRecords(
        points=points, normals=normals, camera=camera, place=place, frame=frame,
        light=np.minimum(light, white).astype(np.float32), uneven=np.full(light.size, 0.02, dtype=np.float32),
        clipped=light >= white,
    )  # fmt: skip


def dark(origins: FloatArray, _: FloatArray) -> FloatArray:
    return np.zeros(len(origins))


def found(
    records: FrameRecords, lamps: ShownLamps = LAMPS, *, scan: Scan = FLOOR, mirrored: Mirrored = dark
) -> GlossOfPart:
    part = np.zeros(len(records.points), dtype=np.int64)
    (gloss,) = gloss_of_parts(records, part, 1, lamps, RayCaster(scan), mirrored, np.random.default_rng(0))
    return gloss


def seen_by(records: FrameRecords, frames: Sequence[int], places: int = 400) -> FrameRecords:
    """What some frames show of the first places."""
    kept = np.isin(records.frame, frames) & (records.place < places)
    rows = {name: getattr(records, name)[kept] for name in ("place", "frame", "light", "uneven", "clipped")}
    return replace(records, **rows)


@pytest.mark.parametrize(("specularity", "roughness"), [(0.04, 0.12), (0.06, 0.2), (0.02, 0.06)])
def test_specularity_and_roughness_come_back_within_their_deviations(specularity: float, roughness: float) -> None:
    gloss = found(walk(specularity, roughness))
    assert not gloss.matt
    assert abs(gloss.specularity - specularity) < 3.0 * gloss.specularity_deviation
    assert abs(gloss.roughness - roughness) < 3.0 * gloss.roughness_deviation
    assert gloss.specularity_deviation < 0.25 * specularity  # and they say something
    assert gloss.roughness_deviation < 0.3 * roughness


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8), (0.8, 0.6, 0.0)])
def test_facets_are_tilted_by_the_slope_and_turned_by_the_angle(normal: tuple[float, float, float]) -> None:
    normals, turns = np.tile(normal, (4, 1)), np.radians([0.0, 90.0, 180.0, 200.0])
    half = half_vectors(normals, np.full(4, 0.75), turns)
    np.testing.assert_allclose(np.linalg.norm(half, axis=1), 1.0)
    np.testing.assert_allclose(half @ normal, 0.8)  # cosine of the angle whose tangent is .75
    in_surface = (half - 0.8 * normals) / 0.6
    np.testing.assert_allclose(in_surface @ in_surface[0], np.cos(turns), atol=1e-12)


@pytest.mark.parametrize("roughness", [0.05, 0.13, 0.3])
def test_a_roughness_between_those_that_are_tried_comes_back(roughness: float) -> None:
    """It was one of these before, by up to an eighth off, and the specularity by a twentieth with it."""
    gloss = found(walk(0.04, roughness), replace(LAMPS, log_deviation=0.0))
    assert np.abs(np.log(ROUGHNESS / roughness)).min() > 0.03
    assert gloss.roughness == pytest.approx(roughness, rel=0.02)
    assert gloss.specularity == pytest.approx(0.04, rel=0.03)


@pytest.mark.parametrize("gain", [0.02, 0.1])
def test_deviations_are_those_of_what_comes_out(gain: float) -> None:
    lamps = replace(LAMPS, log_deviation=0.0)  # which would hide them
    told = [found(walk(0.04, 0.12, gain=gain, seed=seed), lamps) for seed in range(8)]
    off = np.array([(each.specularity - 0.04) / each.specularity_deviation for each in told])
    assert 0.1 < np.sqrt((off**2).mean()) < 1.5


def test_a_sharp_lobe_that_a_lamp_fills_shows_the_lamp_itself() -> None:
    above = replace(PANEL, shape=Panel(3.0, 3.0))
    point, up = np.array([[1.5, 1.5, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    toward = np.array([[0.1, 0.05, 1.0]]) / np.linalg.norm([0.1, 0.05, 1.0])
    light = highlight(point, up, toward, np.array([[0.03], [0.08]]), LampPieces.of(above, 64))
    np.testing.assert_allclose(light, 1.0, atol=0.02)  # whose radiosity it shows, times the specularity


def test_a_floor_shows_its_specularity_times_the_radiosity_of_a_lamp_that_fills_the_lobe() -> None:
    """By hand: where the mirrored eye looks into a large lamp the floor is brighter by s M, elsewhere it is not."""
    records = walk(0.0, 0.1, gain=0.0)
    way = records.points[records.place] - records.camera[records.frame]
    way[:, 2] *= -1.0  # mirrored
    met = records.points[records.place] + way * (PANEL.center[2] / way[:, 2])[:, None]
    wide = replace(LAMPS, lamps=(replace(PANEL, shape=Panel(1.5, 1.5)),))
    seen = (np.abs(met[:, :2] - PANEL.center[:2]) < 0.75).all(axis=1)
    assert seen.sum() > 400
    light = records.light + np.where(seen, 0.03 * LAMPS.radiosity[0], 0.0).astype(np.float32)
    gloss = found(replace(records, light=light, clipped=np.zeros(light.size, dtype=np.bool_)), wide)
    assert gloss.specularity == pytest.approx(0.03, rel=0.05)


def test_the_rougher_a_floor_is_the_less_of_a_bright_spot_and_the_more_of_its_surroundings_it_shows() -> None:
    """A spot of 12° about the mirrored eye, which facets of up to 6° show: exp(-(tan 6° / α)²) of them are steeper."""
    toward = np.array([[0.6, 0.0, 0.8]])
    mirror, up = np.array([-0.6, 0.0, 0.8]), np.array([[0.0, 0.0, 1.0]])

    def spot(_: FloatArray, ways: FloatArray) -> FloatArray:
        return np.where(ways @ mirror > np.cos(np.radians(12.0)), 1.0, 0.2)

    rest = _rest_of_room(np.zeros((1, 3)), up, toward, spot)[:, 0]
    expected = 1.0 - 0.8 * np.exp(-((np.tan(np.radians(6.0)) / ROUGHNESS) ** 2))
    np.testing.assert_allclose(rest, expected, atol=0.2)  # six directions, of three roughnesses
    assert (np.diff(rest) <= 1e-9).all()
    assert rest[0] == pytest.approx(1.0, abs=0.01)


def test_a_room_of_which_less_than_half_is_known_in_the_lobe_is_not_known() -> None:
    toward, up = np.array([[0.6, 0.0, 0.8]]), np.array([[0.0, 0.0, 1.0]])
    for share, is_known in ((0.2, False), (0.4, True)):  # two of six directions, and three
        told: list[int] = []

        def some(_: FloatArray, ways: FloatArray, told: list[int] = told, share: float = share) -> FloatArray:
            told.append(len(told) % 6)
            return np.full(len(ways), 0.5 if told[-1] < 6 * share else np.nan)

        assert np.isfinite(_rest_of_room(np.zeros((1, 3)), up, toward, some)).all() == is_known


def test_views_beside_edges_which_a_pose_lays_elsewhere_count_little() -> None:
    records, generator = walk(0.04, 0.12), np.random.default_rng(6)
    beside = records.frame % 2 == 1
    wrong = np.where(beside, np.exp(0.4 * generator.normal(size=beside.size)), 1.0)
    light = (records.light * wrong).astype(np.float32)
    uneven = np.where(beside, 0.8, records.uneven).astype(np.float32)
    gloss, known = found(replace(records, light=light, uneven=uneven)), found(seen_by(records, range(0, 40, 2)))
    assert gloss.specularity == pytest.approx(known.specularity, rel=0.1)
    assert gloss.roughness == pytest.approx(known.roughness, rel=0.1)


def test_a_matt_floor_is_matt_although_gains_are_off() -> None:
    assert found(walk(0.0, 0.1, gain=0.04)).matt


def test_a_highlight_that_two_frames_show_and_three_do_not_is_not_told() -> None:
    """An error of a few frames, as a spot of sun that came and went."""
    matt, glossy = walk(0.0, 0.1, gain=0.0), walk(0.03, 0.1, gain=0.0)
    light = np.where(np.isin(matt.frame, [0, 13]), glossy.light, matt.light)
    gloss = found(seen_by(replace(matt, light=light), [0, 13, 5, 20, 33]))
    assert gloss.specularity > MIN_SPECULARITY
    assert gloss.gain > MIN_GAIN
    assert gloss.matt == NOT_TOLD


def test_two_frames_of_a_few_places_are_no_proof() -> None:
    gloss = found(seen_by(walk(0.01, 0.1, gain=0.0), [0, 20], places=60))
    assert gloss.specularity > MIN_RATIO * gloss.specularity_deviation
    assert gloss.matt == NOT_TOLD


def test_a_lamp_that_something_hides_from_the_floor_is_not_mirrored_in_it() -> None:
    plate = np.array([[0, 0, 2], [3, 0, 2], [3, 3, 2], [0, 3, 2.0]])
    vertices = np.concatenate([FLOOR.vertices, plate])
    covered = bare_scan(vertices, np.concatenate([FLOOR.faces, [[4, 6, 5], [4, 7, 6]]]))
    assert not found(walk(0.04, 0.1)).matt
    assert found(walk(0.04, 0.1), scan=covered).matt == NO_HIGHLIGHT


def test_a_bright_wall_that_is_mirrored_tells_gloss_as_a_lamp_does() -> None:
    records = walk(0.0, 0.1)
    toward = records.camera[records.frame] - records.points[records.place]

    def wall(_: FloatArray, ways: FloatArray) -> FloatArray:
        return np.where(ways[:, 0] > 0.0, 4.0, 0.0)

    light = records.light + np.where(toward[:, 0] < 0.0, 0.05 * 4.0, 0.0).astype(np.float32)  # mirrored along x
    behind = replace(PANEL, normal=np.array([0.0, 0.0, 1.0]))
    gloss = found(replace(records, light=light), replace(LAMPS, lamps=(behind,)), mirrored=wall)
    assert gloss.specularity == pytest.approx(0.05, abs=3.0 * gloss.specularity_deviation)
    assert not gloss.matt


def test_what_is_mirrored_of_a_scan_is_its_picture_without_lamps_and_holes() -> None:
    """A wall to the right in grey, a lamp's plate above it, and nothing to the left."""
    corners = np.array([[2, -1, 0], [2, 1, 0], [2, 1, 2], [2, -1, 2.0]])
    wall = bare_scan(corners, np.array([[0, 2, 1], [0, 3, 2]]))
    grey = replace(wall.appearance, corner_color=np.full((2, 3, 3), 0.5), color_source=np.full(2, PHOTOGRAPHED))
    scan = replace(wall, appearance=grey)
    lamp = replace(PANEL, center=np.array([2.0, 0.0, 1.7]), normal=np.array([-1.0, 0.0, 0.0]), shape=Panel(0.4, 0.4))
    light = mirrored_in(scan, RayCaster(scan), [lamp])
    origins = np.tile([0.0, 0.0, 0.5], (3, 1))
    shown = light(origins, np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 1.2], [-1.0, 0.0, 0.0]]))
    assert shown[0] == pytest.approx(scan.face_colors().mean())
    assert shown[1] == 0.0
    assert np.isnan(shown[2])


def test_a_highlight_that_is_cut_at_white_in_part_still_tells_and_is_not_taken_for_a_dull_one() -> None:
    records = walk(0.04, 0.08, white=0.45)
    assert 0.01 < records.clipped.mean() < 0.2
    gloss = found(records)
    assert not gloss.matt
    assert abs(gloss.specularity - 0.04) < 3.0 * gloss.specularity_deviation


def test_a_floor_that_no_frame_shows_from_where_the_lamp_is_mirrored_is_matt() -> None:
    behind = replace(PANEL, normal=np.array([0.0, 0.0, 1.0]))
    assert found(walk(0.04, 0.1), replace(LAMPS, lamps=(behind,))).matt == NO_HIGHLIGHT


def test_a_part_of_few_places_is_matt() -> None:
    records = walk(0.04, 0.1)
    part = np.where(np.arange(400) < 10, 0, -1)
    (gloss,) = gloss_of_parts(records, part, 1, LAMPS, RayCaster(FLOOR), dark, np.random.default_rng(0))
    assert gloss.matt == TOO_FEW


def test_a_rough_meshs_normals_are_smoothed_but_not_over_an_edge() -> None:
    generator = np.random.default_rng(1)
    floor = np.column_stack([generator.uniform(0, 1, (2000, 2)), np.zeros(2000)])
    wall = floor[:, [2, 0, 1]]
    normals = np.repeat([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], 2000, axis=0) + 0.1 * generator.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    smooth = smoothed(np.concatenate([floor, wall]), normals)
    assert np.degrees(np.arccos(np.clip(smooth[:2000, 2], -1, 1))).mean() < 2.0
    assert np.degrees(np.arccos(np.clip(smooth[2000:, 0], -1, 1))).mean() < 2.0


def test_what_frames_show_is_kept_and_read_back(tmp_path: Path) -> None:
    points = np.random.default_rng(0).uniform(0, 1, (500, 3))
    recorder = Recorder(500, 1.0, np.random.default_rng(2))
    seen = np.arange(0, 500, 2)
    light = np.linspace(0, 1, seen.size)[:, None] * [1.0, 2.0, 3.0]
    recorder.add(0, seen, light, np.zeros(seen.size), light[:, 0] > 0.5)
    normals = np.tile([0.0, 0.0, 1.0], (400, 1))
    records = recorder.records(points=points[recorder.texels], normals=normals, camera=np.zeros((1, 3))).scaled(0.5)
    assert len(records.points) == 400  # of a square metre, 5 cm apart
    assert len(np.unique(recorder.texels)) == 400
    records.save(tmp_path)
    read = FrameRecords.load(tmp_path)
    assert read is not None
    number = np.array([np.argmin(np.linalg.norm(points - each, axis=1)) for each in read.points[read.place]])
    np.testing.assert_allclose(read.light, light[np.searchsorted(seen, number), 1] * 0.5, rtol=1e-6)
    np.testing.assert_array_equal(read.clipped, light[np.searchsorted(seen, number), 0] > 0.5)
    assert FrameRecords.load(tmp_path / "nowhere") is None


@pytest.mark.parametrize("damage", ["cut", "text", "a place beyond", "lengths"])
def test_damaged_records_are_one_clear_error(tmp_path: Path, damage: str) -> None:
    walk(0.04, 0.1).save(tmp_path)
    path = tmp_path / RECORDS_FILE
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-200])
    elif damage == "text":
        path.write_text("not arrays", encoding="utf-8")
    else:
        arrays = read_arrays(path)
        changed = {"place": arrays["place"] + 1} if damage == "a place beyond" else {"light": arrays["light"][1:]}
        write_arrays(path, **{**arrays, **changed})
    with pytest.raises(ScanError, match="Run the scan stage again"):
        FrameRecords.load(tmp_path)


def _materials(**changes: object) -> MaterialMap:
    material = Material(
        name="floor", category="unknown", reflectance=WHITE.scaled(0.3), source="default", provenance="recovered",
        confidence=1.0, measured_range_nm=(380.0, 780.0), color=(0.3, 0.3, 0.3),
    )  # fmt: skip
    return MaterialMap(
        materials=(replace(material, **changes),), face_material=np.zeros(2, dtype=int), face_color=np.zeros((2, 3)),
        face_seen=np.ones(2),
    )  # fmt: skip


GLOSSY = GlossOfPart(specularity=0.05, specularity_deviation=0.01, roughness=0.1, roughness_deviation=0.01, gain=20.0)


def test_a_glossy_material_throws_back_what_it_did_not_scatter() -> None:
    (material,) = with_gloss(_materials(), [GLOSSY]).materials
    assert (material.specularity, material.roughness) == (0.05, 0.1)
    np.testing.assert_allclose(material.reflectance.values, 0.35)
    (white,) = with_gloss(_materials(reflectance=WHITE.scaled(MAX_REFLECTANCE)), [GLOSSY]).materials
    assert white.reflectance.values.max() <= MAX_REFLECTANCE
    assert gloss_in_words([GLOSSY]) == "; gloss of 1 of 1 materials from the frames"


@pytest.mark.parametrize("changes", [{"provenance": "assigned"}, {"kind": "glass", "transmittance": 0.5}])
def test_what_is_assigned_and_glass_keep_their_own_gloss(changes: dict[str, object]) -> None:
    before = _materials(**changes)
    assert with_gloss(before, [GLOSSY]).materials[0] == before.materials[0]


def test_where_nothing_is_told_a_material_stays_as_it_was() -> None:
    before = _materials()
    assert with_gloss(before, [replace(GLOSSY, matt=NO_HIGHLIGHT)]).materials[0] == before.materials[0]
    assert with_gloss(before, []) is before
    assert gloss_in_words([]) == ""
