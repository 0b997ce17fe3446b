"""How a frame is looked at for its stripe: which channel, which direction, what is saturated."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.messages import message

Axis = Literal["columns", "rows"]
Color = Literal["grey", "red", "green", "blue"]
ImageArray = NDArray[np.uint8 | np.uint16]

_CHANNEL: dict[Color, int] = {"red": 0, "green": 1, "blue": 2}
SMALLEST_PX = 32
"""No frame is less high or wide."""
_LARGEST_PX = 65_535
_SAMPLED_LINES = 64
_USUAL_RISES = 5.0
_SHORT_STRIPE_WEIGHT = 0.1
_LIT_SHARE = 0.08  # of the range of grey values: more than this in the room's light is a lit frame
_WIDEST_LINE_PX = 15
_OFFSET_SHARE = 0.08  # keeps the noise's negative half


class StripeView(NamedTuple):
    """One channel of a frame, turned so that the stripe runs from left to right.

    Parameters
    ----------
    image : (H, W)
        Contiguous, 8 or 16 bit.
    axis : {"columns", "rows"}
        "rows": the image is the frame turned over its diagonal.
    saturation : float
        Grey value from which a pixel is saturated.
    zero : float
        Grey value of no light, as far as something was taken off.
    """

    image: ImageArray
    axis: Axis
    saturation: float
    zero: float = 0.0


def view_of(
    image: ImageArray, dark: ImageArray | None, axis: Axis | None, color: Color | None, saturation: float | None
) -> StripeView:
    """Return the view of a frame in which its stripe stands out most, as far as axis and colour are left open.

    Parameters
    ----------
    image : (H, W) or (H, W, 3), red green blue
    dark : like image, or None
        Taken off.
    axis, color, saturation : see `StripeOptions`

    Raises
    ------
    InputError
        If the image has the wrong type or shape, or the dark frame differs from it.
    """
    if dark is None and saturation is None and (along := _plain_axis(image, axis)):
        return StripeView(image, along, 255.0)
    _require_image(image, "frame")
    level = saturation if saturation is not None else _saturation(image)
    zero = 0.0
    if dark is not None:
        _require_image(dark, "dark frame")
        if dark.shape != image.shape or dark.dtype != image.dtype:
            to_do = "Take both frames with the same camera settings."
            raise InputError("a dark frame like the lit one, {image}", _words(dark), to_do, image=_words(image))
        image, level, zero = _difference(image, dark, level)
    channels = _channels(image, color)
    if len(channels) == 1 and axis is None and channels[0].flags.c_contiguous:
        axis = _clear_axis(channels[0])
    axes: list[Axis] = [axis] if axis else ["columns", "rows"]
    candidates: list[tuple[int, Axis]] = [(k, a) for k in range(len(channels)) for a in axes]
    best, along = candidates[0]
    if len(candidates) > 1:
        best, along = max(candidates, key=lambda c: _prominence(_turned(channels[c[0]], c[1])))
    channel = channels[best]
    if image.ndim == 3 and color != "grey":
        before = channel
        channel = _without_room_light(image, channel, along, level)
        if channel is not before:
            level = float(np.iinfo(image.dtype).max)
            zero = float(round(_OFFSET_SHARE * level))
    return StripeView(np.ascontiguousarray(_turned(channel, along)), along, level, zero)


def _plain_axis(image: ImageArray, axis: Axis | None) -> Axis | None:
    """Return "columns" for a grey frame of 8 bit that can be taken as it is: no more is done than must be."""
    if image.dtype.char != "B" or image.ndim != 2 or not image.flags.c_contiguous:
        return None
    if min(image.shape) < SMALLEST_PX or max(image.shape) > _LARGEST_PX:
        return None
    return "columns" if (axis or _clear_axis(image)) == "columns" else None


def _clear_axis(channel: ImageArray) -> Axis | None:
    """Return how the stripe runs where few lines tell."""
    from calib_core.kernels.stripe_axis import COLUMNS, ROWS, clear_direction

    clear = clear_direction(channel)
    return "columns" if clear == COLUMNS else "rows" if clear == ROWS else None


def _turned(channel: ImageArray, axis: Axis) -> ImageArray:
    return channel if axis == "columns" else channel.T


def _without_room_light(image: ImageArray, channel: ImageArray, axis: Axis, saturation: float) -> ImageArray:
    """Return a channel less another, where room light shows its pattern in both: the laser is left."""
    others = [image[..., k] for k in range(3) if not np.shares_memory(image[..., k], channel)]
    full = float(np.iinfo(image.dtype).max)
    if min(float(np.median(other[::8, ::8])) for other in others) < _LIT_SHARE * full:
        return channel
    offset = round(_OFFSET_SHARE * full)
    saturated = _narrow(channel >= saturation)
    differences = [
        np.where(saturated, full, np.clip(channel.astype(np.int32) - other + offset, 0, full)).astype(image.dtype)
        for other in others
    ]
    return max(differences, key=lambda difference: _prominence(_turned(difference, axis)))


def _narrow(saturated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where saturation is as narrow as a laser's line: not white paper, which a lamp alone saturates.

    A laser that saturates its own channel shines in the others too: their difference would make its line hollow.
    """
    if not saturated.any():
        return saturated
    import cv2

    wide = cv2.morphologyEx(
        saturated.astype(np.uint8), cv2.MORPH_OPEN, np.ones((_WIDEST_LINE_PX, _WIDEST_LINE_PX))
    )
    return saturated & (wide == 0)


