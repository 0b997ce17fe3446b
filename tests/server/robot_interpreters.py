"""Interpreters of what the robot programs use of their languages: the text itself runs; what is unknown fails.

No interpreter or emulator of these languages is to be had as a package.  Each program is rewritten line by line
into Python, and runs against a controller: a simulated arm, an operator who lets it go on, and sockets.
"""

import re
import socket
import xml.etree.ElementTree as ElementTree
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from calib_core.frames import RigidTransform
from calib_core.robots import parse_pose, to_pose


class Controller(ABC):
    """What a program's words act on."""

    def __init__(self) -> None:
        self.starts = self.refused = 0
        self.shown: list[str] = []
        self._socket: socket.socket | None = None
        self._received = b""

    @abstractmethod
    def move(self, base_from_tool0: RigidTransform) -> None:
        """Go there in a straight line and arrive."""

    @abstractmethod
    def where(self) -> RigidTransform:
        """Return where the flange is."""

    def operator(self) -> None:
        """The operator lets the program go on."""
        self.starts += 1

    def connect(self, host: str, port: int) -> bool:
        self._socket = socket.create_connection((host, port), timeout=20)
        return True

    def send(self, content: bytes) -> None:
        assert self._socket is not None
        self._socket.sendall(content)

    def receive(self, end: bytes) -> bytes:
        """Return what came up to and with `end`."""
        assert self._socket is not None
        while end not in self._received:
            more = self._socket.recv(500)
            assert more, "the workbench has hung up"
            self._received += more
        found, _, self._received = self._received.partition(end)
        return found + end

    def line(self) -> str:
        text = self.receive(b"\n").decode("ascii").strip()
        assert len(text) <= 80, text
        self.shown.append(text)
        return text

    def disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


Rule = tuple[str, str | Callable[[re.Match[str]], str]]


def run(text: str, rules: list[Rule], opens: str, closes: str, words: dict[str, Any], entry: str) -> None:
    """Rewrite each line by the first rule that fits it, indented by the blocks it is in, and run `entry`."""
    depth, python = 0, []
    for line in filter(None, map(str.strip, text.splitlines())):
        for pattern, by in rules:
            if (found := re.fullmatch(pattern, line)) is not None:
                new = by(found) if callable(by) else found.expand(by)
                break
        else:
            raise SyntaxError(f"no word of the language: {line}")
        if re.match(closes, line):
            depth -= 1
        python.append("    " * depth + (new or "pass"))
        if re.match(opens, line):
            depth += 1
            python.append("    " * depth + "pass")
    assert depth == 0, text
    exec("\n".join(python), words)
    words[entry]()


def outside_strings(text: str, change: Callable[[str], str]) -> str:
    """Return a text whose parts outside of double quotes are changed."""
    return "".join(p if p.startswith('"') else change(p) for p in re.split(r'("[^"]*")', text))


def run_urscript(files: Mapping[str, str], robot: Controller) -> None:
    rules: list[Rule] = [
        (r"#.*", ""),
        (r"end|halt", ""),
        (r"(def \w+\(.*\):|(el)?if .*:|else:|while .*:)", lambda m: outside_strings(m[0], _urscript_words)),
        (r"(scancell_captures\(\))", ""),
        (r"((\w+ = )?\w+\(.*\))", lambda m: outside_strings(m[0], _urscript_words)),
    ]
    words = {
        "pose": lambda *numbers: list(numbers),
        "set_tcp": lambda offset: _require(not any(offset)),
        "socket_open": lambda host, port, name: robot.connect(host, port),
        "socket_close": lambda name: robot.disconnect(),
        "socket_send_line": lambda text, name: robot.send(f"{text}\n".encode()),
        "socket_read_line": lambda name, timeout: robot.line(),
        "str_find": lambda text, wanted: text.find(wanted),
        "to_str": lambda pose: f"p[{', '.join(f'{v:.7g}' for v in pose)}]",
        "get_actual_tool_flange_pose": lambda: to_pose("ur", robot.where()),
        "movel": lambda target, a, v: robot.move(parse_pose("ur", _slow(target, v, 0.25))),
        "textmsg": lambda text: None,
        "sleep": lambda seconds: None,
        "popup": lambda text, title, blocking, **kind: _popup(robot, text, kind),
    }
    run(files["scancell.script"], rules, r"def |if |while ", r"end$", words, "scancell_captures")


def _urscript_words(text: str) -> str:
    return re.sub(r"p\[([^\]]*)\]", r"pose(\1)", text)


def _popup(robot: Controller, text: str, kind: Mapping[str, bool]) -> None:
    if kind.get("warning") or kind.get("error"):
        robot.refused += 1
    else:
        robot.operator()


