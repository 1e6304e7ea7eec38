"""What reading, colouring and keeping a scan usually take: processor time of one core, for the shares of a progress.

Measured in the demo room (55 thousand faces, 4 million pixels) and the hall of benchmarks/scale.py (a million faces,
268 million pixels of texture).
"""

from lidarspectra.hardware.phone.scan import Scan

SAVING_S_A_PIXEL, SAVING_S_A_FACE = 4.5e-8, 1.5e-6  # [s]
LOADING_S_A_PIXEL, LOADING_S_A_FACE = 3.6e-8, 0.8e-6  # [s]
COLORING_S_A_PIXEL = 5.5e-8  # [s]


def texture_pixels(scan: Scan) -> int:
    """Pixels of all textures of a scan."""
    return sum(image.shape[0] * image.shape[1] for image in scan.appearance.images)


def saving_s(scan: Scan) -> float:
    """Time that `save_scan` usually takes [s]."""
    return SAVING_S_A_PIXEL * texture_pixels(scan) + SAVING_S_A_FACE * len(scan.faces)


def loading_s(scan: Scan) -> float:
    """Time that `load_scan` usually takes [s]."""
    return LOADING_S_A_PIXEL * texture_pixels(scan) + LOADING_S_A_FACE * len(scan.faces)


def coloring_s(scan: Scan) -> float:
    """Time that `Scan.face_colors` usually takes when it is first asked for [s]."""
    return COLORING_S_A_PIXEL * texture_pixels(scan)
