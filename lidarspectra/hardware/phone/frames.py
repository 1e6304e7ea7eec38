"""Frames of a phone: pictures with pose, intrinsics, exposure and depth, and what an app exported of them.

Only what these records name is ever taken from an app's files. Positions on Earth, dates, names of devices and people
stand beside it in some of them (EXIF, `info.json`) and are not read.
"""

import io
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from lidarspectra.arrays import ByteArray, FloatArray, float_array
from lidarspectra.errors import ArrayError, ScanError
from lidarspectra.geometry.textures import IMAGE_FORMATS, decode_image
from lidarspectra.hardware.phone.raw_mesh import PARSER_FAULTS, Axis, RawMesh

MAX_DEPTH_PIXELS = 2048 * 2048  # [px] phones write 256 x 192
ROTATION_TOLERANCE = 1e-2  # [1] of R^T R from the identity; poses are written as 32-bit floats or better
MAX_SPEED_M_S = 2.5  # [m/s] away and back again; stills are half a second apart, in which no arm goes further
MIN_JUMP_M = 0.1  # [m] between neighbours in a video, whose poses tremble; poses are mended by less than that
MAX_JUMPED = 5  # frames in a row that jumped away together
FOCAL_RANGE = (0.2, 10.0)  # [1] of the focal length over the picture's width: 5° to 136° of view
OFF_CENTER, UNEVEN_PIXELS = 0.1, 0.1  # [1] of the principal point, over the size; between the focal lengths
MAX_NAMED = 5  # frames named in a note
FEW_FRAMES, MAX_FRAMES = 400, 600  # up to which all are used; of a video
KEY_STEP_M, KEY_STEP_DEG = 0.08, 6.0  # [m], [deg] from one frame of a video to the next that is used
LOOK_S = 0.7  # [s] without such a step, in which a phone comes to expose for what it looks at, as a lamp
ASPECT_TOLERANCE = 0.02  # [1] between the sides of a picture and of its depth
FEW_LEFT_OUT = (
    "What only they saw takes its colour from its surroundings; export or copy the scan again if that is a large part "
    "of the room."
)

ReadImage = Callable[[int], ByteArray]
"""From the least width [px] to the picture, which may be decoded at a half or a quarter of its size."""


class FrameFault(Exception):  # noqa: N818 - it never leaves the readers: the frame is left out and its reason kept
    """Why a single frame cannot be used, as a short reason for the user."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthMap:
    """What the LiDAR measured for a frame.

    Parameters
    ----------
    depth_m : (row, column) float32
        Along the camera's axis; 0 where nothing was measured. [m]
    confidence : (row, column) uint8
        0 low, 1 medium, 2 high, as ARKit says it.
    """

    depth_m: FloatArray
    confidence: ByteArray


ReadDepth = Callable[[], DepthMap | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One picture of a scan.

    Parameters
    ----------
    name : str
        As the app numbers it.
    camera_to_world : (4, 4) float
        Pose, rigid: camera x to the right, y up, looking along -z. [m]
    intrinsics : (3, 3) float
        Focal lengths and principal point of the picture as it is stored. [px]
    size_px : (int, int)
        Width and height. [px]
    time_s : float or None
        On any clock. [s]
    exposure_s, iso : float or None
        Exposure time and sensitivity; None where the app does not say. [s], [1]
    read_image : callable
        Decodes the picture, sRGB bytes, at a least width [px]; raises FrameFault if it is damaged.
    read_depth : callable
        Decodes the depth; None without any; raises FrameFault if it is damaged.
    """

    name: str
    camera_to_world: FloatArray
    intrinsics: FloatArray
    size_px: tuple[int, int]
    time_s: float | None = None
    exposure_s: float | None = None
    iso: float | None = None
    read_image: ReadImage
    read_depth: ReadDepth

    @property
    def position(self) -> FloatArray:
        """(3,) where the camera was [m]."""
        return np.asarray(self.camera_to_world[:3, 3], dtype=np.float64)

    @property
    def direction(self) -> FloatArray:
        """(3,) unit vector along which it looks [1]."""
        return np.asarray(-self.camera_to_world[:3, 2], dtype=np.float64)

    def left_out(self, reason: str) -> "LeftOut":
        """The record of this frame if it is not used."""
        x, y, z = self.position.tolist()
        return LeftOut(name=self.name, reason=reason, position_m=(x, y, z))

    def moved(self, rotation: FloatArray, scale: float = 1.0) -> "Frame":
        """The same frame in axes turned by a (3, 3) rotation; positions are multiplied by a scale [1]."""
        pose = np.eye(4)
        pose[:3, :3] = rotation @ self.camera_to_world[:3, :3]
        pose[:3, 3] = scale * (rotation @ self.position)
        return replace(self, camera_to_world=pose)


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A frame that is not used.

    Parameters
    ----------
    name : str
    reason : str
        Part of a sentence ("its picture is cut off").
    position_m : (float, float, float), optional
        Where it was taken by its pose, in the axes of the frames that are used; None if that is not known. [m]
    """

    name: str
    reason: str
    position_m: tuple[float, float, float] | None = None


def _stay_closed() -> None:
    """Of frames that hold no file open."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Capture:
    """What an app exported of a scan, frame by frame.

    Parameters
    ----------
    app : str
        Whose layout it is.
    where : str
        Name of its folder or file.
    frames : tuple of Frame
        Those that can be used, in the order of time; metres, y up as far as the app knows.
    left_out : tuple of LeftOut
        The others.
    mesh : RawMesh or None
        The app's own mesh, in the axes of the poses; None if it exported none.
    notes : tuple of str
        What the user should know.
    up : str or None
        Upward axis of the poses; None if it may be another than y, where the app does not know the vertical.
    close : callable
        Closes the archive that pictures and depths are read from; one that is read afterwards opens it again.
    """

    app: str
    where: str
    frames: tuple[Frame, ...]
    left_out: tuple[LeftOut, ...] = ()
    mesh: RawMesh | None = None
    notes: tuple[str, ...] = ()
    up: Axis | None = "+y"
    close: Callable[[], None] = _stay_closed


