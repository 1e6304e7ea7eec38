"""Glass, mirrors and screens are found where they are and nowhere else, and the mesh is mended where they are."""

import re
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib.figure import Figure

from lidarspectra.config import PaneSection, read_run_file
from lidarspectra.errors import ArrayError
from lidarspectra.geometry.appearance import PHOTOGRAPHED, Appearance
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.mapping.figures.plan_drawing import draw_panes
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.pane_materials import GLASS_TRANSMITTANCE, pane_material, with_pane_materials
from lidarspectra.material.part_materials import typical_material
from lidarspectra.room.panes.glass import glass_of_wall
from lidarspectra.room.panes.mirrors import images_behind, mirror_of_wall
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.panes.placing import with_panes
from lidarspectra.room.panes.search import views_of_room
from lidarspectra.room.room import find_room
from lidarspectra.room.room_planes import face_geometry
from lidarspectra.workflow.init import init_file
from lidarspectra.workflow.init.init_file import write_init
from lidarspectra.workflow.run_folder.panes_of_run import assumed_notes
from lidarspectra.workflow.whole_room import WholeRoom, whole_room
from research.virtual_rooms import damaged_rooms, rooms_with_panes
from research.virtual_rooms.rooms_with_panes import GLASS_WALL, MIRROR, ROOMS, SCREEN, PaneRoom, bulging, mirrored

pytestmark = pytest.mark.usefixtures("few_viewpoints")

STEP_M = 0.1  # [m] of most rooms' meshes: a quarter of the triangles that 5 cm gives
FINE = {  # rooms whose panes' edges are told to a square of the mesh
    "window, a hole",
    "glass before a corridor, clean",
}
CLOSED = {"close_ceiling": True, "close_floor": True, "close": False}
BY_NAME = {room.name: room for room in ROOMS}
FOUND = (
    "glass wall, bulges",
    "window, a hole",
    "glass before a corridor, 8 patches",
    "mirror of 2 m",
    "mirror, half of its image lost",
    "screen, off",
    "screen, on",
)
NOTHING = (
    "nothing",
    "door to a corridor",
    "door to a room of the same plan",
    "niche, .3 m deep",
    "picture on a canvas",
    "grey board",
)


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    """The rooms as a phone's files, read and repaired; each once."""
    folder = tmp_path_factory.mktemp("panes")
    made: dict[str, Scan] = {}

    def scan_of(room: PaneRoom) -> Scan:
        if room.name not in made:
            path = folder / f"{len(made)}.glb"
            step_m = rooms_with_panes.STEP_M if room.name in FINE else STEP_M
            with patch.object(rooms_with_panes, "STEP_M", step_m):
                path.write_bytes(damaged_rooms.glb(room.scanned()))
            made[room.name] = repair_scan(read_scan(path), flatten=True)
        return made[room.name]

    return scan_of


@pytest.fixture(scope="module")
def whole(scanned):
    """(name, with_its_pane) -> what becomes of a room in the scan stage, its pane in the run file or not; each once."""
    made: dict[tuple[str, bool], WholeRoom] = {}

    def whole_of(name: str, with_its_pane: bool = False) -> WholeRoom:
        if (name, with_its_pane) not in made:
            room = BY_NAME[name]
            panes = [room.true] if with_its_pane else []
            made[name, with_its_pane] = whole_room(scanned(room), **CLOSED, panes=panes)
        return made[name, with_its_pane]

    return whole_of


@pytest.mark.parametrize("name", FOUND)
def test_a_pane_is_found_where_it_is(name: str, whole) -> None:
    true = BY_NAME[name].true
    scan, _, _, found = whole(name)
    assert [pane.kind for pane in found] == [true.kind]
    # Squares of 5 cm at either edge, and rounded corners of the mesh beside it.
    np.testing.assert_allclose(found[0].size_m, true.size_m, atol=0.15)
    np.testing.assert_allclose(found[0].center, true.center, atol=0.1)
    np.testing.assert_allclose(found[0].normal, true.normal, atol=0.02)
    assert any(found[0].why in note for note in scan.record.notes)


