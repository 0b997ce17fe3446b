"""Text tables: CSV, TSV and their like, with or without preamble and header, as most programs export points."""

from calib_core.formats.format import NO_MATCH, Format, Match, PointKind, Reading, by_ending, ending_of
from calib_core.formats.shared.columns import TableSettings, reading_of
from calib_core.formats.shared.text_style import decode_text, looks_like_text
from calib_core.formats.shared.text_table import parse_table

EXAMPLES = {"profile": "x_mm,z_mm", "cloud": "x,y,z", None: "x_mm,z_mm or x,y,z"}


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is a table of text: never more than its ending says."""
    if by_ending(name, FORMAT.endings).sure:
        return by_ending(name, FORMAT.endings, 0.2)
    return (
        Match(0.05, "is text") if looks_like_text(data) and ending_of(name) in ("", ".log", ".prn") else NO_MATCH
    )


def read(data: bytes, name: str, settings: TableSettings, kind: PointKind | None) -> Reading:
    """Return the points of a table; raises InputError with the line or the column at fault.

    Three columns without names are x, z and intensity in a CSV file, else x, y and z.
    """
    table = parse_table(decode_text(data, name, EXAMPLES[kind]), name, EXAMPLES[kind])
    return reading_of(table, name, settings, kind, "profile" if ending_of(name) == ".csv" else "cloud")


FORMAT = Format(
    name="table",
    title="Text table (CSV, TSV, TXT, ASC)",
    endings=(".csv", ".txt", ".tsv", ".asc", ".dat"),
    kinds=("profile", "cloud"),
    recognise=recognise,
    read=read,
    settings=TableSettings,
    media_type="text/csv",
    proof="real files",
)
