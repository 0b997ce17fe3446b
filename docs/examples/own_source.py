"""A source of one's own: a robot whose controller answers `GET /pose` with JSON.

A package brings it by an entry point of the group `scancell.sources`:

    [project.entry-points."scancell.sources"]
    acme-robot = "own_source:SOURCE"
"""

import json
import time
from urllib.request import urlopen

from calib_core.robots import parse_pose
from server.sources.device import Description, Sample, host_now_s
from server.sources.source import Settings, Source


class AcmeSettings(Settings):
    """Where the controller is; the page makes a form of these fields."""

    url: str
    interval_s: float = 0.05


class AcmeRobot:
    """Connected once it is made; anything that it raises is told, and it is made anew."""

    def __init__(self, settings: AcmeSettings) -> None:
        self._settings = settings
        self._ask()

    def describe(self) -> Description:
        """Return what it tells."""
        return Description("ACME", "mm, degrees", "fanuc", "flange in base", ("pose", "moving"))

    def read(self) -> Sample | None:
        """Return where the flange is now: {"pose": [x, y, z, w, p, r], "moving": false, "t": 12.3}."""
        time.sleep(self._settings.interval_s)
        told = self._ask()
        return Sample(
            host_now_s(),
            device_time_s=told["t"],
            base_from_tool0=parse_pose("fanuc", told["pose"]),
            moving=told["moving"],
        )

    def close(self) -> None:
        """Nothing is held."""

    def _ask(self) -> dict:
        with urlopen(self._settings.url, timeout=1.5) as answer:
            return json.load(answer)


SOURCE = Source(
    "acme-robot", "ACME robot", "Reads the flange's pose.", AcmeSettings, connect=AcmeRobot, delivers=("robot",)
)
