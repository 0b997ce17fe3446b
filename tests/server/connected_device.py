"""A live device connected for a test, and what it tells first."""

from typing import Any

from server.sources.device import Device, Sample
from server.sources.registry import SOURCES


def connected(source: str, **settings: Any) -> Device:
    entry = SOURCES.get(source)
    assert entry.connect is not None
    return entry.connect(entry.settings(**settings))


def sample_of(device: Device) -> Sample:
    try:
        reading = next(found for _ in range(20) if (found := device.read()) is not None)
    finally:
        device.close()
    assert isinstance(reading, Sample)
    return reading
