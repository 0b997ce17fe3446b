"""Mitsubishi: the lines of a program that set tool and user frame."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Settings
from calib_core.exports.writing import Part, listed, program_export, tool_pose


class PlainSettings(Settings):
    """What is written."""

    part: Part | None = None


def _tool(answer: Answer, settings: PlainSettings) -> list[str]:
    return [f"Tool ({listed(tool_pose(answer, 'mitsubishi'), 6, 8)})"]


def _table(answer: Answer, settings: PlainSettings) -> list[str]:
    return ["' not written: set the work coordinate on the teaching box by three points of the table"]


EXPORT = program_export(
    "mitsubishi", "Mitsubishi: Tool and Base (MELFA BASIC)", ".prg", "' ", PlainSettings, _tool, _table
)
