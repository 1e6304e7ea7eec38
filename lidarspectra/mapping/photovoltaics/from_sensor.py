"""A cell's current from the 14 or 18 channels of a spectral sensor beside it, with its uncertainty."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.photometry.channel_estimate import channel_estimate
from lidarspectra.mapping.photometry.indoor_spectra import IndoorSpectra
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.spectra.spectrum import BandSet


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
        The channels' errors are taken as independent, that of the weights as common to all channels. [A/m²]
    """
    estimate = channel_estimate(ensemble, bands, cell.responsivity)
    density = readings @ estimate.weights
    read = np.sqrt((uncertainty**2) @ (estimate.weights**2))
    missed = estimate.standard_uncertainty(lamp_kind) * np.abs(density)
    return density, np.asarray(np.hypot(read, missed), dtype=np.float64)
