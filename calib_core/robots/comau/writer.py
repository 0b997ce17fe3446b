"""Comau: the lines of a program that set tool and user frame; those lines of a program."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Settings
from calib_core.exports.writing import Part, listed, patched_line, program_export, table_pose, tool_pose, wanted


class PlainSettings(Settings):
    """What is written."""

    part: Part | None = None


def _tool(pose: list[float], settings: PlainSettings, answer: Answer) -> list[str]:
    return [f"  $TOOL := POS({listed(pose, 6, 8)}, '')"]


def _table(pose: list[float], settings: PlainSettings, answer: Answer) -> list[str]:
    return [f"  $UFRAME := POS({listed(pose, 6, 8)}, '')"]


def patch(backup: bytes, answer: Answer, settings: PlainSettings) -> bytes:
    """Return a program with the numbers of its $TOOL, or its $UFRAME, changed."""
    with_tool, with_table = wanted(answer, settings.part, "tool")
    poses = [("$TOOL", tool_pose)] * with_tool + [("$UFRAME", table_pose)] * with_table
    entries = [
        (
            f"{name} := POS(…)",
            rf"^(?![ \t]*--)[^\r\n]*?\{name}[ \t]*:=[ \t]*POS[ \t]*\(",
            listed(pose_of(answer, "kawasaki"), 6, 8),
        )
        for name, pose_of in poses
    ]
    return patched_line(backup, answer, "-- ", entries)


EXPORT = program_export(
    "comau", "Comau: $TOOL and $UFRAME (PDL2)", ".pdl", "  -- ", PlainSettings, _tool, _table,
    (["PROGRAM scancell NOHOLD", "BEGIN"], ["END scancell"]), patch, "kawasaki",
)  # fmt: skip
