"""Poses of the robot over time, from a CSV, from ROS 2 bags, and from the output of `ros2 topic echo`."""

import importlib
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.robot.corrected_odometry import corrected_odometry
from lidarspectra.hardware.robot.trajectory import LONGEST_GAP_S, MIN_POSES, Trajectory
from lidarspectra.hardware.sensor.log_times import parse_time
from lidarspectra.io.csv_cells import csv_rows

POSE_TYPES = {
    "nav_msgs/msg/Odometry": ("pose", "pose"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("pose", "pose"),
    "geometry_msgs/msg/PoseStamped": ("pose",),
}  # ROS message types that hold a pose, and the fields that lead to it
ODOMETRY = "/odom"
PREFERRED_TOPICS = ("/amcl_pose", "/pose", ODOMETRY)  # positions in the map before odometry, which drifts
_TIME_COLUMNS = ("unix_s", "time_s", "stamp", "timestamp", "time", "t", "utc")
_ECHO_PARTS = re.compile(r"^(?P<indent> *)(?P<key>\w+):(?: (?P<value>\S.*))?$")


def read_poses(path: Path, *, topic: str | None = None) -> Trajectory:
    """Read poses.

    Parameters
    ----------
    path : Path
        A CSV with columns for time (unix_s, time, stamp ...), x, y and optionally z and yaw or qx, qy, qz, qw [m, rad];
        the output of `ros2 topic echo --csv` or `ros2 topic echo`; or a ROS 2 bag (folder, .db3, .mcap).
    topic : str, optional
        Topic of a bag; by default the one of /amcl_pose, /pose, /odom that it has, or its only one with poses. Where it
        has odometry beside positions in a map, which come seldom, by default the odometry corrected by them.

    Returns
    -------
    trajectory : Trajectory

    Raises
    ------
    ReadingError
        If it cannot be read, or holds no poses.
    """
    if path.is_dir() or path.suffix in (".db3", ".mcap", ".bag"):
        return _read_bag(path, topic)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as cause:
        raise ReadingError(expected="a readable pose file", found=str(cause), where=str(path)) from cause
    rows = list(csv_rows(line for line in text.splitlines() if line.strip() and not line.startswith("#")))
    if rows and {"x", "y"} <= {name.strip().lower() for name in rows[0]}:
        return _from_table(rows, path)
    if rows and len(rows[0]) >= 11 and rows[0][0].strip().isdigit() and rows[0][1].strip().isdigit():
        return _from_echo_csv(rows, path)
    if "position:" in text:
        return _from_echo(text, path)
    raise ReadingError(
        expected="columns for time, x and y, or the output of 'ros2 topic echo'",
        found=f"'{text[:60]}'",
        where=str(path),
        todo="Give a header such as 'unix_s,x,y,yaw' [s, m, m, rad].",
    )


def _trajectory(rows: list[tuple[float, float, float, float, float]], frame: str, where: str) -> Trajectory:
    """Poses (time, x, y, z, heading) in order of time; of several at one time the last is used."""
    table = np.array([row for row in rows if all(map(math.isfinite, row))], dtype=np.float64).reshape(-1, 5)
    if table.shape[0] < MIN_POSES:
        raise ReadingError(
            expected="two poses or more", found=f"{table.shape[0]}", where=where, todo="Check its columns and times."
        )
    table = table[np.argsort(table[:, 0], kind="stable")]
    last = np.append(np.diff(table[:, 0]) > 0, True)
    table = table[last]
    return Trajectory(unix_s=table[:, 0], positions=table[:, 1:4], headings=table[:, 4], frame=frame)


def yaw(x: float, y: float, z: float, w: float) -> float:
    """Heading of a quaternion: rotation about the vertical axis [rad]."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _from_table(rows: list[list[str]], path: Path) -> Trajectory:
    names = [name.strip().lower() for name in rows[0]]
    time_name = next((name for name in _TIME_COLUMNS if name in names), None)
    if time_name is None:
        raise ReadingError(
            expected=f"a column of times ({', '.join(_TIME_COLUMNS)})",
            found=", ".join(names),
            where=str(path),
            todo="Name it unix_s.",
        )

    def number(row: dict[str, str], name: str, default: float) -> float:
        try:
            return float(row[name]) if row.get(name) else default
        except ValueError:
            return math.nan

    poses = []
    for cells in rows[1:]:
        row = dict(zip(names, cells, strict=False))
        heading = number(row, "yaw", number(row, "theta", 0.0))
        if "yaw_deg" in row:
            heading = math.radians(number(row, "yaw_deg", math.nan))
        if {"qx", "qy", "qz", "qw"} <= row.keys():
            heading = yaw(*(number(row, name, math.nan) for name in ("qx", "qy", "qz", "qw")))
        place = (number(row, "x", math.nan), number(row, "y", math.nan), number(row, "z", 0.0))
        poses.append((parse_time(row.get(time_name, "")), *place, heading))
    has_headings = bool({"yaw", "theta", "yaw_deg"} & set(names)) or {"qx", "qy", "qz", "qw"} <= set(names)
    return replace(_trajectory(poses, "as in the file", str(path)), has_headings=has_headings)


def _from_echo_csv(rows: list[list[str]], path: Path) -> Trajectory:
    """`ros2 topic echo --csv /odom`: sec, nanosec, frame, [child frame,] x, y, z, qx, qy, qz, qw, ..."""
    poses = []
    for row in rows:
        words = [cell.strip() for cell in row]
        numbers = 2
        while numbers < len(words) and not _is_number(words[numbers]):
            numbers += 1
        try:
            x, y, z, qx, qy, qz, qw = (float(word) for word in words[numbers : numbers + 7])
            poses.append((int(words[0]) + int(words[1]) * 1e-9, x, y, z, yaw(qx, qy, qz, qw)))
        except (ValueError, OverflowError):  # a line that was cut
            continue
    return _trajectory(poses, rows[0][2].strip(), str(path))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _from_echo(text: str, path: Path) -> Trajectory:
    """`ros2 topic echo /odom`: indented keys, messages parted by '---'."""
    poses = []
    frame = "as in the file"
    for message in text.split("---"):
        values = dict(_leaves(message))
        frame = values.get("header.frame_id", frame).strip("'\"")
        try:
            time_s = int(values["header.stamp.sec"]) + int(values["header.stamp.nanosec"]) * 1e-9
            lead = "pose.pose" if "pose.pose.position.x" in values else "pose"
            x, y, z = (float(values[f"{lead}.position.{axis}"]) for axis in "xyz")
            heading = yaw(*(float(values[f"{lead}.orientation.{axis}"]) for axis in "xyzw"))
        except (KeyError, ValueError, OverflowError):  # the last message may be cut
            continue
        poses.append((time_s, x, y, z, heading))
    return _trajectory(poses, frame, str(path))


def _leaves(message: str) -> Iterator[tuple[str, str]]:
    """Values of an indented text by their path of keys."""
    path: list[tuple[int, str]] = []
    for line in message.splitlines():
        match = _ECHO_PARTS.match(line)
        if match is None:
            continue
        indent = len(match["indent"])
        path = [(at, key) for at, key in path if at < indent]
        path.append((indent, match["key"]))
        if match["value"] is not None:
            yield ".".join(key for _, key in path), match["value"].strip()


def _read_bag(path: Path, topic: str | None) -> Trajectory:
    try:
        reader_type: Any = importlib.import_module("rosbags.highlevel").AnyReader
        typesys: Any = importlib.import_module("rosbags.typesys")
    except ImportError as cause:
        raise ReadingError(
            expected="the library rosbags, to read ROS bags",
            found="it is not installed",
            where=str(path),
            todo="Install it with: pip install 'lidarspectra[robot]'.",
        ) from cause
    store = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        with reader_type([_bag_path(path)], default_typestore=store) as bag:
            types = {c.topic: c.msgtype for c in bag.connections}
            chosen = _choose_topic(types, topic, path)
            found = _of_topic(bag, chosen, path)
            has_odometry = sum(c.msgcount for c in bag.connections if c.topic == ODOMETRY) >= MIN_POSES
            if topic is None and chosen != ODOMETRY and types.get(ODOMETRY) in POSE_TYPES and has_odometry:
                found = corrected_odometry(_of_topic(bag, ODOMETRY, path), found, longest_gap_s=LONGEST_GAP_S)
            return found
    except ReadingError:
        raise
    except _bag_failures() as cause:
        raise ReadingError(
            expected="a whole ROS bag", found=str(cause), where=str(path), todo="Try 'ros2 bag reindex' on it."
        ) from cause


def _of_topic(bag: Any, topic: str, path: Path) -> Trajectory:
    """The poses of a topic of an open bag."""
    poses, frame = [], topic
    for connection, received_ns, raw in bag.messages(connections=[c for c in bag.connections if c.topic == topic]):
        message = bag.deserialize(raw, connection.msgtype)
        pose = message
        for name in POSE_TYPES[connection.msgtype]:
            pose = getattr(pose, name)
        stamp = message.header.stamp
        time_s = stamp.sec + stamp.nanosec * 1e-9 if stamp.sec else received_ns * 1e-9
        q = pose.orientation
        place = (pose.position.x, pose.position.y, pose.position.z)
        poses.append((time_s, *place, yaw(q.x, q.y, q.z, q.w)))
        frame = message.header.frame_id or frame
    return _trajectory(poses, frame, f"{path}, topic {topic}")


def _bag_failures() -> tuple[type[Exception], ...]:
    """What the library raises for damaged bags: one error class per format, and some errors of its dependencies."""
    names = (
        ("rosbags.highlevel", "AnyReaderError"),
        ("rosbags.rosbag1", "ReaderError"),
        ("rosbags.rosbag2", "ReaderError"),
    )
    own = [getattr(importlib.import_module(module), name) for module, name in names]
    sqlite_error: type[Exception] = importlib.import_module("sqlite3").Error
    return (*own, sqlite_error, OSError, ValueError, KeyError, AssertionError)


def _bag_path(path: Path) -> Path:
    """A ROS 2 bag is a folder: of a file inside, that folder."""
    inside = path.suffix in (".db3", ".mcap") and (path.parent / "metadata.yaml").is_file()
    return path.parent if inside else path


def _choose_topic(types: dict[str, str], wanted: str | None, path: Path) -> str:
    topics = sorted(topic for topic, kind in types.items() if kind in POSE_TYPES)
    if wanted is not None and wanted in topics:
        return wanted
    if wanted is None:
        for topic in PREFERRED_TOPICS:
            if topic in topics:
                return topic
        if len(topics) == 1:
            return topics[0]
    raise ReadingError(
        expected=f"the topic '{wanted}' with poses" if wanted is not None else "one topic with poses",
        found=", ".join(topics) or "none",
        where=str(path),
        todo="Name one with --topic." if topics else "Record /odom or /amcl_pose: 'ros2 bag record /odom /amcl_pose'.",
    )
