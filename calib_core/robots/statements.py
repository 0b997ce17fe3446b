"""Readers of brands whose programs say one thing a line: a pose, joints, a tool, a frame, or which is active."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from calib_core.messages import explained, message
from calib_core.robots.controller_file import Found, Frame, Reference, Taught
from calib_core.robots.phrases import of_line, require_count
from calib_core.robots.text import numbers, source_of, without_comments

VALUES = r"(?P<values>[-+.\d eE,]+)"
"""Of a rule: numbers with commas between."""

Kind = Literal["pose", "joints", "tool", "frame", "use-tool", "use-frame", "move"]


@dataclass(frozen=True)
class Rule:
    """What a line that matches holds.

    Parameters
    ----------
    kind : str
    pattern : str
        A regular expression, matched anywhere in a line without its comment, with the groups `values` (numbers
        with commas between), `name` (of a position, or of the one that a move goes to), and `tool` or `frame`
        where they stand in the line itself.
    """

    kind: Kind
    pattern: str


def find_by_rules(
    data: bytes, name: str, convention: str, rules: Sequence[Rule], comment: str, heads: str
) -> Found:
    """Return what stands in a program.

    Parameters
    ----------
    data, name
        Of the file.
    convention : str
        Of its poses.
    rules : sequence of Rule
        Tried in this order; each line obeys the first that matches.
    comment : str
        What comments begin with.
    heads : str
        A regular expression of what lines with a pose, tool or frame begin with: those that no rule reads are
        skipped aloud.
    """
    source = source_of(data, name)
    found = Found(name)
    tool: Reference | None = None
    frame: Reference | None = None
    compiled = [(rule.kind, re.compile(rule.pattern, re.IGNORECASE)) for rule in rules]
    wanted = re.compile(heads, re.IGNORECASE)
    for line, content in enumerate(without_comments(source.text, comment).split("\n"), start=1):
        if not content.strip():
            continue
        kind, match = next(((k, m) for k, pattern in compiled if (m := pattern.search(content))), (None, None))
        if match is None:
            if wanted.search(content):
                found.skip(
                    line,
                    message(
                        "'{content}' cannot be read: a name, a calculation, or a cut line",
                        content=content.strip()[:60],
                    ),
                )
            continue
        groups = match.groupdict()
        if kind == "use-tool":
            tool = _reference(groups.get("tool"))
        elif kind == "use-frame":
            frame = _reference(groups.get("frame"))
        elif kind == "move":
            found.want(groups["name"], line)
        else:
            try:
                taken = _taken(kind or "", groups, convention, line, found)
            except ValueError as error:
                found.skip(line, explained(f"{groups.get('name') or kind}", error), groups.get("name") or "")
                continue
            if taken is not None and kind == "tool":
                tool = taken
            elif taken is not None and kind == "frame":
                frame = taken
            elif kind == "pose":
                _place(found, groups, tool, frame)
    return found


def _taken(kind: str, groups: dict[str, str], convention: str, line: int, found: Found) -> Reference | None:
    """Take a pose, joints, tool or frame; return the tool or frame where the line makes it the active one."""
    values = numbers(groups["values"].strip().rstrip(","))
    name = (groups.get("name") or f"line {line}").strip()
    require_count(values[:6], 6)
    if kind in ("tool", "frame"):
        given = groups.get("number")
        number: Reference = int(given) if given else of_line(kind == "tool", line)
        entry = Frame(number, None if given else str(number), values[:6], convention, line, found.file)
        (found.tools if kind == "tool" else found.frames).append(entry)
        return None if given else number
    external = {f"E{i}": v for i, v in enumerate(values[6:], start=1)} or None
    if kind == "joints":
        found.poses.append(Taught(name, None, convention, line, values[:6], external, file=found.file))
    else:
        found.poses.append(Taught(name, values[:6], convention, line, None, external, file=found.file))
    return None


def _place(found: Found, groups: dict[str, str], tool: Reference | None, frame: Reference | None) -> None:
    own_tool, own_frame = _reference(groups.get("tool")), _reference(groups.get("frame"))
    found.poses[-1] = replace(
        found.poses[-1],
        tool=tool if own_tool is None else own_tool,
        frame=frame if own_frame is None else own_frame,
    )


def _reference(text: str | None) -> Reference | None:
    stripped = (text or "").strip()
    return int(stripped) if stripped.isdigit() else stripped or None
