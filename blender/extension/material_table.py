"""The table that gives single faces of a scan their reflectances."""

import csv
import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .faults import ExtensionError


def assignments_table(
    face: NDArray[np.int_], slot: NDArray[np.int_], slot_before: NDArray[np.int_], reflectance: Sequence[str],
    default: str = "", face_count: int | None = None,
) -> str:  # fmt: skip
    """CSV of the faces that have a reflectance; empty where none has.

    Parameters
    ----------
    face : (polygon,) int
        Number of each polygon's face in the run's scan.
    slot, slot_before : (polygon,) int
        Material of each polygon now, and as the run had it.
    reflectance : sequence of str
        Of each material: database ID or spectrum file; empty for what stays as estimated.
    default : str
        For faces without one, where the run gives all faces one material.
    face_count : int, optional
        Faces of the run's scan, by which the program knows whether the numbers still hold.

    Raises
    ------
    ExtensionError
        If a face was given a material that has no reflectance by a name.
    """
    given = np.array([bool(name) for name in reflectance], dtype=bool)
    moved = slot != slot_before
    if np.any(moved & ~given[slot]):
        number = int(slot[moved & ~given[slot]][0])
        raise ExtensionError(
            expected="a reflectance by name for a material that is given to other faces", found="none",
            where=f"material in slot {number + 1}",
            todo="Choose one under Materials: the spectrum that was estimated for a group of faces has no name.",
        )  # fmt: skip
    if not given[slot].any():
        return ""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    if face_count is not None:
        stream.write(f"# of {face_count} faces\n")
    writer.writerow(["face", "reflectance"])
    names = [name or default for name in reflectance]
    for number, which in sorted(zip(face.tolist(), slot.tolist(), strict=True)):
        if names[which]:
            writer.writerow([number, names[which]])
    return stream.getvalue()
