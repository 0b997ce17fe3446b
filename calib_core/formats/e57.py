"""E57 (ASTM E2807): one cloud of x, y, z in metres, as the standard counts, in pages with CRC-32C checksums."""

import struct
import tempfile
import uuid
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared.binary_table import require_count
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.unnamed import Column
from calib_core.frames import FloatArray
from calib_core.messages import message

_TO_DO = message("Copy or export the cloud again.")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")

_PAGE, _PAYLOAD = 1024, 1020
_HEADER_BYTES = 48
_SECTION_BYTES = 32
_RECORDS = 5400  # a data packet: three streams of float32 in less than 64 KiB
_PACKET_BYTES, _RECORD_BYTES = 12, 12
_PAGES_AT_ONCE = 1024
_ENTRIES = 2048  # the most that an index packet may have

_XML = """<?xml version="1.0" encoding="UTF-8"?>
<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">
<formatName type="String"><![CDATA[ASTM E57 3D Imaging Data File]]></formatName>
<guid type="String"><![CDATA[{{{file}}}]]></guid>
<versionMajor type="Integer">1</versionMajor>
<versionMinor type="Integer">0</versionMinor>
<e57LibraryVersion type="String"><![CDATA[scancell]]></e57LibraryVersion>
<coordinateMetadata type="String"/>
<data3D type="Vector" allowHeterogeneousChildren="1">
<vectorChild type="Structure">
<guid type="String"><![CDATA[{{{scan}}}]]></guid>
<name type="String"><![CDATA[merged]]></name>
<points type="CompressedVector" fileOffset="{offset}" recordCount="{count}">
<prototype type="Structure">
<cartesianX type="Float" precision="single"/>
<cartesianY type="Float" precision="single"/>
<cartesianZ type="Float" precision="single"/>
</prototype>
<codecs type="Vector" allowHeterogeneousChildren="1"/>
</points>
</vectorChild>
</data3D>
<images2D type="Vector" allowHeterogeneousChildren="1"/>
</e57Root>
"""


def e57_pieces(blocks_mm: Iterable[NDArray[np.floating]], count: int) -> Iterator[bytes | memoryview]:
    """Give an E57 file, in metres, of points in mm that come in blocks (N, 3), `count` in all."""
    layout = _layout(count)
    records = _records(blocks_mm)
    first = next(records)
    guids = [uuid.uuid5(uuid.NAMESPACE_OID, first[:1000].tobytes().hex() + name) for name in ("file", "scan")]
    offset = _physical(_HEADER_BYTES)
    xml = _XML.format(file=guids[0], scan=guids[1], offset=offset, count=count).encode()
    xml_at = _HEADER_BYTES + layout.size
    pages = -(-(xml_at + len(xml)) // _PAYLOAD)
    sizes = (pages * _PAGE, _physical(xml_at), len(xml), _PAGE)
    data_at = _physical(_HEADER_BYTES + _SECTION_BYTES)

    def logical() -> Iterator[bytes]:
        yield struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, *sizes)
        yield struct.pack("<B7xQQQ", 1, layout.size, data_at, layout.root)
        yield _data_packet(first)
        yield from map(_data_packet, records)
        yield from layout.index
        yield xml

    yield from _paged(logical())


@dataclass(frozen=True)
class _Layout:
    """What follows from the number of points: the section's size, its index, and where the index's root stands."""

    size: int
    index: list[bytes]
    root: int


def _physical(logical: int) -> int:
    """Return where a byte lies in the file, checksums counted."""
    return logical // _PAYLOAD * _PAGE + logical % _PAYLOAD


def _layout(count: int) -> _Layout:
    """Return the layout of the binary section of so many points, which begins right behind the header."""
    at = _HEADER_BYTES + _SECTION_BYTES
    entries: list[tuple[int, int]] = []
    for start in range(0, count, _RECORDS):
        entries.append((start, _physical(at)))
        at += _PACKET_BYTES + _RECORD_BYTES * min(_RECORDS, count - start)
    index: list[bytes] = []
    level = 0
    while True:
        above: list[tuple[int, int]] = []
        for first in range(0, len(entries), _ENTRIES):
            group = entries[first : first + _ENTRIES]
            above.append((group[0][0], _physical(at)))
            index.append(_index_packet(group, level))
            at += len(index[-1])
        entries, level = above, level + 1
        if len(entries) == 1:
            return _Layout(at - _HEADER_BYTES, index, entries[0][1])


def _records(blocks_mm: Iterable[NDArray[np.floating]]) -> Iterator[NDArray[np.float32]]:
    """Give the points in metres, as many at a time as a packet holds; the last ones may be fewer."""
    left = np.zeros((0, 3), dtype="<f4")
    for block in blocks_mm:
        metres = np.concatenate([left, (block.astype(np.float64) / 1000).astype("<f4")])
        whole = len(metres) // _RECORDS * _RECORDS
        for start in range(0, whole, _RECORDS):
            yield metres[start : start + _RECORDS]
        left = metres[whole:]
    if len(left):
        yield left


def _data_packet(block: NDArray[np.float32]) -> bytes:
    streams = [np.ascontiguousarray(block[:, axis]).tobytes() for axis in range(3)]
    size = 6 + 6 + 3 * len(streams[0])
    head = struct.pack("<BBHHHHH", 1, 0, size - 1, 3, *(len(stream) for stream in streams))
    return head + b"".join(streams)


def _index_packet(entries: list[tuple[int, int]], level: int) -> bytes:
    head = struct.pack("<BBHHB9x", 0, 0, 16 + 16 * len(entries) - 1, len(entries), level)
    return head + b"".join(struct.pack("<QQ", *entry) for entry in entries)