def run_rapid(files: Mapping[str, str], robot: Controller) -> None:
    rules: list[Rule] = [
        (r"!.*|MODULE \w+|ENDMODULE|ENDPROC|ENDIF", ""),
        (r"VAR (string|robtarget|socketdev) (\w+);", r"\2 = None"),
        (r"CONST (?:robtarget|speeddata) (\w+):=(.*);", r"\1 = \2"),
        (r"PROC (\w+)\((?:string )?(\w*)\)", r"def \1(\2):"),
        (r"IF (.*)<>(.*) THEN", r"if \1 != \2:"),
        (r"SocketReceive cell\\Str:=(\w+)\\Time:=(\d+);", r"\1 = SocketReceive(\2)"),
        (r"(\w+):=(.*);", lambda m: f"{m[1]} = {_rapid_call(m[2])}"),
        (r"(\w+)(\\?.*);", lambda m: f"{m[1]}({_rapid_arguments(m[2])})"),
    ]
    words = {
        "ConfL": lambda Off: None, "SocketCreate": lambda device: None,
        "SocketClose": lambda device: robot.disconnect(),
        "SocketConnect": lambda device, host, port: robot.connect(host, port),
        "SocketSend": lambda device, Str: robot.send(_rapid_bytes(Str)),
        "SocketReceive": lambda seconds: robot.line(),
        "TPWrite": lambda text: None, "WaitTime": lambda seconds, InPos: None,
        "Stop": lambda: _stop(robot), "StrMatch": lambda text, start, wanted: text.find(wanted, start - 1) + 1,
        "NumToStr": lambda value, digits: f"{value:.{digits}f}",
        "CRobT": lambda Tool, WObj: _robtarget(robot.where()),
        "MoveL": lambda at, speed, zone, tool, WObj: robot.move(
            parse_pose("abb", _slow([*at[0], *at[1]], speed[0], 250))
        ),
        "fine": None, "tool0": None, "wobj0": None,
    }  # fmt: skip
    run(files["Scancell.mod"], rules, r"PROC |IF ", r"ENDPROC|ENDIF", words, "ScancellCaptures")


def _rapid_arguments(text: str) -> str:
    found = [part for part in re.split(r",(?![^\[(]*[\])])", outside_strings(text, _rapid_words).strip()) if part]
    named = [part for part in found if re.match(r"\s*\w+=", part)]
    return ", ".join([part for part in found if part not in named] + named)


def _rapid_words(text: str) -> str:
    return re.sub(r"\\(\w+)", r",\1=True", re.sub(r"\\(\w+):=", r",\1=", text))


def _rapid_call(text: str) -> str:
    name, _, rest = text.partition("(")
    return f"{name}({_rapid_arguments(rest.removesuffix(')'))})"


def _rapid_bytes(text: str) -> bytes:
    assert len(text) <= 80, text
    return text.replace("\0D", "\r").replace("\0A", "\n").encode("ascii")


def _robtarget(pose: RigidTransform) -> SimpleNamespace:
    x, y, z, *q = to_pose("abb", pose)
    rot = SimpleNamespace(**{f"q{k + 1}": value for k, value in enumerate(q)})
    return SimpleNamespace(trans=SimpleNamespace(x=x, y=y, z=z), rot=rot)


def _stop(robot: Controller) -> None:
    if robot.shown and not robot.shown[-1].startswith("OK"):
        robot.refused += 1
    robot.operator()


