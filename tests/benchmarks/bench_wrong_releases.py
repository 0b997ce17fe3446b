"""Ways to a wrong release by page, REST and command line: how many are refused or marked with their reason."""

from pathlib import Path
from tempfile import TemporaryDirectory

from harness import Row

from tests.server.wrong_releases import WAYS, world


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing."""
    silent: list[str] = []
    with TemporaryDirectory() as folder, world(Path(folder)) as here:
        for way in WAYS:
            try:
                way(here)
            except AssertionError:
                silent.append(way.__name__.replace("_", " "))
    return [
        Row(
            f"{len(WAYS)} ways to a wrong release: silent",
            "0 of 25",
            f"{len(silent)}{': ' if silent else ''}{', '.join(silent)}",
            not silent and len(WAYS) >= 25,
        )
    ]
