"""Links as Windows' start menu has them (MS-SHLLINK): a target, its arguments and a folder; no shell is asked."""

import struct
from typing import Final

_CLASS: Final = bytes.fromhex("0114020000000000c000000000000046")
_HAS_NAME, _HAS_FOLDER, _HAS_ARGUMENTS, _IS_UNICODE, _HAS_EXPANDED = 0x4, 0x10, 0x20, 0x80, 0x200
_EXPANDED: Final = 0xA0000001
_EXPANDED_BYTES: Final = 0x314
_SIGNS: Final = 260
NORMAL: Final = 1


def link(target: str, arguments: str, folder: str, window: int = NORMAL) -> bytes:
    """Return a link's bytes.

    Parameters
    ----------
    target : str
        A program's whole path; variables such as `%SystemRoot%` may stand in it.
    arguments : str
        As one line.
    folder : str
        Where it runs; empty: where it likes.
    window : int
        How its window shows: 1 as usual, 7 minimized.
    """
    flags = _HAS_NAME | _HAS_ARGUMENTS | _IS_UNICODE | _HAS_EXPANDED | (_HAS_FOLDER if folder else 0)
    header = struct.pack("<I16sIIQQQIiIHHII", 0x4C, _CLASS, flags, 0, 0, 0, 0, 0, 0, window, 0, 0, 0, 0)
    texts = ["scancell", *([folder] if folder else []), arguments]
    strings = b"".join(struct.pack("<H", len(text)) + text.encode("utf-16-le") for text in texts)
    narrow = target.encode("cp1252", "replace").ljust(_SIGNS, b"\0")
    wide = target.encode("utf-16-le").ljust(2 * _SIGNS, b"\0")
    return header + strings + struct.pack("<II", _EXPANDED_BYTES, _EXPANDED) + narrow + wide + struct.pack("<I", 0)
