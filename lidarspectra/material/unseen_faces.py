"""Faces without a colour of their own: those that no frame saw, and those that an app left black for want of a picture.

An app's texture invents colours there; here such a face is taken to be of the material of the nearest face of its own
smooth piece of surface, a wall or a ceiling for instance, or, where nothing of that has a colour, of the nearest that
looks the same way; and to send what that material would in the light there.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.segmentation.face_groups import face_adjacency

SMOOTH_COSINE = 0.94  # [1] of 20 degrees between neighbours of one piece, a scanner's noise
PIECE_NORMAL_WEIGHT_M = 2.0  # [m] the same within a piece, whose corners a scanner may have rounded
APART_M = 1e3  # [m] between pieces, more than any room
LARGE_PIECE_M2, FAR_M = 1.0, 0.3  # [m²], [m] of pieces that are no thing's and lie beside none: walls, ceilings, floors
GUESS_DEVIATION = 0.4  # [1] of the log of their reflectance: rms .45, median .31 (research.benchmarks.unseen_planes)
LEVEL_WEIGHT_M = 2.0  # [m] distance equivalent to a turn of such a piece from upright to level
NORMAL_WEIGHT_M = 0.15  # [m] distance equivalent to a turn of one radian: a board's underside is like its top
MIN_SHOWN = 1e-3  # [1] of white, floor of what is divided by


@dataclass(frozen=True, kw_only=True, eq=False)
class UnseenFaces:
    """Faces without a colour, and those whose material they are taken to have.

    Parameters
    ----------
    faces, like : (unseen,) int
        Of the scan.
    guessed : (unseen,) bool, optional
        Which are of a wall, floor or ceiling of which nothing was seen, and like another one for want of better.
    """

    faces: IntArray
    like: IntArray
    guessed: BoolArray | None = None

    def filled(self, values: FloatArray) -> FloatArray:
        """(face, 3) values, those of unseen faces being the ones of the faces that they are like."""
        result = values.copy()
        result[self.faces] = values[self.like]
        return result

    def widened(self, deviation: FloatArray) -> FloatArray:
        """(face, 3) deviations of log reflectance, with what a guess may be off."""
        if self.guessed is None:
            return deviation
        result = deviation.copy()
        guessed = self.faces[self.guessed]
        result[guessed] = np.hypot(result[guessed], GUESS_DEVIATION)
        return result

    def excess(self, excess: FloatArray, shown: FloatArray, reflectance: FloatArray, light: FloatArray) -> FloatArray:
        """(face, 3) factors on what faces show, so that unseen ones send their reflectance times the light there."""
        result = excess.copy()
        result[self.faces] = reflectance[self.like] * light[self.faces] / np.maximum(shown[self.faces], MIN_SHOWN)
        return result


def unseen_faces(scan: Scan, known: BoolArray) -> UnseenFaces:
    """Faces that no frame saw, or that an app left black; none of those that have a name.

    Parameters
    ----------
    scan : Scan
    known : (face,) bool
        Whose colour is a surface's.

    Returns
    -------
    unseen : UnseenFaces
    """
    nowhere = np.zeros(0, dtype=np.int64)
    if not known.any():
        return UnseenFaces(faces=nowhere, like=nowhere)
    appearance = scan.appearance
    unseen = appearance.unpictured if appearance.linear is None else ~appearance.photographed
    faces = np.flatnonzero(unseen & (appearance.face_kinds < 0))
    if not faces.size:
        return UnseenFaces(faces=nowhere, like=nowhere)
    like, guessed = _like(scan, faces, np.flatnonzero(known))
    return UnseenFaces(faces=faces, like=like, guessed=guessed)


def _like(scan: Scan, faces: IntArray, seen: IntArray) -> tuple[IntArray, BoolArray]:
    """Of (n,) faces without a colour, those of the (m,) seen ones that they are like, and which of that are guesses.

    A face of a piece that is partly seen is like the nearest that looks the same way there: half a wall without a
    picture is no floor, however near. Else things are like their other sides; but a whole wall or ceiling that no
    picture shows is rather like another one than like the floor before it.
    """
    centers, normals = scan.centers, scan.normals
    piece = _smooth_pieces(scan)
    plain = np.hstack([centers, NORMAL_WEIGHT_M * normals])
    like = _nearest(plain, faces, seen)
    partly = np.isin(piece[faces], np.unique(piece[seen]))
    own = np.hstack([centers, PIECE_NORMAL_WEIGHT_M * normals, APART_M * piece[:, None]])
    like[partly] = _nearest(own, faces[partly], seen)
    whole = np.flatnonzero(~partly)
    alone = whole[_are_alone(scan, faces[whole], seen, piece)]
    level = np.hstack([centers, NORMAL_WEIGHT_M * normals[:, :2], LEVEL_WEIGHT_M * normals[:, 2:]])
    like[alone] = _nearest(level, faces[alone], seen)
    guessed = np.zeros(faces.size, dtype=np.bool_)
    guessed[alone] = True
    return like, guessed


def _smooth_pieces(scan: Scan) -> IntArray:
    """(face,) number of the piece of surface, without an edge in it, that each belongs to."""
    first, second = face_adjacency(scan).pairs.T
    smooth = np.einsum("ij,ij->i", scan.normals[first], scan.normals[second]) > SMOOTH_COSINE
    count = len(scan.faces)
    pairs = csr_array((smooth[smooth], (first[smooth], second[smooth])), shape=(count, count))
    return np.asarray(connected_components(pairs, directed=False)[1], dtype=np.int64)


def _are_alone(scan: Scan, faces: IntArray, seen: IntArray, piece: IntArray) -> BoolArray:
    """Which of (n,) faces are of large pieces most of which lies beside nothing that is seen."""
    if not faces.size:
        return np.zeros(0, dtype=np.bool_)
    distance = cKDTree(scan.centers[seen]).query(scan.centers[faces])[0]
    count = int(piece.max()) + 1
    area = np.bincount(piece[faces], weights=scan.areas[faces], minlength=count)
    far = np.bincount(piece[faces], weights=scan.areas[faces] * (distance > FAR_M), minlength=count)
    alone = (area > LARGE_PIECE_M2) & (far > 0.5 * area)
    return np.asarray(alone[piece[faces]], dtype=np.bool_)


def _nearest(place: FloatArray, faces: IntArray, seen: IntArray) -> IntArray:
    """(n,) of the (m,) seen faces, the one nearest to each of the (n,) faces by the (face, k) places."""
    if not faces.size:
        return faces
    return np.asarray(seen[cKDTree(place[seen]).query(place[faces])[1]], dtype=np.int64)
