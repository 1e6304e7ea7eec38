"""What an MP4's edit list leaves out of a video: frames that are in the file, and that no decoder gives.

A writer whose first frame lies before the beginning of its session (AVFoundation, `startSession(atSourceTime:)`) keeps
that frame in the file and lets the edit list begin after it. FFmpeg then gives one frame less, so that the first that
it gives is the second that was recorded.

References
----------
ISO 14496-12 (2015) ISO base media file format, 4.2 (boxes), 8.4.3 (handler), 8.6.1.2 and 8.6.1.3 (times of samples),
8.6.6 (edit list).
"""

import struct
from collections.abc import Iterator
from io import SEEK_CUR
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import IntArray

MAX_TABLES_BYTES = 64 * 1024**2  # [byte] of all tables of a file, some 16 a frame
MAX_FRAMES = 4_000_000  # of a video: 18 hours at 60 a second
_TABLES, _TRACK, _EDITS = b"moov", b"trak", (b"edts", b"elst")
_HANDLER = (b"mdia", b"hdlr")
_DURATIONS, _OFFSETS = (b"mdia", b"minf", b"stbl", b"stts"), (b"mdia", b"minf", b"stbl", b"ctts")


def frames_before_edit(stream: BinaryIO) -> int:
    """How many of a video's first frames its edit list leaves out.

    Parameters
    ----------
    stream : binary file
        At its beginning.

    Returns
    -------
    count : int
        Of frames whose time is before that at which the list begins; 0 without a list.

    Raises
    ------
    ValueError
        If boxes or tables are cut off.
    """
    tables = _tables(stream)
    for kind, track in _boxes(tables):
        handler = _inside(track, _HANDLER) if kind == _TRACK else None
        if handler is not None and handler[8:12] == b"vide":
            begin = _begin_of_edit(_inside(track, _EDITS))
            return int((_times(track) < begin).sum())
    return 0


def _tables(stream: BinaryIO) -> bytes:
    """Content of the box that holds all tables, wherever it lies; empty if there is none."""
    while len(header := stream.read(8)) == 8:
        size, kind = struct.unpack(">I4s", header)
        rest = int.from_bytes(stream.read(8), "big") - 16 if size == 1 else size - 8  # 1: 64 bits follow
        if size == 0:  # up to the file's end
            rest = MAX_TABLES_BYTES + 1
        if rest < 0:
            raise ValueError("a box is smaller than its own header")
        if kind == _TABLES:
            content = stream.read(min(rest, MAX_TABLES_BYTES + 1))
            if len(content) > MAX_TABLES_BYTES:
                raise ValueError("tables are larger than any recording's")
            return content
        stream.seek(rest, SEEK_CUR)
    return b""


def _boxes(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of the boxes that a box holds."""
    start = 0
    while start + 8 <= len(content):
        size, kind = struct.unpack_from(">I4s", content, start)
        if size < 8 or start + size > len(content):
            raise ValueError("a box is cut off")
        yield kind, content[start + 8 : start + size]
        start += size


def _inside(content: bytes, path: tuple[bytes, ...]) -> bytes | None:
    """Content of the first box of a path of kinds; None if there is none."""
    for kind, inner in _boxes(content):
        if kind == path[0]:
            return inner if len(path) == 1 else _inside(inner, path[1:])
    return None


def _begin_of_edit(edits: bytes | None) -> int:
    """When what is shown begins, in the units of the track's times; edits of -1 are pauses before it."""
    if edits is None:
        return 0
    whole = ">i8" if edits[:1] == b"\x01" else ">i4"  # by the version
    entries = _table(edits, [("duration", whole), ("at", whole), ("rate", ">u4")])
    shown = entries["at"][entries["at"] >= 0]
    return int(shown[0]) if shown.size else 0


def _times(track: bytes) -> IntArray:
    """(frame,) when each frame is shown, in the units of the track's times, in the order of the file."""
    durations, offsets = _inside(track, _DURATIONS), _inside(track, _OFFSETS)
    if durations is None:
        return np.zeros(0, dtype=np.int64)
    each = _runs(durations)
    times = np.cumsum(each) - each
    if offsets is not None:
        times = times + _runs(offsets)[: times.size]
    return times


def _runs(table: bytes) -> IntArray:
    """(frame,) values of a table of run lengths."""
    runs = _table(table, [("count", ">u4"), ("value", ">i4")])
    if runs["count"].sum(dtype=np.int64) > MAX_FRAMES:
        raise ValueError("a table counts more frames than any recording has")
    return np.repeat(runs["value"].astype(np.int64), runs["count"])


def _table(content: bytes, columns: list[tuple[str, str]]) -> NDArray[np.void]:
    """Rows of a table, whose number stands after four bytes of version and flags."""
    count = int.from_bytes(content[4:8], "big")
    return np.frombuffer(content[8:], dtype=columns, count=count)
