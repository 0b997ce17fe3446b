"""Height images: 16-bit counts (PNG, TIFF) or heights in mm (TIFF with floating point), with their pitches told.

As the makers say: LMI, SICK, Cognex and Keyence write 0 where nothing came back; LMI and
Keyence put 0 mm at 32768.
"""

import io
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from calib_core.errors import InputError
from calib_core.formats.format import NO_MATCH, Format, Match, PointKind, Reading, ending_of
from calib_core.formats.shared.heights import HeightSettings, grid_of
from calib_core.formats.shared.images import decode_image
from calib_core.messages import message
from calib_core.records.base import Finite

_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_MOST_PIXELS = 20_000_000


class HeightImageSettings(HeightSettings):
    """As `HeightSettings`; `rows` counts the rows of heights, where others follow (LMI: intensities, stamps)."""

    rows: Annotated[int, Field(ge=1)] | None = None
    missing: list[Finite] = Field(default_factory=lambda: [0.0])


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is a height image: 16-bit frames look the same."""
    if ending_of(name) not in FORMAT.endings:
        return NO_MATCH
    deep = data[:8] == b"\x89PNG\r\n\x1a\n" and data[24:25] == b"\x10"
    return Match(0.4, "is an image of 16 bit") if deep else Match(0.2, "is an image")


def read(data: bytes, name: str, settings: HeightImageSettings, kind: PointKind | None) -> Reading:
    """Return the points of a height image; raises InputError where a pitch is not told."""
    heights = _float_tiff(data, name) if data[:4] in _TIFF else None
    if heights is None:
        heights = decode_image(data, name, _MOST_PIXELS)
    if heights.ndim != 2 or heights.dtype == np.uint8:
        got = message("colours") if heights.ndim != 2 else message("8 bit")
        to_do = "Export the heights."
        raise InputError("an image of heights, grey with 16 bit or floating point", got, to_do, name)
    if settings.rows is not None and settings.rows > len(heights):
        raise InputError("{rows} rows", f"{len(heights)}", "Correct it.", name, rows=settings.rows)
    return grid_of(heights[: settings.rows], settings, name)


def _float_tiff(data: bytes, name: str) -> NDArray[Any] | None:
    """Return the heights of a TIFF with floating point, None of any other."""
    import tifffile

    try:
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            page = file.pages[0]
            if not isinstance(page, tifffile.TiffPage) or page.dtype is None or page.dtype.kind != "f":
                return None
            if page.imagewidth * page.imagelength * max(1, page.samplesperpixel) > _MOST_PIXELS:
                got = f"{page.imagewidth}×{page.imagelength}"
                need = "an image of at most {most_pixels} pixels"
                raise InputError(need, got, "Crop it.", name, most_pixels=_MOST_PIXELS)
            return np.asarray(page.asarray())
    except InputError:
        raise
    except Exception as error:  # tifffile and its codecs raise what they will on damaged files
        raise InputError("a whole TIFF image", f"{error}"[:120], "Copy or export it again.", name) from None


FORMAT = Format(
    name="height-image",
    title="Height image (16-bit PNG or TIFF; TIFF with floating point)",
    endings=(".png", ".tif", ".tiff"),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    settings=HeightImageSettings,
)
