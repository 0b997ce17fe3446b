"""A live device connected for a test, and what it tells first."""

from contextlib import suppress
from typing import Any

from server.sources.device import Device, Sample
from server.sources.registry import SOURCES


def connected(source: str, **settings: Any) -> Device:
    entry = SOURCES.get(source)
    assert entry.connect is not None
    return entry.connect(entry.settings(**settings))


def sample_of(device: Device) -> Sample:
    """Return the first sample of a device; on a busy machine its server may be late."""
    reading = None
    try:
        for _ in range(20):
            with suppress(TimeoutError):
                if (reading := device.read()) is not None:
                    break
    finally:
        device.close()
    assert isinstance(reading, Sample)
    return reading
