"""Prior probabilities of material classes by the place of a face in the room (suggested in the paper's Section 5).

A picture of a plain white surface has little information; but a large, level surface overhead is a ceiling, and
ceilings are mostly painted. Faces get one of five kinds of place from height, direction, flatness and size, and each
kind has a prior over the classes. The network was trained on all classes evenly, so that its probabilities times the
prior are proportional to the posterior (Bayes' rule).

The priors are our judgement of furnished rooms, rounded, and not counted from data; the segmentation benchmark shows
their effect.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray, linked
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.segmentation.face_groups import Adjacency
from lidarspectra.room.room import Room

KINDS = ("floor", "ceiling", "wall", "top", "other")
PRIORS: dict[str, dict[str, float]] = {
    "floor": {"carpet": 0.27, "wood": 0.27, "stone": 0.15, "tile": 0.14, "plastic": 0.08, "fabric": 0.04},
    "ceiling": {"painted": 0.88, "wood": 0.04, "plastic": 0.02, "metal": 0.02, "tile": 0.01},
    "wall": {
        "painted": 0.62, "wallpaper": 0.08, "wood": 0.08, "glass": 0.05, "brick": 0.03, "fabric": 0.03, "tile": 0.03,
        "stone": 0.02, "plastic": 0.02, "metal": 0.01, "mirror": 0.01,
    },
    "top": {
        "wood": 0.36, "plastic": 0.16, "fabric": 0.16, "painted": 0.08, "metal": 0.05, "stone": 0.05, "glass": 0.03,
        "paper": 0.04, "leather": 0.03, "ceramic": 0.01,
    },
    "other": {
        "painted": 0.18, "wood": 0.18, "fabric": 0.15, "plastic": 0.15, "metal": 0.13, "paper": 0.05, "glass": 0.04,
        "leather": 0.03, "ceramic": 0.03, "foliage": 0.02,
    },
}  # fmt: skip  # [1] a kind's other classes share what is left to 1
RARE = dict.fromkeys(("hair", "skin", "sky", "water"), 0.001)  # [1] in all kinds: seldom scanned in a room
LEVEL = 0.85  # [1] least vertical part of the normal of a level face
UPRIGHT = 0.35  # [1] largest vertical part of that of an upright one
FLAT = 0.95  # [1] cosine between normals of neighbours in one plane patch
LARGE_M2 = 0.7  # [m²] of a wall's plane patch: a cabinet's side or a door counts as a wall, a chair's back does not
TABLE_M2 = 0.05  # [m²] of a top
NEAR_M = 0.15  # [m] of floor or ceiling
TOP_M = 1.4  # [m] above the floor; higher ones are not put things on
ROUNDS = 3  # of averaging normals with the neighbours', against a phone's noise


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Kind of place of every face.

    Parameters
    ----------
    kind : (face,) int
        Of `KINDS`.
    patch_m2 : (face,) float
        Area of the flat patch that the face belongs to. [m²]
    """

    kind: IntArray
    patch_m2: FloatArray


def find_places(scan: Scan, room: Room, adjacency: Adjacency) -> Places:
    """Sort faces by where they lie.

    Parameters
    ----------
    scan : Scan
        z up.
    room : Room
        Its heights of floor and ceiling.
    adjacency : Adjacency
        Of the scan's faces.

    Returns
    -------
    places : Places
    """
    normals = _smooth_normals(scan, adjacency)
    patch = _patches(normals, adjacency)
    patch_m2 = np.bincount(patch, weights=scan.areas)[patch]
    up, height = normals[:, 2], scan.centers[:, 2]
    kind = np.full(len(scan.faces), KINDS.index("other"), dtype=np.int64)
    above = height - room.floor_at(scan.centers)
    kind[(np.abs(up) < UPRIGHT) & (patch_m2 > LARGE_M2)] = KINDS.index("wall")
    kind[(up > LEVEL) & (above < TOP_M) & (patch_m2 > TABLE_M2)] = KINDS.index("top")
    kind[(up > LEVEL) & (above < NEAR_M)] = KINDS.index("floor")
    kind[(up < -LEVEL) & (room.ceiling_z - height < NEAR_M)] = KINDS.index("ceiling")
    return Places(kind=kind, patch_m2=np.asarray(patch_m2, dtype=np.float64))


def class_prior(places: Places, classes: tuple[str, ...]) -> FloatArray:
    """(face, class) prior probability, for classes of a model that may be others than MINC's.

    A class that a kind does not name shares, with the others like it, what the named ones leave to 1.
    """
    rows = []
    for kind in KINDS:
        named = PRIORS[kind] | RARE
        rest = 1.0 - sum(named.values())
        unnamed = sum(name not in named for name in classes)
        rows.append([named.get(name, rest / max(1, unnamed)) for name in classes])
    table = np.array(rows)
    return np.asarray((table / table.sum(axis=1, keepdims=True))[places.kind], dtype=np.float64)


def _smooth_normals(scan: Scan, adjacency: Adjacency) -> FloatArray:
    """Normals averaged with their neighbours', by the cosine between them and by area."""
    a, b = adjacency.pairs.T
    normals, count = scan.normals, len(scan.faces)
    for _ in range(ROUNDS):
        alike = np.clip(np.einsum("ij,ij->i", normals[a], normals[b]), 0.0, 1.0) ** 2
        weights = csr_array(
            (np.concatenate([alike * scan.areas[b], alike * scan.areas[a]]), (np.r_[a, b], np.r_[b, a])),
            shape=(count, count),
        )
        total = weights @ normals + scan.areas[:, None] * normals
        normals = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
    return np.asarray(normals, dtype=np.float64)


def _patches(normals: FloatArray, adjacency: Adjacency) -> IntArray:
    """(face,) number of the flat patch: neighbours whose normals agree, joined."""
    a, b = adjacency.pairs.T
    flat = np.einsum("ij,ij->i", normals[a], normals[b]) > FLAT
    return linked(adjacency.pairs[flat], len(normals))
