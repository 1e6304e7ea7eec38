"""Lit lamps: found where they are painted, and nothing else taken for one."""

from functools import partial

import cv2
import numpy as np
import pytest

from lidarspectra.geometry.rays import caster_of
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.surfaces import Place
from lidarspectra.material.lit_lamps import evidence
from lidarspectra.material.lit_lamps.lit_lamps import CLEARANCE_M, BrightPatch, find_lit_lamps, search_lit_lamps
from lidarspectra.material.lit_lamps.outline_fit import fit_outline
from lidarspectra.material.lit_lamps.plane_picture import PlaneFrame, PlanePicture
from lidarspectra.radiance.scene.clearance import clear_lamps, hidden_light
from lidarspectra.room.room import find_room
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.init.summary import bright_places_advice

FLAT = Spectrum(wavelengths_nm=[400, 700], values=[1.0, 1.0])
NOISE_M = 0.005  # [m] of the mesh
PLACE_M = 0.01  # [m] two pixels of the painted texture
SIZE_M = 0.015  # [m] a rim of three pixels is blurred


def room_with(builder, ceiling, *, noise_m=NOISE_M, turn_deg=0.0, boxes=(), walls=None, holes=None):
    room = builder(step_m=0.1, noise_m=noise_m)
    blurred = cv2.GaussianBlur(ceiling.picture, (0, 0), 1.5)  # as a phone's picture is
    pictures = {"top": blurred, **(walls or {})}
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, pictures=pictures, holes=holes)
    for low, high, color in boxes:
        room.box(low, high, color=color)
    return room.scan(turn_deg=turn_deg)


def lamps_in(scan):
    return find_lit_lamps(scan, find_room(scan))


@pytest.fixture
def plain(ceiling):
    return ceiling((0.0, 0.0), (4.0, 3.0))


def test_a_panel_is_found_in_place_and_size(builder, plain) -> None:
    plain.rectangle((1.2, 1.7), (0.6, 0.6))
    (lamp,) = lamps_in(room_with(builder, plain))
    assert lamp.shape.word == "panel"
    np.testing.assert_allclose(lamp.center[:2], [1.2, 1.7], atol=PLACE_M)
    np.testing.assert_allclose(lamp.shape.size, [0.6, 0.6], atol=SIZE_M)
    np.testing.assert_allclose(lamp.normal, [0, 0, -1])
    assert lamp.rotation_deg == pytest.approx(0.0, abs=1.5)
    assert lamp.saturated_share > 0.9
    assert lamp.confidence > 0.8


@pytest.mark.parametrize("turn_deg", [0.0, 30.0, 90.0, 120.0, -20.0])
def test_a_strip_is_turned_as_painted(builder, plain, turn_deg) -> None:
    plain.rectangle((2.0, 1.5), (1.2, 0.15), turn_deg=turn_deg)
    (lamp,) = lamps_in(room_with(builder, plain))
    assert lamp.shape.word == "strip"
    np.testing.assert_allclose(lamp.shape.size, [1.2, 0.15], atol=SIZE_M)
    # About a normal that points down a turn runs the other way round than seen from above.
    difference = (lamp.rotation_deg + turn_deg + 90.0) % 180.0 - 90.0
    assert difference == pytest.approx(0.0, abs=1.0)
    assert -45.0 <= lamp.rotation_deg < 135.0


def test_a_lamp_turns_with_its_room(builder, plain) -> None:
    plain.rectangle((2.0, 1.5), (1.2, 0.3))
    (lamp,) = lamps_in(room_with(builder, plain, turn_deg=30.0))
    turn = np.radians(30.0)
    expected = [np.cos(turn) * 2.0 - np.sin(turn) * 1.5, np.sin(turn) * 2.0 + np.cos(turn) * 1.5]
    np.testing.assert_allclose(lamp.center[:2], expected, atol=PLACE_M)
    assert lamp.rotation_deg == pytest.approx(-30.0, abs=1.0)


