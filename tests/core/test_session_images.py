"""Frames from bytes: every format and depth, and every way in which a file can be bad."""

import contextlib
import struct
import zlib

import cv2
import numpy as np
import pytest

from calib_core.errors import CalibrationError, InputError, TooLargeError
from calib_core.formats.shared.images import decode_image

GREY = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64)


def encode(suffix: str, image: np.ndarray) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".bmp"])
def test_grey_comes_back_bit_for_bit(suffix: str) -> None:
    np.testing.assert_array_equal(decode_image(encode(suffix, GREY)).reshape(48, 64, -1)[:, :, 0], GREY)


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_sixteen_bit_comes_back_bit_for_bit(suffix: str) -> None:
    image = GREY.astype(np.uint16) * 257
    decoded = decode_image(encode(suffix, image))
    assert decoded.dtype == np.uint16
    np.testing.assert_array_equal(decoded, image)


def test_colour_is_red_green_blue() -> None:
    bgr = np.zeros((8, 8, 3), np.uint8)
    bgr[:, :, 2] = 200
    assert decode_image(encode(".png", bgr))[3, 3].tolist() == [200, 0, 0]
    with_alpha = np.dstack([bgr, np.full((8, 8), 90, np.uint8)])
    assert decode_image(encode(".png", with_alpha))[3, 3].tolist() == [200, 0, 0]


def test_jpeg_is_near() -> None:
    smooth = np.tile(np.linspace(20, 220, 64).astype(np.uint8), (48, 1))
    assert np.abs(decode_image(encode(".jpg", smooth)).astype(int) - smooth).max() <= 4


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".bmp", ".jpg"])
@pytest.mark.parametrize("kept", [0.02, 0.5, 0.9])
def test_a_truncated_file_is_named(suffix: str, kept: float) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (48, 64)).astype(np.uint8)
    data = encode(suffix, noise)
    with pytest.raises(InputError, match="captures/f1"):
        decode_image(data[: int(len(data) * kept)], "captures/f1")


def test_a_bomb_is_refused_by_its_header() -> None:
    header = struct.pack(">IIBBBBB", 20000, 20000, 8, 0, 0, 0, 0)
    chunk = b"IHDR" + header
    bomb = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    with pytest.raises(TooLargeError, match="400 megapixels"):
        decode_image(bomb)


@pytest.mark.parametrize(
    "data", [b"", b"x,z\n1,2\n", b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"BM", b"II*\0", b"\xff\xd8\xff\xff"]
)
def test_what_is_no_image(data: bytes) -> None:
    with pytest.raises(InputError, match=r"(?i)export|as PNG"):
        decode_image(data, "captures/f1.png")


def test_damage_never_escapes_as_another_error() -> None:
    rng = np.random.default_rng(1)
    for suffix in (".png", ".tiff", ".bmp", ".jpg"):
        good = encode(suffix, GREY)
        for _ in range(40):
            bad = bytearray(good)
            for at in rng.integers(0, len(bad), 8):
                bad[at] = rng.integers(0, 256)
            with contextlib.suppress(CalibrationError):
                assert decode_image(bytes(bad)).ndim in (2, 3)


@pytest.mark.parametrize("depth_and_color", [(16, 6), (16, 2)])
def test_images_that_would_take_too_much_memory_are_refused_before_they_are_unpacked(
    depth_and_color: tuple[int, int],
) -> None:
    header = struct.pack(">IIBB", 7000, 7000, *depth_and_color) + b"\0" * 7
    data = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + header + b"\0\0\0\0IEND\xaeB`\x82"
    with pytest.raises(TooLargeError, match="MB unpacked"):
        decode_image(data, "f.png")


def test_a_chunk_that_claims_more_than_the_file_has_is_a_truncated_file() -> None:
    data = bytearray(encode(".png", GREY))
    place = data.index(b"IDAT") - 4
    data[place : place + 4] = struct.pack(">I", 1_000_000_000)  # a decoder would make room for it
    with pytest.raises(InputError, match="breaks off"):
        decode_image(bytes(data), "f.png")
