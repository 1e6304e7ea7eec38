"""Virtual devices for rehearsals and tests: a robot, a spectral sensor, a solar cell, and a serial module."""
