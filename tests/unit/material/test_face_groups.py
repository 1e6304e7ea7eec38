"""Faces that adjoin are known across texture seams, and labels follow colour first, neighbours second."""

import numpy as np

from lidarspectra.material.segmentation.face_groups import agreement, face_adjacency, smooth_labels
from lidarspectra.spectra.colorimetry import linear_srgb_to_lab

from .conftest import COLORS, box_scan


def test_a_closed_meshs_faces_have_three_neighbours_each_though_no_corner_is_shared():
    scan, _ = box_scan(cells=4)
    adjacency = face_adjacency(scan)
    # Euler: a closed triangle mesh has 3/2 edges a face
    assert len(adjacency.pairs) == 3 * len(scan.faces) // 2
    assert (np.bincount(adjacency.pairs.ravel()) == 3).all()
    a, b = adjacency.pairs[0]
    shared = {tuple(p) for p in np.round(scan.corners[a], 6)} & {tuple(p) for p in np.round(scan.corners[b], 6)}
    first, second = (np.array(p) for p in shared)
    assert np.isclose(adjacency.length[0], np.linalg.norm(first - second))


def test_neighbours_across_a_corner_of_the_room_or_of_another_color_do_not_speak_for_each_other():
    scan, part = box_scan(cells=3)
    lab = linear_srgb_to_lab(np.array([COLORS["floor"], COLORS["ceiling"], COLORS["walls"]])[part])
    weights = agreement(face_adjacency(scan), lab, scan.normals).toarray()
    assert np.allclose(weights.sum(axis=1), 1.0)
    assert weights[part == 0][:, part == 2].max() == 0
    level = np.abs(scan.normals @ scan.normals.T) > 0.99
    assert weights[~level].max() == 0


def test_one_odd_face_joins_its_surroundings_and_a_patch_does_not():
    scan, part = box_scan(cells=8)
    centers = np.array([[30.0, 0, 0], [40.0, 0, 0]])
    lab = np.tile(centers[0], (len(part), 1))
    floor = np.flatnonzero(part == 0)
    odd = floor[40]
    patch = np.flatnonzero((part == 0) & (scan.centers[:, 0] > 2) & (scan.centers[:, 1] > 1.5))
    lab[odd] = lab[patch] = centers[1] - [2.0, 0, 0]
    weights = agreement(face_adjacency(scan), lab, scan.normals)
    label = smooth_labels(lab, centers, np.ones(len(part)), weights)
    assert label[odd] == 0
    inner = patch[(scan.centers[patch, :2] > [2.3, 1.8]).all(axis=1)]
    assert (label[inner] == 1).all()


def test_a_face_of_unknown_color_takes_its_neighbours():
    scan, part = box_scan(cells=6)
    lab = linear_srgb_to_lab(np.array([COLORS["floor"], COLORS["ceiling"], COLORS["walls"]])[part])
    centers = np.array([lab[part == n][0] for n in range(3)])
    evidence = np.ones(len(part))
    hidden = np.flatnonzero(part == 0)[30]
    evidence[hidden] = 0.0
    label = smooth_labels(lab, centers, evidence, agreement(face_adjacency(scan), lab, scan.normals))
    assert np.array_equal(label, part)


def test_a_face_alone_keeps_its_own_color():
    scan, part = box_scan(cells=1)
    lab = linear_srgb_to_lab(np.array([COLORS["floor"], COLORS["ceiling"], COLORS["walls"]])[part])
    centers = np.array([lab[part == n][0] for n in range(3)])
    adjacency = face_adjacency(scan)
    nobody = agreement(adjacency, lab, np.zeros_like(scan.normals))
    assert np.array_equal(smooth_labels(lab, centers, np.ones(len(part)), nobody), part)
