from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.texture_atlas import Atlas, unwrap
from lidarspectra.spectra.spectrum import Spectrum
from research.virtual_rooms.camera import (
    SurfaceLight,
    _corner_colors,
    filmic_curve,
    material_colors,
    photograph,
    tone_curve,
    white_balance_matrix,
)
from research.virtual_rooms.phone import ScannedShape, scan_shape
from research.virtual_rooms.room_plan import CameraSection, RoomPlan
from research.virtual_rooms.true_room import TrueRoom

WAVELENGTHS = np.arange(380.0, 785.0, 5.0)
PLAIN = CameraSection(texture_px=256, exposure_spread=0.0, noise=0.0, tone=0.0)


@pytest.fixture(scope="module")
def shape(room: TrueRoom, plan: RoomPlan) -> ScannedShape:
    return scan_shape(room, plan.file.phone, np.random.default_rng(7))


@pytest.fixture(scope="module")
def atlas(room: TrueRoom, shape: ScannedShape) -> Atlas:
    return unwrap(shape.vertices, shape.faces, room.normals[shape.true_face], 256)


def even_light(room: TrueRoom, spectrum: np.ndarray | None = None) -> SurfaceLight:
    points, faces = room.sample(0.08, np.random.default_rng(0))
    shone = np.ones(WAVELENGTHS.size) if spectrum is None else spectrum
    return SurfaceLight(
        positions=points,
        normals=room.normals[faces],
        wavelengths_nm=WAVELENGTHS,
        direct=np.zeros((len(points), WAVELENGTHS.size)),
        reflected=np.tile(shone, (len(points), 1)),
    )


