"""A cell's current from the 14 or 18 channels of a spectral sensor beside it, with its uncertainty."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamp_spectra import cct_spectrum
from lidarspectra.mapping.maps.light_unknowns import UNIFORM
from lidarspectra.mapping.maps.response_weights import share_within
from lidarspectra.mapping.photometry.channel_estimate import channel_estimate
from lidarspectra.mapping.photometry.indoor_spectra import IndoorSpectra
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.spectra.spectrum import BandSet, Spectrum

HOT_BODY_K = {None: 2700.0, "incandescent": 2700.0, "daylight": 4999.0}
"""Black bodies that lamps of a kind are like in the infrared, daylight behind clear glass too; None is any lamp. [K]"""


def current_from_channels(
    readings: FloatArray,
    uncertainty: FloatArray,
    bands: BandSet,
    cell: Cell,
    ensemble: IndoorSpectra,
    *,
    lamp_kind: str | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Current density of a cell from the readings of a sensor at the same place.

    The weights on the channels are fitted to the cell's current for indoor spectra of all kinds of lamp; their error
    for a lamp that was left out of the fit is part of the uncertainty.

    Parameters
    ----------
    readings, uncertainty : (reading, band) float
        Spectral irradiance and its standard uncertainty. [W/m²/nm]
    bands : BandSet
        The sensor's channels.
    cell : Cell
    ensemble : IndoorSpectra
    lamp_kind : str, optional
        'led', 'fluorescent' ... where it is known; the uncertainty is then that for such lamps.

    Returns
    -------
    density, standard_uncertainty : (reading,) float
        The channels' errors are taken as independent, that of the weights as common to all channels. Under lamps that
        glow, in daylight, and where the lamp is not known, anything from none to the light of a hot body may come
        beyond the channels, which the spectra of the fit, most of them up to 780 nm, do not tell. [A/m²]
    """
    estimate = channel_estimate(ensemble, bands, cell.responsivity)
    density = readings @ estimate.weights
    read = np.sqrt((uncertainty**2) @ (estimate.weights**2))
    missed = estimate.standard_uncertainty(lamp_kind) * np.abs(density)
    if lamp_kind in HOT_BODY_K:
        unseen = unseen_share(bands.centers_nm, cell, HOT_BODY_K[lamp_kind])
        missed = np.hypot(missed, UNIFORM * unseen / (1.0 - unseen) * np.abs(density))
    return density, np.asarray(np.hypot(read, missed), dtype=np.float64)


def unseen_share(centers_nm: FloatArray, cell: Cell, kelvin: float) -> float:
    """Share of a cell's current under a black body that comes of light beyond channels of these centres [1]."""
    response = cell.responsivity
    grid = response.wavelengths_nm
    product = response.values * cct_spectrum(kelvin).at(grid, outside="zero")
    return 1.0 - share_within(centers_nm, Spectrum(wavelengths_nm=grid, values=product))
