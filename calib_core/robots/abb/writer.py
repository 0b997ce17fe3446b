"""ABB RAPID: tooldata and wobjdata, alone or patched into a module."""

import re

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.patching import only_match, patched_by, replaced
from calib_core.exports.writing import NamedSettings, fixed, program_export, provenance
from calib_core.messages import message, plural
from calib_core.robots.abb.literal import literal
from calib_core.robots.text import without_comments


def _frame(pose: list[float]) -> str:
    position, rotation = (",".join(fixed(v, d) for v in part) for part, d in ((pose[:3], 9), (pose[3:], 15)))
    return f"[[{position}],[{rotation}]]"


_HERE = "[[0,0,0],[1,0,0,0]]"


def _tool(pose: list[float], settings: NamedSettings, answer: Answer) -> list[str]:
    load = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"
    return [
        "  ! the robot holds it (robhold TRUE); enter or identify its load data before moving",
        f"  PERS tooldata {settings.tool}:=[TRUE,{_frame(pose)},{load}];",
    ]


def _table(pose: list[float], settings: NamedSettings, answer: Answer) -> list[str]:
    return [f'  PERS wobjdata {settings.frame}:=[FALSE,TRUE,"",{_frame(pose)},{_HERE}];']


def _put(text: str, what: str, pose: list[float], settings: NamedSettings, answer: Answer) -> str:
    """Return a module with one frame changed; the load data and all else stay as they are."""
    kind, name = "tooldata" if what == "tool" else "wobjdata", getattr(settings, what)
    plain = without_comments(text, "!")
    found = only_match(rf"\b(?:PERS|VAR|CONST)\s+{kind}\s+{re.escape(name)}\s*:=", plain, f"{kind} {name}")
    end = plain.find(";", found.end())
    try:
        items = list(literal(plain, found.end(), end).items or ())
    except ValueError as error:
        to_do = message("Correct the module first.")
        raise InputError("a whole {kind} {name}", str(error), to_do, "into", kind=kind, name=name) from None
    if len(items) not in ((3,) if kind == "tooldata" else (5,)):
        got = plural("{count} part", "{count} parts", by="count", count=len(items))
        to_do = "Correct the module first."
        raise InputError("a whole {kind} {name}", got, to_do, "into", kind=kind, name=name)
    held = items[0].text.strip().upper() == "TRUE"
    if held != (kind == "tooldata"):
        got = message("robhold {items}", items=items[0].text.strip())
        need = (
            message("a tool that the robot holds")
            if kind == "tooldata"
            else message("a work object that stands still")
        )
        raise InputError(need, got, "Choose another name with --tool or --frame.", name)
    note = f" ! {'; '.join(provenance(answer))}"
    line_end = min((i for i in (text.find("\r", end), text.find("\n", end)) if i >= 0), default=len(text))
    text = replaced(text, end + 1, line_end, note) if not plain[end + 1 : line_end].strip() else text
    if kind == "wobjdata":
        if items[1].text.strip().upper() != "TRUE":
            raise InputError("a fixed user frame (ufprog TRUE)", "a moved one", "Name another.", name)
        text = replaced(text, items[4].position, items[4].position + len(items[4].text), _HERE)
    place = items[1 if kind == "tooldata" else 3]
    return replaced(text, place.position, place.position + len(place.text), _frame(pose))


EXPORT = program_export(
    "abb", "ABB RAPID: tooldata and wobjdata", ".sys", "  ! ", NamedSettings, _tool, _table,
    (["MODULE ScancellData(SYSMODULE)"], ["ENDMODULE"]), patched_by("abb", _put),
)  # fmt: skip
