"""Writers of the brands whose programs set a numbered tool and frame by one statement each: `Tool 1, P(…)`."""

from dataclasses import dataclass

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.writing import (
    NumberedSettings,
    listed,
    patched_line,
    program_export,
    table_pose,
    tool_pose,
    wanted,
)


@dataclass(frozen=True)
class Statements:
    """How a brand's programs set tool and frame.

    Attributes
    ----------
    tool, frame : str
        The statements' words.
    call : str
        What stands before the six numbers' bracket.
    call_pattern : str
        What may stand there in a program that is read.
    convention : str
        Of the six numbers.
    """

    tool: str
    frame: str
    call: str
    call_pattern: str
    convention: str

    def export(self, name: str, title: str, suffix: str) -> Export:
        """Return the export of the brand; its programs' comments begin with an apostrophe."""
        return program_export(
            name, title, suffix, "' ", NumberedSettings, self._tool, self._table,
            patch=self._patch, convention=self.convention,
        )  # fmt: skip

    def _tool(self, pose: list[float], settings: NumberedSettings, answer: Answer) -> list[str]:
        return [f"{self.tool} {settings.tool}, {self.call}({_numbers(pose)})"]

    def _table(self, pose: list[float], settings: NumberedSettings, answer: Answer) -> list[str]:
        return [f"{self.frame} {settings.frame}, {self.call}({_numbers(pose)})"]

    def _patch(self, backup: bytes, answer: Answer, settings: NumberedSettings) -> bytes:
        entries: list[tuple[str, str, str]] = []
        with_tool, with_table = wanted(answer, settings.part, "tool")
        if with_tool:
            entries.append(self._entry(self.tool, settings.tool, tool_pose(answer, self.convention)))
        if with_table:
            entries.append(self._entry(self.frame, settings.frame, table_pose(answer, self.convention)))
        return patched_line(backup, answer, "' ", entries)

    def _entry(self, word: str, number: int, pose: list[float]) -> tuple[str, str, str]:
        before = rf"^[ \t]*{word}[ \t]+{number}[ \t]*,[ \t]*{self.call_pattern}[ \t]*\("
        return f"{word} {number}, {self.call}(…)", before, _numbers(pose)


def _numbers(pose: list[float]) -> str:
    return listed(pose, 6, 8)
