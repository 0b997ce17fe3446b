"""KUKA: TOOL_DATA and BASE_DATA for $config.dat, alone or patched into one."""

import re

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.patching import only_match, patched_by, replaced
from calib_core.exports.writing import NumberedSettings, fixed, mark, program_export, provenance
from calib_core.messages import message

_NAMES = "XYZABC"


def _list(pose: list[float]) -> str:
    texts = (f"{n} {fixed(v, 9 if n in 'XYZ' else 11)}" for n, v in zip(_NAMES, pose, strict=True))
    return "{" + ",".join(texts) + "}"


def _tool(pose: list[float], settings: NumberedSettings, answer: Answer) -> list[str]:
    return [
        f"TOOL_DATA[{settings.tool}]={_list(pose)}",
        f"TOOL_TYPE[{settings.tool}]=#BASE",
        f'TOOL_NAME[{settings.tool},]="{mark(answer, 24)}"',
    ]


def _table(pose: list[float], settings: NumberedSettings, answer: Answer) -> list[str]:
    return [f"BASE_DATA[{settings.frame}]={_list(pose)}", f"BASE_TYPE[{settings.frame}]=#BASE"]


def _put(text: str, what: str, pose: list[float], settings: NumberedSettings, answer: Answer) -> str:
    """Return a $config.dat with the entry changed; load data and all else stay as they are."""
    variable, index = "TOOL_DATA" if what == "tool" else "BASE_DATA", getattr(settings, what)
    if what == "tool":
        text = _selectable(text, index)
    pattern = (
        rf"^[ \t]*(?:\w+[ \t]+)*\$?{variable}\[[ \t]*{index}[ \t]*\][ \t]*=[ \t]*(\{{[^{{}}\r\n]*\}})([^\r\n]*)"
    )
    found = only_match(pattern, text, f"{variable}[{index}]")
    note = f" ; {'; '.join(provenance(answer))}"
    return replaced(text, found.start(1), found.end(2), _list(pose) + note)


def _selectable(text: str, tool: int) -> str:
    """Return a $config.dat in which a tool can be selected; refuses one that stands beside the robot."""
    kind = re.search(rf"^[ \t]*TOOL_TYPE\[\s*{tool}\s*\]\s*=\s*#(\w+)", text, re.M | re.I)
    if kind and kind[1].upper() == "TCP":
        to_do = message("Choose another tool with --tool: this one stands still beside the robot.")
        raise InputError("a tool on the flange", "TOOL_TYPE[{tool}]=#TCP", to_do, "tool", tool=tool)
    if kind and kind[1].upper() == "NONE":  # of a slot that nothing was in: it could not be selected
        return replaced(text, kind.start(1), kind.end(1), "BASE")
    return text


EXPORT = program_export(
    "kuka", "KUKA: TOOL_DATA and BASE_DATA ($config.dat)", ".dat", "; ", NumberedSettings, _tool, _table,
    patch=patched_by("kuka", _put),
)  # fmt: skip