def checked_frame(
    *,
    name: str,
    camera_to_world: object,
    intrinsics: object,
    size_px: tuple[int, int],
    read_image: ReadImage,
    read_depth: ReadDepth,
    time_s: object = None,
    exposure_s: object = None,
    iso: object = None,
) -> Frame:
    """A frame of what an app's file says.

    Parameters
    ----------
    name : str
        As the app numbers it.
    camera_to_world : (4, 4) or (16,) of number
        Row by row; x to the right, y up, looking along -z. [m]
    intrinsics : (3, 3) or (9,) of number
        Row by row, of the picture as it is stored. [px]
    size_px : (int, int)
        Width and height. [px]
    read_image, read_depth : callable
        As of `Frame`.
    time_s, exposure_s, iso : optional
        None is kept of what is no finite number, and of exposures that are not above 0. [s, s, 1]

    Returns
    -------
    frame : Frame

    Raises
    ------
    FrameFault
        If pose or intrinsics are missing, no finite numbers, no rotation, or of a picture of another size.
    """
    pose = _numbers(camera_to_world, (4, 4), "its pose")
    turn = pose[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > ROTATION_TOLERANCE or np.linalg.det(turn) < 0:
        raise FrameFault("its pose is no rotation and shift")
    matrix = _numbers(intrinsics, (3, 3), "its intrinsics")
    width, height = size_px
    focal, center = np.array([matrix[0, 0], matrix[1, 1]]), matrix[:2, 2]
    low, high = FOCAL_RANGE
    # Those of a picture of half the size, or held upright, have their middle elsewhere; pixels are square.
    central = (np.abs(center / (width, height) - 0.5) < OFF_CENTER).all()
    square = focal.min() > (1.0 - UNEVEN_PIXELS) * focal.max()
    if not (central and square and (focal > low * width).all() and (focal < high * width).all()):
        raise FrameFault("its intrinsics do not belong to a picture of its size")
    return Frame(
        name=name,
        camera_to_world=np.vstack([pose[:3], [0.0, 0.0, 0.0, 1.0]]),
        intrinsics=np.array([[focal[0], 0.0, center[0]], [0.0, focal[1], center[1]], [0.0, 0.0, 1.0]]),
        size_px=size_px,
        time_s=_finite(time_s),
        exposure_s=_positive(exposure_s),
        iso=_positive(iso),
        read_image=read_image,
        read_depth=read_depth,
    )


def _numbers(values: object, shape: tuple[int, int], what: str) -> FloatArray:
    try:
        numbers = np.asarray(values, dtype=np.float64).reshape(shape)
        return float_array(numbers, name=what, shape=shape)
    except (ValueError, TypeError, OverflowError, ArrayError) as cause:
        raise FrameFault(f"{what} is missing or no matrix of finite numbers") from cause


def _finite(value: object) -> float | None:
    if isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value):
        return float(value)
    return None


def _positive(value: object) -> float | None:
    number = _finite(value)
    return number if number is not None and number > 0 else None


def pose_of_quaternion(values: object) -> FloatArray | None:
    """Pose of a quaternion and a position.

    Parameters
    ----------
    values : (7,) of number
        Quaternion x, y, z, w, of any length above 0, and position x, y, z. [1], [m]

    Returns
    -------
    pose : (4, 4) float or None
        None if they are no such numbers.
    """
    try:
        row = np.asarray(values, dtype=np.float64)
        if row.shape != (7,) or not np.isfinite(row).all():
            return None
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat(row[:4]).as_matrix()
    except (ValueError, TypeError, OverflowError):
        return None
    pose[:3, 3] = row[4:]
    return pose


