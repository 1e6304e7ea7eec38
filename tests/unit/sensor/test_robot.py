"""Poses, clocks, frames and locations: where a reading was taken."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ArrayError, LidarSpectraError, ReadingError
from lidarspectra.hardware.robot.alignment import align, read_point_pairs
from lidarspectra.hardware.robot.corrected_odometry import corrected_odometry
from lidarspectra.hardware.robot.poses import read_poses, yaw
from lidarspectra.hardware.robot.reference_files import map_light
from lidarspectra.hardware.robot.robot import (
    grid_readings,
    measured_table,
    place_readings,
    read_locations,
    write_measured,
)
from lidarspectra.hardware.robot.time_offset import estimate_time_offset
from lidarspectra.hardware.robot.trajectory import Trajectory
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
from lidarspectra.hardware.sensor.readings import make_readings

START = 1.7e9  # [s]
SPEED = 0.2  # [m/s]
ROW_S = 14.1  # [s] one row of the drive below and the way to the next


def drive(rows: int = 13) -> Trajectory:
    """To and fro over 2.6 m x 2.64 m, as a robot that maps a floor."""
    corners = [(x, 0.2 + 0.22 * row) for row in range(rows) for x in ((0.2, 2.8) if row % 2 == 0 else (2.8, 0.2))]
    points = np.array(corners)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    t = np.arange(0.0, way[-1] / SPEED, 0.05)
    place = np.stack([np.interp(t * SPEED, way, points[:, i]) for i in (0, 1)], axis=1)
    heading = np.unwrap(np.arctan2(np.gradient(place[:, 1]), np.gradient(place[:, 0])))
    positions = np.column_stack([place, np.zeros(t.size)])
    return Trajectory(unix_s=START + t, positions=positions, headings=heading, frame="odom")


def light_at(places: FloatArray) -> FloatArray:
    """Two lamps of different colour over the floor: (n, 18)."""
    one = 1.0 / (((places[:, 0] - 0.9) ** 2 + (places[:, 1] - 1.5) ** 2) + 4.0)
    two = 1.0 / (((places[:, 0] - 2.1) ** 2 + (places[:, 1] - 0.8) ** 2) + 4.0)
    mix = np.linspace(0.2, 1.0, 18)
    return 0.02 * (one[:, None] * mix + two[:, None] * mix[::-1])


def readings_on(path: Trajectory, offset_s: float, *, every_s: float = 1.0, noise: float = 0.01) -> xr.Dataset:
    """Readings once a second, dated by a clock that is `offset_s` behind the robot's."""
    times = np.arange(path.unix_s[0] + 2.0, path.unix_s[-1] - 2.0, every_s)
    places, _ = path.at(times, longest_gap_s=2.0)
    rng = np.random.default_rng(3)
    counts = np.rint(3e6 * light_at(places) * (1.0 + noise * rng.standard_normal((times.size, 18))))
    return make_readings(unix_s=times - offset_s, counts=counts, gain=16.0, integration_ms=165.2)


def test_the_clock_offset_is_found_and_its_error_is_honest() -> None:
    path = drive()
    for true in (0.0, 3.7, -5.2):
        readings = readings_on(path, true)
        found = estimate_time_offset(readings["unix_s"], readings["counts"], path, longest_gap_s=2.0)
        assert found.is_known
        assert abs(found.seconds - true) < 3.0 * found.standard_error_s
        assert found.standard_error_s < 0.5
        assert "fit as well" in found.words  # rows that lie on one another after the time of a row


def test_of_offsets_a_row_apart_a_map_tells_the_right_one() -> None:
    path = drive()
    for true in (-11.2, 25.0):
        readings = readings_on(path, true)
        found = estimate_time_offset(readings["unix_s"], readings["counts"], path, longest_gap_s=2.0, expected=light_at)
        assert abs(found.seconds - true) < 0.3  # 0.06 m of the drive
        alone = estimate_time_offset(readings["unix_s"], readings["counts"], path, longest_gap_s=2.0)
        # the drive alone gives that offset, less whole rows
        rows = (alone.seconds - true) / ROW_S
        assert abs(rows - round(rows)) < 0.1


