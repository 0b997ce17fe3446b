"""FANUC: a TP program that sets UTOOL and UFRAME from a position register; entries of a .va listing."""

import re

from pydantic import Field

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export
from calib_core.exports.patching import patched_by, replaced
from calib_core.exports.writing import NumberedSettings, fixed, frames_written, provenance, remarks
from calib_core.messages import message

_NAMES = "XYZWPR"


class FanucSettings(NumberedSettings):
    """Which tool and user frame are written, by way of which position register, which it overwrites."""

    position_register: int = Field(default=99, ge=1, le=999)


def write(answer: Answer, settings: FanucSettings) -> str:
    """Return a TP program as a listing; the controller's ASCII option or its PC tool loads it."""
    steps: list[str] = []
    for line in provenance(answer):
        steps += [f"  !{piece}" for piece in remarks(line)]
    for one in frames_written(answer, settings, "fanuc", "both"):
        steps += [f"  !{piece}" for piece in remarks(one.note)] if one.note else []
        target = f"UTOOL[{one.settings.tool}]" if one.kind == "tool" else f"UFRAME[{one.settings.frame}]"
        steps += _assignments(settings.position_register, one.pose, target)
    numbered = [f"{i:4d}:{step} ;" for i, step in enumerate(steps, start=1)]
    comment = "DO NOT USE" if answer.faults else "scancell"
    head = ["/PROG  SCANCELL", "/ATTR", f'COMMENT\t\t= "{comment}";', "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    return "\r\n".join([*head, *numbered, "/POS", "/END"]) + "\r\n"


def _assignments(register: int, pose: list[float], target: str) -> list[str]:
    steps = [f"  PR[{register}]=LPOS"]
    for i, value in enumerate(pose, start=1):
        text = fixed(value, 3)
        steps.append(f"  PR[{register},{i}]={f'({text})' if text.startswith('-') else text}")
    return [*steps, f"  {target}=PR[{register}]"]


def _put(text: str, which: str, pose: list[float], settings: FanucSettings, answer: Answer) -> str:
    """Return a .va listing with the numbers of one frame changed."""
    variable, index = "MNUTOOL" if which == "tool" else "MNUFRAME", getattr(settings, which)
    what = f"${variable}[1,{index}]"
    head = re.search(rf"^\[\*SYSTEM\*\]\${variable}\b[^\r\n]*", text, re.MULTILINE)
    begin = re.compile(rf"^[ \t]*\[[ \t]*1[ \t]*,[ \t]*{index}[ \t]*\][ \t]*=", re.MULTILINE)
    entry = begin.search(text, head.end()) if head else None
    following = re.compile(r"^[ \t]*\[", re.MULTILINE)
    limit = re.compile(r"^\[\*", re.MULTILINE).search(text, head.end()) if head else None
    if head is None or entry is None or (limit and limit.start() < entry.start()):
        need = "{what} in the backup"
        raise InputError(need, "none", "Give sysframe.va, or name another frame.", "into", what=what)
    after = following.search(text, entry.end())
    end = after.start() if after else len(text)
    for name, value in reversed(list(zip(_NAMES, pose, strict=True))):
        number = re.compile(rf"\b{name}[ \t]*:[ \t]*([-+.\d]+)").search(text, entry.end(), end)
        if number is None:
            to_do = message("Set the frame on the pendant once, and save the backup again.")
            raise InputError("numbers in {what}", "an entry that is not set", to_do, "into", what=what)
        new = fixed(value, 3).rjust(number.end(1) - number.start(1))
        text = replaced(text, number.start(1), number.end(1), new)
        end += len(new) - (number.end(1) - number.start(1))
    return text


EXPORT = Export(
    "fanuc",
    "FANUC: UTOOL and UFRAME (TP program)",
    "text/plain",
    ".ls",
    write,
    FanucSettings,
    "fanuc",
    patched_by("fanuc", _put),
)
