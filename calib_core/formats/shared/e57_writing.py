"""How an E57 file (ASTM E2807) is written: clouds in metres, in pages with checksums, piece by piece."""

import struct
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import IO

import numpy as np
from numpy.typing import NDArray

from calib_core.formats.format import INTENSITY, SCAN_COLUMN, Pieces, ScanPlace, Tables
from calib_core.formats.shared.writing import in_one_type, number_type
from calib_core.frames import FloatArray, vector_from_rotation

_PAGE, _PAYLOAD = 1024, 1020
_HEADER_BYTES = 48
_SECTION_BYTES = 32
_READ_BACK = 100_000
_PACKET_VALUES = 16_200  # of float32 in a data packet: less than 64 KiB
_PAGES_AT_ONCE = 1024
_ENTRIES = 2048  # the most that an index packet may have

_XML = """<?xml version="1.0" encoding="UTF-8"?>
<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0"\
 xmlns:nor="http://www.libe57.org/E57_NOR_surface_normals.txt">
<formatName type="String"><![CDATA[ASTM E57 3D Imaging Data File]]></formatName>
<guid type="String"><![CDATA[{{{file}}}]]></guid>
<versionMajor type="Integer">1</versionMajor>
<versionMinor type="Integer">0</versionMinor>
<e57LibraryVersion type="String"><![CDATA[scancell]]></e57LibraryVersion>
<coordinateMetadata type="String"/>
<data3D type="Vector" allowHeterogeneousChildren="1">
{scans}</data3D>
<images2D type="Vector" allowHeterogeneousChildren="1"/>
</e57Root>
"""
_SCAN = """<vectorChild type="Structure">
<guid type="String"><![CDATA[{{{scan}}}]]></guid>
<name type="String"><![CDATA[{name}]]></name>
{pose}<points type="CompressedVector" fileOffset="{offset}" recordCount="{count}">
<prototype type="Structure">
{fields}</prototype>
<codecs type="Vector" allowHeterogeneousChildren="1"/>
</points>
</vectorChild>
"""
_PLACE = ("cartesianX", "cartesianY", "cartesianZ")
_NORMAL = {"nx": "nor:normalX", "ny": "nor:normalY", "nz": "nor:normalZ"}


@dataclass(frozen=True, eq=False)
class _Scan:
    """Points in metres in their scanner's frame, in blocks (N, fields); its pose."""

    name: str
    count: int
    fields: tuple[str, ...]
    blocks: Iterator[NDArray[np.float32]]
    pose: FloatArray | None = None

    @property
    def width(self) -> int:
        """How many numbers a point has."""
        return len(self.fields)


def cloud_pieces(tables: Iterable[NDArray[np.floating]], count: int, names: tuple[str, ...]) -> Pieces:
    """Give an E57 file of one cloud, in metres; a pose brings points there that lie far from zero."""
    _, rows = in_one_type(tables, names)
    first = next(rows)
    pose = np.eye(4)
    if number_type(first) == "<f8":
        pose[:3, 3] = np.round(first[0, :3], -3)
    blocks = (((table[:, :3] - pose[:3, 3]) / 1000).astype("<f4") for table in chain([first], rows))
    yield from _pieces([_Scan("merged", count, _PLACE, blocks, pose if pose[:3, 3].any() else None)])


def pieces_of_scans(tables: Tables, names: tuple[str, ...], scans: Sequence[ScanPlace]) -> Pieces:
    """Give an E57 file of a merged cloud, its points by the scan that weighs most there, each with its pose.

    Parameters
    ----------
    tables : callable
        Gives the cloud's tables from the beginning each time.
    names : tuple of str
        Of the columns, among them `scan`: the number among `scans`; others have points of none.
    scans : sequence of ScanPlace
    """
    column = names.index(SCAN_COLUMN)
    normals = [names.index(name) for name in _NORMAL if name in names]
    fields, axes = (*_PLACE, *list(_NORMAL.values())[: len(normals)]), [0, 1, 2, *normals]
    if INTENSITY in names:
        fields, axes = (*fields, INTENSITY), [*axes, names.index(INTENSITY)]
    counts = np.zeros(len(scans) + 1, np.int64)
    for table in tables():
        counts += np.bincount(_numbers(table, column, len(scans)), minlength=len(counts))
    places = [*scans, ScanPlace("others", scans[0].cloud_from_scan)]  # near the part, too
    starts = np.cumsum(counts) - counts
    at = starts.copy()
    ways = [np.linalg.inv(one.cloud_from_scan) for one in places]
    with tempfile.TemporaryFile() as waiting:
        for table in tables():
            of = _numbers(table, column, len(scans))
            for number in np.unique(of).tolist():
                way, mine = ways[number], table[of == number][:, axes].astype(float)
                mine[:, :3] = (mine[:, :3] @ way[:3, :3].T + way[:3, 3]) / 1000
                if normals:
                    mine[:, 3:6] = mine[:, 3:6] @ way[:3, :3].T
                mine = np.nan_to_num(mine)
                waiting.seek(4 * len(axes) * int(at[number]))
                waiting.write(mine.astype("<f4").tobytes())
                at[number] += len(mine)
        found = [
            _Scan(one.name, many, fields, _read_back(waiting, start, many, axes), one.cloud_from_scan)
            for one, start, many in zip(places, starts.tolist(), counts.tolist(), strict=True)
            if many
        ]
        yield from _pieces(found)