@pytest.mark.parametrize("name", ["glass wall, bulges", "mirror of 2 m"])
def test_a_pane_that_the_run_file_has_is_not_asked_about_again(name: str, whole) -> None:
    assert BY_NAME[name].true is not None
    scan, *_ = whole(name, with_its_pane=True)
    assert not any("probably" in note for note in scan.record.notes)


@pytest.mark.parametrize("name", NOTHING)
def test_nothing_is_found_where_there_is_no_pane(name: str, whole) -> None:
    scan, _, _, found = whole(name)
    assert found == ()
    assert not any("probably" in note or "straight edges" in note for note in scan.record.notes)


def test_an_opening_that_may_be_clean_glass_is_asked_about_with_its_effect_until_the_run_file_has_it(whole) -> None:
    scan, _, _, found = whole("glass before a corridor, clean")
    assert found == ()
    (note,) = (each for each in scan.record.notes if "straight edges" in each)
    assert "3.0 m x 2.4 m at (5.0, 2.0, 1.3) m" in note
    # 7.3 m² of glass, which returns .15, among 136 m² of scan, corridor included, whose surfaces return a half.
    assert "1.6 % brighter" in note
    given, *_ = whole("glass before a corridor, clean", with_its_pane=True)
    assert not any("straight edges" in each for each in given.record.notes)


def test_the_room_behind_a_mirror_is_cut_off_and_a_real_room_there_is_not(scanned, whole) -> None:
    ghost = scanned(BY_NAME["mirror of 2 m"])
    assert BY_NAME["mirror of 2 m"].true is MIRROR
    assert whole("mirror of 2 m").room.area_m2 > 35.0
    assert whole("mirror of 2 m", with_its_pane=True).room.area_m2 == pytest.approx(20.0, rel=0.08)
    corridor = scanned(BY_NAME["glass before a corridor, 8 patches"])
    assert images_behind(ghost, MIRROR).sum() > 10_000
    assert not images_behind(corridor, MIRROR).any()


@pytest.mark.parametrize("name", ["window, a hole", "mirror of 2 m"])
def test_a_room_found_before_its_panes_were_known_is_found_again_only_for_mirrors(name: str, scanned, whole) -> None:
    room, alone = BY_NAME[name], whole(name).room
    assert room.true is not None
    again = whole_room(scanned(room), **CLOSED, panes=[room.true], room=alone).room
    expected = whole(name, with_its_pane=True).room
    np.testing.assert_array_equal(again.outline, expected.outline)
    assert again.area_m2 == expected.area_m2
    assert (again is alone) == (room.true.kind != "mirror")


def test_glass_becomes_one_flat_pane_and_its_bulge_is_gone(scanned) -> None:
    bulge = scanned(BY_NAME["glass wall, bulges"])
    flat = with_panes(bulge, [GLASS_WALL])
    places = GLASS_WALL.center + np.array([[0.0, y, z] for y in (-1.5, 0.0, 1.5) for z in (-1.0, 0.0, 1.0)])
    for start, scan in ((bulge, bulge), (flat, flat)):
        depth = RayCaster(scan).nearest(places + 0.5 * GLASS_WALL.normal, -GLASS_WALL.normal).distance - 0.5
        if start is flat:
            np.testing.assert_allclose(depth, 0.0, atol=1e-5)
        else:
            assert np.abs(depth).max() > 0.1
    assert flat.record.faces_kept == len(flat.faces)
    left_of_scan = len(bulge.faces) - flat.record.cut_faces
    assert flat.record.cut_faces > 0
    assert (flat.appearance.sources[:left_of_scan] == PHOTOGRAPHED).all(), "what was cut is counted, the rest is there"
    assert flat.record.cut_area_m2 > 1.0
    assert flat.appearance.sources[-1] != PHOTOGRAPHED  # no paint is read from it


@pytest.mark.parametrize(
    "name", ["glass wall, bulges", "glass wall, mostly in its plane", "glass before a corridor, 8 patches"]
)
def test_no_slit_is_left_around_a_pane(name: str, whole) -> None:
    assert BY_NAME[name].true is not None
    bare = whole(name).openness.total
    # A thousand rays from each of 150 places; cracks of the mesh are left. A slit of 3 cm around the pane lets out 1 %.
    assert whole(name, with_its_pane=True).openness.total < bare + 3e-4


