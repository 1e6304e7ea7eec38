"""Fine structure that a texture of 128 pixels is too coarse for: pile, weave, grain, chips, veins; drawn, and seamless.

Each is a picture of a factor on the light, about 1: stored as half of it, so that values between 0 and 2 fit. Smooth
noise is white noise filtered in its Fourier transform, which makes it continue without a seam.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import ByteArray, FloatArray
from research.training.rendered.texture_bank import GAMMA

SIZE_PX = 256  # [px]
COUNT = 12  # of each structure
SPREAD = 0.2  # [1] standard deviation of the factor; a surface takes a multiple of it
UNIT = 0.5  # [1] stored light of a factor of 1
Draw = Callable[[np.random.Generator], FloatArray]


def draw_structures(generator: np.random.Generator) -> tuple[ByteArray, tuple[str, ...]]:
    """Draw `COUNT` of each structure.

    Returns
    -------
    pictures : (picture, SIZE_PX, SIZE_PX, 3) uint8
        Encoded, of mean `UNIT`.
    names : (picture,) of str
        Of `STRUCTURES`.
    """
    pictures, names = [], []
    for name, draw in STRUCTURES.items():
        for _ in range(COUNT):
            relief = draw(generator)
            relief = relief[:, :, None] * np.ones(3) if relief.ndim == 2 else relief
            relief = (relief - relief.mean()) / max(float(relief.std()), 1e-9)
            factor = np.clip(1.0 + SPREAD * relief, 0.0, 2.0)
            pictures.append(np.rint(255.0 * (UNIT * factor / factor.mean()).clip(0, 1) ** (1.0 / GAMMA)))
            names.append(name)
    return np.asarray(pictures, dtype=np.uint8), tuple(names)


def seamless_noise(generator: np.random.Generator, across: float, down: float, power: float = 2.0) -> FloatArray:
    """(SIZE_PX, SIZE_PX) noise without bumps finer than so many an edge, mean 0 and deviation 1."""
    frequency = np.fft.fftfreq(SIZE_PX, 1.0 / SIZE_PX)
    height = np.hypot(frequency[None, :] / across, frequency[:, None] / down)
    spectrum = np.fft.fft2(generator.standard_normal((SIZE_PX, SIZE_PX))) / (1.0 + height**2) ** power
    spectrum[0, 0] = 0.0
    noise = np.fft.ifft2(spectrum).real
    return np.asarray(noise / max(float(noise.std()), 1e-9), dtype=np.float64)


def _grid() -> tuple[FloatArray, FloatArray]:
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX] / SIZE_PX
    return x, y


def _pile(generator: np.random.Generator) -> FloatArray:
    """Carpet of loops or cut pile: bumps of about one size."""
    fine = generator.uniform(25, 70)
    bumps = seamless_noise(generator, fine, fine, 3.0) - seamless_noise(generator, 0.4 * fine, 0.4 * fine, 3.0)
    return bumps + generator.uniform(0.0, 0.8) * generator.standard_normal((SIZE_PX, SIZE_PX))


def _ribs(generator: np.random.Generator) -> FloatArray:
    """Carpet of rows of loops."""
    x, y = _grid()
    rows, loops = int(generator.integers(24, 60)), int(generator.integers(24, 80))
    bend = generator.uniform(0.0, 0.25) * seamless_noise(generator, 8, 8)
    wave = np.cos(2 * np.pi * (rows * x + bend)) + generator.uniform(0.0, 1.0) * np.cos(
        2 * np.pi * (loops * y + 0.5 * np.floor(rows * x) + bend)
    )
    return np.asarray(wave + generator.uniform(0.3, 1.2) * seamless_noise(generator, 60, 60))


def _weave(generator: np.random.Generator) -> FloatArray:
    """Two threads that cross, plain or as twill."""
    x, y = _grid()
    count, slant = int(generator.integers(20, 60)), int(generator.integers(0, 2))
    threads = np.sin(2 * np.pi * count * x) * np.sin(2 * np.pi * count * y)
    twill = np.sin(2 * np.pi * count * (x + y))
    uneven = seamless_noise(generator, 100, 3) + seamless_noise(generator, 3, 100)
    return np.asarray((twill if slant else threads) + generator.uniform(0.2, 0.7) * uneven)


def _grain(generator: np.random.Generator) -> FloatArray:
    """Wood: fibres along the second axis, with rings that a cut shows as bands."""
    x, _ = _grid()
    fibres = seamless_noise(generator, generator.uniform(30, 110), generator.uniform(1.0, 4.0), 1.5)
    bend = generator.uniform(0.03, 0.25) * seamless_noise(generator, 2.5, 1.2)
    rings = np.sin(2 * np.pi * int(generator.integers(3, 16)) * (x + bend))
    pores = np.minimum(seamless_noise(generator, 110, 12, 1.0) + 1.2, 0.0)
    return np.asarray(fibres + generator.uniform(0.0, 1.6) * rings + generator.uniform(0.0, 2.0) * pores)


def _chips(generator: np.random.Generator) -> FloatArray:
    """Terrazzo and granite: chips of stone in a ground, of several shades."""
    count = int(np.exp(generator.uniform(np.log(300), np.log(6000))))
    tree = cKDTree(generator.uniform(0, SIZE_PX, (count, 2)), boxsize=SIZE_PX)
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX]
    far, nearest = tree.query(np.stack([x.ravel(), y.ravel()], axis=1), k=2)
    tint = generator.standard_normal((count, 1)) + generator.uniform(0.0, 0.5) * generator.standard_normal((count, 3))
    tint[generator.random(count) < generator.uniform(0.0, 0.7)] = generator.uniform(-1, 1)
    gap = (far[:, 1] - far[:, 0]) < generator.uniform(0.0, 2.5)
    chips = np.where(gap[:, None], generator.uniform(-1, 1), tint[nearest[:, 0]])
    return np.asarray(chips.reshape(SIZE_PX, SIZE_PX, 3))


def _flecks(generator: np.random.Generator) -> FloatArray:
    """Sparse spots of other colours."""
    fine, least = generator.uniform(20, 90), generator.uniform(0.8, 2.0)
    spots = np.zeros((SIZE_PX, SIZE_PX, 3))
    for _ in range(int(generator.integers(1, 4))):
        spots[seamless_noise(generator, fine, fine) > least] = generator.standard_normal() + 0.4 * (
            generator.standard_normal(3)
        )
    return spots + 0.1 * seamless_noise(generator, 100, 100)[:, :, None]


def _veins(generator: np.random.Generator) -> FloatArray:
    """Marble: thin lines where a noise passes zero, over clouds."""
    slope = generator.uniform(0.5, 2.0)
    lines = np.zeros((SIZE_PX, SIZE_PX))
    for octave in (2.0, 5.0):
        noise = seamless_noise(generator, octave, octave * slope, 1.6)
        lines -= np.exp(-np.abs(noise) / generator.uniform(0.03, 0.25))
    return lines * generator.choice([-1.0, 1.0, 1.0]) + generator.uniform(0.2, 1.0) * seamless_noise(
        generator, 4, 4, 1.2
    )


def _clouds(generator: np.random.Generator) -> FloatArray:
    """Slow changes, with some finer ones on them: dirt, wear, plaster."""
    coarse = generator.uniform(1.5, 8)
    return seamless_noise(generator, coarse, coarse, generator.uniform(0.8, 2.0))


def _roller(generator: np.random.Generator) -> FloatArray:
    """Paint put on by a roller, or woodchip wallpaper: soft bumps, lit from a side."""
    fine = generator.uniform(20, 70)
    bumps = seamless_noise(generator, fine, fine, 3.0)
    return np.asarray(bumps - np.roll(bumps, int(generator.integers(1, 4)), axis=0))


def _brushed(generator: np.random.Generator) -> FloatArray:
    """Metal: scratches along the second axis."""
    return seamless_noise(generator, 120, generator.uniform(1, 6), 0.8)


def _folds(generator: np.random.Generator) -> FloatArray:
    """Hanging cloth: waves along the first axis."""
    x, _ = _grid()
    bend = 0.4 * seamless_noise(generator, 2, 1)
    return np.asarray(
        np.sin(2 * np.pi * (int(generator.integers(2, 9)) * x + bend)) + 0.5 * seamless_noise(generator, 9, 1)
    )


STRUCTURES: dict[str, Draw] = {
    "pile": _pile, "ribs": _ribs, "weave": _weave, "grain": _grain, "chips": _chips, "flecks": _flecks,
    "veins": _veins, "clouds": _clouds, "roller": _roller, "brushed": _brushed, "folds": _folds,
}  # fmt: skip