@pytest.mark.parametrize("diameter", [0.08, 0.12, 0.3])
def test_a_downlight_is_a_disc(builder, plain, diameter) -> None:
    plain.disc((3.1, 0.8), diameter)
    (lamp,) = lamps_in(room_with(builder, plain))
    assert lamp.shape.word == "disc"
    np.testing.assert_allclose(lamp.center[:2], [3.1, 0.8], atol=PLACE_M)
    assert lamp.shape.size[0] == pytest.approx(diameter, abs=SIZE_M)
    assert lamp.shape.area == pytest.approx(np.pi / 4 * lamp.shape.size[0] ** 2)


def test_strips_in_one_line_with_gaps_stay_apart(builder, plain) -> None:
    for x in (0.7, 1.4, 2.1, 2.8):
        plain.rectangle((x, 1.5), (0.6, 0.13))
    lamps = lamps_in(room_with(builder, plain))
    np.testing.assert_allclose([lamp.center[0] for lamp in lamps], [0.7, 1.4, 2.1, 2.8], atol=PLACE_M)


def test_eleven_downlights_and_two_panels_are_all_found(builder, plain) -> None:
    places = [(x, y) for x in (0.5, 1.5, 2.5, 3.5) for y in (0.4, 1.5, 2.6)][:11]
    for place in places:
        plain.disc(place, 0.1)
    plain.rectangle((1.0, 0.95), (0.6, 0.6))
    plain.rectangle((3.0, 2.05), (0.6, 0.3))
    lamps = lamps_in(room_with(builder, plain))
    assert sorted(lamp.shape.word for lamp in lamps) == ["disc"] * 11 + ["panel"] * 2


@pytest.mark.parametrize("noise_m", [0.002, 0.012])
def test_lamps_hang_before_the_level_of_their_ceiling_and_none_of_their_light_is_lost_in_its_noise(
    builder, plain, noise_m: float
) -> None:
    plain.rectangle((1.2, 1.7), (0.6, 0.6))
    plain.disc((3.0, 1.0), 0.1)
    scan = room_with(builder, plain, noise_m=noise_m)
    found = lamps_in(scan)
    assert [lamp.center[2] for lamp in found] == pytest.approx([2.5 - CLEARANCE_M] * 2, abs=noise_m)
    lamps = [
        Lamp(name=str(number), shape=lamp.shape, center=lamp.center, normal=lamp.normal, flux=FLAT)
        for number, lamp in enumerate(found)
    ]
    clear = clear_lamps(lamps, scan)
    caster = caster_of(clear.scan)
    for before, after in zip(lamps, clear.lamps, strict=True):
        assert hidden_light(after, caster).share <= 0.005  # not pressed back, 2 cm of noise took 30 %
        np.testing.assert_allclose(after.center, before.center, atol=0.01)


def bright_paint(plain, center, radius_m: float, brightest: float) -> None:
    """A part of the ceiling that is nearly cut at white, and fades: beside a strong lamp or a window."""
    distance = np.hypot(plain.x - center[0], plain.y - center[1])[..., None]
    plain.picture = np.maximum(plain.picture, brightest * np.exp(-0.5 * (distance / radius_m) ** 4))


@pytest.mark.parametrize("brightest", [215.0, 232.0])  # of 255: .68 and .81 in linear light
@pytest.mark.parametrize("diameter", [0.12, 0.18])
def test_a_downlight_is_found_in_paint_that_is_nearly_cut_at_white(builder, plain, brightest, diameter) -> None:
    bright_paint(plain, (2.0, 1.5), 0.6, brightest)
    plain.disc((1.9, 1.6), diameter)
    plain.disc((3.6, 0.5), 0.15)
    found = lamps_in(room_with(builder, plain))
    assert len(found) == 2
    hidden = min(found, key=lambda lamp: lamp.center[0])
    np.testing.assert_allclose(hidden.center[:2], [1.9, 1.6], atol=PLACE_M)
    assert hidden.shape.size[0] == pytest.approx(diameter, abs=SIZE_M)
    assert hidden.confidence < 0.5, "it is told as less sure than a lamp on a darker ceiling"


