"""Profiles of an invented scanner: the line ACME, then x and z in µm as pairs of big-endian 32-bit numbers."""

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.format import NO_MATCH, Format, Match, PointKind, Reading, Settings

_HEAD = b"ACME\n"
_MISSING = -(2**31)


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is of this scanner."""
    return Match(1.0, "begins with ACME") if data.startswith(_HEAD) else NO_MATCH


def read(data: bytes, name: str, settings: Settings, kind: PointKind | None) -> Reading:
    """Return the points of a profile, NaN where nothing came back."""
    body = data[len(_HEAD) :]
    if len(body) % 8:
        raise InputError("pairs of 32-bit numbers", f"{len(body)} bytes", "Copy it again.", name)
    counts = np.frombuffer(body, ">i4").reshape(-1, 2)
    points = np.where(counts == _MISSING, np.nan, counts / 1000.0)
    return Reading("profile", points, {"x": "first", "z": "second"}, "um", "format")


FORMAT = Format("acme-profile", "ACME profile", (".acme",), ("profile",), recognise, read)