def test_a_rough_edge_around_a_pane_is_joined_to_it_without_a_crack_and_looks_like_what_is_beside_it() -> None:
    side = np.linspace(0.0, 4.0, 41)
    y, z = (grid.ravel() for grid in np.meshgrid(side, side, indexing="ij"))
    x = 5.0 + np.random.default_rng(3).normal(scale=0.02, size=y.size)
    first = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    # Fronts look towards -x, as the pane's does.
    quads = np.stack([first, first + 1, first + 42, first + 41], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    wall = bare_scan(np.column_stack([x, y, z]), faces)
    colored = Appearance(
        images=(), face_image=np.full(len(faces), -1), corner_uv=np.zeros((len(faces), 3, 2)),
        corner_color=np.full((len(faces), 3, 3), 0.7),
    )  # fmt: skip
    pane = Pane(kind="glass", center=np.array([5.0, 2.03, 1.98]), size_m=(1.47, 0.91), normal=np.array([-1.0, 0, 0]))
    placed = with_panes(replace(wall, appearance=colored), [pane])
    places = np.random.default_rng(4).uniform([4.0, 1.0, 1.0], [4.0, 3.0, 3.0], (20_000, 3))
    assert RayCaster(placed).nearest(places, np.tile([1.0, 0.0, 0.0], (len(places), 1))).met.all()
    glass = pane.members(placed.centers) & (placed.appearance.sources != PHOTOGRAPHED)
    assert placed.areas[glass].sum() == pytest.approx(pane.area_m2, rel=1e-9)
    around = placed.face_colors()[~glass]
    np.testing.assert_allclose(around, np.broadcast_to(around[0], around.shape), atol=1e-6)
    # Seen from the room, wall, pane and what joins them cover what the wall did: no face is turned round. Squares of
    # 10 cm whose middle lies beside the pane's rectangle stay, and cover some of it twice.
    seen, whole = ((each.areas * (each.normals @ pane.normal)).sum() for each in (placed, wall))
    assert whole - 1e-9 <= seen < whole + 0.25 * 0.1 * 2.0 * sum(pane.size_m)


def test_a_pane_that_shines_in_the_picture_stays_white() -> None:
    mesh = damaged_rooms.furnished(step_m=0.2)
    bare = bare_scan(mesh.vertices, mesh.faces)
    color = np.where(GLASS_WALL.members(bare.centers)[:, None, None], 1.0, np.full((len(mesh.faces), 3, 3), 0.5))
    count = len(mesh.faces)
    seen = Appearance(images=(), face_image=np.full(count, -1), corner_uv=np.zeros((count, 3, 2)), corner_color=color)
    placed = with_panes(replace(bare, appearance=seen), [GLASS_WALL])
    assert (placed.appearance.sources[-2:] == PHOTOGRAPHED).all()
    assert (placed.face_colors()[-2:] == 1.0).all()


def test_faces_in_a_pane_get_its_material_and_no_others() -> None:
    mesh = damaged_rooms.furnished(step_m=0.2)
    scan = with_panes(bare_scan(mesh.vertices, mesh.faces), [GLASS_WALL])
    paint = typical_material("wall")
    before = MaterialMap(
        materials=(paint,),
        face_material=np.zeros(len(scan.faces), dtype=np.int64),
        face_color=np.full((len(scan.faces), 3), 0.5),
        face_seen=np.ones(len(scan.faces)),
    )
    glass, screen = pane_material("glass", name="wall"), pane_material("screen", name="tv", reflectance=0.1)
    after = with_pane_materials(before, scan, [(GLASS_WALL, glass), (SCREEN, screen)])
    assert [material.kind for material in after.materials] == ["plastic", "glass", "plastic"]
    assert after.materials[1].transmittance == GLASS_TRANSMITTANCE
    areas = after.areas(scan.areas)
    # And those parts of what joins the wall's squares of 20 cm to it that lie in its rectangle.
    assert GLASS_WALL.area_m2 <= areas[1] < 1.04 * GLASS_WALL.area_m2
    assert areas[2] == pytest.approx(SCREEN.area_m2, rel=0.5)  # whole squares of 20 cm
    assert (after.face_material[~GLASS_WALL.members(scan.centers) & ~SCREEN.members(scan.centers)] == 0).all()


def test_the_reveal_around_glass_in_a_doorway_is_no_glass(builder) -> None:
    # As glass it let light into the wall, and was said to be curved.
    rooms = builder(step_m=0.1, noise_m=0.003)
    rooms.box([0, 0, 0], [3, 3, 2.5], inward=True, holes={"east": (0.0, 0.8, 0.35, 0.65)})
    rooms.box([3.1, 0, 0], [6, 3, 2.5], inward=True, holes={"west": (0.35, 0.65, 0.0, 0.8)})
    for y, turned in ((1.05, 1), (1.95, -1)):  # the reveal, looking into the doorway
        rooms.rectangle([3, y, 0], *([[0.1, 0, 0], [0, 0, 2.0]][::-turned]))
    door = Pane(kind="glass", center=np.array([3.05, 1.5, 1.0]), size_m=(0.9, 2.0), normal=np.array([1.0, 0.0, 0.0]))
    scan = with_panes(rooms.scan(), [door])
    paint = MaterialMap(
        materials=(typical_material("wall"),),
        face_material=np.zeros(len(scan.faces), dtype=np.int64),
        face_color=np.full((len(scan.faces), 3), 0.5),
        face_seen=np.ones(len(scan.faces)),
    )
    glass = with_pane_materials(paint, scan, [(door, pane_material("glass", name="door"))])
    assert glass.areas(scan.areas)[1] == pytest.approx(door.area_m2, rel=0.01)


def test_panes_are_drawn_on_the_plan_where_they_stand() -> None:
    axes = Figure().add_subplot()
    handles = draw_panes(axes, [MIRROR, SCREEN, MIRROR])
    assert [str(handle.get_label()) for handle in handles] == ["mirror, assumed", "screen, assumed"]
    x, y = axes.lines[0].get_data()
    np.testing.assert_allclose(x, 5.0)
    np.testing.assert_allclose(sorted(np.asarray(y)), [1.0, 3.0])


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.5]])
def test_a_pane_that_does_not_stand_upright_is_refused(normal: list[float]) -> None:
    with pytest.raises(ArrayError, match="upright"):
        Pane(kind="glass", center=np.zeros(3), size_m=(1.0, 1.0), normal=np.array(normal))


