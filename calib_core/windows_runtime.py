"""Microsoft's runtime for C++, without which neither numba nor Open3D loads: not every Windows has it."""

from functools import cache

from calib_core.disk import WINDOWS
from calib_core.errors import InputError
from calib_core.messages import message

LIBRARIES = ("msvcp140.dll", "vcruntime140_1.dll", "vcomp140.dll")
"""Windows' own Python brings the second alone; wheels that bring them give them other names."""


@cache
def require_runtime() -> None:
    """Refuse a Windows without Microsoft's runtime, before a library fails without a word of it.

    Raises
    ------
    InputError
    """
    if WINDOWS and (lacking := [name for name in LIBRARIES if not _loads(name)]):
        to_do = message("Install it (vc_redist.x64.exe, of Microsoft), or have its files beside python.exe.")
        got = message("a Windows without {names}", names=", ".join(lacking))
        raise InputError("Microsoft's Visual C++ runtime", got, to_do, "Windows")


def _loads(name: str) -> bool:
    import ctypes

    try:
        ctypes.WinDLL(name)  # pyright: ignore
    except OSError:
        return False
    return True