def image_size(data: bytes) -> tuple[int, int]:
    """(width, height) of an encoded picture [px], from its header; FrameFault if it has none."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of odd metadata, which are not looked at
            with Image.open(io.BytesIO(data), formats=IMAGE_FORMATS) as image:
                return image.width, image.height
    except (*PARSER_FAULTS, SyntaxError, Image.DecompressionBombError) as cause:
        raise FrameFault("its picture cannot be read") from cause


def decode_picture(data: bytes, size_px: tuple[int, int], least_px: int) -> ByteArray:
    """Decode a frame's picture of a known size.

    Parameters
    ----------
    data : bytes
        Encoded.
    size_px : (int, int)
        Width and height by its header. [px]
    least_px : int
        Least width; larger pictures may be decoded at a half, a quarter or an eighth of theirs. [px]

    Returns
    -------
    picture : (height, width, 3) uint8
        sRGB, by the picture's ICC profile where it has one.

    Raises
    ------
    FrameFault
        If it is damaged, or has another shape than its header says.
    """
    try:
        picture = decode_image(data, name="picture", least_px=least_px, by_profile=True)
    except ScanError as cause:
        raise FrameFault("its picture is cut off or damaged") from cause
    height, width = picture.shape[:2]
    if abs((width / height) / (size_px[0] / size_px[1]) - 1.0) > ASPECT_TOLERANCE:
        raise FrameFault("its picture has another shape than its header says")
    return picture


def decode_depth(
    depth: bytes, confidence: bytes | None, size_px: tuple[int, int], *, confidence_scale: float = 1.0
) -> DepthMap:
    """Decode depth [mm, 16 bit] and confidence as apps write them (PNG).

    Parameters
    ----------
    depth : bytes
    confidence : bytes or None
        High everywhere if there is none.
    size_px : (int, int)
        Of the picture: both show the same field of view. [px]
    confidence_scale : float
        Of the file's values over 0, 1, 2. [1]

    Raises
    ------
    FrameFault
        If one is damaged, or of another shape than the other or the picture.
    """
    millimetres = _single_channel(depth, "its depth")
    sure = np.full(millimetres.shape, 2.0) if confidence is None else _single_channel(confidence, "its confidence")
    return depth_map(millimetres / 1000.0, np.rint(sure / confidence_scale), size_px)


def depth_map(depth_m: FloatArray, confidence: FloatArray, size_px: tuple[int, int]) -> DepthMap:
    """Depth and confidence that belong to a picture.

    Parameters
    ----------
    depth_m : (row, column) float
        Not finite, or not above 0, where nothing was measured. [m]
    confidence : (row, column) float
        0 low, 1 medium, 2 high; clipped to these.
    size_px : (int, int)
        Width and height of the picture, which shows the same field of view. [px]

    Returns
    -------
    depth : DepthMap

    Raises
    ------
    FrameFault
        If confidence is of another size than depth, or depth of another shape than the picture.
    """
    if confidence.shape != depth_m.shape:
        raise FrameFault("its confidence has another size than its depth")
    aspect = (depth_m.shape[1] / max(depth_m.shape[0], 1)) / (size_px[0] / size_px[1])
    if depth_m.size == 0 or abs(aspect - 1.0) > ASPECT_TOLERANCE:
        raise FrameFault("its depth has another shape than its picture")
    known = np.isfinite(depth_m) & (depth_m > 0)
    return DepthMap(
        depth_m=np.where(known, depth_m, 0.0).astype(np.float32),
        confidence=np.where(known, np.clip(confidence, 0, 2), 0).astype(np.uint8),
    )


def _single_channel(data: bytes, what: str) -> FloatArray:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=("PNG",)) as image:
                if image.width * image.height > MAX_DEPTH_PIXELS:
                    raise FrameFault(f"{what} is larger than any phone's")
                values = np.asarray(image, dtype=np.float64)
    except (*PARSER_FAULTS, SyntaxError, Image.DecompressionBombError) as cause:
        raise FrameFault(f"{what} is cut off or damaged") from cause
    if values.ndim != 2:
        raise FrameFault(f"{what} has more than one channel")
    return values


def gathered(names: Iterable[str], read: Callable[[str], Frame]) -> tuple[tuple[Frame, ...], tuple[LeftOut, ...]]:
    """Read frames one by one.

    Parameters
    ----------
    names : iterable of str
        As the app numbers them, in the order of time.
    read : callable
        From a name to its frame; raises FrameFault.

    Returns
    -------
    frames : tuple of Frame
    left_out : tuple of LeftOut
        Those of a fault.
    """
    frames, left_out = [], []
    for name in names:
        try:
            frames.append(read(name))
        except FrameFault as fault:
            left_out.append(LeftOut(name=name, reason=str(fault)))
    return tuple(frames), tuple(left_out)


def without_jumps(frames: Sequence[Frame]) -> tuple[tuple[Frame, ...], tuple[LeftOut, ...]]:
    """Leave out frames whose pose jumped away from those before and after, which lie near each other.

    The first and the last, if alone, are left out as well: of more, nothing but the mesh says which are wrong.
    """
    jumped: set[int] = set()
    for end, next_one, third in ((0, 1, 2), (-1, -2, -3)) if len(frames) > 2 else ():
        if _jumps(frames[end], frames[next_one]) and not _jumps(frames[next_one], frames[third]):
            jumped.add(end % len(frames))
    number = 1
    while number < len(frames) - 1:
        count = _jumped_together(frames, number)
        jumped |= set(range(number, number + count))
        number += count + 1
    out = [
        LeftOut(name=frames[each].name, reason="its pose jumps away from its neighbours'") for each in sorted(jumped)
    ]
    return tuple(frame for each, frame in enumerate(frames) if each not in jumped), tuple(out)


def _jumped_together(frames: Sequence[Frame], first: int) -> int:
    """How many frames from this one on jumped away from the one before them and back to the one after them."""
    before = frames[first - 1]
    if not _jumps(before, frames[first]):
        return 0
    for count in range(1, min(MAX_JUMPED, len(frames) - first - 1) + 1):
        after = frames[first + count]
        if _jumps(frames[first + count - 1], after) and not _jumps(before, after):
            return count
    return 0


def key_frames(frames: Sequence[Frame]) -> tuple[Frame, ...]:
    """Frames of a video that differ in position or direction, at most `MAX_FRAMES`; all of a scan's stills.

    Parameters
    ----------
    frames : sequence of Frame
        In the order of time.

    Returns
    -------
    kept : tuple of Frame
        All if there are few. Of more, those that moved by a step from the last that is kept, and the last before them
        where that took a look's time: only then the phone was exposed for what it looked at. The step is widened until
        they are few enough.
    """
    if len(frames) <= FEW_FRAMES:
        return tuple(frames)
    shift_m, turn = KEY_STEP_M, np.radians(KEY_STEP_DEG)
    while True:
        kept = [frames[0]]
        key = frames[0]
        for before, frame in pairwise(frames):
            if _differ(key, frame, shift_m, turn):
                kept += [before, frame] if _is_look(key, before) else [frame]
                key = frame
        kept += [frames[-1]] if _is_look(key, frames[-1]) else []
        if len(kept) <= MAX_FRAMES:
            return tuple(kept)
        shift_m, turn = 1.3 * shift_m, min(1.3 * turn, np.pi)


def _differ(one: Frame, other: Frame, shift_m: float, turn: float) -> bool:
    """Whether they were taken further apart than a shift [m], or look elsewhere by more than a turn [rad]."""
    cosine = float((one.camera_to_world[:3, 2] * other.camera_to_world[:3, 2]).sum())
    return bool(np.linalg.norm(other.position - one.position) > shift_m or cosine < np.cos(turn))


def _is_look(first: Frame, last: Frame) -> bool:
    """Whether a phone looked at one thing from the first to the last; not where that is not known."""
    return first.time_s is not None and last.time_s is not None and last.time_s - first.time_s >= LOOK_S


def _jumps(one: Frame, other: Frame) -> bool:
    """Whether nobody can have walked from one to the other in the time between; not where that is not known."""
    if one.time_s is None or other.time_s is None:
        return False
    way_m, took_s = float(np.linalg.norm(one.position - other.position)), abs(one.time_s - other.time_s)
    return way_m > max(MIN_JUMP_M, MAX_SPEED_M_S * took_s)


def left_out_note(left_out: Sequence[LeftOut], total: int, *, then: str = FEW_LEFT_OUT) -> tuple[str, ...]:
    """A note on the frames that are not used, by reason, and what comes of it; none if all are."""
    if not left_out:
        return ()
    names: dict[str, list[str]] = {}
    for each in left_out:
        names.setdefault(each.reason, []).append(each.name)
    parts = [
        f"{len(some)} because {reason} ({', '.join(some[:MAX_NAMED])}{', ...' if len(some) > MAX_NAMED else ''})"
        for reason, some in names.items()
    ]
    return (f"{len(left_out)} of {total} frames of the scan are not used: {'; '.join(parts)}. {then}",)
