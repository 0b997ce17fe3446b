"""Epson: the lines of a program that set tool and user frame; those lines of a program."""

from calib_core.exports.answer import Answer
from calib_core.exports.writing import (
    NumberedSettings,
    listed,
    patched_line,
    program_export,
    table_pose,
    tool_pose,
    wanted,
)


def _tool(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"TLSet {settings.tool}, XY({_numbers(tool_pose(answer, 'nachi'))})"]


def _table(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"Local {settings.frame}, XY({_numbers(table_pose(answer, 'nachi'))})"]


def _numbers(pose: list[float]) -> str:
    return listed(pose, 6, 8)


def patch(backup: bytes, answer: Answer, settings: NumberedSettings) -> bytes:
    """Return a program with the numbers of its tool, or its local frame, changed."""
    entries: list[tuple[str, str, str]] = []
    with_tool, with_table = wanted(answer, settings.part, "tool")
    if with_tool:
        before = rf"^[ \t]*TLSet[ \t]+{settings.tool}[ \t]*,[ \t]*XY[ \t]*\("
        entries.append((f"TLSet {settings.tool}, XY(…)", before, _numbers(tool_pose(answer, "nachi"))))
    if with_table:
        before = rf"^[ \t]*Local[ \t]+{settings.frame}[ \t]*,[ \t]*XY[ \t]*\("
        entries.append((f"Local {settings.frame}, XY(…)", before, _numbers(table_pose(answer, "nachi"))))
    return patched_line(backup, answer, "' ", entries)


EXPORT = program_export(
    "epson", "Epson: TLSet and Local (SPEL+)", ".prg", "' ", NumberedSettings, _tool, _table, patch=patch
)
