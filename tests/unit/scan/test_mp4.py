"""Which of a video's first frames its edit list leaves out, by tables that are written here box by box."""

import io
import struct
from collections.abc import Sequence

import pytest

from lidarspectra.hardware.phone.mp4 import frames_before_edit

STEP = 10  # from one frame to the next, in the units of the track's times
REORDERED = (10, 30, 0, 20, 10, 30, 0, 20)  # of times of display over those of decoding: 10, 40, 20, 50, 50, 80, ...


def box(kind: bytes, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack(">I", len(content) + 8) + kind + content


def table(kind: bytes, *rows: bytes, version: int = 0) -> bytes:
    return box(kind, bytes([version, 0, 0, 0]), struct.pack(">I", len(rows)), *rows)


def track(
    handler: bytes, edits: Sequence[int] | None, *, offsets: Sequence[int] = (), wide: bool = False, frames: int = 8
) -> bytes:
    """A track of frames of equal length, with what is shown of it: times at which edits begin."""
    entry = ">qqI" if wide else ">iiI"
    rows = [struct.pack(entry, 100, at, 1 << 16) for at in edits or ()]
    listed = [] if edits is None else [box(b"edts", table(b"elst", *rows, version=int(wide)))]
    times = [table(b"stts", struct.pack(">II", frames, STEP))]
    if offsets:
        times.append(table(b"ctts", *(struct.pack(">Ii", 1, offset) for offset in offsets)))
    kind = box(b"hdlr", bytes(8), handler, bytes(12))
    return box(b"trak", *listed, box(b"mdia", kind, box(b"minf", box(b"stbl", *times))))


def count(*tracks: bytes) -> int:
    """As of a file of these tracks."""
    return frames_before_edit(io.BytesIO(box(b"ftyp", b"isom") + box(b"moov", box(b"mvhd", bytes(20)), *tracks)))


@pytest.mark.parametrize(
    ("edits", "frames"),
    [(None, 0), ((), 0), ((0,), 0), ((1,), 1), ((STEP,), 1), ((STEP + 1,), 2), ((-1, STEP), 1), ((-1,), 0)],
)
@pytest.mark.parametrize("wide", [False, True])
def test_frames_that_begin_before_the_first_edit_are_left_out(
    edits: tuple[int, ...] | None, frames: int, wide: bool
) -> None:
    assert count(track(b"vide", edits, wide=wide)) == frames


@pytest.mark.parametrize(("edit", "frames"), [(10, 0), (11, 1), (20, 1), (21, 2)])
def test_frames_that_are_decoded_in_another_order_are_counted_by_when_they_are_shown(edit: int, frames: int) -> None:
    assert count(track(b"vide", (edit,), offsets=REORDERED)) == frames


def test_sound_and_files_without_a_video_leave_nothing_out() -> None:
    assert count(track(b"soun", (3 * STEP,)), track(b"vide", (STEP,))) == 1
    assert count(track(b"soun", (3 * STEP,))) == 0
    assert frames_before_edit(io.BytesIO(b"")) == 0


def test_tables_are_found_behind_the_pictures_of_a_file_that_is_larger_than_32_bits_tell() -> None:
    pictures = struct.pack(">I4sQ", 1, b"mdat", 16 + 40) + bytes(40)
    tables = box(b"moov", track(b"vide", (STEP,)))
    assert frames_before_edit(io.BytesIO(pictures + tables)) == 1
    to_the_end = struct.pack(">I", 0) + tables[4:]
    assert frames_before_edit(io.BytesIO(pictures + to_the_end)) == 1
    assert frames_before_edit(io.BytesIO(struct.pack(">I", 0) + b"mdat" + bytes(100))) == 0


def test_tables_that_are_cut_off_or_count_too_much_are_refused() -> None:
    whole = box(b"moov", track(b"vide", (STEP,), offsets=REORDERED))
    for size in (20, len(whole) // 2, len(whole) - 1):
        with pytest.raises(ValueError, match=r"."):
            frames_before_edit(io.BytesIO(whole[:size]))
    with pytest.raises(ValueError, match="more frames"):
        count(track(b"vide", (STEP,), frames=2**32 - 1))
    with pytest.raises(ValueError, match="own header"):
        frames_before_edit(io.BytesIO(struct.pack(">I4s", 4, b"moov")))
