"""Channels as the cross-check gives them to the other engine."""

import numpy as np

from lidarspectra.spectra.spectrum import Spectrum, sensor_bands
from research.benchmarks.cross_check import STRETCHES, in_stretches


def test_the_stretches_of_a_channel_are_the_channel() -> None:
    channels = sensor_bands("as7265x-14")
    stretches, share = in_stretches(channels)
    steep = Spectrum(wavelengths_nm=[350.0, 850.0], values=[0.0, 1.0])
    parts = (share * stretches.band_values(steep, outside="nearest")).reshape(-1, STRETCHES)

    np.testing.assert_allclose(parts.sum(axis=1), channels.band_values(steep, outside="nearest"), rtol=1e-12)
    np.testing.assert_allclose(share, 1 / STRETCHES, atol=0.04)  # a step of 1 nm in the middle holds 4 % of a channel
    assert np.all(np.diff(stretches.centers_nm) > 0)
