"""What a robot's program says and is answered: one line or one small XML element in, one short line out.

    in   p07 -195.8 1363.305 524.812 -179.924 0.889 179.635     out  OK p07 good 0.71
    in   t03 {X 170.1,Y 1301.2,…} step=turntable table=45.0     out  NO arc too short, move 12 mm to -x
    in   done                                                  out  OK done 14 captures
    in   <Scancell Capture="p07"><Pose X="1" …/></Scancell>     out  <Answer Ok="1" Capture="p07" Zone="0.71" …/>

The pose stands as the brand writes it.  Everything is ASCII; a line out has 78 characters at most, since strings
of some controllers hold no more than 80.
"""

import re
from dataclasses import dataclass, field
from typing import Literal
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from calib_core.errors import CalibrationError, InputError
from calib_core.frames import RigidTransform
from calib_core.messages import message

LONGEST_MESSAGE = 2048
LONGEST_ANSWER = 78

_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_WORD = re.compile(r"\b(step|mount|table|tool|frame)=(\S+)", re.IGNORECASE)
_FIELDS = {"step": "step", "mount": "mount", "table": "table_deg", "tool": "active_tool", "frame": "active_frame"}
_ASCII = str.maketrans({"−": "-", "–": "-", "°": " deg", "…": "...", "’": "'", "±": "+-", "≥": ">="})


@dataclass(frozen=True)
class Message:
    """What a robot's program said.

    Parameters
    ----------
    action : {"capture", "done", "token"}
    capture : str
        The capture's id; of `token`, the token.
    pose : str
        As the brand writes it; empty where the robot's own source tells it.
    fields : dict
        Of the capture's record.
    xml : bool
        Whether it came as an element, and is answered as one.
    """

    action: Literal["capture", "done", "token"]
    capture: str = ""
    pose: str = ""
    fields: dict[str, str | float | int] = field(default_factory=dict[str, "str | float | int"])
    xml: bool = False


def next_message(received: bytes) -> tuple[str, bytes] | None:
    """Return the first whole message of what has come and the rest, or None where it is not whole yet.

    A line ends with CR, LF or both; an element with its own end, whatever follows.

    Raises
    ------
    InputError
        If it is longer than a message may be.
    """
    text = received.lstrip(b"\r\n\t \0")
    if text.startswith(b"<"):
        end = _end_of_element(text)
    else:
        found = re.search(rb"[\r\n]", text)
        end = found.start() if found else 0
    if max(end, 0 if end else len(text)) > LONGEST_MESSAGE:
        raise InputError("at most {longest} characters", "more", "Send one at a time.", longest=LONGEST_MESSAGE)
    return (text[:end].decode("ascii", errors="replace"), text[end:]) if end else None


def _end_of_element(text: bytes) -> int:
    """Return where the first element ends, 0 where it is not there whole."""
    name = re.match(rb"<([A-Za-z_][\w.-]*)", text)
    if name is None:
        found = re.search(rb"[\r\n>]", text)
        return found.end() if found else 0
    head = re.match(rb"<[^<>]*>", text)
    if head is None:
        return 0
    if head.group().endswith(b"/>"):
        return head.end()
    close = re.search(rb"</" + re.escape(name.group(1)) + rb"\s*>", text)
    return close.end() if close else 0


def parse_message(text: str) -> Message:
    """Return what a message says; raises InputError."""
    text = text.strip()
    if text.startswith("<"):
        return _parse_element(text)
    first, _, rest = text.partition(" ")
    if first.startswith("scancell_") and not rest.strip():
        return Message("token", first)
    if first.lower() == "done" and not rest.strip():
        return Message("done")
    fields = {name.lower(): value for name, value in _WORD.findall(rest)}
    return Message("capture", _capture_id(first), _WORD.sub(" ", rest).strip(), _record_fields(fields))


