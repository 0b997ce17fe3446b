"""Rows of typed fields out of bytes: what NPY, PLY and PCD share, with every length checked before it is used."""

import ast
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, TooLargeError
from calib_core.frames import FloatArray
from calib_core.messages import message

MAX_POINTS = 20_000_000


def require_count(count: int, available: int, where: str) -> None:
    """Refuse a count that the file cannot hold or the program will not.

    Raises
    ------
    InputError
        If the header announces more than the file holds.
    TooLargeError
        If it is beyond `MAX_POINTS`.
    """
    if count > MAX_POINTS:
        need = "at most {max_points} points"
        to_do = "Thin the points."
        raise TooLargeError(need, "{count} announced", to_do, where, max_points=MAX_POINTS, count=count)
    if count < 1:
        to_do = "Copy or export it again."
        raise InputError("at least one point", "{count} announced", to_do, where, count=count)
    if available < count:
        need = "the {count} points that the header announces"
        to_do = "Copy or export it again."
        raise InputError(need, "{available} in the file", to_do, where, count=count, available=available)


def columns_from_records(
    data: bytes, offset: int, count: int, dtype: np.dtype[Any], names: tuple[str, ...], where: str
) -> FloatArray:
    """Return named fields of `count` packed records, (count, len(names)), as float64."""
    require_count(count, (len(data) - offset) // dtype.itemsize, where)
    records = np.frombuffer(data, dtype=dtype, count=count, offset=offset)
    return np.stack([records[name].astype(np.float64) for name in names], axis=1)


def parse_npy(data: bytes, where: str) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return the array of an NPY file, and the names of its fields where it is one of records; never unpickles.

    Records (N,) with fields of numbers become (N, fields) float64.

    Raises
    ------
    InputError
        If it is no NPY file, is cut off, or holds something other than numbers.
    """
    to_do = message("Save it with numpy.save, an array of numbers.")
    need = message("an NPY file of numbers")
    header, offset = _npy_header(data, need, to_do, where)
    try:
        dtype = np.dtype(header["descr"])
        shape = tuple(int(n) for n in header["shape"])
        fortran = bool(header["fortran_order"])
    except (KeyError, TypeError, ValueError, SyntaxError):
        raise InputError(need, "a header that numpy does not know", to_do, where) from None
    kinds = {dtype[field].kind for field in dtype.names} if dtype.names else {dtype.kind}
    if not kinds <= set("fiu") or dtype.itemsize == 0:
        raise InputError(need, "values of type {dtype}", to_do, where, dtype=dtype.name)
    if not shape or len(shape) > 3 or min(shape) < 0:
        raise InputError(need, "an array of shape {shape}", to_do, where, shape=shape)
    width = list(shape)[-1] if len(shape) > 1 else 1
    rows = math.prod(list(shape)[:-1]) if len(shape) > 1 else math.prod(shape)
    require_count(rows, (len(data) - offset) // max(dtype.itemsize * width, 1), where)
    if rows * width > 4 * MAX_POINTS:
        raise InputError(need, "an array of shape {shape}", "Save fewer points in a file.", where, shape=shape)
    flat = np.frombuffer(data, dtype=dtype, count=rows * width, offset=offset)
    array = flat.reshape(shape, order="F" if fortran else "C")
    if not dtype.names:
        return array, ()
    if array.ndim != 1:
        raise InputError(need, "records in an array of shape {shape}", to_do, where, shape=shape)
    return np.stack([array[field].astype(np.float64) for field in dtype.names], axis=1), dtype.names


def _npy_header(data: bytes, need: str, to_do: str, where: str) -> tuple[dict[str, Any], int]:
    if data[:6] != b"\x93NUMPY" or len(data) < 12:
        raise InputError(need, "a file that does not begin like one", to_do, where)
    width = 2 if data[6] == 1 else 4
    start = 8 + width
    length = int.from_bytes(data[8:start], "little")
    if length > 10_000 or start + length > len(data):
        raise InputError(need, "a header that is cut off", "Copy or export it again.", where)
    try:
        header = ast.literal_eval(data[start : start + length].decode("latin-1").strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError, TypeError):
        header = None
    if not isinstance(header, dict):
        raise InputError(need, "a header that numpy does not know", to_do, where)
    return header, start + length
