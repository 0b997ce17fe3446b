"""PTS: the number of points in the first line, then x y z, intensity and colours; of several scans, each so."""

from calib_core.formats import table, xyz
from calib_core.formats.format import Format, Match, PointKind, Reading, by_ending
from calib_core.formats.shared.columns import TableSettings
from calib_core.formats.shared.text_style import decode_text


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is PTS: by its ending."""
    return by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: TableSettings, kind: PointKind | None) -> Reading:
    """Return the points of a PTS file, all scans of it; raises InputError with the line or the column at fault."""
    text = _as_one(decode_text(data, name, table.EXAMPLES["cloud"]))
    return xyz.read(text.encode(), name, settings, kind)


def _as_one(text: str) -> str:
    """Return several scans, each under its count, as one under their sum; else the text as it is."""
    lines, rows, place, scans = text.split("\n"), list[str](), 0, 0
    while place < len(lines) and lines[place].strip().isdecimal():
        rows += lines[place + 1 : (end := place + 1 + int(lines[place]))]
        place, scans = end, scans + 1
    is_whole = scans > 1 and not "".join(lines[place:]).strip()
    return "\n".join([str(len(rows)), *rows]) if is_whole else text


FORMAT = Format(
    name="pts",
    title="PTS text",
    endings=(".pts",),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    settings=TableSettings,
)