@pytest.mark.parametrize("brightest", [232.0, 300.0, 400.0])
def test_paint_that_is_cut_at_white_is_no_lamp(builder, plain, brightest) -> None:
    bright_paint(plain, (2.0, 1.5), 0.6, brightest)
    plain.rectangle((1.9, 1.6), (0.3, 0.3), color=240.0)  # a vent of a lighter white
    assert lamps_in(room_with(builder, plain)) == ()


def drum(half_m: float, *, height_m: float = 0.08, color=(255, 255, 255)):
    """An opal lamp below the ceiling, as a box."""
    low, high = [2.0 - half_m, 1.5 - half_m, 2.49 - height_m], [2.0 + half_m, 1.5 + half_m, 2.49]
    return low, high, color


@pytest.mark.parametrize("radius_m", [0.5, 0.8])
def test_a_lamp_that_lights_the_ceiling_beside_it_to_white_is_found_where_it_stands_out(
    builder, plain, radius_m
) -> None:
    bright_paint(plain, (2.0, 1.5), radius_m, 400.0)
    (lamp,) = lamps_in(room_with(builder, plain, boxes=[drum(0.2)]))
    np.testing.assert_allclose(lamp.center, [2.0, 1.5, 2.41 - CLEARANCE_M], atol=0.02)
    np.testing.assert_allclose(lamp.shape.size, [0.4, 0.4], atol=0.03)


@pytest.mark.parametrize(
    "body",
    [drum(0.05), drum(0.2, height_m=0.02), drum(0.2, height_m=0.3), drum(0.2, color=(225, 225, 225))],
    ids=["a smoke detector", "a flat cover", "a boxed-in duct", "a grey box"],
)
def test_what_stands_out_of_a_pool_of_light_and_is_no_lamp(builder, plain, body) -> None:
    bright_paint(plain, (2.0, 1.5), 0.6, 400.0)
    assert lamps_in(room_with(builder, plain, boxes=[body])) == ()


def test_what_hangs_low_in_a_pool_of_light_is_told_as_a_possible_lamp(builder, plain) -> None:
    """A tube of light, or a white board in the light of a lamp: the picture, white all over, does not say which."""
    bright_paint(plain, (2.0, 1.5), 0.8, 400.0)
    tube = ([1.5, 1.45, 1.9], [2.5, 1.55, 1.96], (255, 255, 255))
    scan = room_with(builder, plain, noise_m=0.002, boxes=[tube])
    search = search_lit_lamps(scan, find_room(scan))
    assert search.lamps == ()
    (advice,) = bright_places_advice(search.left_out)
    assert "0.10 m² at (2.0, 1.5, 1.9) m" in advice


@pytest.mark.parametrize(
    ("what", "draw"),
    [
        ("a pool of light", lambda c: c.glow((2.0, 1.5), 0.35)),
        ("a white tile", lambda c: c.rectangle((2.0, 1.5), (0.6, 0.6), color=175.0)),
        ("a dim ghost of a lamp", lambda c: c.rectangle((2.0, 1.5), (0.55, 0.12), color=200.0)),
        ("a wall of light", lambda c: c.rectangle((2.0, 1.5), (2.4, 1.6))),
        ("a speck", lambda c: c.disc((2.0, 1.5), 0.02)),
        ("a ring", lambda c: (c.disc((2.0, 1.5), 0.5), c.disc((2.0, 1.5), 0.42, color=60.0))),
        ("a blue sign", lambda c: c.rectangle((2.0, 1.5), (0.4, 0.2), color=(10.0, 20.0, 255.0))),
        ("a long cross", lambda c: (c.rectangle((2, 1.5), (1.4, 0.1)), c.rectangle((2, 1.5), (0.1, 1.4)))),
        ("nothing", lambda c: None),
    ],
)
def test_what_is_bright_but_no_lamp_is_left_out(builder, plain, what, draw) -> None:
    draw(plain)
    assert lamps_in(room_with(builder, plain)) == (), what


