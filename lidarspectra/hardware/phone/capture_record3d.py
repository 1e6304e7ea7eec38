"""Frames of Record3D (`.r3d`): a zip archive of `metadata`, `rgbd/N.jpg`, `rgbd/N.depth` and `rgbd/N.conf`.

`metadata` is JSON without an ending. `poses` has a row a frame, quaternion x, y, z, w and position [m], camera to world
with y up, camera x to the right of the picture as it is stored and looking along -z. Intrinsics stand in
`perFrameIntrinsicCoeffs` (f_x, f_y, c_x, c_y) or, in older files, once in `K` (column-major), both of a picture `w` by
`h`. Depth is 32-bit floats [m], `dh` rows of `dw`, confidence bytes 0, 1, 2 alike, both compressed by LZFSE. There is
no mesh, and no exposure.

The axes are those of the phone when the recording began ("the initial pose is zero", the app's author): y is up only if
it was held upright then. The vertical is told by the walk: a phone is pitched up and down but hardly rolled, so that
the side of its picture that lies level sweeps out a horizontal plane as one turns.

References
----------
Record3D, "Exporting" (record3d.app); github.com/marek-simonik/record3d, issue 27 (where poses begin); nerfstudio,
nerfstudio/process_data/record3d_utils.py (poses).
"""

import ctypes
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.capture_files import CaptureFiles
from lidarspectra.hardware.phone.frames import (
    Capture,
    DepthMap,
    Frame,
    FrameFault,
    checked_frame,
    decode_picture,
    depth_map,
    gathered,
    image_size,
    pose_of_quaternion,
)

APP = "Record3D"
METADATA = "metadata"
LIDAR_PX = (192, 256)  # [px] columns and rows of the LiDAR's depth in a picture held upright, where the file is silent
MAX_PIXELS = (
    640 * 480
)  # [px] of the face camera's depth, the larger of the two; bounds what a packed file may unpack to
MIN_SWEPT, MAX_ROLLED = 0.2, 0.25  # [1] least variance across the plane that an axis sweeps out; that off it, over it
MIN_POSES = 8
AS_IT_IS_DEG = 20.0  # [deg] of the vertical from y, within which recordings stay: what leans so little is set upright
TURNED = (
    "Record3D counts from how the phone was held when the recording began, {angle:.0f}° from upright. Up is what it is "
    "by how the phone was turned while you walked. If the room lies on its side or its head, give up in [scan]."
)
_DECODE_ARGUMENTS = (ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p)
_PICTURE = re.compile(r"rgbd/(\d{1,9})\.jpg")


def is_record3d(files: CaptureFiles) -> bool:
    """Whether a folder has this app's layout."""
    return METADATA in files.names and any(_PICTURE.fullmatch(name) for name in files.names)


def read_record3d(files: CaptureFiles) -> Capture:
    """Read the frames; there is no mesh.

    Parameters
    ----------
    files : CaptureFiles

    Returns
    -------
    capture : Capture

    Raises
    ------
    ScanError
        If the metadata are damaged, all poses are one, or the library for the depth is missing.
    """
    about = _metadata(files)
    if any(name.endswith(".depth") for name in files.names):
        _lzfse(files.where)
    numbers = {int(match[1]): match[1] for name in files.names if (match := _PICTURE.fullmatch(name))}
    # Rows count the frames in their order, also where the app was told to keep only some of them.
    names = [numbers[each] for each in sorted(numbers)]
    rows = {name: row for row, name in enumerate(names)}
    frames, left_out = gathered(names, lambda name: _frame(files, about, name, rows[name]))
    if len(frames) > 1 and all((frame.camera_to_world == frames[0].camera_to_world).all() for frame in frames):
        raise ScanError(
            expected="a recording with the LiDAR, whose frames have poses",
            found=f"one and the same pose in all {len(frames)} frames, as the face camera's have",
            where=f"{files.where} ({APP})",
            todo="Record again with the LiDAR.",
        )
    capture = Capture(app=APP, where=files.where, frames=frames, left_out=left_out, up=None)
    vertical = vertical_of_walk([frame.camera_to_world for frame in frames])
    if vertical is None:
        return capture
    capture = replace(capture, up="+y" if vertical.is_sure else None)
    angle = float(np.degrees(np.arccos(np.clip(vertical.up[1], -1.0, 1.0))))
    if angle < AS_IT_IS_DEG:
        return capture
    turn = Rotation.align_vectors([[0.0, 1.0, 0.0]], vertical.up[None])[0].as_matrix()
    upright = tuple(frame.moved(turn) for frame in frames)
    return replace(capture, frames=upright, notes=(TURNED.format(angle=angle),))


@dataclass(frozen=True, kw_only=True, eq=False)
class Vertical:
    """Which way is up in the axes of a recording: (3,) unit vector [1], and whether it may not be down instead."""

    up: FloatArray
    is_sure: bool


def vertical_of_walk(poses: Sequence[FloatArray]) -> Vertical | None:
    """The vertical by how a phone was held while it was turned.

    Parameters
    ----------
    poses : sequence of (4, 4) float
        Camera to world, x to the right of the picture and y up in it. [m]

    Returns
    -------
    vertical : Vertical or None
        The normal of the plane that the picture's level axis swept out; None if it was hardly turned, or rolled much.
        Of a phone held with its picture upright it is the way that the picture's top points; of one held on its side,
        the way that it looked away from, as one looks down rather than up, which is not sure.
    """
    if len(poses) < MIN_POSES:
        return None
    axes = np.stack([pose[:3, :3] for pose in poses])
    best: tuple[float, int, FloatArray] | None = None
    for axis in (0, 1):
        spread, ways = np.linalg.eigh(axes[:, :, axis].T @ axes[:, :, axis] / len(axes))
        rolled = float(spread[0] / max(spread[1], 1e-9))
        if spread[1] > MIN_SWEPT and rolled < MAX_ROLLED and (best is None or rolled < best[0]):
            best = rolled, axis, ways[:, 0]
    if best is None:
        return None
    _, level, up = best
    along = float((axes[:, :, 1 if level == 0 else 2] @ up).mean())
    return Vertical(up=up if along > 0 else -up, is_sure=level == 0)


