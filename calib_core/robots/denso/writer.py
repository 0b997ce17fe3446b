"""Denso: the lines of a program that set tool and user frame; those lines of a program."""

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
    return [f"Tool {settings.tool}, P({_numbers(tool_pose(answer, 'yaskawa'))})"]


def _table(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"Work {settings.frame}, P({_numbers(table_pose(answer, 'yaskawa'))})"]


def _numbers(pose: list[float]) -> str:
    return listed(pose, 6, 8)


def patch(backup: bytes, answer: Answer, settings: NumberedSettings) -> bytes:
    """Return a program with the numbers of its tool, or its work, changed."""
    entries: list[tuple[str, str, str]] = []
    with_tool, with_table = wanted(answer, settings.part, "tool")
    if with_tool:
        before = rf"^[ \t]*Tool[ \t]+{settings.tool}[ \t]*,[ \t]*P?[ \t]*\("
        entries.append((f"Tool {settings.tool}, P(…)", before, _numbers(tool_pose(answer, "yaskawa"))))
    if with_table:
        before = rf"^[ \t]*Work[ \t]+{settings.frame}[ \t]*,[ \t]*P?[ \t]*\("
        entries.append((f"Work {settings.frame}, P(…)", before, _numbers(table_pose(answer, "yaskawa"))))
    return patched_line(backup, answer, "' ", entries)


EXPORT = program_export(
    "denso", "Denso: Tool and Work (PacScript)", ".pcs", "' ", NumberedSettings, _tool, _table, patch=patch
)
