"""A camera that OpenCV opens: V4L2 by its number or path, or a network stream by its address."""

from typing import Any

from pydantic import Field

from calib_core.messages import message
from server.sources.device import Description, Frame, host_now_s
from server.sources.lossless import lossless
from server.sources.source import Settings, Source


class OpenCvSettings(Settings):
    """The camera: `0` or `/dev/video0` for V4L2, else an address; sizes that are left out stay as they are.

    Exposure and gain are in the camera's own units.
    """

    camera: str = Field(default="0", max_length=1000)
    width: int | None = Field(default=None, ge=16, le=20000)
    height: int | None = Field(default=None, ge=16, le=20000)
    exposure: float | None = None
    gain: float | None = None
    gray: bool = True


class OpenCvCamera:
    """Takes frames as they come, and keeps them without loss."""

    def __init__(self, settings: OpenCvSettings) -> None:
        import cv2

        self._cv2, self._settings = cv2, settings
        place: Any = int(settings.camera) if settings.camera.isdigit() else settings.camera
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 2000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 1500]
        is_address = isinstance(place, str) and "://" in place
        self._camera = cv2.VideoCapture(place, cv2.CAP_FFMPEG, limits) if is_address else cv2.VideoCapture(place)
        if not self._camera.isOpened():
            raise ConnectionError(message("no camera at {camera}", camera=settings.camera))
        for name, value in (
            (cv2.CAP_PROP_FRAME_WIDTH, settings.width),
            (cv2.CAP_PROP_FRAME_HEIGHT, settings.height),
            (cv2.CAP_PROP_EXPOSURE, settings.exposure),
            (cv2.CAP_PROP_GAIN, settings.gain),
        ):
            if value is not None:
                self._camera.set(name, value)
        self._number = 0

    def describe(self) -> Description:
        """Return the camera's size as it is set."""
        cv2 = self._cv2
        size = [int(self._camera.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
        return Description(f"{self._camera.getBackendName()} camera", can=("images",), more={"size": size})

    def read(self) -> Frame | None:
        """Return the next frame; raises ConnectionError where the camera is gone."""
        found, image = self._camera.read()
        if not found:
            raise ConnectionError(message("the camera sends no frames"))
        if self._settings.gray and image.ndim == 3:
            image = self._cv2.cvtColor(image, self._cv2.COLOR_BGR2GRAY)
        self._number += 1
        return Frame(host_now_s(), *lossless(image, self._number))

    def close(self) -> None:
        """Give the camera back."""
        self._camera.release()


SOURCE = Source(
    "opencv",
    "Camera: V4L2, network stream",
    "Takes frames of a camera that OpenCV opens.",
    OpenCvSettings,
    connect=OpenCvCamera,
    delivers=("scanner",),
)