def test_a_ghost_beside_a_lamp_changes_neither_its_place_nor_its_size(builder, plain) -> None:
    plain.rectangle((1.88, 1.5), (0.1, 0.55), color=205.0)
    plain.rectangle((2.0, 1.5), (0.13, 0.55))
    scan = room_with(builder, plain)
    search = search_lit_lamps(scan, find_room(scan))
    (lamp,) = search.lamps
    np.testing.assert_allclose(lamp.center[:2], [2.0, 1.5], atol=PLACE_M)
    np.testing.assert_allclose(lamp.shape.size, [0.55, 0.13], atol=0.02)


@pytest.mark.parametrize("depth_m", [0.2, 0.4])
def test_a_skylight_is_no_lamp(builder, plain, depth_m) -> None:
    # A shaft: its bright glass lies above the ceiling.
    room = builder(step_m=0.05, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, pictures={"top": plain.picture}, holes={"top": (0.4, 0.6, 0.4, 0.6)})
    room.box([1.6, 1.2, 2.5], [2.4, 1.8, 2.5 + depth_m], inward=True, leave_out=("bottom",), color=(255, 255, 255))
    assert lamps_in(room.scan()) == ()


def test_a_suspended_panel_is_found_at_its_own_height(builder, plain) -> None:
    panel = ([1.4, 1.2, 2.0], [2.6, 1.5, 2.04], (255, 255, 255))
    (lamp,) = lamps_in(room_with(builder, plain, noise_m=0.002, boxes=[panel]))
    np.testing.assert_allclose(lamp.center[:2], [2.0, 1.35], atol=0.02)
    assert lamp.center[2] == pytest.approx(2.0 - CLEARANCE_M, abs=0.015)
    np.testing.assert_allclose(lamp.shape.size, [1.2, 0.3], atol=0.03)


@pytest.mark.parametrize("half_m", [0.2, 0.09])  # around a small one, more of the ceiling is seen than of its shade
def test_a_pendant_over_a_table_is_found_where_it_hangs(builder, plain, half_m: float) -> None:
    pendant = ([2.0 - half_m, 1.7 - half_m, 1.35], [2.0 + half_m, 1.7 + half_m, 1.39], (255, 255, 255))
    table = ([1.4, 1.2, 0.7], [2.6, 2.0, 0.74], (255, 255, 255))
    (lamp,) = lamps_in(room_with(builder, plain, noise_m=0.002, boxes=[pendant, table]))
    np.testing.assert_allclose(lamp.center, [2.0, 1.7, 1.35 - CLEARANCE_M], atol=0.015)


def test_what_hangs_before_a_ceiling_nearly_as_bright_is_told_as_a_possible_lamp(builder, ceiling) -> None:
    bright = ceiling((0.0, 0.0), (4.0, 3.0), base=(178, 178, 178))  # .45 of white: by day, near a window
    strip = ([1.3, 1.4, 2.0], [2.7, 1.55, 2.04], (255, 255, 255))
    scan = room_with(builder, bright, noise_m=0.002, boxes=[strip])
    search = search_lit_lamps(scan, find_room(scan))
    assert search.lamps == ()
    (advice,) = bright_places_advice(search.left_out)
    assert "at (2.0, 1.5, 2.0) m. If that is lamps, add them" in advice
    assert list(bright_places_advice([BrightPatch(center=np.zeros(3), area_m2=1.0, reason="too large")])) == []
    assert not any(patch.is_lit_ceiling for patch in search.left_out if patch.may_be_lamp), "it hangs below it"


def test_a_bright_table_top_is_no_lamp(builder, plain) -> None:
    table = ([1.4, 1.2, 0.7], [2.6, 1.8, 0.74], (255, 255, 255))
    assert lamps_in(room_with(builder, plain, boxes=[table])) == ()


def wall_picture(painted, draw):
    picture = painted(4.0, 2.5)
    draw(picture)
    return picture