def no_direct_light(positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return np.zeros((len(positions), WAVELENGTHS.size))


def test_in_even_white_light_colours_are_in_the_ratio_of_reflectances(room: TrueRoom) -> None:
    light = even_light(room)
    colors = material_colors(room, light, light.irradiance, PLAIN.model_copy(update={"white_balance": 1.0}))
    grey, white = colors[0, 0], colors[0, 1]
    # The 5 nm sums and the printed matrices of sRGB and Bradford close to a thousandth.
    assert white / grey == pytest.approx(0.8 / 0.3, rel=1e-6)
    assert white / white.mean() == pytest.approx(1.0, abs=2e-3)


def test_full_white_balance_takes_the_colour_of_the_light_out_and_none_leaves_it(room: TrueRoom) -> None:
    warm = Spectrum(wavelengths_nm=np.array([380.0, 780.0]), values=np.array([0.2, 1.8])).at(
        WAVELENGTHS, outside="zero"
    )
    light = even_light(room, warm)
    balanced, left = (
        material_colors(room, light, light.irradiance, PLAIN.model_copy(update={"white_balance": degree}))[0, 1]
        for degree in (1.0, 0.0)
    )
    assert np.ptp(balanced) / balanced.mean() < 5e-3
    assert left[0] > 1.3 * left[2]


def test_white_balance_takes_its_white_to_d65() -> None:
    warm = np.array([1.09, 1.0, 0.36])
    from lidarspectra.spectra.colorimetry import SRGB_WHITE_XYZ

    assert white_balance_matrix(warm, 1.0) @ warm == pytest.approx(SRGB_WHITE_XYZ, rel=1e-9)
    assert white_balance_matrix(warm, 0.0) == pytest.approx(np.eye(3), abs=1e-9)


def test_the_tone_curve_keeps_black_and_white_rises_and_is_cut_at_white() -> None:
    x = np.linspace(0, 2, 201)
    y = tone_curve(x, 0.6)
    assert y[0] == 0
    assert y[100] == pytest.approx(1.0)
    assert np.all(np.diff(y) >= 0)
    assert y.max() == 1.0
    below = y[1:100]
    assert below / (1 + 0.6 - 0.6 * below) == pytest.approx(x[1:100])


def test_the_filmic_curve_has_a_toe_that_no_lifted_one_has() -> None:
    x = np.linspace(0, 2, 201)
    y = filmic_curve(x)
    assert y[0] == 0
    assert y[100:] == pytest.approx(1.0)
    assert np.all(np.diff(y) >= 0)
    assert filmic_curve(np.array([0.005]))[0] < 0.005  # darker than plain
    assert filmic_curve(np.array([0.3]))[0] > 0.3  # and lighter above
    steep = np.diff(y)[:100]
    assert np.argmax(steep) > 2  # bent both ways, where a lifted curve is steepest at black


def test_a_filmic_camera_shows_what_is_light_lighter_than_a_plain_one(
    room: TrueRoom, shape: ScannedShape, atlas: Atlas
) -> None:
    light = even_light(room)
    plain, filmic = (
        photograph(room, shape, atlas, light, no_direct_light, settings, np.random.default_rng(0))
        for settings in (PLAIN, PLAIN.model_copy(update={"curve": "filmic"}))
    )
    light_too = atlas.covered & (plain.min(axis=2) > 140) & (plain.max(axis=2) < 250)
    assert light_too.sum() > 50
    assert (filmic[light_too].astype(int) > plain[light_too]).all()


def test_the_lit_face_of_a_lamp_is_white_and_nothing_else_is(room: TrueRoom, shape: ScannedShape, atlas: Atlas) -> None:
    texture = photograph(room, shape, atlas, even_light(room), no_direct_light, PLAIN, np.random.default_rng(0))
    lamp = np.array([surface.lamp is not None for surface in room.surfaces])
    lit_faces = lamp[room.face_surface[shape.true_face]] & (room.normals[shape.true_face][:, 2] < -0.9)
    center = lit_faces & (np.abs(shape.vertices[shape.faces].mean(axis=1) - [0.8, 0.6, 1.36]).max(axis=1) < 0.12)
    shown = atlas.covered & center[atlas.texel_face]
    assert shown.sum() > 50
    assert np.all(texture[shown] == 255)
    floor = atlas.covered & (room.face_surface[shape.true_face] == 0)[atlas.texel_face]
    assert texture[floor].max() < 200


def test_a_surface_in_half_the_light_is_half_as_bright(room: TrueRoom, shape: ScannedShape, atlas: Atlas) -> None:
    light = even_light(room)
    west = light.positions[:, 0] < 0.8
    dimmed = replace(light, reflected=light.reflected * np.where(west, 0.5, 1.0)[:, None])
    texture = photograph(room, shape, atlas, dimmed, no_direct_light, PLAIN, np.random.default_rng(0))
    linear = (texture / 255.0) ** 2.2
    centers = shape.vertices[shape.faces].mean(axis=1)
    floor = room.face_surface[shape.true_face] == 0
    dark, bright = (
        np.median(linear[atlas.covered & (floor & side)[atlas.texel_face]])
        for side in (centers[:, 0] < 0.6, centers[:, 0] > 1.0)
    )
    # Eight bits at these levels are good to 2 %, the exponent 2.2 for sRGB's curve to 5 %.
    assert dark / bright == pytest.approx(0.5, abs=0.04)


def test_light_that_rises_up_a_wall_is_shown_right_under_the_ceiling(
    room: TrueRoom, shape: ScannedShape, atlas: Atlas
) -> None:
    light = even_light(room)
    rising = replace(light, reflected=light.reflected * light.positions[:, 2:].clip(0.0))
    corners = shape.vertices[shape.faces]
    upright = np.abs(room.normals[shape.true_face][:, 2]) < 0.1
    wall = upright & (corners[:, :, 2].min(axis=1) > 1.3) & (corners[:, :, 2].max(axis=1) < 1.4)
    assert wall.sum() > 30
    shown = _corner_colors(room, shape, atlas, rising, no_direct_light, PLAIN)[wall][:, :, 1, 1]  # in white, as green
    even = material_colors(room, light, light.irradiance, PLAIN)[0, 1, 1]
    # A mean over the points below falls short by 1.5 %.
    assert np.median(shown / (even * corners[wall][:, :, 2])) == pytest.approx(1.0, abs=5e-3)


def test_a_board_shows_nothing_of_the_light_on_its_other_side(
    room: TrueRoom, shape: ScannedShape, atlas: Atlas
) -> None:
    light = even_light(room)
    below = light.normals[:, 2] < -0.9
    dark = replace(light, reflected=light.reflected * np.where(below, 0.1, 1.0)[:, None])
    shown = _corner_colors(room, shape, atlas, dark, no_direct_light, PLAIN)[:, :, 0, 1].mean(axis=1)
    height = shape.vertices[shape.faces].mean(axis=1)[:, 2]
    level, facing = (height > 0.4) & (height < 0.55), room.normals[shape.true_face][:, 2]  # the table's board
    under, top = shown[level & (facing < -0.9)], shown[level & (facing > 0.9)]
    assert min(under.size, top.size) > 20
    # Rims show a little of both: a plane's value may be up to twice the most around.
    assert np.median(under) / np.median(top) == pytest.approx(0.1, abs=0.005)


def test_no_plane_leads_far_beyond_the_light_around(room: TrueRoom, shape: ScannedShape, atlas: Atlas) -> None:
    light = even_light(room)
    steps = np.where(light.positions[:, 0] > 0.8, 1.0, 0.02)[:, None]
    cut = replace(light, reflected=light.reflected * steps)
    shown = _corner_colors(room, shape, atlas, cut, no_direct_light, PLAIN)[:, :, 0, 1]
    even = material_colors(room, light, light.irradiance, PLAIN)[0, 0, 1]
    assert (1 + 1e-9) * shown.min() / even >= 0.5 * 0.02
    assert shown.max() / even <= (1 + 1e-9) * 2.0


def test_light_of_the_lamps_is_asked_for_on_the_true_surface(room: TrueRoom, shape: ScannedShape, atlas: Atlas) -> None:
    asked = []

    def remember(positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
        asked.append((positions, normals))
        return no_direct_light(positions, normals)

    _corner_colors(room, shape, atlas, even_light(room), remember, PLAIN)
    ((positions, normals),) = asked
    floor = (normals[:, 2] > 0.9) & (positions[:, 2] < 0.05)
    assert floor.sum() > 100
    assert np.abs(positions[floor, 2]).max() < 1e-9  # the scan's own corners are some millimetres off


def test_a_shadow_has_an_edge(room: TrueRoom, shape: ScannedShape, atlas: Atlas) -> None:
    def lamp_east(positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return (positions[:, :1] > 0.8) * np.ones(WAVELENGTHS.size)

    light = even_light(room)
    halved = replace(light, direct=lamp_east(light.positions, light.normals))
    shown = _corner_colors(room, shape, atlas, halved, lamp_east, PLAIN)[:, :, 0, 1]
    corners = shape.vertices[shape.faces]
    floor = (room.face_surface[shape.true_face] == 0)[:, None]
    # Light points stand 8 cm apart, and yet no corner beside the edge is between dark and bright.
    assert shown[floor & (corners[:, :, 0] > 0.81)] == pytest.approx(shown.max(), rel=1e-6)
    assert shown[floor & (corners[:, :, 0] < 0.79)] == pytest.approx(0.5 * shown.max(), rel=1e-6)


def test_the_same_seed_gives_the_same_picture(room: TrueRoom, shape: ScannedShape, atlas: Atlas) -> None:
    settings = CameraSection(texture_px=256)
    one, same, other = (
        photograph(room, shape, atlas, even_light(room), no_direct_light, settings, np.random.default_rng(seed))
        for seed in (1, 1, 2)
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_light_that_is_negative_nowhere_or_too_little_is_refused() -> None:
    points = np.zeros((20, 3))
    for irradiance in (np.full((20, 2), -1.0), np.zeros((20, 2)), np.ones((3, 2))):
        count = len(irradiance)
        with pytest.raises(ScanError):
            SurfaceLight(
                positions=points[:count],
                normals=points[:count],
                wavelengths_nm=np.array([400.0, 500.0]),
                direct=np.zeros_like(irradiance),
                reflected=irradiance,
            )
