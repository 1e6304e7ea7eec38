import numpy as np
import pytest
import trimesh

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.texture_atlas import PADDING_PX, Atlas, split_at_charts, unwrap
from research.virtual_rooms.phone import ScannedShape, scan_shape
from research.virtual_rooms.room_plan import RoomPlan
from research.virtual_rooms.true_room import TrueRoom


@pytest.fixture(scope="module")
def shape(room: TrueRoom, plan: RoomPlan) -> ScannedShape:
    return scan_shape(room, plan.file.phone, np.random.default_rng(7))


@pytest.fixture(scope="module")
def atlas(room: TrueRoom, shape: ScannedShape) -> Atlas:
    return unwrap(shape.vertices, shape.faces, room.normals[shape.true_face], 512)


def test_texture_coordinates_lie_inside_the_image(atlas: Atlas) -> None:
    assert atlas.corner_uv.min() > 0
    assert atlas.corner_uv.max() < 1


def test_a_triangle_has_the_area_that_it_shows_along_its_chart_at_one_scale(atlas: Atlas, shape: ScannedShape) -> None:
    corners = shape.vertices[shape.faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = 0.5 * np.einsum("fc,fc->f", crosses, atlas.chart_normal[atlas.face_chart])
    px = atlas.corner_px
    edge1, edge2 = px[:, 1] - px[:, 0], px[:, 2] - px[:, 0]
    drawn = 0.5 * (edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0])
    # Rows count downwards, so that what is not mirrored turns the other way round.
    assert drawn == pytest.approx(-shown * atlas.pixels_per_m**2, abs=1e-6)


def test_charts_do_not_overlap_and_keep_their_distance(atlas: Atlas) -> None:
    rows, columns = np.nonzero(atlas.covered)
    chart = np.full(atlas.covered.shape, -1)
    chart[rows, columns] = atlas.face_chart[atlas.texel_face[rows, columns]]
    for step in range(1, PADDING_PX):
        for one, other in ((chart[:, step:], chart[:, :-step]), (chart[step:], chart[:-step])):
            both = (one >= 0) & (other >= 0)
            assert np.all(one[both] == other[both])


def test_every_sizeable_triangle_is_seen_in_the_image(atlas: Atlas, shape: ScannedShape) -> None:
    seen = np.bincount(atlas.texel_face[atlas.covered], minlength=len(shape.faces))
    # Triangles on folded edges lie behind others in their chart.
    assert (seen > 0).mean() > 0.95


def test_barycentric_weights_give_back_the_pixel(atlas: Atlas) -> None:
    rows, columns = np.nonzero(atlas.covered)
    weights = atlas.barycentric(rows, columns)
    again = np.einsum("nk,nkc->nc", weights, atlas.corner_px[atlas.texel_face[rows, columns]])
    off = np.abs(again - np.stack([columns, rows], axis=1)).max(axis=1)
    # A pixel that a triangle's border crosses may have its centre outside; the narrowest tips are two pixels away.
    assert np.median(off) < 1e-6
    assert off.max() < 2.5


def test_split_vertices_repeat_positions_and_keep_the_triangles(atlas: Atlas, shape: ScannedShape) -> None:
    origin, faces, uv = split_at_charts(shape.faces, atlas)
    assert np.array_equal(origin[faces], shape.faces)
    assert uv[faces] == pytest.approx(atlas.corner_uv)
    assert len(origin) < 1.4 * len(shape.vertices)


def test_an_image_too_small_for_its_charts_is_refused() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    directions = np.asarray(mesh.face_normals)
    with pytest.raises(ScanError, match="texture"):
        unwrap(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64), directions, 8)
