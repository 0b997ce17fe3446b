"""Universal Robots: set_tcp and a feature in a script; the TCP of an installation."""

import gzip
import re

from pydantic import Field

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.entry import Settings
from calib_core.exports.writing import (
    Name,
    Part,
    as_bytes_kept,
    fixed,
    only_match,
    program_export,
    provenance,
    put_back,
    replaced,
    table_pose,
    tool_pose,
    wanted,
)
from calib_core.robots.ur.reader import find
from calib_core.robots.xml_file import is_gzip, unzipped


class UrSettings(Settings):
    """What the turntable's feature is called; which TCP of an installation is changed, where it has several."""

    tool: str = Field(default="", max_length=64)
    frame: Name = "turntable"
    part: Part | None = None


def _list(pose: list[float]) -> str:
    return ", ".join(fixed(v, 12 if i < 3 else 14) for i, v in enumerate(pose))


def _tool(answer: Answer, settings: UrSettings) -> list[str]:
    return [f"set_tcp(p[{_list(tool_pose(answer, 'ur'))}])"]


def _table(answer: Answer, settings: UrSettings) -> list[str]:
    return [f"global {settings.frame}=p[{_list(table_pose(answer, 'ur'))}]"]


def patch(backup: bytes, answer: Answer, settings: UrSettings) -> bytes:
    """Return a script or an installation with its TCP changed; an installation stays packed as it was."""
    wanted(answer, settings.part, "tool")
    packed = is_gzip(backup)
    plain = unzipped(backup, "into")
    text, encoding = as_bytes_kept(plain)
    numbers = _list(tool_pose(answer, "ur"))
    if plain.lstrip()[:1] == b"<":
        new = put_back(_in_installation(text, plain, settings.tool, numbers), encoding)
    else:
        call = r"^[^#\r\n]*?\bset_tcp\s*\(\s*p\s*\[([^\]\r\n]*)\][ \t]*\)([^\r\n]*)"
        literal = only_match(call, text, "set_tcp(p[…])")
        kept = re.sub(r"[ \t]*# (?:NOT TO BE USED|scancell).*", "", literal[2])
        noted = f"{kept} # {'; '.join(provenance(answer))}"
        text = replaced(text, literal.start(2), literal.end(2), noted)
        new = put_back(replaced(text, literal.start(1), literal.end(1), numbers), encoding)
    return gzip.compress(new, mtime=0) if packed else new


def _in_installation(text: str, plain: bytes, name: str, numbers: str) -> str:
    tools = find(plain, "into").tools
    chosen = [i for i, tool in enumerate(tools) if not name or tool.name == name]
    places = list(re.finditer(r"<(?:\w+:)?\w*tcp\w*\b[^<>]*>([^<>]*,[^<>]*)<", text, re.IGNORECASE))
    places = [place for place in places if place[1].count(",") == 5]
    if len(chosen) != 1 or len(places) != len(tools):
        names = ", ".join(str(tool.name) for tool in tools) or "none"
        raise InputError("one TCP of the installation", f"these: {names}", "Name one with --tool.", "into")
    place = places[chosen[0]]
    return replaced(text, place.start(1), place.end(1), numbers)


EXPORT = program_export(
    "ur", "Universal Robots: set_tcp (script), TCP of an installation", ".script", "# ", UrSettings, _tool, _table,
    patch=patch,
)  # fmt: skip
