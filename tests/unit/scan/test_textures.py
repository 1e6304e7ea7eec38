import io
import struct
import zlib
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from lidarspectra.errors import ScanError
from lidarspectra.geometry import appearance as appearance_module
from lidarspectra.geometry.appearance import Appearance
from lidarspectra.geometry.textures import (
    MAX_IMAGE_PIXELS,
    decode_image,
    mean_texture_colors,
    sample_image,
    subdivision_barycentrics,
    tint_image,
)
from lidarspectra.spectra.colorimetry import decode_srgb, encode_srgb


def encoded(image: Image.Image, kind: str = "PNG") -> bytes:
    stream = io.BytesIO()
    image.save(stream, format=kind)
    return stream.getvalue()


def checkers(seed: int = 0, height: int = 5, width: int = 8) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def test_a_pixel_centre_has_exactly_its_pixels_colour() -> None:
    image = checkers()
    rows, columns = np.indices(image.shape[:2])
    uv = np.column_stack([(columns.ravel() + 0.5) / 8, 1 - (rows.ravel() + 0.5) / 5])
    # single precision inside
    np.testing.assert_allclose(sample_image(image, uv), decode_srgb(image.reshape(-1, 3) / 255), atol=1e-5)


def test_between_two_pixels_light_is_averaged_not_bytes() -> None:
    image = np.array([[[0, 0, 0], [255, 255, 255]]], dtype=np.uint8)
    np.testing.assert_allclose(sample_image(image, np.array([[0.5, 0.5]])), 0.5, atol=1e-6)


@settings(max_examples=50, deadline=None)
@given(
    u=st.floats(-3, 3, allow_nan=False),
    v=st.floats(-3, 3, allow_nan=False),
    across=st.integers(-1000, 1000),
    down=st.integers(-1000, 1000),
)
def test_the_texture_repeats_outside_zero_to_one(u: float, v: float, across: int, down: int) -> None:
    image = checkers(1)
    here = sample_image(image, np.array([[u, v]]))
    there = sample_image(image, np.array([[u + across, v + down]]))
    # adding a thousand costs ten bits of the coordinate
    np.testing.assert_allclose(here, there, atol=1e-4)


@pytest.mark.parametrize("parts", [1, 2, 5])
def test_subdivision_points_have_the_triangles_centroid_as_mean(parts: int) -> None:
    points = subdivision_barycentrics(parts)
    assert points.shape == (parts**2, 3)
    assert (points > 0).all()
    np.testing.assert_allclose(points.sum(axis=1), 1)
    np.testing.assert_allclose(points.mean(axis=0), 1 / 3)


def test_the_mean_colour_of_a_face_is_that_of_the_area_it_covers() -> None:
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    image[:, 32:] = 255
    # u runs from 0 to 1 over a right triangle: white beyond u = 1/2 covers a quarter of it.
    face = np.array([[[0, 0], [1, 0], [0, 1]]], dtype=float)
    # the edge between black and white is two texels wide, of which samples see a part: 1 of 64
    np.testing.assert_allclose(mean_texture_colors(image, face), 0.25, atol=1 / 64)


def test_mean_colours_agree_with_many_random_samples() -> None:
    image = checkers(2, 10, 15).repeat(6, axis=0).repeat(6, axis=1)
    rng = np.random.default_rng(3)
    faces = rng.uniform(-0.5, 1.5, (20, 3, 2))
    weights = rng.dirichlet([1, 1, 1], 40_000)
    brute = np.array([sample_image(image, weights @ face).mean(axis=0) for face in faces])
    # patches of 6 texels with a spread of 0.3 are sampled every 2 texels: what an edge cuts off is a few per cent
    np.testing.assert_allclose(mean_texture_colors(image, faces), brute, atol=0.03)


@pytest.mark.parametrize("mode", ["L", "LA", "RGBA", "P", "1", "CMYK"])
def test_any_mode_becomes_rgb_bytes(mode: str) -> None:
    gray = Image.fromarray(np.full((4, 6), 255, dtype=np.uint8))
    image = decode_image(encoded(gray.convert(mode), "TIFF" if mode == "CMYK" else "PNG"), name="t")
    assert image.shape == (4, 6, 3)
    assert image.dtype == np.uint8
    assert (image == 255).all()


def test_sixteen_bits_keep_their_upper_eight() -> None:
    levels = np.array([[0, 257, 128 * 257, 65535]], dtype=np.uint16)
    image = decode_image(encoded(Image.fromarray(levels)), name="t")
    np.testing.assert_array_equal(image[0, :, 0], [0, 1, 128, 255])


def test_transparent_pixels_keep_their_colour() -> None:
    image = Image.new("RGBA", (2, 2), (10, 20, 30, 0))
    np.testing.assert_array_equal(decode_image(encoded(image), name="t")[0, 0], [10, 20, 30])


def png_of_claimed_size(width: int, height: int) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    )


SRGB_PRIMARIES = ((0.4360, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))  # XYZ under D50
GREEN_AND_RED_SWAPPED = (SRGB_PRIMARIES[1], SRGB_PRIMARIES[0], SRGB_PRIMARIES[2])


