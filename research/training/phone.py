"""What a phone makes of a material: other distance and angle, a room's light, exposure, blur, noise, compression."""

import cv2
import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray

SCALE = (0.4, 2.0)  # [1] pixels of the picture to a pixel of the material
MIN_ASPECT = 0.5  # [1] foreshortening; a surface seen more aslant counts little anyway
DYED = ("carpet", "fabric", "leather", "painted", "paper", "plastic", "wallpaper", "tile")  # come in any colour


def phone_picture(image: ByteArray, size_px: int, generator: np.random.Generator, *, dyed: bool = False) -> ByteArray:
    """One picture of a material as it may look in a scan's view.

    Parameters
    ----------
    image : (height, width, 3) uint8
    size_px : int
        Edge of the picture that comes out. [px]
    generator : numpy.random.Generator
    dyed : bool
        Whether the material may as well have another colour.

    Returns
    -------
    picture : (size_px, size_px, 3) uint8
    """
    light = _seen_from_elsewhere(image, size_px, generator).astype(np.float32) / 255.0
    if dyed and generator.random() < 0.6:
        light = other_hue(light, generator)
    return developed(light**2.2 * _room_light(size_px, generator), generator)


def developed(light: np.ndarray[tuple[int, ...], np.dtype[np.floating]], generator: np.random.Generator) -> ByteArray:
    """What a phone's camera makes of (height, width, 3) light, 1 being white: exposure, tone, blur, noise, JPEG."""
    encoded = np.clip(light * np.exp(generator.normal(0.0, 0.35)), 0.0, 1.0) ** (1.0 / generator.uniform(1.6, 2.8))
    if generator.random() < 0.6:
        encoded = cv2.GaussianBlur(encoded, (0, 0), generator.uniform(0.3, 1.6))
    grain = generator.standard_normal(encoded.shape, dtype=np.float32)
    if generator.random() < 0.5:
        grain = 1.8 * cv2.GaussianBlur(grain, (0, 0), 0.8)
    encoded = np.clip(encoded + generator.uniform(0.0, 0.025) * grain, 0.0, 1.0)
    picture = np.asarray(np.rint(255.0 * encoded), dtype=np.uint8)
    if generator.random() < 0.5:
        _, packed = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, int(generator.integers(40, 95))])
        picture = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), dtype=np.uint8)
    return picture


def _seen_from_elsewhere(image: ByteArray, size_px: int, generator: np.random.Generator) -> ByteArray:
    """The picture scaled, turned and foreshortened about a point of it."""
    scale = float(np.exp(generator.uniform(*np.log(SCALE))))
    if scale < 1.0:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.5 / scale))
    turn, aspect = generator.uniform(0, 2 * np.pi), generator.uniform(MIN_ASPECT, 1.0)
    lean = generator.uniform(0, 2 * np.pi)
    stretch = _turn(lean) @ np.diag([1.0, aspect]) @ _turn(-lean)
    matrix = scale * stretch @ _turn(turn)
    height, width = image.shape[:2]
    middle = np.array([generator.uniform(0.2, 0.8) * width, generator.uniform(0.2, 0.8) * height])
    shift = 0.5 * size_px - matrix @ middle
    affine = np.hstack([matrix, shift[:, None]])
    return np.asarray(
        cv2.warpAffine(image, affine, (size_px, size_px), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101),
        dtype=np.uint8,
    )


def _turn(angle: float) -> FloatArray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def other_hue(
    light: np.ndarray[tuple[int, ...], np.dtype[np.float32]], generator: np.random.Generator, *, deepest: float = 1.3
) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """The same pattern in another hue and depth of colour, up to `deepest` times as deep."""
    hsv = cv2.cvtColor(light, cv2.COLOR_RGB2HSV)
    hsv[..., 0] = (hsv[..., 0] + generator.uniform(0, 360)) % 360
    hsv[..., 1] = np.clip(hsv[..., 1] * generator.uniform(0.0, deepest), 0, 1)
    return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB), dtype=np.float32)


def _room_light(size_px: int, generator: np.random.Generator) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Light on the surface: tinted, growing to one side, now and then with the edge of a shadow."""
    y, x = np.mgrid[-0.5 : 0.5 : size_px * 1j, -0.5 : 0.5 : size_px * 1j]
    angle = generator.uniform(0, 2 * np.pi)
    across = x * np.cos(angle) + y * np.sin(angle)
    level = np.exp(generator.normal(0.0, 0.5) * across)
    if generator.random() < 0.15:
        edge = (across - generator.uniform(-0.5, 0.5)) / generator.uniform(0.01, 0.2)
        level = level * (1.0 - generator.uniform(0.1, 0.6) / (1.0 + np.exp(-edge)))
    tint = np.exp(generator.normal(0.0, 0.08, 3))
    return np.asarray(level[:, :, None] * tint, dtype=np.float32)
