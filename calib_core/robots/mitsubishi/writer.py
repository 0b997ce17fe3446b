"""Mitsubishi: the line of a program that sets the tool; that line of a program."""

from typing import Self

from calib_core.errors import ConflictError
from calib_core.exports.answer import Answer
from calib_core.exports.patching import patched_line
from calib_core.exports.writing import ControllerSettings, listed, program_export, require_one_scanner, tool_pose
from calib_core.messages import message


class PlainSettings(ControllerSettings):
    """What is written; programs have no statement for a user frame."""

    def of_fixed_scanner(self, before: int) -> Self:
        """Raise ConflictError."""
        to_do = "Set the work coordinate on the teaching box by the numbers of `scancell answer`."
        raise ConflictError("a scanner on the flange", "one that stands still", to_do, "part")


def _tool(pose: list[float], settings: PlainSettings, answer: Answer) -> list[str]:
    return [f"Tool ({listed(pose, 6, 8)})"]


def _table(pose: list[float], settings: PlainSettings, answer: Answer) -> list[str]:
    return ["' not written: set the work coordinate on the teaching box by three points of the table"]


def patch(backup: bytes, answer: Answer, settings: PlainSettings) -> bytes:
    """Return a program with the numbers of its Tool line changed."""
    if settings.part in ("table", "both"):
        to_do = message("Set the work coordinate on the teaching box, by three points of the table.")
        raise ConflictError("part tool", settings.part, to_do, "part")
    require_one_scanner(answer, settings)
    before = r"^[ \t]*(?:\d+[ \t]+)?Tool[ \t]*\("
    numbers = listed(tool_pose(answer, "mitsubishi"), 6, 8)
    return patched_line(backup, answer, "' ", [("Tool (…)", before, numbers)])


EXPORT = program_export(
    "mitsubishi", "Mitsubishi: Tool (MELFA BASIC)", ".prg", "' ", PlainSettings, _tool, _table, patch=patch
)
