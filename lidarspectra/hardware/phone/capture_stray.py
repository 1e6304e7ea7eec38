"""Frames of Stray Scanner: `rgb.mp4`, `odometry.csv`, `camera_matrix.csv`, `depth/N.png`, `confidence/N.png`.

`odometry.csv` has a row a frame, its columns named in the first line: timestamp [s], frame, x, y, z [m], qx, qy, qz,
qw, and in later versions fx, fy, cx, cy [px]. Poses are camera to world with y up; the camera's axes are those of
computer vision (x right, y down, looking along z). Intrinsics are the video's. Depth is in millimetres (16 bit),
confidence 0, 1, 2. There is no mesh, and no exposure. The video's first frame has a time before the beginning of its
session, so that its edit list leaves it out (`mp4`): the first picture is that of the second row.

References
----------
Stray Robots, scanner (github.com/strayrobots/scanner), docs/format.md, StrayScanner/Helpers/OdometryEncoder.swift,
DatasetEncoder.swift and VideoEncoder.swift (times of frames).
"""

import csv
import io
from collections.abc import Mapping

import numpy as np

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.capture_files import CaptureFiles
from lidarspectra.hardware.phone.frames import (
    Capture,
    DepthMap,
    Frame,
    FrameFault,
    checked_frame,
    decode_depth,
    gathered,
    pose_of_quaternion,
)
from lidarspectra.hardware.phone.video import Video, open_video

APP = "Stray Scanner"
VIDEO, ODOMETRY, CAMERA = "rgb.mp4", "odometry.csv", "camera_matrix.csv"
POSE_COLUMNS = ("qx", "qy", "qz", "qw", "x", "y", "z")
FROM_VISION = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y up, looking along -z, in axes of computer vision
MAX_DIGITS = 9  # of a frame's number; the app writes 6
MAX_TEXT_BYTES = 256 * 1024**2  # [byte] of the odometry: 200 bytes a frame, 60 frames a second


def is_stray(files: CaptureFiles) -> bool:
    """Whether a folder has this app's layout."""
    return {VIDEO, ODOMETRY} <= files.names


def read_stray(files: CaptureFiles) -> Capture:
    """Read the frames; there is no mesh.

    Parameters
    ----------
    files : CaptureFiles

    Returns
    -------
    capture : Capture
        Its `close` closes the video, too.

    Raises
    ------
    ScanError
        If video or odometry are damaged.
    """
    rows = _rows(files)
    usual = _camera(files)
    video = open_video(files, VIDEO)
    # The app's video leaves out its first frame, whose pose and depth are exported: it is none that is lost.
    shown = [name for name in rows if not (_is_number(name) and int(name) < video.before)]
    frames, left_out = gathered(shown, lambda name: _frame(files, video, name, rows[name], usual))
    return Capture(app=APP, where=files.where, frames=frames, left_out=left_out, close=video.close)


def _rows(files: CaptureFiles) -> dict[str, dict[str, str]]:
    """Columns of each frame, by its number."""
    text = files.read_whole(ODOMETRY, limit=MAX_TEXT_BYTES).decode("utf-8", errors="replace")
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        names = [name.strip() for name in next(reader, [])]
        rows = [dict(zip(names, row, strict=False)) for row in reader if row]
    except csv.Error as cause:
        raise _damaged(files, str(cause)) from cause
    if not {*POSE_COLUMNS, "frame"} <= set(names):
        raise _damaged(files, f"columns {', '.join(names)[:200]}")
    return {row.get("frame", "").strip(): row for row in rows}


def _damaged(files: CaptureFiles, found: str) -> ScanError:
    return ScanError(
        expected=f"{ODOMETRY} with the columns timestamp, frame, {', '.join(POSE_COLUMNS)}",
        found=found,
        where=f"{files.where} ({APP})",
        todo="Export the recording again with a present version of the app, or copy it again.",
    )


def _camera(files: CaptureFiles) -> list[list[str]] | None:
    """Rows of `camera_matrix.csv`, if there is one."""
    if CAMERA not in files.names:
        return None
    text = files.read_whole(CAMERA, limit=MAX_TEXT_BYTES).decode("utf-8", errors="replace")
    return [line.split(",") for line in text.splitlines() if line.strip()]


def _is_number(name: str) -> bool:
    return name.isdecimal() and name.isascii() and len(name) <= MAX_DIGITS


def _frame(
    files: CaptureFiles, video: Video, name: str, row: Mapping[str, str], usual: list[list[str]] | None
) -> Frame:
    if not _is_number(name) or int(name) >= video.frames:
        raise FrameFault("the video has no such frame")
    number = int(name)

    def depth() -> DepthMap | None:
        measured, sure = f"depth/{name}.png", f"confidence/{name}.png"
        if measured not in files.names:
            return None
        confidence = files.read(sure) if sure in files.names else None
        return decode_depth(files.read(measured), confidence, video.size_px)

    pose = pose_of_quaternion([row.get(each) for each in POSE_COLUMNS])
    own = [row.get(each) for each in ("fx", "fy", "cx", "cy")]
    matrix = usual if None in own else [[own[0], "0", own[2]], ["0", own[1], own[3]], ["0", "0", "1"]]
    try:
        time_s: object = float(row.get("timestamp", ""))
    except ValueError:
        time_s = None
    return checked_frame(
        name=name,
        camera_to_world=None if pose is None else pose @ FROM_VISION,
        intrinsics=matrix,
        size_px=video.size_px,
        time_s=time_s,
        read_image=lambda least_px: video.read(number, least_px),
        read_depth=depth,
    )