def icc_profile(gamma: float, primaries=SRGB_PRIMARIES) -> bytes:
    """A display profile of three primaries and a power, as phones embed them in their pictures (ICC.1:2010)."""

    def fixed(values) -> bytes:
        return b"".join(struct.pack(">i", round(65536 * value)) for value in values)

    curve = b"curv" + bytes(4) + struct.pack(">IH", 1, round(256 * gamma)) + bytes(2)
    tags = {b"wtpt": b"XYZ " + bytes(4) + fixed((0.9642, 1.0, 0.8249))}
    for name, primary in zip((b"r", b"g", b"b"), primaries, strict=True):
        tags[name + b"XYZ"] = b"XYZ " + bytes(4) + fixed(primary)
        tags[name + b"TRC"] = curve
    start = 128 + 4 + 12 * len(tags)
    table, body = struct.pack(">I", len(tags)), b""
    for name, content in tags.items():
        table += name + struct.pack(">II", start + len(body), len(content))
        body += content
    head = struct.pack(">I4sI", start + len(body), b"test", 0x02100000) + b"mntrRGB XYZ " + bytes(12) + b"acsp"
    head += bytes(28) + fixed((0.9642, 1.0, 0.8249))
    return head.ljust(128, b"\0") + table + body


def with_profile(image: Image.Image, profile: bytes) -> bytes:
    stream = io.BytesIO()
    image.save(stream, format="PNG", icc_profile=profile)
    return stream.getvalue()


def test_a_picture_is_read_by_its_own_profile_and_a_texture_is_not() -> None:
    """Phones write frames of videos with the power of 1.961: a grey of 100 of 255 is 16 % of the light, sRGB's 13 %."""
    gray = Image.new("RGB", (4, 4), (100, 100, 100))
    data = with_profile(gray, icc_profile(1.961))
    np.testing.assert_array_equal(decode_image(data, name="t"), 100)
    shown = decode_image(data, name="t", by_profile=True)
    np.testing.assert_allclose(decode_srgb(shown / 255.0), (100 / 255) ** 1.961, rtol=0.02)
    red = with_profile(Image.new("RGB", (4, 4), (255, 0, 0)), icc_profile(2.2, GREEN_AND_RED_SWAPPED))
    np.testing.assert_allclose(decode_image(red, name="t", by_profile=True)[0, 0], [0, 255, 0], atol=2)


@pytest.mark.parametrize("profile", [b"no profile", icc_profile(1.961)[:150], b"\0" * 200])
def test_a_damaged_profile_is_as_none(profile: bytes) -> None:
    gray = Image.new("RGB", (4, 4), (100, 100, 100))
    for data in (encoded(gray), with_profile(gray, profile)):
        np.testing.assert_array_equal(decode_image(data, name="t", by_profile=True), 100)


def test_white_stays_white_by_any_profile() -> None:
    white = with_profile(Image.new("RGB", (4, 4), (255, 255, 255)), icc_profile(1.961))
    np.testing.assert_array_equal(decode_image(white, name="t", by_profile=True), 255)


@pytest.mark.parametrize("side", [12_000, 60_000, 2_000_000])
def test_an_image_bomb_is_refused_by_its_header(side: int) -> None:
    with pytest.raises(ScanError, match=f"at most {MAX_IMAGE_PIXELS} pixels"):
        decode_image(png_of_claimed_size(side, side), name="bomb")


def test_text_and_nothing_are_no_images() -> None:
    for data in (b"", b"%!PS-Adobe-3.0 EPSF-3.0\n", b"<svg/>"):
        with pytest.raises(ScanError, match="can be decoded"):
            decode_image(data, name="t")


def test_a_tint_multiplies_light() -> None:
    image = checkers(4)
    factor = np.array([0.5, 1.0, 0.1])
    expected = encode_srgb(decode_srgb(image / 255) * factor)
    np.testing.assert_allclose(tint_image(image, factor) / 255, expected, atol=0.5 / 255 + 1e-9)


def test_mean_colours_of_faces_are_read_from_the_texture_once() -> None:
    """Of what is left of a scan, and of what is added to it, they are those of a fresh look."""
    random = np.random.default_rng(4)

    def appearance(count: int, *, textured: bool) -> Appearance:
        return Appearance(
            images=(random.integers(0, 256, size=(16, 16, 3), dtype=np.uint8),) if textured else (),
            face_image=np.full(count, 0 if textured else -1),
            corner_uv=random.uniform(size=(count, 3, 2)),
            corner_color=random.uniform(size=(count, 3, 3)),
            known=True,
        )

    seen, added, kept = appearance(9, textured=True), appearance(2, textured=False), np.array([7, 0, 3])
    fresh = [each.face_colors().copy() for each in (seen.select(kept), seen.with_more(added))]
    assert seen.face_colors().shape == (9, 3)
    with patch.object(appearance_module, "mean_texture_colors", side_effect=AssertionError):
        again = [each.face_colors() for each in (seen.select(kept), seen.with_more(added))]
    for first, second in zip(fresh, again, strict=True):
        assert np.array_equal(first, second)
        assert not second.flags.writeable
