"""What reading, colouring and keeping a scan usually take: processor time of one core, for the shares of a progress.

Measured in the demo room (55 thousand faces, 4 million pixels) and the hall of the benchmark `scale` (a million faces,
268 million pixels of texture).
"""

from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.decimation import carried_pixels

SAVING_S_PER_PIXEL, SAVING_S_PER_FACE = 4.5e-8, 1.5e-6  # [s]
LOADING_S_PER_PIXEL, LOADING_S_PER_FACE = 3.6e-8, 0.8e-6  # [s]
COLORING_S_PER_PIXEL = 5.5e-8  # [s]


def saving_s(scan: Scan, max_faces: int | None = None) -> float:
    """Time that `save_scan` usually takes, of a scan that has at most `max_faces` by then [s]."""
    faces, pixels = len(scan.faces), scan.appearance.pixels
    if max_faces is not None and max_faces < faces:
        faces, pixels = max_faces, carried_pixels(scan)
    return SAVING_S_PER_PIXEL * pixels + SAVING_S_PER_FACE * faces


def loading_s(scan: Scan) -> float:
    """Time that `load_scan` usually takes [s]."""
    return LOADING_S_PER_PIXEL * scan.appearance.pixels + LOADING_S_PER_FACE * len(scan.faces)


def coloring_s(scan: Scan) -> float:
    """Time that `Scan.face_colors` usually takes when it is first asked for [s]."""
    return COLORING_S_PER_PIXEL * scan.appearance.pixels
