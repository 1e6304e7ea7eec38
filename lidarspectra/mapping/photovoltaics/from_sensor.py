"""What a cell gives beside a spectral sensor: its current from 14 or 18 channels, with its uncertainty."""

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
    """Current density of a cell from what a sensor reads at the same place.

    The weights on the channels are those that give the cell's current for indoor spectra of all kinds of lamp; how far
    they miss it for a lamp that they were not made from is part of the uncertainty.

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
        Channels' errors are taken as independent, those of the method as common to all channels. [A/m²]
    """
    estimate = channel_estimate(ensemble, bands, cell.responsivity)
    density = readings @ estimate.weights
    read = np.sqrt((uncertainty**2) @ (estimate.weights**2))
    missed = estimate.standard_uncertainty(lamp_kind) * np.abs(density)
    return density, np.asarray(np.hypot(read, missed), dtype=np.float64)
