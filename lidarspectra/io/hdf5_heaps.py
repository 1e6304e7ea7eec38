"""Detects damaged HDF5 files on which the HDF5 library would loop forever.

Text and references to dimensions lie in global heaps of a file. HDF5 walks through a heap object by object; an
object of free space (number 0) without a size makes it loop there, and nothing in Python can interrupt it.

References
----------
HDF5 File Format Specification 3.0, III.E (global heap). HDFGroup/hdf5, issue 1707 (files that hang the library).
"""

import mmap
import struct
from pathlib import Path

SIGNATURE = b"GCOL"
VERSION = 1
HEAD = struct.Struct("<4sB3xQ")  # signature, version, size of the heap with its head [byte]
ITEM = struct.Struct("<HHIQ")  # number, references, nothing, size [byte]
PADDED_TO = 8  # [byte]
MAX_ITEMS = 1_000_000  # objects in all heaps of a file; a file of this package has about ten


def check_heaps(path: Path) -> None:
    """Refuse a file whose global heaps HDF5 would never finish reading.

    Parameters
    ----------
    path : Path
        Any file.

    Raises
    ------
    ValueError
        If a heap has free space of no size, or the heaps hold more than `MAX_ITEMS` objects.
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as stream:
        if not stream.seek(0, 2):
            return  # nothing can be mapped of an empty file
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            left, start = MAX_ITEMS, data.find(SIGNATURE)
            while start >= 0:
                left -= _items(data, start, left)
                start = data.find(SIGNATURE, start + 1)


def _items(data: mmap.mmap, start: int, most: int) -> int:
    """Objects of the heap that starts there; 0 where the signature is part of other data."""
    if start + HEAD.size > len(data):
        return 0
    _, version, size = HEAD.unpack_from(data, start)
    end = start + size
    if version != VERSION or end > len(data):
        return 0  # HDF5 refuses such a heap itself
    at, count = start + HEAD.size, 0
    while at + ITEM.size <= end:
        number, _, _, length = ITEM.unpack_from(data, at)
        if number == 0 and length == 0:
            raise ValueError(f"a global heap at byte {start} with free space of no size")
        at += length if number == 0 else ITEM.size + -(-length // PADDED_TO) * PADDED_TO
        count += 1
        if count > most:
            raise ValueError(f"more than {MAX_ITEMS:,} objects in its global heaps")
    return count
