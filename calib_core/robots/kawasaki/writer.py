"""Kawasaki AS: a program that sets tool and user frame; a transformation of a saved file."""

import re

from calib_core.exports.answer import Answer
from calib_core.exports.writing import (
    NamedSettings,
    as_bytes_kept,
    fixed,
    listed,
    only_match,
    program_export,
    put_back,
    replaced,
    table_pose,
    tool_pose,
    wanted,
)


def _tool(answer: Answer, settings: NamedSettings) -> list[str]:
    pose = listed(tool_pose(answer, "kawasaki"), 9, 11)
    return [f"  POINT {settings.tool} = TRANS({pose})", f"  TOOL {settings.tool}"]


def _table(answer: Answer, settings: NamedSettings) -> list[str]:
    pose = listed(table_pose(answer, "kawasaki"), 9, 11)
    return [f"  POINT {settings.frame} = TRANS({pose})", f"  BASE {settings.frame}"]


def patch(backup: bytes, answer: Answer, settings: NamedSettings) -> bytes:
    """Return a saved file with one transformation changed."""
    text, encoding = as_bytes_kept(backup)
    with_tool, with_table = wanted(answer, settings.part, "tool")
    if with_tool:
        text = _put(text, settings.tool, tool_pose(answer, "kawasaki"))
    if with_table:
        text = _put(text, settings.frame, table_pose(answer, "kawasaki"))
    return put_back(text, encoding)


def _put(text: str, name: str, pose: list[float]) -> str:
    number = r"[-+.\deE]+"
    pattern = rf"^[ \t]*{re.escape(name)}[ \t]+({number}(?:[ \t]+{number}){{5}})"
    found = only_match(pattern, text, f"transformation {name}")
    return replaced(text, found.start(1), found.end(1), " ".join(fixed(v, 6) for v in pose))


EXPORT = program_export(
    "kawasaki", "Kawasaki AS: TOOL and BASE", ".as", "  ; ", NamedSettings, _tool, _table,
    ([".PROGRAM scancell()"], [".END"]), patch,
)  # fmt: skip
