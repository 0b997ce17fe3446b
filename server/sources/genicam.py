"""GigE Vision and USB3 Vision cameras (GenICam), by viva-genicam: free running, whole frames alone."""

import re
from typing import Any, Literal

from pydantic import Field

from calib_core.errors import InputError
from calib_core.messages import message
from server.sources.device import Description, Frame, host_now_s
from server.sources.lossless import lossless
from server.sources.source import Settings, Source

_DISCOVERY_MS = 500
_WAIT_MS = 500
_SILENT_READS = 3
_NANOSECONDS = 1e9


class GenicamSettings(Settings):
    """Which camera, and what is set in it; what is left out stays as the camera has it.

    `address` is the camera's IP address, or a serial number on USB; without it the only one is taken.
    `interface` is the name or address of this computer's network interface.  `features` are set before all else,
    by their GenICam names.
    """

    transport: Literal["gige", "usb3"] = "gige"
    address: str | None = Field(default=None, max_length=64)
    interface: str | None = Field(default=None, max_length=64)
    exposure_us: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    gain: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    frame_rate_hz: float | None = Field(default=None, gt=0, le=10_000)
    features: dict[str, str] = Field(
        default={}, max_length=50, examples=[{"Width": "1280", "PixelFormat": "Mono8"}]
    )


class GenicamCamera:
    """Streams from one camera.

    Packets that got lost are asked for again, where the camera keeps them.  Frames of which one is missing all the
    same are not delivered; names count blocks.

    Parameters
    ----------
    settings : GenicamSettings
    camera : viva_genicam.Camera, optional
        One that is open already; left out, the one that `settings` mean is looked for.
    """

    def __init__(self, settings: GenicamSettings, camera: Any = None) -> None:
        self._camera = camera or _opened(settings)
        self._model = f"{self._feature('DeviceVendorName')} {self._feature('DeviceModelName')}".strip()
        self._silent = self._lost = 0
        try:
            self._set(settings)
            self._tick_s = 1.0 / self._ticks()
            self._stream: Any = self._camera.stream()
            self._stream.__enter__()
        except BaseException:
            self._camera.close()
            raise

    def describe(self) -> Description:
        """Return the camera's model and the size of its images."""
        size = {name: self._camera.get(name) for name in ("Width", "Height", "PixelFormat")}
        return Description(self._model, "pixels", can=("images", "device time"), more=size)

    def read(self) -> Frame | None:
        """Return the next whole frame; raises OSError where none comes for a second and a half."""
        import numpy as np

        try:
            frame = self._stream.next_frame(_WAIT_MS)
        except Exception as error:  # the library's own, which tell a time-out and a loss alike
            self._require_whole()
            self._silent += 1
            if self._silent < _SILENT_READS:
                return None
            raise ConnectionError(message("the camera sends nothing ({error})", error=error)) from None
        if frame is None:
            raise ConnectionError(message("the camera ended its stream"))
        self._silent = 0
        arrived_s = host_now_s()
        image = frame.to_numpy(True)
        if image.ndim == 1:
            wanted, got = message("a pixel format of grey values or colours"), f"'{frame.pixel_format}'"
            raise InputError(wanted, got, "Set Mono8 in the camera.", "PixelFormat")
        depth = re.search(r"1[0246]", frame.pixel_format)
        if image.dtype == np.uint16 and depth is not None:
            image = image << (16 - int(depth.group()))  # so that the brightest value is the type's largest
        shown = image[..., ::-1] if image.ndim == 3 else image
        name, content = lossless(shown, frame.block_id)
        ticks = frame.ts_dev
        return Frame(arrived_s, name, content, None if ticks is None else ticks * self._tick_s)

    def _require_whole(self) -> None:
        """Tell frames of which packets were lost since this was asked last; raises InputError."""
        stats = getattr(self._stream, "stats", None)
        told = stats() if callable(stats) else stats
        lost, self._lost = getattr(told, "frames_lost", 0) - self._lost, getattr(told, "frames_lost", self._lost)
        if lost > 0:
            to_do = message(
                "Set the camera's packet size to what the network takes (MTU), or lower the frame rate."
            )
            raise InputError("whole frames", "{count} incomplete", to_do, self._model, count=lost)

    def close(self) -> None:
        """Stop the stream and give the camera back."""
        try:
            self._stream.__exit__(None, None, None)
        finally:
            self._camera.close()

    def _set(self, settings: GenicamSettings) -> None:
        """Set what is to be set; raises InputError where the camera does not take it."""
        from viva_genicam import GenicamError

        for name, value in settings.features.items():
            try:
                self._camera.set(name, value)
            except GenicamError as error:
                to_do = message("Look its name and range up in the camera's manual, or leave it out.")
                need = "a feature that the camera takes"
                raise InputError(need, str(error), to_do, f"features.{name}") from None
        for field, write in (
            ("exposure_us", self._camera.set_exposure_time),
            ("gain", self._camera.set_gain),
            ("frame_rate_hz", self._camera.set_frame_rate),
        ):
            value = getattr(settings, field)
            try:
                if value is not None:
                    write(value)
            except GenicamError as error:
                to_do = message("Leave it out, or set it by the camera's own name among the features.")
                raise InputError("a setting that the camera takes", str(error), to_do, field) from None

    def _feature(self, name: str) -> str:
        """Return a feature's value as text, empty where the camera has none of that name."""
        try:
            return str(self._camera.get(name))
        except Exception:  # the library's own
            return ""

    def _ticks(self) -> float:
        """Return how often a second the camera's clock ticks; nanoseconds where it does not say."""
        try:
            return float(self._camera.get_integer("GevTimestampTickFrequency")) or _NANOSECONDS
        except Exception:  # no such feature, or one that cannot be read
            return _NANOSECONDS


def _opened(settings: GenicamSettings) -> Any:
    from viva_genicam import Camera, GenicamError

    try:
        return Camera.open(_only(_found(settings), settings))
    except GenicamError as error:  # held by another program, say, or this computer has no USB
        raise ConnectionError(message("no camera could be opened ({error})", error=error)) from None


def _found(settings: GenicamSettings) -> list[Any]:
    from viva_genicam import discover, discover_u3v

    if settings.transport == "usb3":
        return list(discover_u3v())
    everywhere = settings.interface is None
    return list(discover(timeout_ms=_DISCOVERY_MS, iface=settings.interface, all=everywhere))


def _only(found: list[Any], settings: GenicamSettings) -> Any:
    """Return the camera that is meant; raises InputError where there is none, or several."""
    names = {str(getattr(one, "ip", "") or getattr(one, "serial", "")): one for one in found}
    if settings.address is not None and settings.address in names:
        return names[settings.address]
    if settings.address is None and len(names) == 1:
        return next(iter(names.values()))
    wanted = (
        message("the camera {address}", address=settings.address) if settings.address else message("one camera")
    )
    to_do = message("Name one of these.") if names else message("Check its cable, its power and the interface.")
    raise InputError(wanted, ", ".join(names) or "none that answers", to_do, "address")


SOURCE = Source(
    "genicam",
    "Camera: GigE Vision or USB3 Vision",
    "Streams images from an industrial camera by GenICam.",
    GenicamSettings,
    connect=GenicamCamera,
    delivers=("scanner",),
    clock="every-reading",
    extra="genicam",
)
