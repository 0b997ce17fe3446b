"""Denso: the lines of a program that set tool and user frame."""

from calib_core.exports.answer import Answer
from calib_core.exports.writing import NumberedSettings, listed, program_export, table_pose, tool_pose


def _tool(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"Tool {settings.tool}, P({listed(tool_pose(answer, 'yaskawa'), 6, 8)})"]


def _table(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [f"Work {settings.frame}, P({listed(table_pose(answer, 'yaskawa'), 6, 8)})"]


EXPORT = program_export("denso", "Denso: Tool and Work (PacScript)", ".pcs", "' ", NumberedSettings, _tool, _table)
