"""Ways to a wrong release by REST and command line: how many are refused or marked with their reason."""

from pathlib import Path
from tempfile import TemporaryDirectory

from harness import Row

from tests.server.wrong_releases import BY_COMMAND, WAYS, world


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing."""
    silent: list[str] = []
    with TemporaryDirectory() as folder, world(Path(folder)) as here:
        for way in WAYS:
            try:
                for channel in (way, BY_COMMAND.get(way)):
                    assert channel is None or channel(here)
            except AssertionError:
                silent.append(way.__name__.replace("_", " "))
    return [
        Row(
            f"{len(WAYS)} ways to a wrong release by REST, {len(BY_COMMAND)} by the command line: silent",
            "0 of 25",
            f"{len(silent)}{': ' if silent else ''}{', '.join(silent)}",
            not silent and len(WAYS) >= 25,
        )
    ]
