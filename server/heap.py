"""How the C library keeps memory, for a process that runs for weeks and whose threads come and go."""

import ctypes
import sys
from typing import Any, Final

_ARENA_MAX, _MMAP_THRESHOLD, _TRIM_THRESHOLD = -8, -3, -1  # of glibc's malloc.h
_BLOCK_BYTES: Final = 256 * 1024


def keep_little() -> None:
    """Let all threads share one heap, and give large blocks back at once; call it before there are threads.

    By default glibc makes up to eight heaps a core, and each keeps the most that any thread ever needed in it: a
    server whose scenes, uploads and solves each have threads of their own grew by some 5 MB with each session.  It
    also takes ever larger blocks from the heaps, where what stands behind them keeps them.  Python's threads wait
    for each other anyway.  What the environment says (`MALLOC_ARENA_MAX`) is overridden; other C libraries have no
    such settings.
    """
    mallopt = _of_glibc("mallopt")
    if mallopt is not None:
        mallopt(_ARENA_MAX, 1)
        mallopt(_MMAP_THRESHOLD, _BLOCK_BYTES)
        mallopt(_TRIM_THRESHOLD, _BLOCK_BYTES)


def give_back() -> None:
    """Give memory that is free in the heap back to the system."""
    trim = _of_glibc("malloc_trim")
    if trim is not None:
        trim(0)


def _of_glibc(name: str) -> Any:
    """Return a function of the C library, None where it has none of this name."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
