"""What each triangle of a scene's scan truly is, and what stands for it in a scan that was repaired or made again."""

import csv
import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.material_map import Material, MaterialMap

NORMAL_WEIGHT_M = 0.1  # [m] keeps the two sides of a board apart when the nearest triangle is looked for


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueFaces:
    """The truth beside a scan, triangle by triangle.

    Parameters
    ----------
    material : (face,) int
        Row in truth/materials.csv, which has the plan's order.
    part : sequence of str, a face each
        The plan's name of what it belongs to.
    """

    material: IntArray
    part: Sequence[str]


def true_faces(folder: Path) -> TrueFaces:
    """Read a scene's truth/faces.csv.gz, in the order of its scan."""
    with gzip.open(folder / "truth" / "faces.csv.gz", "rt", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    numbers = np.array([int(row["material"].removeprefix("m")) for row in rows], dtype=np.int64)
    return TrueFaces(material=numbers, part=[row["part"] for row in rows])


def nearest_faces(scan: Scan, among: Scan) -> IntArray:
    """(face,) the triangle of another scan that each of a scan's is nearest to, on the same side of thin things."""
    theirs, own = (np.hstack([each.centers, NORMAL_WEIGHT_M * each.normals]) for each in (among, scan))
    return np.asarray(cKDTree(theirs).query(own)[1], dtype=np.int64)


def materials_on(materials: Sequence[Material], face_material: IntArray) -> MaterialMap:
    """Materials on triangles of which no more is known: grey, and seen."""
    count = len(face_material)
    return MaterialMap(
        materials=tuple(materials),
        face_material=face_material,
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )
