"""Pictures that are drawn, for classes of which there are no pictures that may be used, or too few.

They carry what these surfaces are known for (strands, wrinkles, ripples, seams) and no more: accuracy on them says that
the network tells drawings apart. The model's card says which classes rest on them.
"""

from collections.abc import Callable

import cv2
import numpy as np

from lidarspectra.arrays import FloatArray
from research.training.pictures import CLASSES, Picture

SIZE_PX = 160  # [px]
Draw = Callable[[np.random.Generator], FloatArray]


def draw_pictures(count: int, generator: np.random.Generator) -> list[Picture]:
    """Draw `count` materials of each class that has a drawing."""
    pictures = []
    for name, draw in DRAWINGS.items():
        for number in range(count):
            image = np.rint(255.0 * np.clip(draw(generator), 0.0, 1.0)).astype(np.uint8)
            pictures.append(
                Picture(image=image, label=CLASSES.index(name), material=f"drawn {name} {number}", origin="drawn")
            )
    return pictures


def noise(generator: np.random.Generator, cells: tuple[float, float], octaves: int = 4) -> FloatArray:
    """(SIZE_PX, SIZE_PX) smooth noise, mean 0 and deviation 1, of about `cells` (across, down) bumps and finer ones."""
    total = np.zeros((SIZE_PX, SIZE_PX))
    for octave in range(octaves):
        across, down = (int(np.clip(n * 2**octave, 2, SIZE_PX)) for n in cells)
        grid = generator.standard_normal((down, across))
        total += 0.6**octave * cv2.resize(grid, (SIZE_PX, SIZE_PX), interpolation=cv2.INTER_CUBIC)
    return np.asarray((total - total.mean()) / max(float(total.std()), 1e-9), dtype=np.float64)


def _color(
    generator: np.random.Generator, low: tuple[float, float, float], high: tuple[float, float, float]
) -> FloatArray:
    """A colour on the way from one to another, a little beside it."""
    share = generator.random()
    return np.asarray(
        np.array(low) + share * (np.array(high) - np.array(low)) + 0.03 * generator.standard_normal(3), dtype=np.float64
    )


def any_color(generator: np.random.Generator) -> FloatArray:
    """Wall paint and cloth: mostly pale or grey, now and then strong."""
    strong = generator.random() < 0.3
    level = generator.uniform(0.15, 0.9) if strong else generator.uniform(0.5, 0.97)
    return np.asarray(np.clip(level + (0.25 if strong else 0.05) * generator.standard_normal(3), 0.02, 1.0))


def _shade(color: FloatArray, relief: FloatArray) -> FloatArray:
    return np.asarray(color * (1.0 + relief[:, :, None]), dtype=np.float64)


def _hair(generator: np.random.Generator) -> FloatArray:
    strands = noise(generator, (generator.uniform(30, 80), generator.uniform(1, 3)), 2)
    bend = (8.0 * noise(generator, (2, 2), 1)).astype(np.float32)
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float32)
    bent = cv2.remap(strands, x + bend, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    shine = np.exp(-0.5 * ((y - generator.uniform(0, SIZE_PX)) / generator.uniform(10, 40)) ** 2)
    color = _color(generator, (0.06, 0.04, 0.03), (0.65, 0.45, 0.25))
    return _shade(color, generator.uniform(0.2, 0.5) * bent + generator.uniform(0.0, 0.8) * shine)


def _leather(generator: np.random.Generator) -> FloatArray:
    count = int(generator.uniform(120, 900))
    seeds = generator.uniform(0, SIZE_PX, (count, 2))
    mask = np.full((SIZE_PX, SIZE_PX), 255, np.uint8)
    mask[seeds[:, 0].astype(int), seeds[:, 1].astype(int)] = 0
    distance = cv2.distanceTransform(mask, cv2.DIST_L2, 3)
    bumps = -distance / max(float(distance.std()), 1e-6)
    color = _color(generator, (0.05, 0.04, 0.04), (0.55, 0.35, 0.22))
    wrinkles = noise(generator, (6, 3), 3)
    return _shade(color, generator.uniform(0.05, 0.2) * (bumps - bumps.mean()) + 0.06 * wrinkles)


def _mirror(generator: np.random.Generator) -> FloatArray:
    """Sharp edges of something else, smooth in between, and no grain of its own."""
    image = np.ones((SIZE_PX, SIZE_PX, 3)) * any_color(generator)
    for _ in range(int(generator.integers(3, 8))):
        corners = generator.uniform(-40, SIZE_PX + 40, (int(generator.integers(3, 5)), 2)).astype(np.int32)
        cv2.fillConvexPoly(image, cv2.convexHull(corners), any_color(generator).tolist())
    light = 1.0 + 0.15 * noise(generator, (2, 2), 1)
    return np.asarray(cv2.GaussianBlur(image, (0, 0), generator.uniform(0.5, 1.5)) * light[:, :, None])


def _skin(generator: np.random.Generator) -> FloatArray:
    color = _color(generator, (0.25, 0.15, 0.1), (0.92, 0.75, 0.66))
    blush = noise(generator, (3, 3), 2)[:, :, None] * np.array([0.012, -0.006, -0.008])
    pores = noise(generator, (60, 60), 1)
    surface = _shade(color, 0.02 * pores + 0.08 * noise(generator, (2, 2), 1))
    return np.asarray(surface + blush, dtype=np.float64)


def _sky(generator: np.random.Generator) -> FloatArray:
    top, bottom = np.array([0.25, 0.45, 0.8]), np.array([0.7, 0.82, 0.95])
    slope = np.linspace(generator.uniform(0, 0.5), generator.uniform(0.5, 1), SIZE_PX)[:, None, None]
    clear = top + slope * (bottom - top)
    cloud = 1.0 / (1.0 + np.exp(-3.0 * (noise(generator, (4, 3), 5) - generator.uniform(-1.5, 2.0))))
    return np.asarray(clear * (1 - cloud[:, :, None]) + generator.uniform(0.7, 1.0) * cloud[:, :, None]) * np.ones(3)


def _water(generator: np.random.Generator) -> FloatArray:
    ripples = noise(generator, (generator.uniform(4, 12), generator.uniform(10, 30)), 3)
    color = _color(generator, (0.05, 0.15, 0.2), (0.4, 0.65, 0.7))
    glints = np.clip(ripples - generator.uniform(1.0, 2.0), 0, 1)
    return _shade(color, 0.2 * ripples) + 0.6 * glints[:, :, None]


def _painted(generator: np.random.Generator) -> FloatArray:
    """A wall with roller texture, or a ceiling of panels with seams."""
    image = _shade(any_color(generator), 0.05 * noise(generator, (2, 2), 1))
    image *= 1.0 + generator.uniform(0.0, 0.025) * noise(generator, (90, 90), 1)[:, :, None]
    if generator.random() < 0.25:
        pitch = int(generator.uniform(30, 120))
        image[::pitch], image[:, ::pitch] = 0.8 * image[::pitch], 0.8 * image[:, ::pitch]
    return image


def _carpet(generator: np.random.Generator) -> FloatArray:
    pile = noise(generator, (generator.uniform(50, 150), generator.uniform(50, 150)), 2)
    color = any_color(generator) * generator.uniform(0.25, 0.8)
    image = _shade(color, generator.uniform(0.08, 0.3) * pile + 0.06 * noise(generator, (4, 4), 2))
    if generator.random() < 0.5:
        flecks = noise(generator, (60, 60), 1)[:, :, None] > 1.2
        image = np.where(flecks, image * 0.5 + 0.5 * any_color(generator), image)
    return np.asarray(image)


def _fabric(generator: np.random.Generator) -> FloatArray:
    """A weave: two threads that cross."""
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX].astype(np.float64)
    pitch = generator.uniform(2.5, 7.0)
    weave = np.sin(2 * np.pi * x / pitch) * np.sin(2 * np.pi * y / pitch)
    threads = noise(generator, (100, 4), 1) + noise(generator, (4, 100), 1)
    folds = noise(generator, (3, 2), 2)
    color = any_color(generator) * generator.uniform(0.3, 1.0)
    return _shade(color, generator.uniform(0.04, 0.15) * weave + 0.05 * threads + 0.12 * folds)


def _wallpaper(generator: np.random.Generator) -> FloatArray:
    """A pale ground with a motif that repeats, or stripes."""
    ground, ink = 0.35 + 0.65 * any_color(generator), any_color(generator)
    pitch = int(generator.uniform(16, 50))
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX]
    if generator.random() < 0.35:
        motif = (x % pitch) < generator.uniform(0.15, 0.6) * pitch
    else:
        cell = cv2.resize(generator.standard_normal((5, 5)), (pitch, pitch), interpolation=cv2.INTER_CUBIC)
        shift = (y // pitch % 2) * (pitch // 2) * (generator.random() < 0.5)
        motif = cell[y % pitch, (x + shift) % pitch] > generator.uniform(0.3, 1.0)
    soft = cv2.GaussianBlur(motif.astype(np.float64), (0, 0), 0.8)[:, :, None]
    share = generator.uniform(0.15, 0.8) * soft
    return np.asarray((1.0 - share) * ground + share * ink)


def _ceramic(generator: np.random.Generator) -> FloatArray:
    """Glaze: smooth, mostly white, with the lamps' soft-edged mirror images."""
    color = (
        _color(generator, (0.8, 0.8, 0.78), (0.97, 0.97, 0.96)) if generator.random() < 0.7 else any_color(generator)
    )
    image = _shade(color, 0.12 * noise(generator, (2, 2), 1))
    for _ in range(int(generator.integers(1, 4))):
        glare = np.zeros((SIZE_PX, SIZE_PX))
        middle = generator.uniform(0, SIZE_PX, 2).astype(int).tolist()
        axes = [int(n) for n in generator.uniform(3, 30, 2)]
        cv2.ellipse(glare, middle, axes, float(generator.uniform(0, 180)), 0, 360, 1.0, -1)
        image += 0.5 * cv2.GaussianBlur(glare, (0, 0), generator.uniform(1.5, 5))[:, :, None]
    return image


DRAWINGS: dict[str, Draw] = {
    "hair": _hair, "leather": _leather, "mirror": _mirror, "skin": _skin, "sky": _sky, "water": _water,
    "painted": _painted, "carpet": _carpet, "fabric": _fabric, "wallpaper": _wallpaper, "ceramic": _ceramic,
}  # fmt: skip
ONLY_DRAWN = ("hair", "leather", "mirror", "skin", "sky", "water")  # nothing else is known of these