def _numbers(table: NDArray[np.floating], column: int, scans: int) -> NDArray[np.int64]:
    """Return the number of each point's scan, that behind the last where it has none."""
    numbers = table[:, column].astype(np.int64)
    return np.where((numbers >= 0) & (numbers < scans), numbers, scans)


def _read_back(file: IO[bytes], first: int, count: int, axes: list[int]) -> Iterator[NDArray[np.float32]]:
    row = 4 * len(axes)
    for start in range(first, first + count, _READ_BACK):
        file.seek(row * start)
        data = file.read(row * min(_READ_BACK, first + count - start))
        yield np.frombuffer(data, "<f4").reshape(-1, len(axes))


def _pieces(scans: Sequence[_Scan]) -> Iterator[bytes]:
    at = _HEADER_BYTES
    layouts: list[_Layout] = []
    for scan in scans:
        layouts.append(_layout(scan, at))
        at += layouts[-1].size
    packets = [_in_packets(scan) for scan in scans]
    first = next(packets[0])
    seed = first[:1000].tobytes().hex()
    described = "".join(_described(scan, layout, seed) for scan, layout in zip(scans, layouts, strict=True))
    xml = _XML.format(file=uuid.uuid5(uuid.NAMESPACE_OID, seed + "file"), scans=described).encode()
    pages = -(-(at + len(xml)) // _PAYLOAD)

    def logical() -> Iterator[bytes]:
        yield struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, pages * _PAGE, _physical(at), len(xml), _PAGE)
        for number, (layout, blocks) in enumerate(zip(layouts, packets, strict=True)):
            data_at = _physical(layout.at + _SECTION_BYTES)
            yield struct.pack("<B7xQQQ", 1, layout.size, data_at, layout.root)
            yield from map(_data_packet, blocks if number else chain([first], blocks))
            yield from layout.index
        yield xml

    yield from _paged(logical())


def _described(scan: _Scan, layout: "_Layout", seed: str) -> str:
    """Return the XML of one scan."""
    pose = ""
    if scan.pose is not None:
        turn = vector_from_rotation(scan.pose[:3, :3]) / 2
        half = float(np.linalg.norm(turn))
        quaternion = [float(np.cos(half)), *(turn * np.sinc(half / np.pi)).tolist()]
        numbers = "".join(f'<{k} type="Float">{v!r}</{k}>' for k, v in zip("wxyz", quaternion, strict=True))
        place = (scan.pose[:3, 3] / 1000).tolist()
        shift = "".join(f'<{k} type="Float">{v!r}</{k}>' for k, v in zip("xyz", place, strict=True))
        pose = f'<pose type="Structure"><rotation type="Structure">{numbers}</rotation>'
        pose += f'<translation type="Structure">{shift}</translation></pose>\n'
    fields = "".join(f'<{name} type="Float" precision="single"/>\n' for name in scan.fields)
    guid = uuid.uuid5(uuid.NAMESPACE_OID, f"{seed}{scan.name}{layout.at}")
    name = scan.name.replace("]]>", "")
    offset = _physical(layout.at)
    return _SCAN.format(scan=guid, name=name, pose=pose, offset=offset, count=scan.count, fields=fields)


@dataclass(frozen=True)
class _Layout:
    """What follows from the number of points: where the section is, its size, its index, and the index's root."""

    at: int
    size: int
    index: list[bytes]
    root: int


def _physical(logical: int) -> int:
    """Return where a byte lies in the file, checksums counted."""
    return logical // _PAYLOAD * _PAGE + logical % _PAYLOAD


def _padded(width: int, rows: int) -> int:
    """Return the bytes of a data packet."""
    return -(-(6 + 2 * width + 4 * width * rows) // 4) * 4


def _layout(scan: _Scan, begin: int) -> _Layout:
    """Return the layout of the binary section of a scan's points."""
    at, rows = begin + _SECTION_BYTES, _PACKET_VALUES // scan.width
    entries: list[tuple[int, int]] = []
    for start in range(0, scan.count, rows):
        entries.append((start, _physical(at)))
        at += _padded(scan.width, min(rows, scan.count - start))
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
            return _Layout(begin, at - begin, index, entries[0][1])


def _in_packets(scan: _Scan) -> Iterator[NDArray[np.float32]]:
    """Give the points, as many at a time as a packet holds; the last ones may be fewer."""
    left, rows = np.zeros((0, scan.width), dtype="<f4"), _PACKET_VALUES // scan.width
    for block in scan.blocks:
        known = np.concatenate([left, block])
        whole = len(known) // rows * rows
        for start in range(0, whole, rows):
            yield known[start : start + rows]
        left = known[whole:]
    if len(left):
        yield left


def _data_packet(block: NDArray[np.float32]) -> bytes:
    width = block.shape[1]
    streams = [np.ascontiguousarray(block[:, axis]).tobytes() for axis in range(width)]
    size = _padded(width, len(block))
    head = struct.pack(f"<BBHH{width}H", 1, 0, size - 1, width, *(len(stream) for stream in streams))
    return (head + b"".join(streams)).ljust(size, b"\0")


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
