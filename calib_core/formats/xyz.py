"""XYZ: one point a line, x y z and what else there is, with or without their count in the first line."""

from collections.abc import Iterable
from typing import Any

from numpy.typing import NDArray

from calib_core.formats import table
from calib_core.formats.format import Format, Match, Pieces, PointKind, Reading, by_ending
from calib_core.formats.shared.columns import TableSettings, reading_of
from calib_core.formats.shared.text_style import decode_text
from calib_core.formats.shared.text_table import parse_table
from calib_core.formats.shared.writing import BLOCK, XYZ, in_one_type


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is XYZ: by its ending."""
    return by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: TableSettings, kind: PointKind | None) -> Reading:
    """Return the points of an XYZ file; raises InputError with the line or the column at fault."""
    text = decode_text(data, name, table.EXAMPLES["cloud"])
    return reading_of(parse_table(text, name, table.EXAMPLES["cloud"]), name, settings, kind, "cloud")


def xyz_pieces(tables: Iterable[NDArray[Any]], count: int, names: tuple[str, ...]) -> Pieces:
    """Give a text file of points, one a line, five decimals, without a header as other programs expect."""
    for points in in_one_type((values[:, :3] for values in tables), XYZ)[1]:
        for start in range(0, len(points), BLOCK):
            block = points[start : start + BLOCK]
            yield ("%.5f %.5f %.5f\n" * len(block) % tuple(block.ravel().tolist())).encode("ascii")


FORMAT = Format(
    name="xyz",
    title="XYZ text",
    endings=(".xyz",),
    kinds=("cloud", "profile"),
    recognise=recognise,
    read=read,
    settings=TableSettings,
    media_type="text/plain",
    write_cloud=xyz_pieces,
    proof="real files",
)
