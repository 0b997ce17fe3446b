"""Frames of a camera: PNG, TIFF, BMP and JPEG of 8 or 16 bit."""

from calib_core.formats.format import Format, Match, by_ending

_MAGIC = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is an image."""
    ending = by_ending(name, FORMAT.endings)
    return Match(0.6, "begins like an image") if ending.sure and data.startswith(_MAGIC) else ending


FORMAT = Format(
    name="image",
    title="Image (PNG, TIFF, BMP, JPEG)",
    endings=(".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg"),
    kinds=("frame",),
    recognise=recognise,
    proof="real files",
)