def _parse_element(text: str) -> Message:
    if "<!" in text or "<?" in text:
        raise _no_message(message("an element with a declaration"), xml=True)
    try:
        root = ElementTree.fromstring(text)  # no document type, so no entities of its own
    except ElementTree.ParseError as error:
        raise _no_message(message("XML that cannot be read ({error})", error=error), xml=True) from None
    told: dict[str, str] = {}
    pose = ""
    for element in root.iter():
        names = {name.lower(): value for name, value in element.attrib.items()}
        if {"x", "y", "z"} <= set(names):
            pose = " ".join(f"{name} {value}" for name, value in element.attrib.items())
        else:
            told |= names
        if element.text and element.text.strip() and element is not root:
            told[element.tag.lower()] = element.text.strip()
    if "token" in told:
        return Message("token", told["token"], xml=True)
    if told.get("done", "0").lower() in ("1", "true"):
        return Message("done", xml=True)
    pose = pose or told.get("pose", "")
    return Message("capture", _capture_id(told.get("capture", "")), pose, _record_fields(told), xml=True)


def _capture_id(text: str) -> str:
    if not _ID.fullmatch(text):
        raise _no_message(repr(text[:30]))
    return text


def _record_fields(told: dict[str, str]) -> dict[str, str | float | int]:
    fields: dict[str, str | float | int] = {}
    for name, value in told.items():
        if name not in _FIELDS:
            continue
        try:
            fields[_FIELDS[name]] = float(value) if name == "table" else int(value)
        except ValueError:
            if name == "table":
                raise InputError("table=ANGLE in degrees", repr(value[:20]), "Send it as 123.456.") from None
            fields[_FIELDS[name]] = value
    return fields


def pose_of(sent: Message, convention: str) -> tuple[list[float], RigidTransform] | None:
    """Return a message's pose as numbers and as a transform, None where it has none; raises InputError."""
    from calib_core.robots import parse_pose_lines

    if not sent.pose:
        return None
    rows = parse_pose_lines(convention, sent.pose.replace('"', " "))
    if len(rows) != 1 or rows[0].numbers is None or rows[0].pose is None:
        got = rows[0].problem if len(rows) == 1 and rows[0].problem else message("no pose")
        to_do = "Send the flange's pose in the base."
        raise InputError("a pose as {convention} writes it", got, to_do, convention=convention)
    return rows[0].numbers, rows[0].pose


@dataclass(frozen=True)
class Answer:
    """What the robot's program is answered: whether it may go on, and a few words."""

    ok: bool
    text: str
    capture: str = ""
    zone: float | None = None

    def line(self) -> str:
        """Return the answer as one line without its end."""
        zone = f" {self.zone:.2f}" if self.zone is not None else ""
        words = f"{self.capture} {self.text}{zone}" if self.capture and self.ok else self.text
        return f"{'OK' if self.ok else 'NO'} {words}"[:LONGEST_ANSWER].rstrip()

    def element(self) -> str:
        """Return the answer as one element without its end of line."""
        told = {"Ok": "1" if self.ok else "0", "Capture": self.capture, "Text": self.text[:LONGEST_ANSWER]}
        told |= {} if self.zone is None else {"Zone": f"{self.zone:.2f}"}
        return f"<Answer {' '.join(f'{name}={quoteattr(value)}' for name, value in told.items() if value)}/>"

    def to_bytes(self, xml: bool) -> bytes:
        """Return the answer as it is sent."""
        return f"{self.element() if xml else self.line()}\r\n".encode("ascii", errors="replace")


def refusal(error: CalibrationError, capture: str = "") -> Answer:
    """Return why something was not done, in short: what was there instead, and what to do."""
    to_do = error.to_do[:1].lower() + error.to_do[1:].rstrip(".")
    return Answer(False, plain(f"{error.got}, {to_do}"), capture)


def plain(text: str) -> str:
    """Return text in ASCII."""
    return " ".join(text.translate(_ASCII).encode("ascii", errors="replace").decode().split())


def _no_message(got: str, xml: bool = False) -> InputError:
    to_do = message("Send Capture and Pose") if xml else message("Send p07 X Y Z A B C, or done")
    return InputError("a capture's name and its pose", got, to_do)
