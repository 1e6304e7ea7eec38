"""Frames of a video in their order, by OpenCV's FFmpeg.

A video is decoded from its beginning, since seeking in HEVC is not exact. Frames are asked for in their order, pass by
pass; one that lies before the last begins anew.

Its values are those of video, not of sRGB, and no decoder brings them there: matrix and range of what a file says of
its colours count, the transfer does not. By that of BT.709 a value stands for about its power of 1.96, which is what
the same phone says of its buffers where an app writes them as JPEG (the profile "QuickTime 'nclc' Video (1,1,6)" of 3D
Scanner App). By sRGB's curve a dark grey would be a quarter darker.

References
----------
ITU-R BT.709-6 (2015), Item 1.2. IEC 61966-2-1:1999, the curve of sRGB.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from weakref import finalize

import cv2
import numpy as np

from lidarspectra.arrays import ByteArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.textures import MAX_TEXTURE_PIXELS
from lidarspectra.hardware.phone.capture_files import CaptureFiles
from lidarspectra.hardware.phone.frames import FrameFault
from lidarspectra.hardware.phone.mp4 import frames_before_edit
from lidarspectra.spectra.colorimetry import encode_srgb

MAX_VIDEO_BYTES = 16 * 1024**3  # [byte] an hour at 30 Mbit/s
POWER = 1.961  # [1] of light over a video's value
MP4_TYPE = b"ftyp"  # of an MP4's first box: FFmpeg goes by content, and a list of addresses must not be opened


SRGB_OF_VIDEO = np.rint(255.0 * encode_srgb((np.arange(256) / 255.0) ** POWER)).astype(np.uint8)
"""(256,) byte of sRGB for each byte of a video."""


class Video:
    """A video file; a frame that is read after `close` opens it again.

    Its `frames` are all in the file, of which the first `before` are left out where it is shown.

    Parameters
    ----------
    path : Path or callable
        The file; or what copies it out of an archive and says where to, to be removed by `close`.
    where : str
        For errors.

    Raises
    ------
    ScanError
        If it is no video that can be decoded.
    """

    def __init__(self, path: Path | Callable[[], Path], where: str) -> None:
        self._copy = None if isinstance(path, Path) else path
        self._path = path if isinstance(path, Path) else self._copied(path)
        self._lock = Lock()
        self._open: cv2.VideoCapture | None = None
        self._next = 0
        with self._path.open("rb") as stream:
            kind = stream.read(8)[4:]
            stream.seek(0)
            try:
                self.before = frames_before_edit(stream) if kind == MP4_TYPE else 0
                capture = self._begin() if kind == MP4_TYPE else None
            except (FrameFault, ValueError):
                capture = None
        size = (
            (0, 0)
            if capture is None
            else tuple(int(capture.get(each)) for each in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        )
        frames = 0 if capture is None else int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        if min(size) <= 0 or size[0] * size[1] > MAX_TEXTURE_PIXELS or frames <= 0:
            self.close()
            raise ScanError(
                expected="a video in MP4 (HEVC or H.264)", found="none that can be decoded", where=where,
                todo="Export or copy the recording again; the video may be cut off.",
            )  # fmt: skip
        self.size_px = (size[0], size[1])
        self.frames = frames

    def read(self, number: int, least_px: int) -> ByteArray:
        """A frame.

        Parameters
        ----------
        number : int
            From 0, as the file counts them: those below `before` cannot be read.
        least_px : int
            Least width, down to which it is averaged by whole factors. [px]

        Returns
        -------
        picture : (height, width, 3) uint8
            sRGB.

        Raises
        ------
        FrameFault
            If it is damaged, or the video ends before it.
        """
        if number < self.before:
            raise FrameFault("its video does not show it")
        with self._lock:
            picture = self._decoded(number - self.before)
        factor = max(1, picture.shape[1] // max(least_px, 1))
        small = (picture.shape[1] // factor, picture.shape[0] // factor)
        if factor > 1:
            picture = np.asarray(cv2.resize(picture, small, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        return np.ascontiguousarray(SRGB_OF_VIDEO[picture[:, :, ::-1]])

    def close(self) -> None:
        """Close the file, and remove it if it is a copy."""
        with self._lock:
            if self._open is not None:
                self._open.release()
                self._open = None
            if self._copy is not None:
                self._remove()

    def _copied(self, copy: Callable[[], Path]) -> Path:
        """A new copy, which is gone with this record at the latest: where a scan is refused, nobody closes it."""
        path = copy()
        self._remove = finalize(self, path.unlink, missing_ok=True)
        return path

    def _begin(self) -> cv2.VideoCapture:
        if self._copy is not None and not self._path.exists():
            try:
                self._path = self._copied(self._copy)
            except ScanError as cause:
                raise FrameFault("its video is missing or cannot be read") from cause
        try:
            capture = cv2.VideoCapture(str(self._path.resolve()), cv2.CAP_FFMPEG)
        except cv2.error as cause:
            raise FrameFault("its video cannot be decoded") from cause
        if not capture.isOpened():
            raise FrameFault("its video cannot be decoded")
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)  # intrinsics are those of the picture as it is stored
        self._open, self._next = capture, 0
        return capture

    def _decoded(self, number: int) -> ByteArray:
        capture = self._open
        if capture is None or number < self._next:
            if capture is not None:
                capture.release()
            capture = self._begin()
        try:
            while self._next < number:
                if not capture.grab():
                    raise FrameFault("its video is damaged, or ends before it")
                self._next += 1
            told, picture = capture.read()
            self._next += 1
        except cv2.error as cause:
            raise FrameFault("its video cannot be decoded") from cause
        if not told or picture is None or picture.ndim != 3 or picture.shape[1::-1] != self.size_px:
            raise FrameFault("its video is damaged, or ends before it")
        return np.asarray(picture, dtype=np.uint8)


def open_video(files: CaptureFiles, name: str) -> Video:
    """Open a video among the files of a capture; one in an archive is copied out first.

    Parameters
    ----------
    files : CaptureFiles
    name : str

    Returns
    -------
    video : Video

    Raises
    ------
    ScanError
        If it is damaged or too large.
    """
    where, inside, archive = f"{files.where}/{name}", files.base + name, files.archive
    if archive is None:
        return Video(files.path / inside, where)

    def copy() -> Path:
        with tempfile.NamedTemporaryFile(suffix=".mp4", delete=False) as stream:
            path = Path(stream.name)
            try:
                archive.copy(inside, stream, limit=MAX_VIDEO_BYTES)
            except ScanError:
                path.unlink()
                raise
        return path

    return Video(copy, where)
