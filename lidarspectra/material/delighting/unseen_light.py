"""How sure the light is that comes from surfaces which no picture shows.

Such a surface is taken to be of the material of another one beside it (`unseen_faces`), and to send
what that material would in the light there. What the unseen surfaces about a point send together, weighted by their
form factors, is off by δ, and with it the light E at the point, of which they are the share u,

    E = k D + G x_seen + (1 + δ) G x_unseen,    d log ρ = -d log E = -u δ,    u = G x_unseen / E,                  (1)

with ρ, k, D and G as in `albedo`. Beside a surface that is told by direct light u is small; a ceiling beside its lamps
has all of its light from below, where a phone sees least.
"""

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb

# [1] of δ in the mean of a surface, whose reflectance is one: .06 to .08 in apartment and large office, whose surfaces
# have 11 % of their light from there (research.benchmarks.unseen_light), and .33 in the office, which has 1.6 % and so
# hardly counts. At single points it is .2.
UNSEEN_DEVIATION = 0.1


def share_of_unseen(evidence: LightEvidence, fit: LightFit, unseen: IntArray) -> FloatArray:
    """Share of the light at points that is held to come from surfaces which no picture shows, u in Eq. 1.

    Parameters
    ----------
    evidence : LightEvidence
    fit : LightFit
        To it.
    unseen : (n,) int
        Faces without a colour of their own.

    Returns
    -------
    share : (sample, 3) float
        In cones. [0-1]
    """
    sent = cones_of_srgb(evidence.face_light(fit.tone, unseen))
    sent[evidence.face_lamp[unseen]] = 0.0
    return np.asarray((evidence.exchange[:, unseen] @ sent) / fit.irradiance, dtype=np.float64)


def unseen_light_deviation(evidence: LightEvidence, fit: LightFit, unseen: IntArray) -> FloatArray:
    """(sample, 3) standard deviation of log ρ that comes from what no picture shows [1]; parameters as above."""
    return UNSEEN_DEVIATION * share_of_unseen(evidence, fit, unseen)
