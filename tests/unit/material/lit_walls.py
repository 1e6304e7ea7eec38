"""Evidence of white walls and a grey one under one lamp, for fits whose answer is known."""

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import WHITE_HUE
from lidarspectra.material.delighting.sharpened_cones import srgb_of_cones

PER_GROUP = 60
BALANCE = np.array([0.30, 0.36, 0.42])  # [1] k of the picture: bluish light
WHITE = 0.8 * np.exp([0.0, *WHITE_HUE])
GREY = np.array([0.2, 0.22, 0.18])


def evidence(white_groups: int) -> LightEvidence:
    """Surfaces that see nothing of each other, so that only what is known beforehand tells k."""
    groups = white_groups + 1
    group = np.repeat(np.arange(groups), PER_GROUP)
    direct = np.random.default_rng(1).permutation(np.linspace(0.5, 1.5, group.size))
    reflectance = np.where((group < white_groups)[:, None], WHITE, GREY)
    shown = srgb_of_cones(BALANCE * reflectance * direct[:, None])
    return LightEvidence(
        shown=shown,
        direct=np.repeat(direct[None, :, None], 3, axis=2),
        emission=np.ones((1, group.size)),
        exchange=csr_array((group.size, group.size + 1)),
        face_shown=shown,
        face_area=np.ones(group.size),
        face_lamp=np.zeros(group.size, dtype=np.bool_),
        group=group,
        cell=np.arange(group.size),
        ceiling=np.zeros(group.size, dtype=np.bool_),
        white=group < white_groups,
        unsure=np.zeros((group.size, 3)),
    )
