"""Comau: the lines of a program that set tool and user frame; those lines of a program."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Settings
from calib_core.exports.writing import Part, listed, patched_line, program_export, table_pose, tool_pose, wanted


class PlainSettings(Settings):
    """What is written."""

    part: Part | None = None


def _tool(answer: Answer, settings: PlainSettings) -> list[str]:
    return [f"  $TOOL := POS({listed(tool_pose(answer, 'kawasaki'), 6, 8)}, '')"]


def _table(answer: Answer, settings: PlainSettings) -> list[str]:
    return [f"  $UFRAME := POS({listed(table_pose(answer, 'kawasaki'), 6, 8)}, '')"]


def patch(backup: bytes, answer: Answer, settings: PlainSettings) -> bytes:
    """Return a program with the numbers of its $TOOL, or its $UFRAME, changed."""
    poses = ((tool_pose, "$TOOL"), (table_pose, "$UFRAME"))
    asked = [
        pair for pair, is_wanted in zip(poses, wanted(answer, settings.part, "tool"), strict=True) if is_wanted
    ]
    return patched_line(
        backup,
        answer,
        "-- ",
        [
            (
                f"{name} := POS(…)",
                rf"^(?![ \t]*--)[^\r\n]*?\{name}[ \t]*:=[ \t]*POS[ \t]*\(",
                listed(pose(answer, "kawasaki"), 6, 8),
            )
            for pose, name in asked
        ],
    )


EXPORT = program_export(
    "comau", "Comau: $TOOL and $UFRAME (PDL2)", ".pdl", "  -- ", PlainSettings, _tool, _table,
    (["PROGRAM scancell NOHOLD", "BEGIN"], ["END scancell"]), patch,
)  # fmt: skip
