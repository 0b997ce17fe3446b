"""Yaskawa: entries of TOOL.CND and UFRAME.CND; the format has no comments, so the name tells the origin."""

import re

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.patching import as_bytes_kept, only_match, put_back, replaced
from calib_core.exports.writing import NumberedSettings, frames_written, listed, mark
from calib_core.messages import message


def write(answer: Answer, settings: NumberedSettings) -> str:
    """Return the entry of TOOL.CND and, behind it, that of UFRAME.CND."""
    lines: list[str] = []
    for one in frames_written(answer, settings, "yaskawa", "both"):
        numbers, name = listed(one.pose, 3, 4), f"///NAME {mark(answer, 16)}"
        if one.kind == "tool":
            load = ["0.000,0.000,0.000", "0.000", "0.000,0.000,0.000", "0"]
            lines += [f"//TOOL {one.settings.tool}", name, numbers, *load]
        else:
            lines += [f"//UFRAME {one.settings.frame}", name, "///TOOL 0", f"////BUSER {numbers}"]
    return "\r\n".join(lines) + "\r\n"


def patch(backup: bytes, answer: Answer, settings: NumberedSettings) -> bytes:
    """Return a TOOL.CND or UFRAME.CND with one frame changed; load data and all else stay as they are."""
    text, encoding = as_bytes_kept(backup)
    is_tool_file = re.search(r"^//TOOL\b", text, re.MULTILINE) is not None
    default = "tool" if is_tool_file or answer.base_from_turntable is None else "table"
    for one in frames_written(answer, settings, "yaskawa", default):
        what, number = ("//TOOL", one.settings.tool) if one.kind == "tool" else ("//UFRAME", one.settings.frame)
        value = r"^([-+.\d][^\r\n/]*)" if one.kind == "tool" else r"^////BUSER[ \t]*([^\r\n]*)"
        text = _put(text, rf"^{what}[ \t]+{number}[ \t]*$", value, what, listed(one.pose, 3, 4), number)
    return put_back(text, encoding)


def _put(text: str, head: str, value: str, what: str, numbers: str, index: int) -> str:
    ends = text.replace("\r", "\n")  # the same positions, with plain line ends
    entry = only_match(head, ends, f"{what} {index}")
    after = re.compile(r"^//[A-Z]", re.MULTILINE).search(ends, entry.end())
    body = ends[entry.end() : after.start() if after else len(ends)]
    place = (
        only_match(value, body, message("the frame of {entry}", entry=f"{what} {index}"), re.MULTILINE)
        if what == "//UFRAME"
        else None
    )
    found = place or re.search(value, body, re.MULTILINE)
    if found is None:
        found = only_match(value, body, message("the frame of {entry}", entry=f"{what} {index}"))
    return replaced(text, entry.end() + found.start(1), entry.end() + found.end(1), numbers)


EXPORT = Export(
    "yaskawa", "Yaskawa: TOOL.CND and UFRAME.CND", "text/plain", ".CND", write, NumberedSettings, "yaskawa", patch
)
