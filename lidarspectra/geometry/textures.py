"""Texture images: safe decoding, and sampling in linear light.

Averages of colour are averages of light, so every mean and interpolation here is taken of linear sRGB values; the
encoded bytes only serve as storage.
"""

import io
import re
import struct
import warnings
import zlib
from functools import lru_cache

import numpy as np
from PIL import Image, ImageCms

from lidarspectra.arrays import ByteArray, FloatArray, IntArray, SmallFloatArray
from lidarspectra.errors import ScanError
from lidarspectra.spectra.colorimetry import decode_srgb, encode_srgb

MAX_IMAGE_PIXELS = 8192 * 8192 * 2  # [px] largest single texture; phones write 4k and 8k squares
MAX_TEXTURE_PIXELS = 8192 * 8192 * 4  # [px] all textures of a scan together: 0.8 GB decoded
IMAGE_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TIFF", "TGA", "GIF")  # no format that starts another program (EPS)
SAMPLES_AT_ONCE = 16_384  # texture samples whose temporaries stay in the processor's cache: half the time of 300,000
MAX_SUBDIVISION = 48  # a face is sampled at up to the square of this
TEXELS_PER_SAMPLE = 4.0  # bilinear samples two texels apart still see every texel
EDGE_TEXELS_PER_SAMPLE = 8.0  # along the longest edge of a narrow face

TextureArray = ByteArray | SmallFloatArray
"""A texture: bytes are sRGB encoded, floats linear and not cut at 1."""

_DECODER_FAULTS = (
    OSError, ValueError, SyntaxError, EOFError, KeyError, IndexError, TypeError, OverflowError, MemoryError,
    NotImplementedError, AttributeError, struct.error, zlib.error, Image.DecompressionBombError,
)  # fmt: skip  # what Pillow's decoders raise on malformed files


_LINEAR_OF_BYTE = decode_srgb(np.arange(256) / 255.0).astype(np.float32)


