"""Yaskawa: entries of TOOL.CND and UFRAME.CND; the format has no comments, so the name tells the origin."""

import re

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.writing import (
    NumberedSettings,
    as_bytes_kept,
    listed,
    mark,
    only_match,
    put_back,
    replaced,
    table_pose,
    tool_pose,
    wanted,
)


def write(answer: Answer, settings: NumberedSettings) -> str:
    """Return the entry of TOOL.CND and, behind it, that of UFRAME.CND."""
    with_tool, with_table = wanted(answer, settings.part, "both")
    lines: list[str] = []
    if with_tool:
        numbers = listed(tool_pose(answer, "yaskawa"), 3, 4)
        load = ["0.000,0.000,0.000", "0.000", "0.000,0.000,0.000", "0"]
        lines += [f"//TOOL {settings.tool}", f"///NAME {mark(answer, 16)}", numbers, *load]
    if with_table:
        numbers = listed(table_pose(answer, "yaskawa"), 3, 4)
        lines += [f"//UFRAME {settings.frame}", f"///NAME {mark(answer, 16)}", "///TOOL 0", f"////BUSER {numbers}"]
    return "\r\n".join(lines) + "\r\n"


def patch(backup: bytes, answer: Answer, settings: NumberedSettings) -> bytes:
    """Return a TOOL.CND or UFRAME.CND with one frame changed; load data and all else stay as they are."""
    text, encoding = as_bytes_kept(backup)
    is_tool_file = re.search(r"^//TOOL\b", text, re.MULTILINE) is not None
    with_tool, with_table = wanted(answer, settings.part, "tool" if is_tool_file else "table")
    if with_tool:
        numbers = listed(tool_pose(answer, "yaskawa"), 3, 4)
        text = _put(
            text, rf"^//TOOL[ \t]+{settings.tool}[ \t]*$", r"^([-+.\d][^\r\n/]*)", "//TOOL", numbers, settings.tool
        )
    if with_table:
        numbers = listed(table_pose(answer, "yaskawa"), 3, 4)
        value = r"^////BUSER[ \t]*([^\r\n]*)"
        text = _put(text, rf"^//UFRAME[ \t]+{settings.frame}[ \t]*$", value, "//UFRAME", numbers, settings.frame)
    return put_back(text, encoding)


def _put(text: str, head: str, value: str, what: str, numbers: str, index: int) -> str:
    ends = text.replace("\r", "\n")  # the same positions, with plain line ends
    entry = only_match(head, ends, f"{what} {index}")
    after = re.compile(r"^//[A-Z]", re.MULTILINE).search(ends, entry.end())
    body = ends[entry.end() : after.start() if after else len(ends)]
    place = only_match(value, body, f"frame under {what} {index}", re.MULTILINE) if what == "//UFRAME" else None
    found = place or re.search(value, body, re.MULTILINE)
    if found is None:
        found = only_match(value, body, f"frame under {what} {index}")
    return replaced(text, entry.end() + found.start(1), entry.end() + found.end(1), numbers)


EXPORT = Export(
    "yaskawa", "Yaskawa: TOOL.CND and UFRAME.CND", "text/plain", ".CND", write, NumberedSettings, "yaskawa", patch
)
