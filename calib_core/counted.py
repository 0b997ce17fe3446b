"""How many of a thing there are, as a sentence says it: "1 capture", "3 captures"."""

from calib_core.messages import Message, plural


def captures(count: int) -> Message:
    """Return so many captures."""
    return plural("{count} capture", "{count} captures", by="count", count=count)


def files(count: int) -> Message:
    """Return so many files."""
    return plural("{count} file", "{count} files", by="count", count=count)


def sessions(count: int) -> Message:
    """Return so many sessions."""
    return plural("{count} session", "{count} sessions", by="count", count=count)


def poses(count: int) -> Message:
    """Return so many poses."""
    return plural("{count} pose", "{count} poses", by="count", count=count)


def tools(count: int) -> Message:
    """Return so many tools of a controller."""
    return plural("{count} tool", "{count} tools", by="count", count=count)


def frames(count: int) -> Message:
    """Return so many coordinate frames of a controller."""
    return plural("{count} frame", "{count} frames", by="count", count=count)
