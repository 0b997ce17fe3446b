"""Comau: the lines of a program that set tool and user frame."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Settings
from calib_core.exports.writing import Part, listed, program_export, table_pose, tool_pose


class PlainSettings(Settings):
    """What is written."""

    part: Part | None = None


def _tool(answer: Answer, settings: PlainSettings) -> list[str]:
    return [f"  $TOOL := POS({listed(tool_pose(answer, 'kawasaki'), 6, 8)}, '')"]


def _table(answer: Answer, settings: PlainSettings) -> list[str]:
    return [f"  $UFRAME := POS({listed(table_pose(answer, 'kawasaki'), 6, 8)}, '')"]


EXPORT = program_export(
    "comau", "Comau: $TOOL and $UFRAME (PDL2)", ".pdl", "  -- ", PlainSettings, _tool, _table,
    (["PROGRAM scancell NOHOLD", "BEGIN"], ["END scancell"]),
)  # fmt: skip