def test_a_window_a_screen_and_a_mirrored_lamp_on_a_wall_are_no_lamps(builder, painted, plain) -> None:
    def draw(picture):
        picture[100:260, 100:300] = 255.0  # a window
        picture[120:220, 420:600] = (90.0, 180.0, 255.0)  # a screen
        picture[60:90, 660:780] = 255.0  # a strip seen in glass

    # The picture's place on the wall does not matter here, only that it is on one.
    walls = {"south": wall_picture(painted, draw), "north": wall_picture(painted, draw)}
    assert lamps_in(room_with(builder, plain, walls=walls)) == ()


def test_a_wall_lamp_that_stands_out_of_its_wall_is_found(builder, plain) -> None:
    lamp_box = ([1.9, 2.9, 1.8], [2.1, 3.0, 2.0], (255, 255, 255))
    (lamp,) = lamps_in(room_with(builder, plain, noise_m=0.002, boxes=[lamp_box]))
    np.testing.assert_allclose(lamp.normal, [0, -1, 0], atol=0.02)
    np.testing.assert_allclose(lamp.center, [2.0, 2.9 - CLEARANCE_M, 1.9], atol=0.02)
    np.testing.assert_allclose(sorted(lamp.shape.size), [0.2, 0.2], atol=0.03)


def test_a_scan_without_colour_shows_no_lamp(builder, plain) -> None:
    room = builder(step_m=0.1)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, color=(255, 255, 255))
    scan = room.scan(known=False)
    assert find_lit_lamps(scan, find_room(scan)) == ()


def test_what_was_left_out_says_why(builder, plain) -> None:
    plain.rectangle((2.0, 1.5), (2.4, 1.6))
    scan = room_with(builder, plain)
    (patch,) = search_lit_lamps(scan, find_room(scan)).left_out
    assert "too large" in patch.reason
    assert patch.area_m2 == pytest.approx(2.4 * 1.6, rel=0.05)


@pytest.mark.parametrize(
    ("shape", "size", "turn"), [("strip", (80, 20), 25.0), ("panel", (60, 40), -40.0), ("disc", (50,), 0.0)]
)
def test_an_outline_is_fitted_to_a_ragged_patch(shape, size, turn) -> None:
    rng = np.random.default_rng(2)
    rows, columns = np.indices((160, 160))
    x, y = columns - 80.0, rows - 77.0
    angle = np.radians(turn)
    along, across = np.cos(angle) * x + np.sin(angle) * y, -np.sin(angle) * x + np.cos(angle) * y
    ragged = rng.normal(scale=1.0, size=x.shape)
    if shape == "disc":
        patch = np.hypot(x, y) + ragged <= size[0] / 2
    else:
        patch = (np.abs(along) + ragged <= size[0] / 2) & (np.abs(across) + ragged <= size[1] / 2)
    fit = fit_outline(patch)
    assert fit.shape == shape
    np.testing.assert_allclose(fit.center, [80, 77], atol=0.5)
    np.testing.assert_allclose(fit.size, size, atol=1.5)
    assert fit.angle_deg == pytest.approx(turn, abs=3.0)
    assert fit.overlap > 0.85


@pytest.mark.parametrize(
    "corner", [(0, 0), (60, 75), (150, 100)]
)  # of the patch: at an edge of the picture, and amid it
def test_what_a_patch_shows_is_the_same_to_the_bit_if_the_whole_picture_is_looked_at(monkeypatch, corner) -> None:
    rng = np.random.default_rng(6)
    shape = (190, 240)
    patch = np.zeros(shape, dtype=bool)
    patch[corner[0] : corner[0] + 40, corner[1] : corner[1] + 30] = rng.random((40, 30)) < 0.9
    usable, seen = rng.random(shape) < 0.9, rng.random(shape) < 0.95
    picture = PlanePicture(
        color=rng.random((*shape, 3)) * np.where(patch, 1.0, 0.6)[..., None],
        height=np.where(seen, rng.normal(scale=0.01, size=shape), np.nan),
        facing=rng.random(shape),
        seen=seen,
        start=np.zeros(2),
        pixel_m=0.0025,
    )
    looked = partial(
        evidence.gather_evidence, picture, usable & seen, patch, fit_outline(patch), kind="wall", around=0.3, core=0.6
    )
    near = looked()
    monkeypatch.setattr(evidence, "_around", lambda patch, pixels: (slice(None), slice(None)))
    for name, value in vars(looked()).items():
        np.testing.assert_array_equal(getattr(near, name), value)
    assert 0.0 < near.rim_m < 1.0
    assert near.contrast > 1.0