def decode_image(data: bytes, *, name: str, least_px: int | None = None, by_profile: bool = False) -> ByteArray:
    """Decode an image file to sRGB bytes.

    Grayscale, 16 bit, palette, CMYK and transparent images become plain RGB; transparency is dropped, not blended.

    Parameters
    ----------
    data : bytes
        The file's content (PNG, JPEG, WebP, BMP, TIFF, TGA or GIF).
    name : str
        Where it is, for the error.
    least_px : int, optional
        A JPEG may be decoded at a half, a quarter or an eighth of its size, but no narrower than this. [px]
    by_profile : bool
        Whether what the file's own ICC profile says of its values counts. It does in a picture; that of a texture
        is ignored, as glTF 2.0 asks for.

    Returns
    -------
    image : (height, width, 3) uint8
        First row at the top.

    Raises
    ------
    ScanError
        If it is no such image, is cut off, or has more than `MAX_IMAGE_PIXELS` pixels.
    """
    try:
        with warnings.catch_warnings():
            # Pillow warns of large images and of odd metadata; the limit below is checked instead, with a clear error.
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=IMAGE_FORMATS) as image:
                _check_pixels(image.width * image.height, limit=MAX_IMAGE_PIXELS, name=name)
                if least_px is not None and image.width > least_px:
                    image.draft("RGB", (least_px, max(1, least_px * image.height // image.width)))
                return _to_rgb_bytes(_to_srgb(image) if by_profile else image)
    except Image.DecompressionBombError as cause:
        found = f"{size[1]} pixels" if (size := re.search(r"(\d+) pixels", str(cause))) else str(cause)
        raise _too_large(found, limit=MAX_IMAGE_PIXELS, name=name) from cause
    except _DECODER_FAULTS as cause:
        raise ScanError(
            expected=f"an image that can be decoded ({', '.join(IMAGE_FORMATS)})",
            found=f"{len(data)} bytes that cannot ({cause})",
            where=name,
            todo="Export the scan again; the texture may have been cut off in copying.",
        ) from cause


def check_texture_total(images: tuple[ByteArray, ...], *, name: str) -> None:
    """Refuse a scan whose textures together exceed `MAX_TEXTURE_PIXELS` (ScanError)."""
    total = sum(image.shape[0] * image.shape[1] for image in images)
    _check_pixels(total, limit=MAX_TEXTURE_PIXELS, name=name)


def _check_pixels(pixels: int, *, limit: int, name: str) -> None:
    if pixels > limit:
        raise _too_large(f"{pixels} pixels", limit=limit, name=name)


def _too_large(found: str, *, limit: int, name: str) -> ScanError:
    return ScanError(
        expected=f"textures of at most {limit} pixels",
        found=found,
        where=name,
        todo="Export the scan with a smaller texture; 4096 x 4096 is plenty for a room.",
    )


def _to_srgb(image: Image.Image) -> Image.Image:
    """A picture by its ICC profile, relative to its own white; as it is without one, or with one that is damaged."""
    profile = image.info.get("icc_profile")
    if image.mode != "RGB" or not isinstance(profile, bytes):
        return image
    try:
        return ImageCms.applyTransform(image, _from_profile(profile)) or image
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError):
        return image


@lru_cache(maxsize=4)
def _from_profile(profile: bytes) -> ImageCms.ImageCmsTransform:
    own = ImageCms.ImageCmsProfile(io.BytesIO(profile))
    intent = ImageCms.Intent.RELATIVE_COLORIMETRIC
    return ImageCms.buildTransform(own, ImageCms.createProfile("sRGB"), "RGB", "RGB", intent)


def _to_rgb_bytes(image: Image.Image) -> ByteArray:
    if image.mode.startswith(("I", "F")):
        return _gray_to_rgb(_high_depth_to_bytes(np.asarray(image), floating=image.mode == "F"))
    # A palette or gray image may carry its transparency apart; through RGBA it is dropped without a warning.
    if "transparency" in image.info:
        image = image.convert("RGBA")
    return np.array(image.convert("RGB"), dtype=np.uint8)


def _high_depth_to_bytes(values: np.ndarray[tuple[int, ...], np.dtype[np.generic]], *, floating: bool) -> ByteArray:
    """16-bit integers hold 0 to 65535 and floats 0 to 1; both become 0 to 255."""
    scale = 255.0 if floating else 255.0 / 65535.0
    levels = np.nan_to_num(values.astype(np.float64)) * scale
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def _gray_to_rgb(gray: ByteArray) -> ByteArray:
    return np.repeat(gray[:, :, np.newaxis], 3, axis=2)


def tint_image(image: ByteArray, factor_linear: FloatArray) -> ByteArray:
    """Multiply an image by a linear colour factor, as glTF's baseColorFactor asks.

    Parameters
    ----------
    image : (height, width, 3) uint8
        sRGB encoded.
    factor_linear : (3,) float
        [0-1]

    Returns
    -------
    tinted : (height, width, 3) uint8
    """
    levels = np.arange(256) / 255.0
    factors = np.clip(np.asarray(factor_linear, dtype=np.float64), 0.0, 1.0)
    table = np.rint(255.0 * encode_srgb(decode_srgb(levels)[:, np.newaxis] * factors)).astype(np.uint8)
    return np.stack([table[image[:, :, channel], channel] for channel in range(3)], axis=2)


def sample_image(image: TextureArray, uv: FloatArray) -> FloatArray:
    """Colour of an image at texture coordinates: bilinear between pixel centres in linear light, repeating outside.

    Parameters
    ----------
    image : (height, width, 3) uint8 or float32
        sRGB encoded or, as floats, linear; first row at the top.
    uv : (n, 2) float
        v up, (0, 0) the lower left corner; outside 0 to 1 the image repeats. [1]

    Returns
    -------
    color : (n, 3) float
        Linear sRGB. [0-1]
    """
    height, width = image.shape[:2]
    across, x0, x1 = _neighbours(uv[:, 0], width)
    down, y0, y1 = _neighbours(1.0 - uv[:, 1], height)
    pixels = image.reshape(-1, 3)  # one index a pixel takes half the time of two
    above, below = width * y0, width * y1
    top = _mix(_linear(pixels, above + x0), _linear(pixels, above + x1), across)
    bottom = _mix(_linear(pixels, below + x0), _linear(pixels, below + x1), across)
    return _mix(top, bottom, down).astype(np.float64)


def _linear(pixels: TextureArray, index: IntArray) -> SmallFloatArray:
    """(n, 3) linear colour of some pixels."""
    if pixels.dtype == np.float32:
        return np.asarray(pixels.take(index, axis=0), dtype=np.float32)
    levels: ByteArray = np.asarray(pixels.take(index, axis=0), dtype=np.uint8)
    return np.asarray(_LINEAR_OF_BYTE.take(levels), dtype=np.float32)


def _neighbours(coordinate: FloatArray, count: int) -> tuple[SmallFloatArray, IntArray, IntArray]:
    """Weight of the second, and the numbers of both pixels whose centres enclose a coordinate [1] that repeats."""
    position = (coordinate - np.floor(coordinate)) * count - 0.5
    first = np.floor(position)
    number = first.astype(np.int64)  # -1 to count - 1
    before, after = np.where(number < 0, count - 1, number), number + 1
    return (position - first).astype(np.float32), before, np.where(after == count, 0, after)


def _mix(first: SmallFloatArray, second: SmallFloatArray, weight: SmallFloatArray) -> SmallFloatArray:
    return np.asarray(first + (second - first) * weight[:, np.newaxis], dtype=np.float32)


def subdivision_barycentrics(parts: int) -> FloatArray:
    """Centroids of the parts² equal triangles into which a triangle is cut.

    Parameters
    ----------
    parts : int
        How many pieces each edge is cut into.

    Returns
    -------
    barycentric : (parts², 3) float
        Each row sums to 1. [1]
    """
    up = [(3 * i + 1, 3 * j + 1) for i in range(parts) for j in range(parts - i)]
    down = [(3 * i + 2, 3 * j + 2) for i in range(parts - 1) for j in range(parts - 1 - i)]
    first_two = np.array(up + down, dtype=np.float64) / (3.0 * parts)
    return np.column_stack([first_two, 1.0 - first_two.sum(axis=1)])


def mean_texture_colors(image: TextureArray, corner_uv: FloatArray) -> FloatArray:
    """Mean linear colour of a texture over each face, by samples spread evenly over its area.

    Parameters
    ----------
    image : (height, width, 3) uint8 or float32
        sRGB encoded or, as floats, linear.
    corner_uv : (n, 3, 2) float
        Texture coordinates of the faces' corners. [1]

    Returns
    -------
    color : (n, 3) float
        Linear sRGB. [0-1]
    """
    corner_px = corner_uv * np.array([image.shape[1], image.shape[0]])
    edges = corner_px[:, 1:] - corner_px[:, :1]
    texels = 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    longest = np.linalg.norm(np.diff(corner_px, axis=1, append=corner_px[:, :1]), axis=2).max(axis=1)
    # A narrow triangle covers few texels, but its long edge crosses many.
    wanted = np.maximum(np.sqrt(texels / TEXELS_PER_SAMPLE), longest / EDGE_TEXELS_PER_SAMPLE)
    parts = np.clip(np.ceil(wanted), 2, MAX_SUBDIVISION).astype(np.int64)
    colors = np.empty((corner_uv.shape[0], 3))
    for count in np.unique(parts):
        barycentric = subdivision_barycentrics(int(count))
        chosen = np.flatnonzero(parts == count)
        per_chunk = max(1, SAMPLES_AT_ONCE // len(barycentric))
        for start in range(0, chosen.size, per_chunk):
            faces = chosen[start : start + per_chunk]
            uv = np.einsum("sk,nkc->nsc", barycentric, corner_uv[faces]).reshape(-1, 2)
            colors[faces] = sample_image(image, uv).reshape(faces.size, -1, 3).mean(axis=1)
    return colors
