"""Groups of faces: which faces adjoin, and labels that follow both a face's own colour and its neighbours'."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray, distinct_rows
from lidarspectra.geometry.scan import Scan

WELD_M = 1e-4  # [m] tolerance for welding corners: texture seams duplicate vertices
COLOR_SCALE = 8.0  # [1] L*a*b* units, scale on which the weight between neighbours falls
NORMAL_POWER = 4.0  # [1] of the cosine between normals: 37 degrees halve twice what neighbours agree on
SPREAD_LAB = 4.0  # [1] L*a*b* units, standard deviation of a surface's colour about its primary colour
NEIGHBOR_WEIGHT = 2.0  # [1] of all neighbours together, against a face's own colour at one standard deviation
ROUNDS = 12  # mean-field updates; labels change by less than 0.1 % after 8


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjacency:
    """Pairs of faces that share an edge.

    Parameters
    ----------
    pairs : (pair, 2) int
        Face numbers, each pair once.
    length : (pair,) float
        Of the shared edge. [m]
    """

    pairs: IntArray
    length: FloatArray


def face_adjacency(scan: Scan) -> Adjacency:
    """Find faces that share an edge, corners welded by position.

    Parameters
    ----------
    scan : Scan

    Returns
    -------
    adjacency : Adjacency
        An edge of n faces gives n - 1 pairs.
    """
    grid = np.rint(scan.vertices / WELD_M).astype(np.int64)
    corners = distinct_rows(grid)[1][scan.faces]
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(scan.faces)), 3)
    positions = scan.vertices[np.stack([scan.faces, np.roll(scan.faces, -1, axis=1)], axis=2).reshape(-1, 2)]
    length = np.linalg.norm(positions[:, 1] - positions[:, 0], axis=1)
    order = np.lexsort((owner, edges[:, 1], edges[:, 0]))
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1) & (owner[order[1:]] != owner[order[:-1]])
    first, second = order[:-1][same], order[1:][same]
    return Adjacency(pairs=np.stack([owner[first], owner[second]], axis=1), length=length[first])


def agreement(adjacency: Adjacency, lab: FloatArray, normals: FloatArray) -> csr_array:
    """Weights between adjoining faces: high where colour and normal agree, rows summing to 1 or 0.

    Parameters
    ----------
    adjacency : Adjacency
    lab : (face, 3) float
    normals : (face, 3) float

    Returns
    -------
    weights : (face, face) sparse float
    """
    a, b = adjacency.pairs[:, 0], adjacency.pairs[:, 1]
    color = np.exp(-0.5 * (np.linalg.norm(lab[a] - lab[b], axis=1) / COLOR_SCALE) ** 2)
    turn = np.clip(np.einsum("ij,ij->i", normals[a], normals[b]), 0.0, 1.0) ** NORMAL_POWER
    weight = adjacency.length * color * turn
    count = len(lab)
    both = csr_array(
        (np.concatenate([weight, weight]), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(count, count)
    )
    total = np.asarray(both.sum(axis=1)).ravel()
    scale = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)
    return csr_array(both.multiply(scale[:, None]))


def smooth_labels(lab: FloatArray, centers: FloatArray, evidence: FloatArray, weights: csr_array) -> IntArray:
    """Label every face with one of the primary colours, by its own colour and by its neighbours' labels.

    Mean-field updates of a Potts model: a face's label k costs evidence |lab - mu_k|² / (2 spread²), and each
    neighbour that has another label costs its share of `NEIGHBOR_WEIGHT`.

    Parameters
    ----------
    lab : (face, 3) float
    centers : (color, 3) float
    evidence : (face,) float
        How much the face's own colour counts, 0 where it is not known. [0-1]
    weights : (face, face) sparse float
        See `agreement`.

    Returns
    -------
    label : (face,) int
    """
    distance = np.linalg.norm(lab[:, None] - centers[None], axis=2)
    own = -0.5 * evidence[:, None] * np.minimum(distance / SPREAD_LAB, 6.0) ** 2
    belief = probabilities_of(own)
    for _ in range(ROUNDS):
        belief = probabilities_of(own + NEIGHBOR_WEIGHT * (weights @ belief))
    return np.asarray(belief.argmax(axis=1), dtype=np.int64)


def probabilities_of(scores: FloatArray) -> FloatArray:
    """Softmax of scores between -30 and some 4, so that the largest need not be taken off first.

    Sums over a last axis of some 20 take most of the time of an ordinary one; a product with ones does not.

    Parameters
    ----------
    scores : (face, class) float

    Returns
    -------
    probabilities : (face, class) float
        Summing to 1 over the classes.
    """
    weights = np.exp(scores)
    weights /= (weights @ np.ones(scores.shape[1]))[:, None]
    return weights
