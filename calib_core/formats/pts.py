"""PTS: the number of points in the first line, then x y z, intensity and colours."""

from calib_core.formats import xyz
from calib_core.formats.format import Format, Match, by_ending
from calib_core.formats.shared.columns import TableSettings


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is PTS: by its ending."""
    return by_ending(name, FORMAT.endings)


FORMAT = Format(
    name="pts",
    title="PTS text",
    endings=(".pts",),
    kinds=("cloud",),
    recognise=recognise,
    read=xyz.read,
    settings=TableSettings,
)
