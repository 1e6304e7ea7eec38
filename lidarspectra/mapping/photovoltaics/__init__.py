"""Solar cells: current and energy in the light of a map, the best mount, and predictions from a sensor."""

from lidarspectra.mapping.photovoltaics.cells import Cell, find_cell, list_cells
from lidarspectra.mapping.photovoltaics.currents import photocurrent, photocurrent_density

__all__ = ["Cell", "find_cell", "list_cells", "photocurrent", "photocurrent_density"]