def test_even_light_does_not_determine_the_offset_and_that_is_said() -> None:
    path = drive()
    readings = readings_on(path, 0.0)
    flat = 100.0 + np.random.default_rng(0).standard_normal((readings.sizes["reading"], 18))
    found = estimate_time_offset(readings["unix_s"], flat, path, longest_gap_s=2.0)
    assert not found.is_known
    assert found.seconds == 0.0
    assert "do not determine" in found.words
    few = estimate_time_offset(readings["unix_s"][:5], flat[:5], path, longest_gap_s=2.0)
    assert not few.is_known


def test_a_reading_gets_the_place_where_the_sensor_was() -> None:
    path = drive()
    readings = readings_on(path, 2.0)
    placed = place_readings(readings, path, light=readings["counts"].to_numpy(), offset_s=2.0, mount=(0.1, 0.0, 0.3))
    assert placed.placed == readings.sizes["reading"]
    first = [float(placed.readings[name][0]) for name in "xyz"]
    # 2 s along the first row at 0.2 m/s, and the sensor 0.1 m in front of the robot's centre
    assert first == pytest.approx([0.2 + 0.4 + 0.1, 0.2, 0.3], abs=0.01)


def test_readings_outside_of_the_drive_and_in_its_gaps_have_no_place() -> None:
    times = np.array([0.0, 1.0, 2.0, 60.0, 61.0])
    path = Trajectory(
        unix_s=times, positions=np.column_stack([times, times * 0, times * 0]), headings=times * 0, frame="x"
    )
    place, _ = path.at([-1.0, 0.5, 30.0, 60.5, 70.0, np.nan], longest_gap_s=2.0)
    assert np.isfinite(place[:, 0]).tolist() == [False, True, False, True, False, False]
    readings = make_readings(unix_s=[1e6, 1e6 + 1])
    with pytest.raises(ReadingError, match="clocks"):
        place_readings(readings, path, light=np.ones((2, 18)), offset_s=0.0)
    with pytest.raises(ReadingError, match=r"s, shifted by 5000 s, poses from"):
        place_readings(readings, path, light=np.ones((2, 18)), offset_s=5000.0)
    with pytest.raises(ReadingError, match="a finite time offset"):
        place_readings(readings, path, light=np.ones((2, 18)), offset_s=np.nan)
    with pytest.raises(ReadingError, match="times"):
        place_readings(make_readings(unix_s=[np.nan]), path, light=np.ones((1, 18)))


def test_headings_turn_the_short_way() -> None:
    path = Trajectory(unix_s=[0.0, 1.0], positions=np.zeros((2, 3)), headings=[3.1, -3.1], frame="x")
    _, heading = path.at([0.5], longest_gap_s=2.0)
    assert math.cos(float(heading[0])) == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_alignment_finds_the_motion_that_was_made(dimensions: int) -> None:
    rng = np.random.default_rng(dimensions)
    points = rng.uniform(-3, 3, (6, 3))
    angle = 2.1
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1.0]])
    if dimensions == 3:
        tilt = np.array([[1, 0, 0], [0, math.cos(0.7), -math.sin(0.7)], [0, math.sin(0.7), math.cos(0.7)]])
        turn = turn @ tilt
    moved = points @ turn.T + (1.0, -2.0, 0.5)
    found = align(points, moved, dimensions=dimensions)
    assert np.allclose(found.rotation, turn, atol=1e-12)
    assert np.allclose(found.apply(points), moved, atol=1e-12)
    assert found.rms < 1e-12
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_alignment_tells_what_is_left() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-3, 3, (200, 3))
    found = align(points, points + 0.02 * rng.standard_normal(points.shape))
    assert found.rms == pytest.approx(0.02 * math.sqrt(2), rel=0.1)  # two of three coordinates; 200 points: 5 %
    assert "residual" in found.words()


