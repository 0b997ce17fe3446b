"""Epson: the lines of a program that set tool and user frame."""

from calib_core.exports.answer import Answer
from calib_core.exports.writing import NumberedSettings, listed, program_export, table_pose, tool_pose


def _tool(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"TLSet {settings.tool}, XY({listed(tool_pose(answer, 'nachi'), 6, 8)})"]


def _table(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"Local {settings.frame}, XY({listed(table_pose(answer, 'nachi'), 6, 8)})"]


EXPORT = program_export("epson", "Epson: TLSet and Local (SPEL+)", ".prg", "' ", NumberedSettings, _tool, _table)