def _paged(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Give the bytes in pages, each followed by its checksum, the last filled up with zeros."""
    waiting = bytearray()
    for piece in pieces:
        waiting += piece
        if len(waiting) >= _PAGES_AT_ONCE * _PAYLOAD:
            whole = len(waiting) // _PAYLOAD * _PAYLOAD
            yield _pages(bytes(waiting[:whole]))
            del waiting[:whole]
    if waiting:
        yield _pages(bytes(waiting))


def _pages(data: bytes) -> bytes:
    from calib_core.kernels.checksum import crc32c_rows

    payload = np.zeros((-(-len(data) // _PAYLOAD), _PAYLOAD), dtype=np.uint8)
    payload.reshape(-1)[: len(data)] = np.frombuffer(data, dtype=np.uint8)
    pages = np.empty((len(payload), _PAGE), dtype=np.uint8)
    pages[:, :_PAYLOAD] = payload
    pages[:, _PAYLOAD:] = crc32c_rows(payload).astype(">u4").view(np.uint8).reshape(-1, 4)
    return pages.tobytes()


class E57Settings(Settings):
    """As `Settings`; `scan` is the scan that is meant, from 0, where the file holds several."""

    scan: Annotated[int, Field(ge=0)] | None = None


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is E57."""
    return Match(1.0, "begins with ASTM-E57") if data[:8] == b"ASTM-E57" else by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: E57Settings, kind: PointKind | None) -> Reading:
    """Return the points of one scan, as its scanner saw them; raises InputError if it is damaged or cut off."""
    if data[:8] != b"ASTM-E57":
        raise InputError("an E57 file", "a file that does not begin like one", _TO_DO, name)
    try:
        import pye57
        from pye57.exception import PyE57Exception
    except ModuleNotFoundError:
        to_do = message("Install it: pip install 'scancell[e57]'; or export the cloud as PLY.")
        raise InputError("the extra 'e57', which reads E57", "an installation without it", to_do, name) from None
    with tempfile.TemporaryDirectory() as folder:  # libE57Format reads files alone
        path = Path(folder) / "scan.e57"
        path.write_bytes(data)
        try:
            with pye57.E57(str(path)) as opened:
                points, posed = _scan(opened, len(data), settings, name)
        except InputError:
            raise
        except (
            PyE57Exception,
            pye57.libe57.E57Exception,
            ValueError,
            KeyError,
            RuntimeError,
            MemoryError,
        ) as error:
            got = " ".join(str(error).split())[:120] or type(error).__name__
            raise InputError("a whole E57 file", got, _TO_DO, name) from None
    columns = [Column(axis, place, f"cartesian{axis.upper()}", "m") for place, axis in enumerate("xyz")]
    reading = points_of(points, columns, kind, name, settings)
    notes = ["The scan's pose in the file is not applied: points are in its scanner's frame."] if posed else []
    return replace(reading, unit_from="settings" if settings.unit else "format").adding(notes)


def scan_poses(data: bytes, name: str) -> list[list[float] | None]:
    """Return each scan's pose as rows of a 4×4 in mm, None where it has none; raises InputError as `read`."""
    try:
        import pye57
    except ModuleNotFoundError:
        to_do = message("Install it: pip install 'scancell[e57]'; or export the cloud as PLY.")
        raise InputError("the extra 'e57', which reads E57", "an installation without it", to_do, name) from None
    found: list[list[float] | None] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.e57"
        path.write_bytes(data)
        try:
            with pye57.E57(str(path)) as opened:
                for number in range(int(opened.scan_count)):
                    header = opened.get_header(number)
                    pose = np.eye(4)
                    if header.node.isDefined("pose"):
                        pose[:3, :3] = header.rotation_matrix
                        pose[:3, 3] = 1000 * np.asarray(header.translation)
                    found.append(pose.ravel().tolist() if header.node.isDefined("pose") else None)
        except (pye57.libe57.E57Exception, ValueError, RuntimeError) as error:
            raise InputError("a whole E57 file", " ".join(str(error).split())[:120], _TO_DO, name) from None
    return found


def _scan(opened: Any, size: int, settings: E57Settings, where: str) -> tuple[FloatArray, bool]:
    """Return the points (N, 3) of a scan in the file's unit, NaN where invalid, and whether it has a pose."""
    scans = int(opened.scan_count)
    chosen = settings.scan if settings.scan is not None else 0
    if chosen >= scans or (scans > 1 and settings.scan is None):
        got = message("{scans} scans", scans=scans)
        raise InputError("one scan", got, "Give the setting scan, from 0, or export one alone.", where)
    header = opened.get_header(chosen)
    require_count(int(header.point_count), 8 * size, where)
    raw = opened.read_scan_raw(chosen, ignore_unsupported_fields=True)  # normals, as an extension has them
    if all(f"cartesian{axis}" in raw for axis in "XYZ"):
        points = np.column_stack([raw[f"cartesian{axis}"] for axis in "XYZ"]).astype(np.float64)
        invalid = raw.get("cartesianInvalidState")
    elif all(name in raw for name in _SPHERICAL):
        distance, azimuth, elevation = (raw[name] for name in _SPHERICAL)
        flat = distance * np.cos(elevation)
        points = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation)])
        invalid = raw.get("sphericalInvalidState")
    else:
        raise InputError("cartesian or spherical coordinates", f"{', '.join(raw)[:80]}", _TO_DO, where)
    if invalid is not None:
        points[np.asarray(invalid) != 0] = np.nan
    return points, bool(header.node.isDefined("pose"))


FORMAT = Format(
    name="e57",
    title="E57 (ASTM E2807)",
    endings=(".e57",),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    settings=E57Settings,
    scan_poses=scan_poses,
    media_type="model/e57",
    write_cloud=lambda tables, count, names: e57_pieces((table[:, :3] for table in tables), count),
    proof="real files",
)