def test_a_mirrored_set_is_not_mirrored_back() -> None:
    points = np.random.default_rng(2).uniform(-1, 1, (8, 3))
    found = align(points, points * (1, 1, -1), dimensions=3)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)
    assert found.rms > 0.1


@pytest.mark.parametrize(
    ("source", "target", "dimensions"),
    [
        (np.zeros((1, 3)), np.zeros((1, 3)), 2),
        (np.zeros((3, 3)), np.zeros((3, 3)), 2),
        (np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2.0]]), np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2.0]]), 3),
        (np.array([[0, 0, 0], [1, 0, 0.0]]), np.array([[0, 0, 0], [1000, 0, 0.0]]), 2),
        (np.array([[0, 0, 0], [1, 0, np.nan]]), np.zeros((2, 3)), 2),
        (np.zeros((3, 3)), np.zeros((2, 3)), 2),
    ],
)
def test_points_that_fix_no_frame_are_refused(source: FloatArray, target: FloatArray, dimensions: int) -> None:
    with pytest.raises((ReadingError, ArrayError)):
        align(source, target, dimensions=dimensions)


def test_pairs_of_points_are_read(tmp_path: Path) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text("name,robot_x,robot_y,scan_x,scan_y\ndoor,0,0,1,2\nwindow,1,0,1,3\n", encoding="utf-8")
    names, robot, scan = read_point_pairs(path)
    found = align(robot, scan, names=names)
    assert names == ("door", "window")
    assert np.allclose(found.apply([[0.5, 0, 0]]), [[1, 2.5, 0]])
    path.write_text("name,robot_x,robot_y,scan_x,scan_y\ndoor,0,x,1,2\n", encoding="utf-8")
    with pytest.raises(ReadingError, match="row 1 below the header"):
        read_point_pairs(path)
    path.write_text("name,x,y\n", encoding="utf-8")
    with pytest.raises(ReadingError, match="robot_x"):
        read_point_pairs(path)
    german = "# by tape\nname;robot_x;robot_y;scan_x;scan_y\ndoor;0;0;1;2\nNA;1,5;0;1;3,5\n"
    path.write_text(german, encoding="utf-8")
    names, robot, scan = read_point_pairs(path)
    assert names == ("door", "NA")
    assert (robot[1, 0], scan[1, 1]) == (1.5, 3.5)


POSES = [(1000.25 + 0.5 * i, 0.1 * i, -0.2 * i, 0.3, 0.1 * i) for i in range(8)]


def check_poses(path: Trajectory) -> None:
    assert len(path) == len(POSES)
    assert np.allclose(path.unix_s, [pose[0] for pose in POSES], atol=1e-6)
    assert np.allclose(path.positions, [pose[1:4] for pose in POSES], atol=1e-9)
    assert np.allclose(path.headings, [pose[4] for pose in POSES], atol=1e-6)


def half(angle: float) -> tuple[float, float]:
    return math.sin(angle / 2), math.cos(angle / 2)