def test_axes_of_a_plane_are_those_of_a_lamp_rotation() -> None:
    for normal in ([0, 0, -1.0], [0, -1.0, 0], [1.0, 0, 0], [-1.0, 0, 0], [0.6, 0.8, 0]):
        place = Place.facing(np.zeros(3), np.array(normal, dtype=float))
        np.testing.assert_allclose(
            PlaneFrame(origin=np.zeros(3), normal=np.array(normal)).axes, [place.length, place.width], atol=1e-12
        )


def test_the_real_meeting_room_has_twelve_lit_strips_and_no_other_lamp(shared) -> None:
    from lidarspectra.hardware.phone.readers import read_scan

    scan = read_scan(shared / "scans" / "meeting-room" / "poly.glb")
    lamps = lamps_in(scan)
    assert [lamp.shape.word for lamp in lamps] == ["strip"] * 12
    # Read off the orthographic picture of the ceiling, 1 cm a pixel.
    seen = np.array(
        [
            *[(-0.84, 1.53), (-0.42, 1.53), (-0.83, 0.40), (-0.42, 0.40), (-0.83, -0.73), (-0.43, -0.73)],
            *[(1.22, 1.70), (1.63, 1.70), (1.25, 0.55), (1.68, 0.55), (1.24, -0.73), (1.79, -0.50)],
        ]
    )
    found = np.array([lamp.center[:2] for lamp in lamps])
    nearest = np.linalg.norm(seen[:, None] - found[None], axis=2).min(axis=1)
    # One strip is half washed out by the scan's own blending, which moves its centre by 8 cm.
    assert nearest.max() < 0.1
    assert np.median(nearest) < 0.03


def test_the_panels_of_the_office_scene_are_found(project) -> None:
    from lidarspectra.hardware.phone.readers import read_scan

    path = project / "scenes" / "office" / "scan.glb"
    if not path.exists():
        pytest.skip("scenes/office has not been built")
    lamps = lamps_in(read_scan(path))
    assert [lamp.shape.word for lamp in lamps] == ["panel", "panel"]
    np.testing.assert_allclose([lamp.center[:2] for lamp in lamps], [[0.85, 1.5], [2.25, 1.5]], atol=0.02)
    np.testing.assert_allclose([lamp.shape.size for lamp in lamps], [[0.6, 0.6], [0.6, 0.6]], atol=0.02)


@pytest.mark.parametrize("top_m", [3.1, 2.8, 2.2])
def test_lamps_of_a_room_with_another_ceiling_are_found(builder, plain, ceiling, top_m: float) -> None:
    plain.rectangle((1.2, 1.7), (0.6, 0.6))
    beside = ceiling((4.15, 0.0), (7.15, 3.0))
    beside.disc((5.0, 1.0), 0.12)
    rooms = builder(step_m=0.05, noise_m=NOISE_M)
    for low, high, painted in (([0, 0, 0], [4, 3, 2.5], plain), ([4.15, 0, 0], [7.15, 3, top_m], beside)):
        rooms.box(low, high, inward=True, pictures={"top": cv2.GaussianBlur(painted.picture, (0, 0), 1.5)})
    panel, disc = sorted(lamps_in(rooms.scan()), key=lambda lamp: lamp.center[0])
    assert (panel.shape.word, disc.shape.word) == ("panel", "disc")
    np.testing.assert_allclose(panel.center[:2], [1.2, 1.7], atol=PLACE_M)
    np.testing.assert_allclose(disc.center[:2], [5.0, 1.0], atol=PLACE_M)
    assert disc.center[2] == pytest.approx(top_m - CLEARANCE_M, abs=0.015)