def test_corners_run_counter_clockwise_about_the_normal() -> None:
    first, second, third, _ = GLASS_WALL.corners
    np.testing.assert_allclose(
        np.cross(second - first, third - second) / GLASS_WALL.area_m2, GLASS_WALL.normal, atol=1e-12
    )


def test_the_rooms_have_what_they_say() -> None:
    random = np.random.default_rng(1)
    mesh = damaged_rooms.furnished(step_m=0.1)
    assert bulging(GLASS_WALL, patches=0.25)(mesh, random).vertices[:, 0].max() > 5.3
    assert mirrored(MIRROR, lost=0.0)(mesh, random).vertices[:, 0].max() == pytest.approx(10.0, abs=0.15)


def test_init_proposes_the_mirror_and_finds_the_room_and_the_lamps_without_its_image(scanned, tmp_path) -> None:
    scan, repaired = tmp_path / "room.glb", scanned(BY_NAME["mirror of 2 m"])
    with patch.object(rooms_with_panes, "STEP_M", STEP_M):
        scan.write_bytes(damaged_rooms.glb(BY_NAME["mirror of 2 m"].scanned()))
    with patch.object(init_file, "repair_scan", return_value=repaired) as repair:  # once more would be the same
        summary = write_init(scan, tmp_path / "room.toml")
    assert repair.call_args.kwargs["flatten"] is True
    (pane,) = read_run_file(tmp_path / "room.toml").panes
    assert (pane.kind, pane.assumed) == ("mirror", True)
    assert summary.room.area_m2 == pytest.approx(20.0, rel=0.08)
    assert len(summary.lamps.lamps) == 2
    # Its own 2.0 m, or with a square of the mesh at one edge.
    assert any(re.search(r"a mirror of 2\.[01] m x 2\.[01] m", line) for line in summary.lines())
    assert assumed_notes([pane])[0].startswith("'mirror 1' (mirror) under [[panes]] is a guess")
    assert not assumed_notes([pane.model_copy(update={"assumed": False})])


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"kind": "glass", "reflectance": 0.5}, "glass takes transmittance"),
        ({"kind": "mirror", "transmittance": 0.5}, "nothing goes through a mirror"),
        ({"kind": "screen", "normal": [0, 0, 1]}, "normal must point"),
    ],
)
def test_a_pane_of_the_run_file_that_cannot_be_is_refused(keys: dict[str, object], words: str) -> None:
    pane = {"name": "one", "center": [0, 0, 1], "size": [1, 1], "normal": [1, 0, 0], **keys}
    with pytest.raises(ValueError, match=words):
        PaneSection.model_validate(pane)


