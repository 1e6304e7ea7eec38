"""Solar cells in the light of a map: current, energy, the best place, and cells told by sensors."""

from lidarspectra.mapping.photovoltaics.cells import Cell, find_cell, list_cells
from lidarspectra.mapping.photovoltaics.currents import photocurrent, photocurrent_density

__all__ = ["Cell", "find_cell", "list_cells", "photocurrent", "photocurrent_density"]