def run_krl(files: Mapping[str, str], robot: Controller) -> None:
    eki = _Eki(ElementTree.fromstring(files["Scancell.xml"]), robot)
    rules: list[Rule] = [
        (r"&ACCESS RVP|;.*|END|ENDIF|ENDFOR|DECL (EKI_STATUS|INT|FRAME|CHAR) [\w,]+(\[\])?|BAS\(#INITMOV,0\)", ""),
        (r"DECL CHAR (\w+)\[(\d+)\]", r"\1 = [0] * (\2 + 1)"),
        (r"DEF (\w+)\( \)", r"def \1():"),
        (r"DEF (\w+)\((\w+)\[\]:IN\)", r"def \1(\2):"),
        (r"\$(TOOL|BASE)=\$NULLFRAME", r"base_and_tool.add('\1')"),
        (r"\$VEL\.CP=([\d.]+)", r"slow(\1)"),
        (r"\$APO\.CDIS=0|WAIT SEC [\d.]+", ""),
        (r"LIN \{(.*)\}", lambda m: "move(dict(" + re.sub(r"([XYZABC]) ", r"\1=", m[1]) + "))"),
        (r"HALT", "halt()"),
        (r"WAIT FOR \$FLAG\[(\d+)\]", r"wait_for_flag(\1)"),
        (r"\$FLAG\[2\]=FALSE", ""),
        (r"AT=\$POS_ACT", "AT = where()"),
        (r"FOR (\w+)=1 TO (\d+)", r"for \1 in range(1, \2 + 1):"),
        (r"(TEXT\[I\])=0", r"\1 = 0"),
        (r"IF OK<>1 THEN", "if OK != 1:"),
        (r"OK=0", "OK = 0"),
        (r'RET=EKI_GetInt\("Scancell",("[^"]+"),OK\)', r"OK = int(EKI_Get(\1))"),
        (r'RET=EKI_GetString\("Scancell",("[^"]+"),TEXT\[\]\)', r"TEXT = EKI_Get(\1)"),
        (r'RET=EKI_(Init|Open|Close|Clear)\("Scancell"\)', r"EKI_\1()"),
        (
            r'RET=EKI_(Set|Send)(?:String|Real|Int)?\("Scancell",(.*)\)',
            lambda m: f"EKI_{m[1]}({_no_brackets(m[2])})",
        ),
        (r"(MsgNotify|SCANCELL_\w+)\((.*)\)", lambda m: f"{m[1]}({_no_brackets(m[2]).strip()})"),
    ]  # fmt: skip
    words: dict[str, Any] = {
        "base_and_tool": (flange := set[str]()), "slow": lambda v: _slow([], v, 0.25), "halt": robot.operator,
        "move": lambda at: robot.move(parse_pose("kuka", [at[name] for name in "XYZABC"])),
        "where": lambda: SimpleNamespace(**dict(zip("XYZABC", to_pose("kuka", robot.where()), strict=True))),
        "wait_for_flag": eki.wait, "EKI_Get": eki.values.__getitem__, "EKI_Set": eki.set, "EKI_Send": eki.send,
        "EKI_Init": lambda: None, "EKI_Open": eki.open, "EKI_Close": robot.disconnect, "EKI_Clear": lambda: None,
        "MsgNotify": lambda text: setattr(robot, "refused", robot.refused + 1),
    }  # fmt: skip
    run(files["scancell.src"], rules, r"DEF |IF |FOR ", r"END", words, "SCANCELL")
    assert flange == {"TOOL", "BASE"}


def _no_brackets(arguments: str) -> str:
    return arguments.replace("[]", "")


class _Eki:
    """EthernetKRL as its configuration describes it."""

    def __init__(self, configuration: ElementTree.Element, robot: Controller) -> None:
        self._robot = robot
        self._host = configuration.findtext(".//EXTERNAL/IP") or ""
        self._port = int(configuration.findtext(".//EXTERNAL/PORT") or 0)
        self._sent = [one.get("Tag", "") for one in configuration.findall("SEND/XML/ELEMENT")]
        received = configuration.findall("RECEIVE/XML/ELEMENT")
        self._received = [one.get("Tag", "") for one in received]
        self._flags = {int(one.get("Set_Flag", 0)): one.get("Tag", "") for one in received if one.get("Set_Flag")}
        self._elements: dict[str, ElementTree.Element] = {}
        self.values: dict[str, str] = {}

    def open(self) -> None:
        self._robot.connect(self._host, self._port)

    def set(self, path: str, value: object) -> None:
        assert path in self._sent, path
        *names, attribute = path.split("/")
        at = self._elements.setdefault(names[0], ElementTree.Element(names[0]))
        for name in names[1:]:
            found = at.find(name)
            at = ElementTree.SubElement(at, name) if found is None else found
        at.set(attribute.removeprefix("@"), f"{value:.6f}" if isinstance(value, float) else str(value))

    def send(self, name: str) -> None:
        self._robot.send(ElementTree.tostring(self._elements[name], short_empty_elements=False))

    def wait(self, flag: int) -> None:
        """Take the next element; its end sets the flag that the configuration names."""
        answer = ElementTree.fromstring(self._robot.receive(b">").decode("ascii"))
        assert answer.tag == self._flags[flag]
        for path in self._received:
            _, _, attribute = path.partition("/@")
            if attribute:
                self.values[path] = answer.attrib[attribute]
        assert len(self.values["Answer/@Text"]) <= 80
        self._robot.shown.append("OK" if self.values["Answer/@Ok"] == "1" else "NO")


def _slow(numbers: list[float], speed: float, most: float) -> list[float]:
    assert 0 < speed <= most
    return numbers


def _require(is_so: bool) -> None:
    assert is_so


INTERPRETERS: dict[str, Callable[[Mapping[str, str], Controller], None]] = {
    "krl": run_krl, "rapid": run_rapid, "urscript": run_urscript,
}  # fmt: skip
