"""Comau: the lines of a program that set tool and user frame; those lines of a program."""

from typing import Self

from calib_core.errors import ConflictError
from calib_core.exports.answer import Answer
from calib_core.exports.patching import patched_line
from calib_core.exports.writing import ControllerSettings, frames_written, listed, program_export


class PlainSettings(ControllerSettings):
    """What is written; a program has one user frame."""

    def of_fixed_scanner(self, before: int) -> Self:
        """Return them; raises ConflictError where the table would be written into the same user frame."""
        if before:
            need = "part tool or table: a program has one $UFRAME, for the scanner or for the turntable"
            raise ConflictError(need, "both", "Export each with its own part.", "part")
        return self


def _tool(pose: list[float], settings: PlainSettings, answer: Answer) -> list[str]:
    return [f"  $TOOL := POS({listed(pose, 6, 8)}, '')"]


def _table(pose: list[float], settings: PlainSettings, answer: Answer) -> list[str]:
    return [f"  $UFRAME := POS({listed(pose, 6, 8)}, '')"]


def patch(backup: bytes, answer: Answer, settings: PlainSettings) -> bytes:
    """Return a program with the numbers of its $TOOL, or its $UFRAME, changed."""
    entries = [
        (f"{name} := POS(…)", rf"^(?![ \t]*--)[^\r\n]*?\{name}[ \t]*:=[ \t]*POS[ \t]*\(", listed(one.pose, 6, 8))
        for one in frames_written(answer, settings, "kawasaki", "tool")
        for name in ("$TOOL" if one.kind == "tool" else "$UFRAME",)
    ]
    return patched_line(backup, answer, "-- ", entries)


EXPORT = program_export(
    "comau", "Comau: $TOOL and $UFRAME (PDL2)", ".pdl", "  -- ", PlainSettings, _tool, _table,
    (["PROGRAM scancell NOHOLD", "BEGIN"], ["END scancell"]), patch, "kawasaki",
)  # fmt: skip
