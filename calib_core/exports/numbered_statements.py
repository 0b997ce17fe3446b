"""Writers of the brands whose programs set a numbered tool and frame by one statement each: `Tool 1, P(…)`."""

from dataclasses import dataclass

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.patching import patched_line
from calib_core.exports.writing import NumberedSettings, Written, frames_written, listed, program_export


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
        entries = [self._entry(one) for one in frames_written(answer, settings, self.convention, "tool")]
        return patched_line(backup, answer, "' ", entries)

    def _entry(self, one: Written) -> tuple[str, str, str]:
        word, number = (self.tool, one.settings.tool) if one.kind == "tool" else (self.frame, one.settings.frame)
        before = rf"^[ \t]*{word}[ \t]+{number}[ \t]*,[ \t]*{self.call_pattern}[ \t]*\("
        return f"{word} {number}, {self.call}(…)", before, _numbers(one.pose)


def _numbers(pose: list[float]) -> str:
    return listed(pose, 6, 8)
