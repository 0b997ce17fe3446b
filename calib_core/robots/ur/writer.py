"""Universal Robots: set_tcp and a feature in a script; the TCP of an installation."""

import re

from pydantic import Field

from calib_core.errors import InputError
from calib_core.exports.answer import Answer
from calib_core.exports.patching import as_bytes_kept, only_match, put_back, replaced
from calib_core.exports.writing import (
    Name,
    NamedSettings,
    fixed,
    program_export,
    provenance,
    require_one_scanner,
    tool_pose,
    wanted,
)
from calib_core.formats.shared.xml_file import elements, gzipped_as, is_gzip, unzipped
from calib_core.messages import message
from calib_core.robots.ur.packed import tcps, with_tcp


class UrSettings(NamedSettings):
    """What the features are called; which TCP of an installation is changed, where it has several."""

    tool: str = Field(default="", max_length=64)
    frame: Name = "turntable"
    scanner_frame: Name = "scanner"


def _list(pose: list[float]) -> str:
    return ", ".join(fixed(v, 12 if i < 3 else 14) for i, v in enumerate(pose))


def _tool(pose: list[float], settings: UrSettings, answer: Answer) -> list[str]:
    return [f"set_tcp(p[{_list(pose)}])"]


def _table(pose: list[float], settings: UrSettings, answer: Answer) -> list[str]:
    return [f"global {settings.frame}=p[{_list(pose)}]"]


def patch(backup: bytes, answer: Answer, settings: UrSettings) -> bytes:
    """Return a script or an installation with its TCP changed; an installation stays packed as it was."""
    wanted(answer, settings.part, "tool")
    require_one_scanner(answer, settings)
    plain = unzipped(backup, "into")
    numbers = _list(tool_pose(answer, "ur"))
    if plain.lstrip()[:1] == b"<":
        new = _in_installation(plain, settings.tool, numbers)
        return gzipped_as(backup, new) if is_gzip(backup) else new
    text, encoding = as_bytes_kept(plain)
    call = r"^[^#\r\n]*?\bset_tcp\s*\(\s*p\s*\[([^\]\r\n]*)\][ \t]*\)([^\r\n]*)"
    literal = only_match(call, text, "set_tcp(p[…])")
    kept = re.sub(r"[ \t]*# (?:NOT TO BE USED|scancell).*", "", literal[2])
    noted = f"{kept} # {'; '.join(provenance(answer))}"
    text = replaced(text, literal.start(2), literal.end(2), noted)
    new = put_back(replaced(text, literal.start(1), literal.end(1), numbers), encoding)
    return gzipped_as(backup, new) if is_gzip(backup) else new


def _in_installation(plain: bytes, name: str, numbers: str) -> bytes:
    known = tcps(elements(plain, "into"))
    chosen = [tcp for tcp in known if not name or tcp.name == name]
    if len(chosen) != 1:
        names = ", ".join(tcp.name for tcp in known)
        got = message("these: {names}", names=names) if known else message("none")
        raise InputError("one TCP of the installation", got, "Name one with --tool.", "into")
    new = with_tcp(plain, chosen[0], numbers)
    after = [] if new is None else [(tcp.name, tcp.text) for tcp in tcps(elements(new, "into"))]
    if new is None or after != [(tcp.name, numbers if tcp is chosen[0] else tcp.text) for tcp in known]:
        got = message("another layout in line {line}", line=chosen[0].element.line)
        raise InputError("the TCP's numbers in its element", got, "Enter the TCP on the pendant.", "into")
    return new


EXPORT = program_export(
    "ur", "Universal Robots: set_tcp (script), TCP of an installation", ".script", "# ", UrSettings, _tool, _table,
    patch=patch,
)  # fmt: skip
