"""Kawasaki AS: a program that sets tool and user frame; a transformation of a saved file."""

import re

from calib_core.exports.answer import Answer
from calib_core.exports.patching import only_match, patched_by, replaced
from calib_core.exports.writing import DottedName, NamedSettings, fixed, listed, program_export
from calib_core.messages import message


class _Settings(NamedSettings):
    """What tool and user frames are called; names may have dots."""

    tool: DottedName = "tScanner"
    frame: DottedName = "fTable"
    scanner_frame: DottedName = "fScanner"


def _tool(pose: list[float], settings: NamedSettings, answer: Answer) -> list[str]:
    return [f"  POINT {settings.tool} = TRANS({listed(pose, 9, 11)})", f"  TOOL {settings.tool}"]


def _table(pose: list[float], settings: NamedSettings, answer: Answer) -> list[str]:
    return [f"  POINT {settings.frame} = TRANS({listed(pose, 9, 11)})", f"  BASE {settings.frame}"]


def _put(text: str, what: str, pose: list[float], settings: NamedSettings, answer: Answer) -> str:
    """Return a saved file with one transformation changed."""
    name = getattr(settings, what)
    number = r"[-+.\deE]+"
    pattern = rf"^[ \t]*{re.escape(name)}[ \t]+({number}(?:[ \t]+{number}){{5}})"
    found = only_match(pattern, text, message("transformation {name}", name=name))
    return replaced(text, found.start(1), found.end(1), " ".join(fixed(v, 6) for v in pose))


EXPORT = program_export(
    "kawasaki", "Kawasaki AS: TOOL and BASE", ".as", "  ; ", _Settings, _tool, _table,
    ([".PROGRAM scancell()"], [".END"]), patched_by("kawasaki", _put),
)  # fmt: skip
