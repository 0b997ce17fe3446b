"""A source: takes one profile of an invented scanner, here out of thin air."""

import numpy as np

from calib_core.records import parse_capture
from server.sources.source import Occasion, Settings, Source, Taken


class DropSettings(Settings):
    """Where the robot stands."""

    pose: list[float]


def take(occasion: Occasion) -> Taken:
    """Return a capture of a flat plate 200 mm away, and its file."""
    number = len(occasion.taken) + 1
    name = f"captures/acme-{number}.acme"
    x = np.arange(-20_000, 20_001, 100)
    rows = np.column_stack([x, np.full(len(x), 200_000)]).astype(">i4")
    record = {
        "id": f"acme-{number}",
        "step": "scan",
        "kind": "profile",
        "files": [name],
        "pose": occasion.settings.pose,
    }
    return parse_capture(record, name), {name: b"ACME\n" + rows.tobytes()}


SOURCE = Source("acme-drop", "ACME scanner", "Takes a profile of a plate.", DropSettings, take)
