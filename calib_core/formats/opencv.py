"""OpenCV's FileStorage in YAML and XML: a matrix or a list of points."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, PointKind, Reading, by_ending
from calib_core.formats.shared.columns import TableSettings, reading_of_values
from calib_core.formats.shared.text_style import decode_text
from calib_core.frames import FloatArray

_EXAMPLE = "an OpenCV file"
_TO_DO = "Write it with cv::FileStorage, one matrix or list of points in it."
_MOST_DEPTH = 3


class OpenCvSettings(TableSettings):
    """As `TableSettings`; `node` names the matrix or list, where the file holds several."""

    node: str | None = None


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is OpenCV's."""
    head = data[:400].lstrip(b"\xef\xbb\xbf")
    if head.startswith(b"%YAML") or b"<opencv_storage>" in head:
        return Match(0.9, "begins like one")
    return by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: OpenCvSettings, kind: PointKind | None) -> Reading:
    """Return the points of a node; raises InputError where there is none, or several and none is named."""
    nodes = _nodes(decode_text(data, name, _EXAMPLE), name)
    if settings.node is not None and settings.node not in nodes:
        there = ", ".join(list(nodes)[:20]) or "none"
        raise InputError(f"points under '{settings.node}'", f"points under {there}", "Name one of these.", name)
    if settings.node is None and len(nodes) != 1:
        got = f"{len(nodes)}: {', '.join(list(nodes)[:20])}" if nodes else "none"
        to_do = "Name it by the setting node." if nodes else _TO_DO
        raise InputError("one matrix or list of points", got, to_do, name)
    chosen = settings.node or next(iter(nodes))
    array = nodes[chosen]
    if array.ndim == 1:
        width = 2 if kind == "profile" else 3 if kind == "cloud" else 0
        if not width or len(array) % width:
            got = f"a list of {len(array)} numbers under '{chosen}'"
            raise InputError(
                "points of two or three numbers", got, "Say whether it is a profile or a cloud.", name
            )
        array = array.reshape(-1, width)
    grid = array.shape[:2] if array.ndim == 3 and min(array.shape[:2]) > 1 else None
    reading = reading_of_values(array.reshape(-1, array.shape[-1]), (), name, settings, kind)
    return replace(reading, grid=(grid[0], grid[1])) if grid and reading.kind == "cloud" else reading


def _nodes(text: str, where: str) -> dict[str, FloatArray]:
    """Return the nodes that can hold points, by their path."""
    found: dict[str, FloatArray] = {}
    _in_storage(text, where, lambda root: _collect(root, "", 0, found))
    return found


def storage_matrices(text: str, where: str) -> dict[str, FloatArray]:
    """Return every matrix of real numbers, by its path; raises InputError where the file is not whole."""
    found: dict[str, FloatArray] = {}
    _in_storage(text, where, lambda root: _collect_matrices(root, "", 0, found))
    return found


def _in_storage(text: str, where: str, look: Callable[[Any], None]) -> None:
    import cv2

    form = cv2.FILE_STORAGE_FORMAT_XML if text.lstrip().startswith("<") else cv2.FILE_STORAGE_FORMAT_YAML
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY | form)
        look(storage.root())
        storage.release()
    except (cv2.error, SystemError, UnicodeError, ValueError) as error:
        got = " ".join(str(error).split())[-160:]
        raise InputError("a whole OpenCV file", got, _TO_DO, where) from None


def _collect_matrices(node: Any, path: str, depth: int, found: dict[str, FloatArray]) -> None:
    matrix = node.mat() if node.isMap() and path else None
    if matrix is not None:
        if matrix.dtype.kind in "fiu" and matrix.ndim == 2:
            found[path] = matrix.astype(np.float64)
    elif node.isMap():
        for key in node.keys() if depth < _MOST_DEPTH else ():
            _collect_matrices(node.getNode(key), f"{path}.{key}" if path else key, depth + 1, found)
    elif node.isSeq() and depth < _MOST_DEPTH:
        for place in range(node.size()):
            _collect_matrices(node.at(place), f"{path}[{place}]", depth + 1, found)


def _collect(node: Any, path: str, depth: int, found: dict[str, FloatArray]) -> None:
    if node.isMap():
        matrix = node.mat() if path else None
        if matrix is not None:
            if matrix.dtype.kind in "fiu" and matrix.ndim in (2, 3) and matrix.shape[-1] in (2, 3, 4):
                found[path] = matrix.astype(np.float64)
            elif matrix.dtype.kind in "fiu" and matrix.ndim == 2 and 1 in matrix.shape:
                found[path] = matrix.ravel().astype(np.float64)
            return
        for key in node.keys() if depth < _MOST_DEPTH else ():
            _collect(node.getNode(key), f"{path}.{key}" if path else key, depth + 1, found)
    elif node.isSeq() and node.size() > 1:
        array = _list(node)
        if array is not None:
            found[path] = array


def _list(node: Any) -> FloatArray | None:
    """Return a list of numbers (N,), or of points (N, K); None where it holds something else."""
    items = [node.at(place) for place in range(node.size())]
    if all(item.isInt() or item.isReal() for item in items):
        return np.array([item.real() for item in items])
    rows = [[item.at(k) for k in range(item.size())] if item.isSeq() else [] for item in items]
    if len({len(row) for row in rows}) != 1 or len(rows[0]) not in (2, 3, 4):
        return None
    if not all(value.isInt() or value.isReal() for row in rows for value in row):
        return None
    return np.array([[value.real() for value in row] for row in rows])


FORMAT = Format(
    name="opencv",
    title="OpenCV YAML or XML",
    endings=(".yml", ".yaml", ".xml"),
    kinds=("cloud", "profile"),
    recognise=recognise,
    read=read,
    settings=OpenCvSettings,
)
