"""Sensor points: grids in free space, files of points, lift and burial."""

import numpy as np
import pytest

from lidarspectra.config import GridSection, SensorsSection
from lidarspectra.errors import ArrayError, SensorError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.radiance.sampling.receptors import Receptor
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import SensorPoints, grid_points, place_points, read_points
from lidarspectra.workflow.run_folder.sensing_of_run import receptor_of_run, seen_by, sensor_points

CABINET = ([3.4, 0.8, 0.0], [4.0, 2.4, 1.1])


def furnished(builder, *, turn_deg: float = 0.0):
    room = builder(step_m=0.05, noise_m=0.005)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    room.box([0.5, 0.5, 0.70], [2.1, 1.3, 0.74])
    room.box(*CABINET, leave_out=("bottom",))
    return room.scan(turn_deg=turn_deg)


@pytest.fixture(scope="module")
def office(builder):
    scan = furnished(builder)
    return scan, find_room(scan)


@pytest.mark.parametrize("count", [1, 2, 7, 44, 176, 500])
def test_a_grid_has_exactly_the_points_asked_for_all_in_free_space(office, count) -> None:
    scan, room = office
    points = grid_points(scan, room, count=count)
    x, y, z = points.positions.T
    assert len(points) == count
    assert len({tuple(row) for row in points.positions.round(6).tolist()}) == count
    np.testing.assert_allclose(z, room.floor_z + 0.3)
    assert not points.buried.any()
    # The margin of 10 cm holds against the noisy mesh, whose faces lie within 2 cm of the true sides.
    assert x.min() > 0.08
    assert x.max() < 3.92
    assert y.min() > 0.08
    assert y.max() < 2.92
    assert not ((x > 3.4 - 0.08) & (y > 0.8 - 0.08) & (y < 2.4 + 0.08)).any()
    assert FreeSpace(scan, room).distance(points.positions).min() >= 0.1


def test_a_grid_reaches_under_the_table_and_covers_the_room(office) -> None:
    scan, room = office
    points = grid_points(scan, room, count=176).positions
    under = (points[:, 0] > 0.5) & (points[:, 0] < 2.1) & (points[:, 1] > 0.5) & (points[:, 1] < 1.3)
    free_area = 12.0 - 0.6 * 1.6
    assert under.sum() == pytest.approx(176 * 1.6 * 0.8 / free_area, rel=0.25)
    # Even cover: nowhere in free space is farther from a point than a diagonal of the grid, margin included.
    spacing = np.sqrt(free_area / 176)
    probes = np.stack(np.meshgrid(np.arange(0.1, 3.3, 0.1), np.arange(0.1, 2.9, 0.1)), -1).reshape(-1, 2)
    nearest = np.linalg.norm(probes[:, None] - points[None, :, :2], axis=2).min(axis=1)
    assert nearest.max() < 1.5 * spacing


def test_a_grid_follows_the_walls_of_a_turned_room(builder) -> None:
    scan = furnished(builder, turn_deg=25.0)
    points = grid_points(scan, find_room(scan), spacing=0.4).positions[:, :2]
    steps = points[1:] - points[:-1]
    near = steps[np.linalg.norm(steps, axis=1) < 0.41]
    angles = np.degrees(np.arctan2(near[:, 1], near[:, 0])) % 90
    np.testing.assert_allclose(np.linalg.norm(near, axis=1), 0.4, atol=1e-9)
    np.testing.assert_allclose(angles, 25.0, atol=0.5)


