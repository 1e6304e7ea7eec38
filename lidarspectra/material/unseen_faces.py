"""Faces without a colour of their own: those that no frame saw, and those that an app left black for want of a picture.

An app's texture invents colours there; here such a face is taken to be of the material of the nearest face that looks
the same way, and to send what that material would in the light there.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan

NORMAL_WEIGHT_M = 0.15  # [m] distance equivalent to a turn of one radian: a board's underside is like its top
MIN_SHOWN = 1e-3  # [1] of white, floor of what is divided by


@dataclass(frozen=True, kw_only=True, eq=False)
class UnseenFaces:
    """Faces without a colour, and those whose material they are taken to have.

    Parameters
    ----------
    faces, like : (unseen,) int
        Of the scan.
    """

    faces: IntArray
    like: IntArray

    def filled(self, values: FloatArray) -> FloatArray:
        """(face, 3) values, those of unseen faces being the ones of the faces that they are like."""
        result = values.copy()
        result[self.faces] = values[self.like]
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
    seen = np.flatnonzero(known)
    place = np.hstack([scan.centers, NORMAL_WEIGHT_M * scan.normals])
    like = seen[cKDTree(place[seen]).query(place[faces])[1]] if faces.size else nowhere
    return UnseenFaces(faces=faces, like=np.asarray(like, dtype=np.int64))
