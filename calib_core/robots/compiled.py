"""Files of controllers that only the controller reads: what each is, and what tells the same in text."""

from collections.abc import Collection

from calib_core.formats.shared.text_style import looks_like_text
from calib_core.messages import templates

_HEAD_BYTES = 65_536
_COMPILED = templates(
    {
        ".tp": ("A compiled FANUC program", "export it as a listing, .ls (ASCII)."),
        ".vr": ("FANUC's variables in binary", "save them as a listing, .va (ASCII)."),
        ".sv": ("FANUC's system variables in binary", "save them as a listing, .va (ASCII)."),
        ".pc": ("A compiled KAREL program", "its source tells more."),
    }
)
_LISTINGS = (".ls", ".va", ".kl")


def compiled(name: str, data: bytes) -> tuple[str, str] | None:
    """Return what a compiled file is and what to do, None where it is none."""
    ending = f".{name.rpartition('.')[2].lower()}" if "." in name else ""
    return _COMPILED.get(ending) if not looks_like_text(data[:_HEAD_BYTES]) else None


def is_listed(name: str, others: Collection[str]) -> bool:
    """Return whether a listing of the same stands beside a compiled file; `others` are in lower case."""
    stem = name.rpartition(".")[0].lower()
    return any(stem + ending in others for ending in _LISTINGS)
