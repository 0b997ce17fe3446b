"""OpenCV's FileStorage in YAML and XML: a matrix or a list of points."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, PointKind, Reading, by_ending
from calib_core.formats.shared.columns import TableSettings, reading_of_values
from calib_core.formats.shared.names import axis_of
from calib_core.formats.shared.text_style import decode_text
from calib_core.frames import FloatArray
from calib_core.messages import message

_EXAMPLE = "an OpenCV file"
_TO_DO = message("Write it with cv::FileStorage, one matrix or list of points in it.")
_MOST_DEPTH = 3
_FEWEST = 8  # points that are more than a pose or a camera's matrix
_FLAT_YAML = re.compile(r"^([A-Za-z_][\w-]*):\x20*\[([-+.0-9eE,\sNanIif]{100,})\]", re.MULTILINE)
_FLAT_XML = re.compile(r"<(?!data>)([A-Za-z_][\w-]*)>([-+.0-9eE\sNanIif]{100,})</\1>")
_NAMED = re.compile(r"point|profil|scan|line|cloud|xyz|xz|data", re.IGNORECASE)


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
        need = "points under '{node}'"
        raise InputError(need, "points under {there}", "Name one of these.", name, node=settings.node, there=there)
    fitting = {settings.node: nodes[settings.node]} if settings.node else _likeliest(nodes)
    if len(fitting) != 1:
        got = f"{len(fitting)}: {', '.join(list(fitting)[:20])}" if fitting else message("none")
        to_do = message("Name it by the setting node.") if fitting else _TO_DO
        raise InputError("one matrix or list of points", got, to_do, name)
    chosen, array = next(iter(fitting.items()))
    if array.ndim == 1:
        array = _points_of_list(array, chosen, kind, name)
    grid = array.shape[:2] if array.ndim == 3 and min(array.shape[:2]) > 1 else None
    reading = reading_of_values(array.reshape(-1, array.shape[-1]), (), name, settings, kind)
    return replace(reading, grid=(grid[0], grid[1])) if grid and reading.kind == "cloud" else reading


def point_nodes(text: str, where: str) -> dict[str, FloatArray]:
    """Return the nodes of a file that are most probably points, (N, 2) of a profile or (N, 3), by their paths.

    Raises
    ------
    InputError
        If the file is not whole.
    """
    found: dict[str, FloatArray] = {}
    for path, array in _likeliest(_nodes(text, where)).items():
        if array.ndim == 1:
            try:
                array = _points_of_list(array, path, None, where)
            except InputError:
                continue
        points = array.reshape(-1, array.shape[-1])
        if len(points) >= _FEWEST:
            flat = points.shape[1] > 2 and np.ptp(points[:, 1]) == 0
            found[path] = points[:, [0, 2]] if flat else points[:, :3]
    return found


def _likeliest(nodes: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the nodes that hold points if one of them does: long ones, in rows, named so."""
    if len(nodes) > 1:
        nodes = {path: array for path, array in nodes.items() if array.size >= 2 * _FEWEST} or nodes
    if len(nodes) > 1:
        nodes = {path: array for path, array in nodes.items() if array.ndim > 1} or nodes
    if len(nodes) > 1:
        nodes = {path: array for path, array in nodes.items() if _NAMED.search(path)} or nodes
    return nodes


def _points_of_list(values: FloatArray, path: str, kind: PointKind | None, where: str) -> FloatArray:
    """Return a plain list as points: of x, y and z where y stands still, else of as many as fit what is needed."""
    threes = values.reshape(-1, 3) if len(values) % 3 == 0 else None
    twos = values.reshape(-1, 2) if len(values) % 2 == 0 else None
    if threes is not None and len(threes) > 2 and np.ptp(threes[:, 1]) == 0:
        return threes if kind == "cloud" else threes[:, [0, 2]]
    wanted = {"profile": [twos], "cloud": [threes], None: [twos, threes]}[kind]
    fitting = [points for points in wanted if points is not None]
    if len(fitting) == 2:  # along a profile x goes one way
        steps = np.diff(fitting[0][:, 0])
        fitting = fitting[:1] if (steps > 0).all() or (steps < 0).all() else fitting[1:]
    if not fitting:
        got = message("a list of {count} numbers under '{path}'", count=len(values), path=path)
        to_do = (
            message("Say whether it is a profile or a cloud.")
            if kind is None
            else message("Write one point a line.")
        )
        raise InputError("points of two or three numbers", got, to_do, where)
    return fitting[0]


def _nodes(text: str, where: str) -> dict[str, FloatArray]:
    """Return the nodes that can hold points, by their path."""
    found: dict[str, FloatArray] = {}

    def taken(match: re.Match[str]) -> str:  # cv2 gives a list number by number, a hundred times slower
        try:
            numbers = match[2].replace(",", " ").replace(".Nan", "nan").replace(".Inf", "inf").split()
            found[match[1]] = np.array(numbers, dtype=np.float64)
        except ValueError:
            return match[0]
        return f"{match[1]}: 0" if match[0].endswith("]") else f"<{match[1]}>0</{match[1]}>"

    rest = (_FLAT_XML if text.lstrip().startswith("<") else _FLAT_YAML).sub(taken, text)
    _in_storage(rest, where, lambda root: _collect(root, "", 0, found))
    return _joined(found)


def _joined(nodes: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the nodes with lists named x and z, or x, y and z, put together where they lie beside each other."""
    apart: dict[tuple[str, int], dict[str, str]] = {}
    for path, array in nodes.items():
        before, _, last = path.rpartition(".")
        axis = axis_of(last)[0]
        if array.ndim == 1 and axis in ("x", "y", "z"):
            apart.setdefault((before, len(array)), {})[axis] = path
    for axes in apart.values():
        if {"x", "z"} <= axes.keys():
            names = [axes[axis] for axis in "xyz" if axis in axes]
            nodes = {", ".join(names): np.column_stack([nodes[name] for name in names]), **nodes}
            nodes = {path: array for path, array in nodes.items() if path not in names}
    return nodes


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
            points = _of_matrix(matrix) if matrix.dtype.kind in "fiu" else None
            if points is not None:
                found[path] = points
            return
        for key in node.keys() if depth < _MOST_DEPTH else ():
            _collect(node.getNode(key), f"{path}.{key}" if path else key, depth + 1, found)
    elif node.isSeq() and node.size() > 1:
        array = _list(node)
        if array is not None:
            found[path] = array


def _of_matrix(matrix: NDArray[Any]) -> FloatArray | None:
    """Return a matrix as points, one a row, or a list of one row or column; None where it can be neither."""
    values = matrix.astype(np.float64)
    if values.ndim in (2, 3) and values.shape[-1] in (2, 3, 4):
        return values
    if values.ndim == 2 and 1 in values.shape:
        return values.ravel()
    return values.T if values.ndim == 2 and values.shape[0] in (2, 3, 4) else None


def _list(node: Any) -> FloatArray | None:
    """Return a list of numbers (N,), or of points (N, K); None where it holds something else."""
    items = [node.at(place) for place in range(node.size())]
    if all(item.isInt() or item.isReal() for item in items):
        return np.array([item.real() for item in items])
    if all(item.isMap() for item in items):
        keys = [[key for key in "xyz" if key in item.keys()] for item in items]  # noqa: SIM118 — no mapping
        items_of = [[item.getNode(key) for key in own] for item, own in zip(items, keys, strict=True)]
        even = len({tuple(own) for own in keys}) == 1 and keys[0] in (["x", "z"], ["x", "y", "z"])
        return np.array([[value.real() for value in row] for row in items_of]) if even else None
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
    proof="real files",
)
