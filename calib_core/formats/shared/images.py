"""Frames from their files: PNG, TIFF, BMP and JPEG of 8 or 16 bit, limited before anything is unpacked."""

import io
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, TooLargeError
from calib_core.messages import message

ImageArray = NDArray[np.uint8] | NDArray[np.uint16]

MOST_PIXELS = 50_000_000
_MOST_BYTES = 200_000_000
_PNG_CHANNELS = {0: 1, 2: 3, 3: 4, 4: 2, 6: 4}  # by colour type; a palette is unpacked
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_STANDALONE = frozenset({0x01, *range(0xD0, 0xD9)})


def decode_image(data: bytes, where: str = "", most_pixels: int = MOST_PIXELS) -> ImageArray:
    """Return the image in a file's bytes: (H, W) grey, or (H, W, 3) red green blue; uint8 or uint16.

    Parameters
    ----------
    data
        The whole file.
    where
        Its name, for messages.
    most_pixels
        What the header may promise; nothing is unpacked beyond it.

    Raises
    ------
    InputError
        If the file is empty, of another format, truncated or damaged.
    TooLargeError
        If the image has more pixels than allowed.
    """
    import cv2

    if not data:
        raise InputError("an image", "an empty file", "Copy or export it again.", where)
    try:
        width, height, pixel_bytes, complete = _header(data)
    except (struct.error, IndexError, ValueError):
        raise _truncated(where, message("a file that ends in its header")) from None
    except InputError as error:
        raise (error.at(where) if where else error) from None
    if width <= 0 or height <= 0:
        got = "a header that says {width}×{height} pixels"
        to_do = "Copy or export it again."
        raise InputError("an image", got, to_do, where, width=width, height=height)
    if width * height > most_pixels:
        raise TooLargeError(
            "an image of at most {most_pixels:g} megapixels",
            "{width}×{height} = {width_other:.0f} megapixels",
            "Crop it or take the frame at the sensor's own size.",
            where,
            most_pixels=most_pixels / 1000000.0,
            width=width,
            height=height,
            width_other=width * height / 1000000.0,
        )
    if width * height * pixel_bytes > _MOST_BYTES:
        raise TooLargeError(
            "an image of at most {most_bytes:g} MB unpacked",
            "{width}×{height} pixels of {pixel_bytes:g} bytes = {width_other:.0f} MB",
            "Save it in grey, or with 8 bit, or crop it.",
            where,
            most_bytes=_MOST_BYTES / 1000000.0,
            width=width,
            height=height,
            pixel_bytes=pixel_bytes,
            width_other=width * height * pixel_bytes / 1000000.0,
        )
    if not complete:
        raise _truncated(where, message("a file that breaks off after {count} bytes", count=len(data)))
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        image = None
    if image is None:
        raise InputError("a complete image file", "damaged content", "Copy or export it again.", where)
    return _as_grey_or_rgb(np.asarray(image), where)


def _as_grey_or_rgb(image: NDArray[Any], where: str) -> ImageArray:
    if image.dtype.name not in ("uint8", "uint16"):
        to_do = "Save it as PNG or TIFF of 8 or 16 bit."
        raise InputError("an image of 8 or 16 bit", "values of type {dtype}", to_do, where, dtype=image.dtype)
    if image.ndim == 3:
        image = image[:, :, 0] if image.shape[2] < 3 else image[:, :, 2::-1]
    result = np.ascontiguousarray(image)
    return result.astype(np.uint8, copy=False) if image.dtype == np.uint8 else result.astype(np.uint16, copy=False)


def _truncated(where: str, got: str) -> InputError:
    return InputError("a complete image file", got, "Copy or export it again.", where)


def _header(data: bytes) -> tuple[int, int, float, bool]:
    """Return width, height, bytes a pixel when unpacked, and whether the file is complete, from headers alone."""
    if data[:8] == _PNG:
        width, height, depth, color = struct.unpack(">IIBB", data[16:26])
        return width, height, _PNG_CHANNELS.get(color, 4) * max(1.0, depth / 8), _png_is_whole(data)
    if data[:2] == b"\xff\xd8":
        return _jpeg_header(data)
    if data[:2] == b"BM":
        size, _, offset = struct.unpack("<III", data[2:14])
        width, height, _, bits = struct.unpack("<iiHH", data[18:30])
        height = abs(height)
        plain = struct.unpack("<I", data[30:34])[0] in (0, 3)
        needed = offset + (width * bits + 31) // 32 * 4 * height if plain else size
        return width, height, max(3.0, bits / 8), len(data) >= needed
    if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _tiff_header(data)
    to_do = "Save it as PNG or TIFF of 8 or 16 bit."
    raise InputError("an image in PNG, TIFF, BMP or JPEG format", "something else", to_do)


def _png_is_whole(data: bytes) -> bool:
    """Return whether the chunks follow each other to the last; a decoder makes room for what a length claims."""
    at = len(_PNG)
    while at + 12 <= len(data):
        (length,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        at += 12 + length
        if kind == b"IEND":
            return at <= len(data)
    return False


def _jpeg_header(data: bytes) -> tuple[int, int, float, bool]:
    at = 2
    while True:
        while data[at] == 0xFF:
            at += 1
        marker = data[at]
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack(">HH", data[at + 4 : at + 8])
            return width, height, 3.0, b"\xff\xd9" in data[-4096:]
        at += 1 if marker in _STANDALONE else 1 + struct.unpack(">H", data[at + 1 : at + 3])[0]


def _tiff_header(data: bytes) -> tuple[int, int, float, bool]:
    import tifffile

    try:
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            page = file.pages[0]
            if not isinstance(page, tifffile.TiffPage):
                raise ValueError("no page")
            ends = [o + n for o, n in zip(page.dataoffsets, page.databytecounts, strict=True)]
            pixel_bytes = max(1, page.samplesperpixel) * max(1.0, page.bitspersample / 8)
            return page.imagewidth, page.imagelength, pixel_bytes, bool(ends) and max(ends) <= len(data)
    except tifffile.TiffFileError as error:
        raise ValueError(str(error)) from None