def test_the_same_room_gives_the_same_grid(office) -> None:
    scan, room = office
    first, second = (grid_points(scan, room, count=50).positions for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_grid_looks_where_it_is_told(office) -> None:
    scan, room = office
    points = grid_points(scan, room, count=9, normal=(0.0, 2.0, 0.0))
    np.testing.assert_allclose(points.normals, np.tile([0.0, 1.0, 0.0], (9, 1)))


@pytest.mark.parametrize("height", [-0.1, 2.5, 40.0])
def test_a_grid_outside_the_heights_of_the_room_is_refused(office, height) -> None:
    with pytest.raises(SensorError, match="between the floor and the ceiling"):
        grid_points(*office, count=9, height=height)


@pytest.mark.parametrize("section", [{"count": 40, "margin": 1.45}, {"spacing": 1.0, "margin": 2.0}])
def test_a_grid_that_finds_no_place_is_refused(office, section) -> None:
    with pytest.raises(SensorError, match="fewer points"):
        grid_points(*office, **section)


@pytest.mark.parametrize("asked", [{}, {"count": 3, "spacing": 0.5}, {"count": 0}, {"spacing": -1.0}])
def test_a_grid_without_one_count_or_spacing_is_refused(office, asked) -> None:
    with pytest.raises(SensorError, match="count"):
        grid_points(*office, **asked)


def test_sensors_look_up_unless_they_are_told_where_and_lie_in_the_air() -> None:
    points = SensorPoints(positions=[[0, 0, 1], [1, 0, 1]])
    np.testing.assert_array_equal(points.normals, [[0, 0, 1], [0, 0, 1]])
    assert not points.buried.any()
    down = SensorPoints(positions=[[0, 0, 1], [1, 0, 1]], normals=[0, 0, -2])
    np.testing.assert_array_equal(down.normals, [[0, 0, -1], [0, 0, -1]])


def test_positions_of_another_shape_are_refused_by_name() -> None:
    with pytest.raises(ArrayError, match=r"SensorPoints\.positions: expected an array of shape \(any, 3\)"):
        SensorPoints(positions=[0.0, 0.0, 1.0])
    with pytest.raises(ArrayError, match=r"SensorPoints\.positions: expected an array of numbers"):
        SensorPoints(positions="here")


def test_a_grid_on_the_floor_is_lifted_clear_of_its_noise(office, tmp_path) -> None:
    scan, room = office
    section = SensorsSection(grid=GridSection(count=30, height=0.0), lift=0.02)
    points = sensor_points(scan, room, section, folder=tmp_path)
    np.testing.assert_allclose(points.positions[:, 2], room.floor_z + 0.02)
    assert points.buried.mean() <= 0.1


@pytest.mark.parametrize("leave_out", [(), ("bottom", "south", "north", "west", "east")], ids=["slab", "sheet"])
def test_sensors_on_a_noisy_desk_are_flagged_exactly_where_the_mesh_covers_them(builder, leave_out) -> None:
    room = builder(step_m=0.04, noise_m=0.005)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    room.box([0.5, 0.5, 0.70], [2.5, 2.0, 0.74], leave_out=leave_out)
    scan = room.scan()
    rng = np.random.default_rng(5)
    plan = rng.uniform([0.7, 0.7], [2.3, 1.8], size=(400, 2))
    caster = RayCaster(scan)
    top = 2.0 - caster.nearest(np.column_stack([plan, np.full(400, 2.0)]), [0, 0, -1.0]).distance
    shares = []
    for lift in (0.0, 0.005, 0.010, 0.020):
        points = place_points(scan, np.column_stack([plan, np.full(400, 0.74)]), np.tile([0, 0, 1.0], (400, 1)), lift)
        covered = points.positions[:, 2] < top
        # Within half a millimetre of the surface the answer may fall either way.
        clear = np.abs(points.positions[:, 2] - top) > 5e-4
        assert (points.buried == covered)[clear].mean() > 0.99
        shares.append(points.buried.mean())
    # RADIANCE measured on such a desk: about half are buried without lift, none at 2 cm.
    assert shares[0] == pytest.approx(0.5, abs=0.1)
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] == 0.0


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
def test_points_inside_furniture_or_outside_the_walls_are_flagged_whichever_way_they_look(office, normal) -> None:
    scan, _ = office
    positions = [[2.0, 2.0, 1.0], [3.7, 1.6, 0.5], [-0.3, 1.0, 1.0], [1.3, 0.9, 0.4], [1.3, 0.9, 0.72], [90.0, 0, 0]]
    points = place_points(scan, positions, [normal] * 6, 0.0)
    assert points.buried.tolist() == [False, True, True, False, True, True]


def test_points_are_lifted_along_their_direction(office) -> None:
    scan, _ = office
    points = place_points(scan, [[0.02, 1.5, 1.2]], [[5.0, 0.0, 0.0]], 0.05)
    np.testing.assert_allclose(points.positions, [[0.07, 1.5, 1.2]])
    assert not points.buried[0]


