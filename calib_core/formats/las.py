"""LAS and LAZ clouds, read by laspy; LAZ is unpacked by lazrs."""

import io

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared.binary_table import require_count
from calib_core.formats.shared.columns import Column, for_kind, points_of

_HEADER = 227
_LEAST_RECORD = 20
_MOST_PACKED = 10  # points in a byte of LAZ
_TO_DO = "Export the cloud again."


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is LAS or LAZ."""
    return Match(1.0, "begins with LASF") if data[:4] == b"LASF" else by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: Settings, kind: PointKind | None) -> Reading:
    """Return the points of a LAS or LAZ file; raises InputError if it is none, or cut off."""
    if data[:4] != b"LASF" or len(data) < _HEADER:
        raise InputError("a LAS or LAZ file", "a file that does not begin like one", _TO_DO, name)
    import laspy

    try:
        with laspy.open(io.BytesIO(data)) as file:
            count = int(file.header.point_count)
            packed = bool(file.header.are_points_compressed)
            require_count(count, len(data) * _MOST_PACKED if packed else len(data) // _LEAST_RECORD, name)
            points = file.read_points(count)
            xyz = np.column_stack([np.asarray(points.x), np.asarray(points.y), np.asarray(points.z)])
    except InputError:
        raise
    except BaseException as error:  # lazrs is Rust: its panics are no Exception
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        got = str(error)[:120] or type(error).__name__
        raise InputError("a whole LAS or LAZ file", got, "Copy or export it again.", name) from None
    require_count(count, len(xyz), name)
    columns = [Column(axis, place, axis.upper(), None) for place, axis in enumerate("xyz")]
    columns, found = for_kind(columns, xyz, kind, name)
    return points_of(xyz.astype(np.float64), columns, found, name, settings)


FORMAT = Format(
    name="las",
    title="LAS and LAZ",
    endings=(".las", ".laz"),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
)