def test_poses_from_a_csv_with_yaw_or_quaternion_or_degrees(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    yaws = "".join(f"{t},{x},{y},{z},{a}\n" for t, x, y, z, a in reversed(POSES))  # any order
    path.write_text("unix_s,x,y,z,yaw\n" + yaws, encoding="utf-8")
    check_poses(read_poses(path))
    turns = "".join(f"{t},{x},{y},{z},0,0,{half(a)[0]},{half(a)[1]}\n" for t, x, y, z, a in POSES)
    path.write_text("# odometry\nstamp,x,y,z,qx,qy,qz,qw\n" + turns, encoding="utf-8")
    check_poses(read_poses(path))
    degrees = "".join(f"{t},{x},{y},{z},{math.degrees(a)}\n" for t, x, y, z, a in POSES)
    path.write_text("Time,X,Y,Z,yaw_deg\n" + degrees, encoding="utf-8")
    check_poses(read_poses(path))
    german = "Time,X,Y,Z,yaw_deg\n".replace(",", ";") + degrees.replace(",", ";").replace(".", ",")
    path.write_text(german, encoding="utf-8")
    check_poses(read_poses(path))


def test_a_sensor_beside_the_robots_middle_needs_to_know_where_the_robot_looks(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("unix_s,x,y\n1000,0,0\n1001,0,1\n1002,0,2\n", encoding="utf-8")
    trajectory = read_poses(path)
    readings = make_readings(unix_s=[1000.5, 1001.5], counts=np.full((2, 18), 9.0), gain=16.0, integration_ms=165.2)
    light = readings["counts"].to_numpy()
    above = place_readings(readings, trajectory, light=light, offset_s=0.0, mount=[0.0, 0.0, 0.3]).readings
    assert above["z"].to_numpy().tolist() == [0.3, 0.3]
    with pytest.raises(ReadingError, match="a column yaw"):
        place_readings(readings, trajectory, light=light, offset_s=0.0, mount=[0.2, 0.0, 0.3])


def test_poses_from_what_ros2_topic_echo_printed(tmp_path: Path) -> None:
    path = tmp_path / "odom.txt"
    covariance = ",".join(["0.0"] * 36)
    lines = [
        f"{int(t)},{round(t % 1 * 1e9)},odom,base_footprint,{x},{y},{z},0.0,0.0,{half(a)[0]},{half(a)[1]},{covariance}"
        for t, x, y, z, a in POSES
    ]
    path.write_text("\n".join([*lines, lines[-1][:30]]) + "\n", encoding="utf-8")  # the last line is cut
    check_poses(read_poses(path))
    messages = [
        f"""header:
  stamp:
    sec: {int(t)}
    nanosec: {round(t % 1 * 1e9)}
  frame_id: odom
child_frame_id: base_footprint
pose:
  pose:
    position:
      x: {x}
      y: {y}
      z: {z}
    orientation:
      x: 0.0
      y: 0.0
      z: {half(a)[0]}
      w: {half(a)[1]}
  covariance:
  - 0.0
twist:
  twist:
    linear:
      x: 9.0
"""
        for t, x, y, z, a in POSES
    ]
    path.write_text("---\n".join([*messages, messages[0][:200]]), encoding="utf-8")
    found = read_poses(path)
    check_poses(found)
    assert found.frame == "odom"


@pytest.mark.parametrize(
    "kind", ["nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped"]
)
@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_poses_from_a_ros_2_bag(kind: str, storage: str, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the extra 'robot' is not installed")
    folder = tmp_path / "bag"
    write_bag(folder, kind, storage)
    check_poses(read_poses(folder))
    (inside,) = [path for path in folder.iterdir() if path.suffix in (".db3", ".mcap")]
    check_poses(read_poses(inside))
    check_poses(read_poses(folder, topic="/odom"))
    with pytest.raises(ReadingError, match="/odom"):
        read_poses(folder, topic="/camera")


def seldom_positions(truth: Trajectory) -> Trajectory:
    """What AMCL publishes: where the robot is each time that it has moved by 0.25 m, and nothing while it stands."""
    told = [0]
    for number, place in enumerate(truth.positions):
        if np.linalg.norm(place - truth.positions[told[-1]]) >= 0.25:
            told.append(number)
    return Trajectory(
        unix_s=truth.unix_s[told], positions=truth.positions[told], headings=truth.headings[told], frame="map"
    )


def slow_drive() -> Trajectory:
    """The drive at half its speed, begun and ended by ten seconds of standing."""
    fast = drive(5)
    times = START + 10.0 + 2.0 * (fast.unix_s - START)
    still = np.arange(0.0, 10.0, 0.1)
    ends = [np.full(still.size, 0), np.arange(len(fast)), np.full(still.size, len(fast) - 1)]
    index = np.concatenate(ends)
    return Trajectory(
        unix_s=np.concatenate([START + still, times, times[-1] + 0.1 + still]),
        positions=fast.positions[index],
        headings=fast.headings[index],
        frame="map",
    )


def drifting_odometry(truth: Trajectory) -> Trajectory:
    """The same drive as a robot's wheels tell it: from its own origin, and turning by 6 degrees on the way."""
    steps = np.diff(truth.positions[:, :2], axis=0)
    turn = 0.4 + 0.1 * np.linspace(0.0, 1.0, len(truth))
    c, s = np.cos(turn[1:]), np.sin(turn[1:])
    moved = np.stack([c * steps[:, 0] - s * steps[:, 1], s * steps[:, 0] + c * steps[:, 1]], axis=1)
    place = np.vstack([[7.0, -2.0], [7.0, -2.0] + np.cumsum(moved, axis=0)])
    return Trajectory(
        unix_s=truth.unix_s,
        positions=np.column_stack([place, np.zeros(len(truth))]),
        headings=truth.headings + turn,
        frame="odom",
    )


def test_odometry_is_put_right_by_positions_that_come_seldom() -> None:
    truth = slow_drive()
    fixes = seldom_positions(truth)
    wanted = np.arange(truth.unix_s[0], truth.unix_s[-1], 1.0)
    assert np.isfinite(fixes.at(wanted, longest_gap_s=2.0)[1]).mean() < 0.3  # alone they place few readings
    found = corrected_odometry(drifting_odometry(truth), fixes, longest_gap_s=2.0)
    place, heading = found.at(wanted, longest_gap_s=2.0)
    true_place, true_heading = truth.at(wanted, longest_gap_s=2.0)
    # [m] half a metre off at the end without it, .0014 with the correction before each pose alone
    assert np.abs(place - true_place).max() < 0.001
    assert np.abs(heading - true_heading).max() < 0.01
    assert found.frame == "map"


def test_readings_between_poses_that_come_seldom_have_no_place_and_that_is_said() -> None:
    truth = slow_drive()
    readings = readings_on(truth, 0.0)
    light = spectral_irradiance(readings)["irradiance"].to_numpy()
    with pytest.raises(ReadingError, match="Record /odom beside"):
        place_readings(readings, seldom_positions(truth), light=light, offset_s=0.0)
    kept = np.abs(truth.unix_s - START - 60.0) > 10.0
    cut = Trajectory(
        unix_s=truth.unix_s[kept], positions=truth.positions[kept], headings=truth.headings[kept], frame="map"
    )
    assert "21 of 155 readings lie between poses" in place_readings(readings, cut, light=light, offset_s=0.0).words[-1]


def test_a_bag_of_odometry_and_positions_gives_the_odometrys_times_in_the_map(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the extra 'robot' is not installed")
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    write_bag(tmp_path / "bag", kind, "SQLITE3", topics={"/odom": POSES, "/amcl_pose": POSES[::2]})
    check_poses(read_poses(tmp_path / "bag"))
    assert len(read_poses(tmp_path / "bag", topic="/amcl_pose")) == len(POSES[::2])


def write_bag(folder: Path, kind: str, storage: str, *, topics: dict[str, Any] | None = None) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    with Writer(folder, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        given = {"/odom": POSES} if topics is None else topics
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic in given}
        for topic, (t, x, y, z, a) in ((topic, pose) for topic, poses in given.items() for pose in poses):
            connection = connections[topic]
            stamp = make["builtin_interfaces/msg/Time"](sec=int(t), nanosec=round(t % 1 * 1e9))
            header = make["std_msgs/msg/Header"](stamp=stamp, frame_id="odom")
            point = make["geometry_msgs/msg/Point"](x=x, y=y, z=z)
            turn = make["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=half(a)[0], w=half(a)[1])
            pose = make["geometry_msgs/msg/Pose"](position=point, orientation=turn)
            if kind == "geometry_msgs/msg/PoseStamped":
                message = make[kind](header=header, pose=pose)
            else:
                covered = make["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))
                message = (
                    make[kind](header=header, pose=covered)
                    if "Odometry" not in kind
                    else odometry(make, header, covered)
                )
            writer.write(connection, round(t * 1e9), store.serialize_cdr(message, kind))


def odometry(make: dict[str, type], header: object, pose: object) -> Any:
    zero = make["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    twist = make["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
    covered = make["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36))
    return make["nav_msgs/msg/Odometry"](header=header, child_frame_id="base", pose=pose, twist=covered)


@pytest.mark.parametrize("spoiled", [b"", b"not a database", b"SQLite format 3\x00" + b"\x00" * 200])
def test_a_damaged_bag_is_a_clear_error(spoiled: bytes, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the extra 'robot' is not installed")
    folder = tmp_path / "bag"
    write_bag(folder, "nav_msgs/msg/Odometry", "SQLITE3")
    (inside,) = folder.glob("*.db3")
    inside.write_bytes(spoiled)
    with pytest.raises(ReadingError):
        read_poses(folder)
    (folder / "metadata.yaml").write_bytes(b"\xff{")
    with pytest.raises(ReadingError):
        read_poses(folder)


@pytest.mark.parametrize(
    "text", ["", "a,b\n1,2\n", "x,y\n1,2\n", "unix_s,x,y\n1,2,3\n", "unix_s,x,y\na,b,c\nd,e,f\n", "\x00"]
)
def test_what_are_no_poses_is_a_clear_error(text: str, tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(LidarSpectraError):
        read_poses(path)
    with pytest.raises(LidarSpectraError):
        read_poses(tmp_path / "none.csv")


def test_a_turn_about_the_upright_is_the_yaw_of_its_quaternion() -> None:
    for angle in (-3.0, -1.0, 0.0, 0.5, 3.1):
        assert yaw(0.0, 0.0, *half(angle)) == pytest.approx(angle)


def locations() -> FloatArray:
    """176 places on the floor, in rows of sixteen."""
    x, y = np.meshgrid(np.linspace(0.3, 2.7, 16), np.linspace(0.3, 2.7, 11))
    return np.column_stack([x.ravel(), y.ravel(), np.full(176, 0.3)])


def test_readings_are_gathered_at_176_locations() -> None:
    path = drive()
    readings = readings_on(path, 0.0, every_s=0.25)
    placed = place_readings(
        readings, path, light=readings["counts"].to_numpy(), offset_s=0.0, mount=(0, 0, 0.3)
    ).readings
    gridded = grid_readings(spectral_irradiance(placed), locations(), radius_m=0.15)
    visited = gridded["readings"].to_numpy() > 0
    assert visited.sum() > 165
    scale = spectral_irradiance(placed)["irradiance"].to_numpy() / placed["counts"].to_numpy()
    true = 3e6 * light_at(locations()[visited]) * np.nanmedian(scale)
    # readings lie up to 0.15 m from their location, over which this light changes by up to 4 %
    assert np.abs(gridded["irradiance"].to_numpy()[visited] / true - 1.0).max() < 0.05
    assert float(gridded["distance"].max()) <= 0.15
    assert gridded.attrs["heights_apart_m"] == pytest.approx(0.3 - float(locations()[0, 2]))


def test_a_measured_table_has_the_columns_of_a_map(tmp_path: Path) -> None:
    path = drive()
    readings = readings_on(path, 0.0)
    placed = place_readings(readings, path, light=readings["counts"].to_numpy(), offset_s=0.0).readings
    gridded = grid_readings(spectral_irradiance(placed), locations())
    count = write_measured(gridded, tmp_path / "measured.csv")
    table = measured_table(gridded)
    assert list(table.columns[:8]) == ["x", "y", "z", "nx", "ny", "nz", "buried", "E_410"]
    assert len(table) == count
    assert np.isfinite(table.to_numpy()).all()
    assert np.allclose(read_locations(tmp_path / "measured.csv"), table[["x", "y", "z"]])


def test_the_error_of_a_location_holds_scatter_and_what_all_readings_share() -> None:
    n = 100
    rng = np.random.default_rng(0)
    counts = 1000.0 * (1.0 + 0.1 * rng.standard_normal((n, 1))) * np.ones((n, 18))
    readings = make_readings(
        unix_s=np.arange(n), counts=counts, gain=16.0, integration_ms=165.2, position=np.zeros((n, 3))
    )
    light = spectral_irradiance(readings)
    gridded = grid_readings(light, [[0.0, 0.0, 0.0]])
    relative = float((gridded["irradiance_se"] / gridded["irradiance"])[0, 0])
    shared = float((light["irradiance_se"] / light["irradiance"])[0, 0])
    assert relative == pytest.approx(np.hypot(shared, 0.1 / np.sqrt(n)), rel=0.02)


@pytest.mark.parametrize("above_m", [0.45, 3.0])
@pytest.mark.parametrize("first", ["lower", "upper"])
def test_a_reading_counts_for_the_location_of_its_height_where_others_lie_below_or_above(
    above_m: float, first: str
) -> None:
    lower = np.array([[x, y, 0.3] for x in range(4) for y in range(4)], dtype=np.float64)
    upper = lower + [0.0, 0.0, above_m]
    both = np.vstack([lower, upper] if first == "lower" else [upper, lower])
    is_upper = np.isclose(both[:, 2], upper[0, 2])
    readings = make_readings(
        unix_s=np.arange(16), counts=np.full((16, 18), 9.0), gain=16.0, integration_ms=165.2,
        position=upper + [0.02, 0.0, 0.05],
    )  # fmt: skip
    gridded = grid_readings(spectral_irradiance(readings), both)
    assert gridded.attrs["radius_m"] == 0.25  # of a grid of 1 m
    assert gridded["readings"].to_numpy().tolist() == is_upper.astype(int).tolist()
    assert gridded.attrs["heights_apart_m"] == pytest.approx(0.05)


def test_readings_in_another_frame_are_refused() -> None:
    readings = make_readings(
        unix_s=[0.0], counts=np.full((1, 18), 9.0), gain=16.0, integration_ms=165.2, position=[[50, 50, 0]]
    )
    with pytest.raises(ReadingError, match="--align"):
        grid_readings(spectral_irradiance(readings), locations())


def test_locations_are_read_as_the_points_file_of_a_run_is(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("# desks\nname,X,y,z\ndesk #2,1.5,2,0.3\nNA,3,4,0.3\n", encoding="utf-8")
    assert read_locations(path).tolist() == [[1.5, 2.0, 0.3], [3.0, 4.0, 0.3]]
    for mark in ";\t":
        path.write_text(f"name{mark}x{mark}y{mark}z\na{mark}1,5{mark}2{mark}0,3\n", encoding="utf-8")
        assert read_locations(path).tolist() == [[1.5, 2.0, 0.3]]


@pytest.mark.parametrize("text", ["", "x,y\n1,2\n", "x,y,z\n1,2,here\n", "x,y,z\n", f"x,y,z\n1,2,{'9' * 400}\n"])
def test_what_are_no_locations_is_a_clear_error(text: str, tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ReadingError):
        read_locations(path)


def test_light_of_a_map_is_that_of_the_robot_s_storey(tmp_path: Path) -> None:
    rows = [f"{x},{y},{z},{light}" for z, light in ((0.3, 1.0), (3.2, 100.0)) for x in range(3) for y in range(3)]
    path = tmp_path / "map.csv"
    path.write_text("\n".join(["x,y,z,E_560", *rows]) + "\n", encoding="utf-8")
    light = map_light(path)(np.array([[0.9, 1.2, 0.0], [0.9, 1.2, 2.9], [1.7, 0.1, 0.5]]))
    np.testing.assert_allclose(light[:, CHANNEL_LABELS.index("560")], [1.0, 100.0, 1.0])
    assert np.isnan(np.delete(light, CHANNEL_LABELS.index("560"), axis=1)).all()
