"""Whether a reading can be true: what a device sends by mistake must not stand beside a frame as its pose."""

import math

from calib_core.messages import message
from server.sources.device import Frame, Reading, Sample

_REACH_MM = 20_000.0
_MOST_BYTES = 64 * 1024 * 1024


def nonsense(reading: Reading, before: Reading | None) -> str | None:
    """Return what is impossible about a reading, None where nothing is.

    Parameters
    ----------
    reading : Sample or Frame
    before : Sample, Frame or None
        The good reading before it, of the same device.
    """
    device_s = reading.device_time_s
    if device_s is not None and not math.isfinite(device_s):
        return "a device time that is not finite"
    before_s = before.device_time_s if before is not None else None
    if before_s is not None and device_s is not None and device_s < before_s:
        return message(
            "a device time that runs back, {before_s:.3f} s to {device_s:.3f} s",
            before_s=before_s,
            device_s=device_s,
        )
    if isinstance(reading, Frame):
        if not reading.content:
            return "an empty exposure"
        return "an exposure of more than 64 MiB" if len(reading.content) > _MOST_BYTES else None
    return _of_sample(reading)


def _of_sample(sample: Sample) -> str | None:
    if sample.base_from_tool0 is not None:
        place = sample.base_from_tool0.translation_mm
        if not all(map(math.isfinite, place.tolist())):
            return "a pose that is not finite numbers"
        if abs(place).max() > _REACH_MM:
            return message("a flange {place:.0f} m from the base", place=abs(place).max() / 1000)
    if sample.joints_deg is not None and not all(map(math.isfinite, sample.joints_deg)):
        return "joints that are not finite numbers"
    if sample.table_deg is not None and not math.isfinite(sample.table_deg):
        return "a table angle that is not a finite number"
    return None
