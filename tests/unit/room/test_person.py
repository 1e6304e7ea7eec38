"""People by lot, and the places where they can stand."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import SensorError
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.mapping.localization.body import PARTS
from lidarspectra.mapping.localization.person import (
    HAIRS,
    LOWERS,
    SHOES,
    SKINS,
    UPPERS,
    Person,
    draw_person,
    grid_positions,
    outside_room,
    read_positions,
    standing_faults,
)
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import load_reflectances


def drawn(count: int, **more: object) -> list[Person]:
    return [draw_person(np.random.default_rng([7, number]), **more) for number in range(count)]


def test_the_same_seed_draws_the_same_person() -> None:
    assert drawn(3) == drawn(3)
    assert len(set(drawn(50))) == 50


def test_drawn_people_are_adults_of_many_kinds() -> None:
    people = drawn(400)
    heights = np.array([person.height_m for person in people])
    assert heights.mean() == pytest.approx(1.70, abs=0.03)  # 0.09 m / sqrt(400) = 0.0045 m; fixed seed
    assert 1.45 <= heights.min() < 1.55 < 1.85 < heights.max() <= 2.0
    assert {person.upper for person in people} == set(UPPERS)
    assert {person.posture for person in people} == {"standing"}
    assert {person.posture for person in drawn(50, postures=("walking", "sitting"))} == {"walking", "sitting"}


def test_all_that_people_wear_is_in_the_built_in_databases() -> None:
    library = load_reflectances()
    for name in (*UPPERS, *LOWERS, *HAIRS, *SKINS, SHOES):
        assert library.find(name).id == name


def test_a_person_turns_and_stands_where_told() -> None:
    body = Person(yaw_deg=90.0).stands_at(np.array([4.0, -2.0, 0.3]))
    assert body.vertices[:, 2].min() == pytest.approx(0.3)
    np.testing.assert_allclose(body.vertices[:, :2].mean(axis=0), [4.0, -2.0], atol=0.1)
    shoes = body.vertices[body.faces][body.face_part == PARTS.index("shoes")].reshape(-1, 3)
    assert shoes[:, 1].max() + 2.0 > -(shoes[:, 1].min() + 2.0)  # toes reach farther than heels, towards +y


def room_of(height_m: float) -> Room:
    return Room(
        floor_z=0.0,
        ceiling_z=height_m,
        floor_area_m2=12.0,
        ceiling_area_m2=12.0,
        floor_confidence=1.0,
        ceiling_confidence=1.0,
        wall_angle_deg=0.0,
        wall_confidence=1.0,
        walls=(),
        outline=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]),
    )


def scan_of(*parts: trimesh.Trimesh) -> Scan:
    mesh = trimesh.util.concatenate([part.subdivide_to_size(0.3) for part in parts])
    assert isinstance(mesh, trimesh.Trimesh)
    return bare_scan(mesh.vertices, mesh.faces)


@pytest.fixture(scope="module")
def free() -> FreeSpace:
    """4 m x 3 m x 2.6 m with a pillar, a table and a lamp that hangs at 2 m."""
    parts = [trimesh.creation.box(bounds=[[0, 0, 0], [4, 3, 2.6]])]
    parts[0].invert()
    parts.append(trimesh.creation.box(bounds=[[0.8, 0.8, -0.1], [1.4, 1.4, 2.7]]))
    parts.append(trimesh.creation.box(bounds=[[2.5, 1.0, 0.70], [3.7, 2.0, 0.74]]))
    parts.append(trimesh.creation.box(bounds=[[1.5, 2.2, 2.0], [1.8, 2.5, 2.1]]))
    return FreeSpace(scan_of(*parts), room_of(2.6))


def test_nobody_stands_in_pillars_or_outside_and_tables_are_told(free: FreeSpace) -> None:
    places = np.array([[1.1, 1.1, 0], [5.0, 1.0, 0], [3.0, 1.5, 0], [2.0, 1.5, 0], [1.65, 2.35, 0], [2.4, 1.5, 0.0]])
    np.testing.assert_array_equal(outside_room(free, places), [True, True, False, False, False, False])
    faults = standing_faults(free, places)
    assert faults[0] == faults[1] == "outside of the room, or inside of a wall or pillar"
    assert faults[2] == "under or in something that is 0.70 m up"
    assert faults[3] == faults[4] == ""  # the lamp hangs higher than a table
    assert faults[5].startswith("touches something")


def test_a_grid_holds_every_place_where_one_can_stand(free: FreeSpace) -> None:
    found = grid_positions(free, 0.5)
    assert found.names[0] == "p1"
    assert len(set(found.names)) == len(found.names)
    assert standing_faults(free, found.places_m) == [""] * len(found.names)
    # 8 x 6 places less those in or near the pillar and the table, 0.18 m around each.
    assert 30 <= len(found.names) <= 44
    np.testing.assert_allclose(found.places_m[:, 2], free.room.floor_z)


def test_a_grid_without_any_place_is_refused() -> None:
    narrow = trimesh.creation.box(bounds=[[0, 0, 0], [4, 3, 1.2]])
    narrow.invert()
    with pytest.raises(SensorError, match="room for somebody to stand"):
        grid_positions(FreeSpace(scan_of(narrow), room_of(1.2)), 0.5)


def test_positions_are_read_with_the_floors_height_where_none_is_given(tmp_path: Path) -> None:
    path = tmp_path / "positions.csv"
    path.write_text("# where we stood\nname,x,y,z\ndoor,1,2,\nstep,3.5,2,0.2\n", encoding="utf-8")
    found = read_positions(path, floor_z=-0.1)
    assert found.names == ("door", "step")
    np.testing.assert_allclose(found.places_m, [[1, 2, -0.1], [3.5, 2, 0.2]])
    path.write_text("name;x;y;z\ndoor;1;2;\nNA;3,5;2;0,2\n", encoding="utf-8")  # of a German spreadsheet
    german = read_positions(path, floor_z=-0.1)
    assert german.names == ("door", "NA")
    np.testing.assert_allclose(german.places_m, found.places_m)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y\n1,2\n", "no column 'name'"),
        ("name,x,y\na,1,wide\n", "wide"),
        ("name,x,y\na,1\n", "CSV of positions"),
        ("name,x,y\na,1,2\na,2,2\n", "2 positions with 1 different"),
        ("name,x,y\na,1,inf\n", "finite"),
        ("name,x,y\n", "0 positions"),
    ],
)
def test_a_file_of_positions_that_is_none_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "positions.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SensorError, match=words):
        read_positions(path, floor_z=0.0)


def test_a_missing_file_of_positions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SensorError, match="CSV of positions"):
        read_positions(tmp_path / "none.csv", floor_z=0.0)