def test_the_other_half_of_a_room_behind_a_partition_is_no_image(builder) -> None:
    room = builder(step_m=0.08, noise_m=0.004)
    room.box([0, 0, 0], [7, 5, 2.9], inward=True)
    room.box([3.45, -0.05, -0.05], [3.55, 3.2, 1.8])  # in the middle, and not up to the ceiling
    for low, high in (([0.7, 0.6, 0.7], [2.3, 1.4, 0.74]), ([4.8, 3.6, 0.7], [6.4, 4.4, 0.74])):
        room.box(low, high)
    for x in (0.6, 6.2):  # alike in both halves
        room.box([x, 4.4, -0.05], [x + 0.2, 4.7, 0.6])
    room.box([4.78, 0.98, -0.05], [5.22, 1.42, 2.95])  # a column in one half
    room.box([6.4, 0.5, -0.05], [7.05, 2.0, 1.9])
    scan = room.scan()
    faces = face_geometry(scan)
    assert [view for view in views_of_room(scan, find_room(scan)) if mirror_of_wall(view, faces) is not None] == []


def test_the_space_between_a_worktop_and_wall_cupboards_is_no_glass(builder) -> None:
    kitchen = builder(step_m=0.06, noise_m=0.004)
    kitchen.box([0, 0, 0], [3.6, 3, 2.5], inward=True)
    kitchen.box([-0.05, -0.05, -0.05], [0.62, 2.3, 0.9])
    kitchen.box([-0.05, -0.05, 1.5], [0.36, 2.3, 2.2])
    kitchen.box([-0.05, 2.3, -0.05], [0.62, 2.9, 1.86])  # a refrigerator, as high as makes a wall of the fronts
    kitchen.box([1.6, 2.5, -0.05], [2.6, 3.05, 2.1])
    for number, depth in enumerate((0.3, 0.12, 0.4, 0.2, 0.35)):  # what stands on the worktop
        kitchen.box([-0.05, 0.1 + 0.42 * number, 0.88], [depth, 0.3 + 0.42 * number, 1.2 + 0.04 * number])
    scan = kitchen.scan()
    room = find_room(scan)
    assert any(0.5 < wall.offset_m < 0.7 and wall.normal[0] > 0.9 for wall in room.walls), "fronts count as a wall here"
    assert not [pane for view in views_of_room(scan, room) for pane in glass_of_wall(view)]


@pytest.mark.parametrize("sofa", [False, True])
def test_a_bulge_that_does_not_fill_the_hole_of_its_window_is_glass(builder, sofa: bool) -> None:
    room = builder(step_m=0.06, noise_m=0.004)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"east": (0.2, 0.8, 0.32, 0.84)})
    dice = np.random.default_rng(3)
    for y in np.arange(0.8, 2.2, 0.15):  # few returns, each at a depth of its own; a rim of the hole has none
        for z in np.arange(1.0, 1.9, 0.15):
            room.rectangle([dice.uniform(4.15, 4.4), y, z], [0, 0, 0.15], [0, 0.15, 0])
    if sofa:
        room.box([3.2, 0.6, -0.05], [3.9, 2.4, 0.7])
    scan = room.scan()
    found = [pane for view in views_of_room(scan, find_room(scan)) for pane in glass_of_wall(view)]
    assert len(found) == 1
    assert np.allclose(found[0].center, [4.0, 1.5, 1.45], atol=0.2)
