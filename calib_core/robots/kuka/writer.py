"""KUKA: TOOL_DATA and BASE_DATA for $config.dat, alone or patched into one."""

import re

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.writing import (
    NumberedSettings,
    as_bytes_kept,
    fixed,
    mark,
    only_match,
    program_export,
    provenance,
    put_back,
    replaced,
    table_pose,
    tool_pose,
    wanted,
)

_NAMES = "XYZABC"


def _list(pose: list[float]) -> str:
    texts = (f"{n} {fixed(v, 9 if n in 'XYZ' else 11)}" for n, v in zip(_NAMES, pose, strict=True))
    return "{" + ",".join(texts) + "}"


def _tool(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [
        f"TOOL_DATA[{settings.tool}]={_list(tool_pose(answer, 'kuka'))}",
        f"TOOL_TYPE[{settings.tool}]=#BASE",
        f'TOOL_NAME[{settings.tool},]="{mark(answer, 24)}"',
    ]


def _table(answer: Answer, settings: NumberedSettings) -> list[str]:
    return [
        f"BASE_DATA[{settings.frame}]={_list(table_pose(answer, 'kuka'))}",
        f"BASE_TYPE[{settings.frame}]=#BASE",
    ]


def patch(backup: bytes, answer: Answer, settings: NumberedSettings) -> bytes:
    """Return a $config.dat with the entry changed; load data and all else stay as they are."""
    text, encoding = as_bytes_kept(backup)
    with_tool, with_table = wanted(answer, settings.part, "tool")
    if with_tool:
        kind = re.search(rf"^[ \t]*TOOL_TYPE\[\s*{settings.tool}\s*\]\s*=\s*#(\w+)", text, re.M | re.I)
        if kind and kind[1].upper() == "TCP":
            to_do = "Choose another tool with --tool: this one stands still beside the robot."
            raise InputError("a tool on the flange", f"TOOL_TYPE[{settings.tool}]=#TCP", to_do, "tool")
        if kind and kind[1].upper() == "NONE":  # of a slot that nothing was in: it could not be selected
            text = replaced(text, kind.start(1), kind.end(1), "BASE")
        text = _put(text, "TOOL_DATA", settings.tool, _list(tool_pose(answer, "kuka")), answer)
    if with_table:
        text = _put(text, "BASE_DATA", settings.frame, _list(table_pose(answer, "kuka")), answer)
    return put_back(text, encoding)


def _put(text: str, variable: str, index: int, value: str, answer: Answer) -> str:
    pattern = (
        rf"^[ \t]*(?:\w+[ \t]+)*\$?{variable}\[[ \t]*{index}[ \t]*\][ \t]*=[ \t]*(\{{[^{{}}\r\n]*\}})([^\r\n]*)"
    )
    found = only_match(pattern, text, f"{variable}[{index}]")
    note = f" ; {'; '.join(provenance(answer))}"
    return replaced(text, found.start(1), found.end(2), value + note)


EXPORT = program_export(
    "kuka",
    "KUKA: TOOL_DATA and BASE_DATA ($config.dat)",
    ".dat",
    "; ",
    NumberedSettings,
    _tool,
    _table,
    patch=patch,
)