def test_points_that_are_all_buried_are_refused(office) -> None:
    scan, _ = office
    with pytest.raises(SensorError, match="all 2 inside") as caught:
        place_points(scan, [[3.7, 1.6, 0.5], [2000.0, 1500.0, 300.0]], [[0, 0, 1.0]] * 2, 0.02)
    assert "unit" in str(caught.value)


def test_points_of_a_file_go_by_the_names_of_their_columns(tmp_path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("label;z; Y ;x\na;1.0;2.0;3.0\n\nb;4;5;6e-1\n", encoding="utf-8-sig")
    positions, normals = read_points(path)
    np.testing.assert_allclose(positions, [[3.0, 2.0, 1.0], [0.6, 5.0, 4.0]])
    np.testing.assert_allclose(normals, [[0, 0, 1.0], [0, 0, 1.0]])


def test_points_as_a_german_spreadsheet_writes_them_are_read(tmp_path) -> None:
    (tmp_path / "points.csv").write_text("Name;X;Y;Z;\nTisch, links;1,5;-0,25;0,8;\n", encoding="utf-8-sig")
    np.testing.assert_allclose(read_points(tmp_path / "points.csv")[0], [[1.5, -0.25, 0.8]])


def test_directions_of_a_file_are_read(tmp_path, office) -> None:
    (tmp_path / "points.csv").write_text("x,y,z,nx,ny,nz\n2,2,1,0,3,0\n2,2.5,1,1,0,0\n", encoding="utf-8")
    scan, room = office
    points = sensor_points(scan, room, SensorsSection(points="points.csv", lift=0.0), folder=tmp_path)
    np.testing.assert_allclose(points.normals, [[0, 1, 0], [1, 0, 0]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty file"),
        ("1,2,3\n4,5,6\n", "header"),
        ("x,y\n1,2\n", "header"),
        ("x,y,z,nx\n1,2,3,4\n", "all or none"),
        ("x,y,z,x\n1,2,3,4\n", "each once"),
        ("x,y,z\n", "without rows"),
        ("x,y,z\n1,2,3\n1,two,3\n", "line 3"),
        ("x,y,z\n1,2\n", "column z"),
        ("x,y,z\n1,2,nan\n", "column z"),
        ("x,y,z\n1,inf,3\n", "column y"),
        ("x;y;z\n1.234,5;2;3\n", "point"),
        ("x,y,z\n1,5,2,0,0,8\n", "line 2: expected 3 cells, as the header has, found 6.*with a point"),
    ],
)
def test_a_file_that_holds_no_points_is_refused_with_the_place_named(tmp_path, text, words) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SensorError, match=words):
        read_points(path)


def test_a_missing_or_binary_file_of_points_is_refused(tmp_path) -> None:
    with pytest.raises(SensorError, match=r"points\.csv"):
        read_points(tmp_path / "points.csv")
    (tmp_path / "points.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(SensorError):
        read_points(tmp_path / "points.csv")


def test_a_direction_of_length_zero_is_refused(office) -> None:
    scan, _ = office
    with pytest.raises(SensorError, match="zero direction"):
        place_points(scan, [[1.0, 1.0, 1.0]], [[0.0, 0.0, 0.0]], 0.0)


@pytest.mark.slow
def test_a_large_grid_is_laid_in_bounded_steps(office) -> None:
    assert len(grid_points(*office, count=20_000)) == 20_000


def test_how_sensors_see_is_told_where_they_read_no_irradiance(tmp_path) -> None:
    grid = GridSection(count=4)
    cosine = SensorsSection(grid=grid)
    assert seen_by(cosine, receptor_of_run(cosine, tmp_path)) == ""
    narrow = SensorsSection(grid=grid, field_of_view_deg=30.0)  # sin² of the half angle: a quarter
    assert (
        seen_by(narrow, receptor_of_run(narrow, tmp_path)) == "field_of_view_deg = 30, which reads 25 % of even light"
    )
    (tmp_path / "dome.csv").write_text("angle_deg,response\n0,1\n90,1\n", encoding="utf-8")
    dome = SensorsSection(grid=grid, receptor="dome.csv")  # ∫ dω / π over the half space
    assert seen_by(dome, receptor_of_run(dome, tmp_path)) == "its receptor's table, which reads 200 % of even light"
    assert Receptor(angles_deg=[0.0, 90.0], response=[0.5, 0.5]).share_of_even_light == pytest.approx(1.0, rel=1e-4)
