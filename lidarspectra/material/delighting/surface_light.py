"""The light at points of a picture: what the tone curve makes of the picture, and light straight from its sources."""

import numpy as np
from scipy.sparse import csc_array

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.material.delighting.tone_curve import ToneCurve

MIN_LIGHT = 1e-5  # [1] of white, floor of cone responses before their logarithm
MIN_EMISSION = 1e-3  # [1] cosine below which a lamp is seen from its edge


class LightAt:
    """The light at some of the samples; what only the tone curve changes is kept, and what only the beam does.

    Parameters
    ----------
    evidence : LightEvidence
    samples : (n,) int or slice
        Which of its samples.
    mean_direct : (3,) float
        Of which direct light is 1. [unit of the evidence's direct light]
    """

    def __init__(self, evidence: LightEvidence, samples: IntArray | slice, mean_direct: FloatArray) -> None:
        self._evidence = evidence
        self._shown = evidence.shown[samples]
        self._tint = 1.0 if evidence.tint is None else evidence.tint[samples]
        # By columns, so that a product stays with the few sums at these points: half the time, the same to the bit.
        exchange = csc_array(evidence.exchange[samples])
        self._faces = np.flatnonzero(np.diff(exchange.indptr)[:-1])  # a large scan has many more than these points see
        self._exchange = csc_array(exchange[:, self._faces])
        self._nothing = exchange[:, [-1]].toarray()
        self._direct = np.ascontiguousarray(evidence.direct[:, samples] / mean_direct)  # or each product copies it
        self._emission = evidence.emission[:, samples]
        self._other = None if evidence.other is None else evidence.other[:, :, samples]
        self._picture: tuple[ToneCurve, FloatArray, FloatArray] | None = None
        self._lamps: tuple[float, FloatArray] | None = None

    def shown(self, tone: ToneCurve) -> tuple[FloatArray, FloatArray]:
        """(n, 3) light that a picture shows at points, brought to daylight's tint, and that it shows around them."""
        if self._picture is None or self._picture[0] != tone:
            if self._nothing.any():
                every = self._sent(tone, slice(None))
                gathered = self._exchange @ every[self._faces]
                gathered += self._nothing * np.average(every, axis=0, weights=self._evidence.face_area)
            else:
                gathered = self._exchange @ self._sent(tone, self._faces)
            seen = np.maximum(cones_of_srgb(tone.light(self._shown)), MIN_LIGHT) / self._tint
            self._picture = (tone, seen, np.asarray(gathered, dtype=np.float64))
        return self._picture[1], self._picture[2]

    def direct(self, beam: float, factors: FloatArray) -> FloatArray:
        """(n, 3) light straight from the lamps, their beams narrowed at equal flux."""
        return np.asarray(np.tensordot(factors, self.each_lamp(beam), axes=1), dtype=np.float64)

    def each_lamp(self, beam: float) -> FloatArray:
        """(lamp, n, 3) light straight from each lamp at its assumed flux."""
        if self._lamps is None or self._lamps[0] != beam:
            cosine = np.maximum(self._emission, MIN_EMISSION)
            shape = np.where(self._emission < 1.0, (1.0 + 0.5 * beam) * cosine**beam, 1.0)
            self._lamps = (beam, shape[:, :, None] * self._direct)
        return self._lamps[1]

    def direct_over_beam(self, beam: float, factors: FloatArray) -> FloatArray:
        """(n, 3) slope of `direct` over the beam exponent."""
        cosine = np.maximum(self._emission, MIN_EMISSION)
        slope = (0.5 + (1.0 + 0.5 * beam) * np.log(cosine)) * cosine**beam
        shape = np.where(self._emission < 1.0, slope, 0.0)
        return np.asarray(np.einsum("l,ln,lnc->nc", factors, shape, self._direct, optimize=True), dtype=np.float64)

    def other(self, strengths: FloatArray) -> FloatArray | float:
        """(n, 3) light straight from unknown sources of (source, lobe, 3) strengths."""
        if self._other is None:
            return 0.0
        return np.asarray(np.einsum("jln,jlc->nc", self._other, strengths, optimize=True), dtype=np.float64)

    def each_lobe(self, strengths: FloatArray) -> FloatArray:
        """(source, lobe, n, 3) light of each lobe of the unknown sources of (source, lobe, 3) strengths."""
        if self._other is None:
            return np.zeros((0, 1, len(self._shown), 3))
        return np.asarray(self._other[:, :, :, None] * strengths[:, :, None, :], dtype=np.float64)

    def _sent(self, tone: ToneCurve, faces: IntArray | slice) -> FloatArray:
        sent = cones_of_srgb(self._evidence.face_light(tone, faces))
        sent[self._evidence.face_lamp[faces]] = 0.0
        return sent
