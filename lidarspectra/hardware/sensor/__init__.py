"""The spectral sensor and the cells: protocols, recording, logs, calibration."""