def _require_image(image: ImageArray, where: str) -> None:
    if image.dtype != np.uint8 and image.dtype != np.uint16:
        to_do = "Save it as PNG or TIFF of 8 or 16 bit."
        raise InputError("an image of 8 or 16 bit", "numbers of type {dtype}", to_do, where, dtype=image.dtype)
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        need = "a grey or a three-colour image"
        raise InputError(need, "an array of shape {shape}", "Give one frame.", where, shape=image.shape)
    if min(image.shape[:2]) < SMALLEST_PX or max(image.shape[:2]) > _LARGEST_PX:
        need = "an image at least {smallest_px:g} pixels high and wide"
        raise InputError(need, _words(image), "Give the whole frame.", where, smallest_px=SMALLEST_PX)


def _words(image: ImageArray) -> str:
    height, width = image.shape[:2]
    return message(
        "{width}×{height} pixels of {itemsize} bit", width=width, height=height, itemsize=8 * image.dtype.itemsize
    )


def _saturation(image: ImageArray) -> float:
    """Return the largest grey value of the camera; 16-bit files often hold 10, 12 or 14 bits."""
    if image.dtype == np.uint8:
        return 255.0
    largest = int(image.max())
    return float(next(level for level in (1023, 4095, 16_383, 65_535) if largest <= level))


def _difference(image: ImageArray, dark: ImageArray, saturation: float) -> tuple[ImageArray, float, float]:
    """Return lit minus dark, its saturation, and the offset under it that keeps the noise's negative half.

    A pixel that is saturated in the raw frame is so in the difference, whatever was taken off: the brighter the
    dark frame is there, the less is left of it.
    """
    offset = 64 if image.dtype == np.uint8 else 1024
    difference = image.astype(np.int32) - dark.astype(np.int32) + offset
    highest = min(saturation + offset, 65_535.0)
    difference[image >= saturation] = int(highest)
    return np.clip(difference, 0, 65_535).astype(np.uint16), highest, float(offset)


def _channels(image: ImageArray, color: Color | None) -> list[ImageArray]:
    if image.ndim == 2:
        return [image]
    if color is None:
        return [image[..., k] for k in range(3)]
    if color == "grey":
        return [np.rint(image.mean(axis=2)).astype(image.dtype)]
    return [image[..., _CHANNEL[color]]]


def _prominence(image: ImageArray) -> float:
    """Return how much each column's highest narrow ridge stands out of the usual.

    Mostly in the middling column; the mean decides where the stripe is so short that most columns have none.
    """
    step = max(1, image.shape[1] // _SAMPLED_LINES)
    lines = image[:, ::step].astype(np.float32)
    box, gap = 6, 8
    sums = np.cumsum(np.pad(lines, ((1, 0), (0, 0))), axis=0)
    sums = sums[box:] - sums[:-box]
    if len(sums) <= 2 * gap:
        return 0.0
    middle, above, below = sums[gap:-gap], sums[: -2 * gap], sums[2 * gap :]
    rise = middle - np.maximum(above, below)
    usual = _USUAL_RISES * 1.4826 * float(np.median(np.abs(rise[::7])))
    highest = np.maximum(rise.max(axis=0) - usual, 0.0)
    return float(np.percentile(highest, 40) + _SHORT_STRIPE_WEIGHT * highest.mean())
