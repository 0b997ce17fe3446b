"""A camera's image as it is looked at live: decoded once, the stripe in it, its focus and its exposure."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import CalibrationError, InputError, MeasurementError
from calib_core.formats.shared.images import decode_image
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.optics.stripe import StripeCenters, find_stripe
from calib_core.optics.stripe_view import ImageArray
from calib_core.optics.triangulate import ProfileCalibration, triangulate_stripe
from server.sources.device import Frame

_DIM = 0.2
"""A stripe whose brightest tenth stays below this share of the full scale is dim: its centres are noisy."""
_SATURATED = 0.05
"""More saturated columns than this share pull the stripe's centres."""
_WIDE_PX = 4.0
_NARROW_PX = 0.6
_PREVIEW_PX = 960
_QUALITY = 80


@dataclass(frozen=True, eq=False)
class Picture:
    """One image and the stripe in it, or why there is none.

    Parameters
    ----------
    image : (H, W) or (H, W, 3)
    stripe : StripeCenters or None
    problem : CalibrationError or None
    brightness : float
        Of the stripe's brightest tenth, as a share of the full scale.
    saturated : float
        Share of the stripe's columns that are saturated.
    """

    image: ImageArray
    stripe: StripeCenters | None
    problem: CalibrationError | None
    brightness: float
    saturated: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.image.shape[1], self.image.shape[0]

    @property
    def exposure_advice(self) -> str:
        """What to change about the exposure, empty where it is good."""
        if self.saturated > _SATURATED:
            return message(
                "{saturated:.0f} % of the stripe is saturated: expose for a shorter time.",
                saturated=100 * self.saturated,
            )
        if self.brightness < _DIM:
            share = 100 * self.brightness
            return message(
                "The stripe reaches {share:.0f} % of the full scale: expose longer, or open the aperture.",
                share=share,
            )
        return ""

    @property
    def focus_advice(self) -> str:
        """What to change about the focus, empty where it is good."""
        width_px = self.stripe.width_px if self.stripe is not None else None
        if width_px is None or _NARROW_PX <= width_px <= _WIDE_PX:
            return ""
        if width_px > _WIDE_PX:
            return message(
                "The stripe is {width_px:.1f} px wide: focus camera and laser on the sphere's distance.",
                width_px=width_px,
            )
        return message(
            "The stripe is {width_px:.1f} px wide: too narrow for its centre to be found between pixels.",
            width_px=width_px,
        )


def picture_of(frame: Frame) -> Picture:
    """Return an exposure that is an image; raises InputError or TooLargeError where it is none."""
    image = decode_image(frame.content, frame.name)
    full = float(np.iinfo(image.dtype).max)
    try:
        stripe = find_stripe(image)
    except MeasurementError as error:
        brightest = float(np.percentile(image[::4, ::4], 99.9)) / full
        return Picture(image, None, error, brightest, 0.0)
    saturated = stripe.left_out.get("saturated", 0)
    columns = len(stripe.column_px) + saturated
    brightness = float(np.percentile(stripe.amplitude, 90)) / full
    return Picture(image, stripe, None, brightness, saturated / columns)


def profile_in(picture: Picture, calibration: ProfileCalibration) -> FloatArray:
    """Return the profile (N, 2), x and z in L, mm, of the stripe in a picture.

    Raises
    ------
    InputError
        If the image's size is not that of the calibrated camera.
    MeasurementError
        If there is no stripe, or none of it lies on the plane of light.
    """
    wanted = calibration.camera.image_size
    if wanted[0] and picture.size != tuple(wanted):
        sizes = [
            message("{width}×{height} pixels", width=width, height=height)
            for width, height in (wanted, picture.size)
        ]
        need = "images of {sizes}"
        raise InputError(need, sizes[1], "Set the camera as it was when it was calibrated.", sizes=sizes[0])
    if picture.stripe is None:
        raise picture.problem or MeasurementError("a stripe", "none", "Switch the laser on.")
    points = triangulate_stripe(calibration, picture.stripe).profile_mm
    if not len(points):
        to_do = message("Check that camera and plane of light are those of this scanner.")
        raise MeasurementError("a stripe on the plane of light", "none", to_do)
    return points


def pixels_of_arc(center_mm: FloatArray, radius_mm: float, calibration: ProfileCalibration) -> FloatArray:
    """Return where a circle in the plane of light lies in the image, (N, 2), column and row."""
    angle = np.linspace(0, 2 * np.pi, 73)
    x, z = center_mm[0] + radius_mm * np.cos(angle), center_mm[1] + radius_mm * np.sin(angle)
    in_laser = np.stack([x, np.zeros_like(x), z], axis=1)
    return calibration.camera.project(calibration.camera_from_laser.apply(in_laser))


def preview_jpeg(picture: Picture) -> bytes:
    """Return an image as a small JPEG for a page.

    It is divided by a whole number, then made smaller by linear interpolation: a twentieth of the time that
    averaging over parts of pixels takes.
    """
    import cv2

    image = picture.image if picture.image.dtype == np.uint8 else (picture.image >> 8).astype(np.uint8)
    width, height = picture.size
    if width > _PREVIEW_PX:
        by = width // _PREVIEW_PX
        if by > 1:
            image = cv2.resize(image, (width // by, height // by), interpolation=cv2.INTER_AREA)
        size = (_PREVIEW_PX, round(height * _PREVIEW_PX / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    shown = image[..., ::-1] if image.ndim == 3 else image
    return cv2.imencode(".jpg", np.ascontiguousarray(shown), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