def _metadata(files: CaptureFiles) -> dict[str, Any]:
    try:
        return files.read_json(METADATA)
    except FrameFault as cause:
        raise ScanError(
            expected="metadata in JSON",
            found=str(cause),
            where=f"{files.where} ({APP})",
            todo="Export or copy the recording again.",
        ) from cause


def _frame(files: CaptureFiles, about: dict[str, Any], name: str, row: int) -> Frame:
    picture = f"rgbd/{name}.jpg"
    size = image_size(files.read(picture))

    def depth() -> DepthMap | None:
        if f"rgbd/{name}.depth" not in files.names:
            return None
        return _depth(files, about, name, size)

    return checked_frame(
        name=name,
        camera_to_world=pose_of_quaternion(_row(about, "poses", row)),
        intrinsics=_intrinsics(about, row, size),
        size_px=size,
        time_s=_time(about, row),
        read_image=lambda least_px: decode_picture(files.read(picture), size, least_px),
        read_depth=depth,
    )


def _row(about: dict[str, Any], key: str, row: int) -> object:
    rows = about.get(key)
    return rows[row] if isinstance(rows, list) and row < len(rows) else None


def _time(about: dict[str, Any], row: int) -> object:
    told = _row(about, "frameTimestamps", row)
    rate = about.get("fps")
    if told is None and isinstance(rate, int | float) and rate > 0:
        return row / rate
    return told


def _intrinsics(about: dict[str, Any], row: int, size_px: tuple[int, int]) -> object:
    """(3, 3) of the picture as it is stored, which may be smaller than the one that the file describes."""
    told = _row(about, "perFrameIntrinsicCoeffs", row)
    try:
        if told is not None:
            focal_x, focal_y, center_x, center_y = (float(value) for value in np.asarray(told)[:4])
        else:
            matrix = np.asarray(about.get("K"), dtype=np.float64).reshape(3, 3).T
            focal_x, focal_y, center_x, center_y = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
        across = size_px[0] / float(about.get("w", size_px[0]))
        down = size_px[1] / float(about.get("h", size_px[1]))
    except (ValueError, TypeError, IndexError, OverflowError, ZeroDivisionError):
        return None
    return [[focal_x * across, 0.0, center_x * across], [0.0, focal_y * down, center_y * down], [0.0, 0.0, 1.0]]


def _depth(files: CaptureFiles, about: dict[str, Any], name: str, size_px: tuple[int, int]) -> DepthMap:
    columns, rows = (about.get(key, usual) for key, usual in zip(("dw", "dh"), LIDAR_PX, strict=True))
    whole = isinstance(columns, int) and isinstance(rows, int) and min(columns, rows) > 0
    if not (whole and columns * rows <= MAX_PIXELS):
        raise FrameFault("the size of its depth is missing, or too large")
    shape = (rows, columns)
    metres = np.frombuffer(_unpacked(files, f"rgbd/{name}.depth", 4 * rows * columns), dtype="<f4").reshape(shape)
    sure = f"rgbd/{name}.conf"
    if sure not in files.names:
        return depth_map(metres.astype(np.float64), np.full(shape, 2.0), size_px)
    confidence = np.frombuffer(_unpacked(files, sure, rows * columns), dtype=np.uint8).reshape(shape)
    return depth_map(metres.astype(np.float64), confidence.astype(np.float64), size_px)


def _unpacked(files: CaptureFiles, name: str, size: int) -> bytes:
    """Content of a file that LZFSE packed, of a known size [byte]."""
    library = _lzfse(files.where)
    packed = files.read(name)
    what = "its depth" if name.endswith(".depth") else "its confidence"
    if len(packed) > size + 1024:  # what cannot be packed is stored, with a few bytes around it
        raise FrameFault(f"{what} is larger than its picture says")
    try:
        data = _decoded(library, packed, size)
    except (library.error, ValueError, MemoryError) as cause:
        raise FrameFault(f"{what} is cut off or damaged") from cause
    if len(data) != size:
        raise FrameFault(f"{what} has another size than the recording says")
    return data


def _decoded(library: Any, packed: bytes, size: int) -> bytes:
    """What was packed, cut off one byte beyond its size: a small file may be made to unpack to gigabytes.

    The library's own function has no such limit. On Windows, where its module shows nothing else, that has to do.
    """
    decode = getattr(ctypes.CDLL(library.__file__), "lzfse_decode_buffer", None)
    if decode is None:
        return bytes(library.decompress(packed))
    decode.restype, decode.argtypes = ctypes.c_size_t, _DECODE_ARGUMENTS
    buffer = ctypes.create_string_buffer(size + 1)
    count = int(decode(buffer, size + 1, packed, len(packed), None))
    if count == 0 and size > 0:
        raise ValueError("nothing could be unpacked")
    return buffer.raw[:count]


def _lzfse(where: str) -> Any:
    """The library, a module of C without types, which is an extra."""
    try:
        import lzfse
    except ImportError as cause:
        raise ScanError(
            expected="the library that unpacks the depth of Record3D (lzfse)",
            found="none",
            where=where,
            todo="Install it with 'pip install lidarspectra[frames]', or export a mesh from the app as GLB.",
        ) from cause
    return lzfse
