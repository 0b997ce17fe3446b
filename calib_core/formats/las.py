"""LAS and LAZ clouds, read by laspy; LAZ is unpacked by lazrs.  Written as LAS 1.2, in metres by its own system.

Their unit is that of their coordinate reference system, as WKT or GeoTIFF keys say it (LAS 1.4, section 3).
"""

import io
import re
import struct
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import CalibrationError, InputError
from calib_core.formats.format import INTENSITY, Format, Match, Pieces, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared.binary_table import require_count
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.unnamed import Column
from calib_core.messages import message

_HEADER = 227
_LEAST_RECORD = 20
_MOST_PACKED = 10  # points in a byte of LAZ
_PIECE_BYTES = 32_000_000
_PACKING = b"laszip encoded"
_RECORD_HEAD = 54  # of a record before the points
_TO_DO = message("Copy or export it again.")
_CRS_OWNER: Final = "LASF_Projection"
_WKT, _GEO_KEYS = 2112, 34735
_MODEL_KEY, _LINEAR_KEY, _PROJECTED_KEY = 1024, 3076, 3072
_GEOGRAPHIC: Final = 2
_METRES_A_CODE: Final = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
_METRES_A_ZONE: Final = {*range(32601, 32761), *range(25828, 25839), *range(26901, 26924)}
"""UTM on WGS 84, ETRS 89 and NAD 83."""
_LINEAR: Final = re.compile(
    r'(?:LENGTH)?UNIT\s*\[\s*"(?!degree|radian|grad)[^"]*"\s*,\s*([0-9.eE+-]+)', re.IGNORECASE
)


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is LAS or LAZ."""
    return Match(1.0, "begins with LASF") if data[:4] == b"LASF" else by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: Settings, kind: PointKind | None) -> Reading:
    """Return the points of a LAS or LAZ file; raises InputError if it is none, or cut off."""
    if data[:4] != b"LASF" or len(data) < _HEADER:
        raise InputError("a LAS or LAZ file", "a file that does not begin like one", _TO_DO, name)
    import laspy

    packed = _require_plausible(data, name)
    try:
        # Not the parallel one: it reserves what the table of pieces claims, whatever that is.
        with laspy.open(io.BytesIO(data), laz_backend=laspy.LazBackend.Lazrs) as file:
            count = int(file.header.point_count)
            metres = _metres(file.header.vlrs, name)
            require_count(count, len(data) * _MOST_PACKED if packed else len(data) // _LEAST_RECORD, name)
            # Piece by piece: a header that claims too much ends with the data, not with the memory.
            piece = max(1, _PIECE_BYTES // max(1, int(file.header.point_format.size)))
            pieces = [
                np.column_stack([np.asarray(p.x), np.asarray(p.y), np.asarray(p.z), np.asarray(p.intensity)])
                for p in file.chunk_iterator(piece)
            ]
            xyz = np.concatenate(pieces) if pieces else np.empty((0, 4))
    except CalibrationError:
        raise
    except BaseException as error:  # lazrs is Rust: its panics are no Exception
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        got = str(error)[:120] or type(error).__name__
        raise InputError("a LAS or LAZ file", got, "Copy or export it again.", name) from None
    require_count(count, len(xyz), name)
    columns = [Column(axis, place, axis.upper(), None) for place, axis in enumerate("xyz")]
    read = points_of(xyz[:, :3].astype(np.float64), columns, kind, name, settings).with_intensity(xyz[:, 3])
    return _in_its_unit(read, metres, settings)


def _in_its_unit(reading: Reading, metres: float | None, settings: Settings) -> Reading:
    """Return a reading in mm by the length of its unit, None where the file does not say it."""
    if settings.unit:
        return reading
    if metres is None:
        doubt = message("It has no coordinate reference system, which tells its unit: give the unit, m as a rule.")
        return reading.adding(doubts=[doubt])
    in_feet = [] if metres == 1 else [message("Its unit is {metres:.6g} m.", metres=metres)]
    scaled = replace(reading, points=reading.points * (1000 * metres), unit="m", unit_from="header")
    return scaled.adding(in_feet)


def _metres(records: Iterable[Any], where: str) -> float | None:
    """Return how many metres a file's unit has, by its coordinate reference system; None where it has none."""
    found = {int(r.record_id): bytes(r.record_data_bytes()) for r in records if r.user_id == _CRS_OWNER}
    if _WKT in found:
        return _metres_of_wkt(found[_WKT].decode(errors="replace"), where)
    words = np.frombuffer(found.get(_GEO_KEYS, b"")[: len(found.get(_GEO_KEYS, b"")) // 8 * 8], "<u2").reshape(
        -1, 4
    )
    keys = {int(key): int(value) for key, place, _, value in words[1:] if place == 0}
    if keys.get(_MODEL_KEY) == _GEOGRAPHIC:
        raise _in_degrees(where)
    if _LINEAR_KEY in keys:
        return _METRES_A_CODE.get(keys[_LINEAR_KEY])
    return 1.0 if keys.get(_PROJECTED_KEY) in _METRES_A_ZONE else None


def _metres_of_wkt(text: str, where: str) -> float | None:
    """Return the metres of the horizontal unit: the last one before a vertical system begins."""
    horizontal = re.split(r"VERT_?CS|VERTCRS", text, flags=re.IGNORECASE)[0]
    if re.match(r"\s*(GEOGCS|GEOGCRS|GEODCRS)", horizontal, re.IGNORECASE):
        raise _in_degrees(where)
    units = _LINEAR.findall(horizontal)
    return float(units[-1]) if units else None


def _in_degrees(where: str) -> InputError:
    to_do = message("Export the cloud in a system of lengths.")
    return InputError("coordinates that are lengths", "a geographic system, in degrees", to_do, where)


def _require_plausible(data: bytes, name: str) -> bool:
    """Refuse a header that claims more than the file can hold, before anything is reserved; return if packed.

    Fields and their places are those of the LAS specification; the table of a LAZ file's pieces has its place
    before the first point, and its own count before its entries.
    """
    header_size, first_point, records = struct.unpack_from("<HII", data, 94)
    packed = bool(data[104] & 0xC0)
    if not _HEADER <= header_size <= first_point <= len(data):
        need = "a LAS or LAZ file"
        raise InputError(need, "points that begin at byte {first_point}", _TO_DO, name, first_point=first_point)
    if records * _RECORD_HEAD > first_point - header_size:
        need = "a LAS or LAZ file"
        raise InputError(need, "{records} records before the points", _TO_DO, name, records=records)
    if packed and first_point + 8 <= len(data):
        (table,) = struct.unpack_from("<q", data, first_point)
        table = struct.unpack_from("<q", data, len(data) - 8)[0] if table == -1 else table
        if not first_point <= table <= len(data) - 8:
            raise InputError("a LAS or LAZ file", "no table of its pieces", _TO_DO, name)
        (pieces,) = struct.unpack_from("<I", data, table + 4)
        require_count(pieces, len(data), name)
        _require_item_sizes(data[header_size:first_point], struct.unpack_from("<H", data, 105)[0], name)
    return packed


def _require_item_sizes(records: bytes, point_bytes: int, name: str) -> None:
    """Refuse a LAZ file whose packing describes points of another size than its header."""
    begin = records.find(_PACKING)
    if begin < 0:
        raise InputError("a LAS or LAZ file", "no description of its packing", _TO_DO, name)
    items = begin - 2 + _RECORD_HEAD + 32
    try:
        (count,) = struct.unpack_from("<H", records, items)
        sizes = [struct.unpack_from("<H", records, items + 2 + 6 * k + 2)[0] for k in range(count)]
    except struct.error:
        sizes = []
    if sum(sizes) != point_bytes:
        got = message("{sizes} in its packing", sizes=sum(sizes))
        need = "points of {point_bytes} bytes, as its header says"
        raise InputError(need, got, _TO_DO, name, point_bytes=point_bytes)


_STEP_M: Final = 1e-6
_LOCAL: Final = 32767  # no system that others know: axes of lengths
_RECORD: Final = np.dtype([("xyz", "<i4", (3,)), ("intensity", "<u2"), ("rest", "V6")])
_BRIGHTEST: Final = 65_535


def las_pieces(tables: Iterable[NDArray[Any]], count: int, names: tuple[str, ...]) -> Pieces:
    """Give a LAS file of points, x, y and z in steps of a micrometre, in metres by its GeoTIFF keys.

    Intensities are whole numbers of 16 bits there: those that are shares of one are multiplied.

    Raises
    ------
    InputError
        If a point lies farther than 2 km from the first.
    """
    bright, times = names.index(INTENSITY) if INTENSITY in names else None, 0.0
    origin: NDArray[np.float64] | None = None
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    with tempfile.TemporaryFile() as waiting:  # the header tells bounds before the points
        for table in tables:
            xyz_m = np.asarray(table[:, :3], np.float64) / 1000
            origin = np.round(xyz_m[0], 3) if origin is None else origin
            steps = np.round((xyz_m - origin) / _STEP_M)
            if np.abs(steps).max() > np.iinfo(np.int32).max:
                got = message("points 2 km apart")
                raise InputError("points within 2 km for LAS", got, "Export it in one of these formats.", "las")
            low, high = np.minimum(low, steps.min(axis=0)), np.maximum(high, steps.max(axis=0))
            records = np.zeros(len(steps), _RECORD)
            records["xyz"] = steps
            if bright is not None:
                values = np.nan_to_num(table[:, bright])
                times = times or (_BRIGHTEST if values.max(initial=0.0) <= 1 else 1.0)
                records["intensity"] = np.clip(np.round(times * values), 0, _BRIGHTEST)
            waiting.write(records.tobytes())
        origin = np.zeros(3) if origin is None else origin
        yield _written_header(count, origin, origin + low * _STEP_M, origin + high * _STEP_M)
        waiting.seek(0)
        while piece := waiting.read(1 << 20):
            yield piece


def _written_header(
    count: int, origin: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> bytes:
    """Return header and unit: fields and their places are those of LAS 1.2, point format 0."""
    keys = [(1, 1, 0, 2), (_MODEL_KEY, 0, 1, _LOCAL), (_LINEAR_KEY, 0, 1, 9001)]
    unit = struct.pack("<H16sHH32s", 0, _CRS_OWNER.encode(), _GEO_KEYS, 8 * len(keys), b"metre")
    unit += b"".join(struct.pack("<4H", *key) for key in keys)
    start = struct.pack("<4s2H16s2B32s32s2H", b"LASF", 0, 0, b"", 1, 2, b"scancell", b"scancell", 1, 2026)
    start += struct.pack(
        "<HIIBHI5I", _HEADER, _HEADER + len(unit), 1, 0, _RECORD.itemsize, count, count, 0, 0, 0, 0
    )
    bounds = [value for axis in range(3) for value in (high[axis], low[axis])]
    return start + struct.pack("<12d", *[_STEP_M] * 3, *origin.tolist(), *bounds) + unit


FORMAT = Format(
    name="las",
    title="LAS and LAZ",
    endings=(".las", ".laz"),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    media_type="application/vnd.las",
    write_cloud=las_pieces,
    proof="real files",
)
