"""Odd invocations of the command line: what people, scripts and broken disks come up with."""

import contextlib
import io
import itertools
import json
import os
import random
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calib_core.simulation import simulate
from server.cli import main

GOOD, NOT_ACCEPTED, BAD = 0, 1, 2
DIGITS = "9" * 5000
_EDITS: dict[str, Any] = {
    "cell.robot.position_sigma_mm": [1e9, -1, 0, "NaN", None, "x", 1e308, True, []],
    "cell.robot.orientation_sigma_deg": [1e9, -1e-300, "1e999", {}],
    "cell.scanner.point_sigma_mm": [1e9, 1e-300, -0.1, "\u0000"],
    "cell.sphere_diameter_mm": [1e9, 0, -40, 1e-9, "\u202e40", [40]],
    "cell.sphere_diameter_sigma_mm": [1e9, -1, 1e-300],
    "cell.pose_convention": ["klingon", "", "\x1b[31m", 7, None, "abb\n", "\u0000"],
    "cell.known": [{"tool0_from_laser": [[2, 0, 0, 0]]}, {"camera": {}}, 5],
    "cell.turntable": [{"direction": 7}, {"angle_sigma_deg": 1e9}, {"direction": 0}],
    "cell.board": [{"kind": "chessboard", "columns": 10**9, "rows": 2, "pitch_mm": 1}, {"kind": "x"}],
    "name": ["\u0000", "\x07\x1b]0;x\x07", "a" * 10_000, "\ud800", 5, "\n\n", "../../x"],
    "captures": [[], {}, None, [5], [{}], "x"],
    "captures.0.id": ["", "../x", "a" * 300, "p02", "\u0000", 7],
    "captures.0.pose": [[], [1, 2], [1e308] * 7, ["x"] * 7, [0] * 7, None, "0 0 0 0 0 0 0"],
    "captures.0.files": [[], ["/etc/passwd"], ["../x.csv"], ["loop"], ["captures"], ["\u0000"], ["a" * 300], [5]],
    "captures.0.kind": ["cloud", "frame", "sweep", "hologram", None],
    "captures.0.step": ["scan", "dance", "laser-plane", ""],
    "captures.0.side": [0, 5, "x"],
    "format": ["scancell-session/99", "", None, 3],
}  # fmt: skip
_TEXTS = [
    b"", b"{", b"null", b"[]", b"\xff\xfe", b'{"format": NaN}', b"[" * 5000, b'{"a": ' + DIGITS.encode() + b"}",
    b'\xef\xbb\xbf{"format": "scancell-session/1"}', b'{"format": "scancell-session/1", "format": "x"}',
    b"\x00" * 99,
]  # fmt: skip
_PROFILES = [
    b"", b"x_mm,z_mm\n", b"x_mm,z_mm\n1,2\n", b"\x00" * 1000, f"x_mm,z_mm\n{DIGITS},1\n".encode() * 3,
    b"1e999,1\n" * 99,
    b"PK\x03\x04", b"x_mm,z_mm\n" + b"nan,nan\n" * 500, b"\x1b[2J" * 100, b"x_mm,z_mm\n" + b"1,1\n" * 500,
]  # fmt: skip
_ON_SERVERS = ("run", "check", "answer", "report", "export", "archive", "next", "recheck")
_SERVERS = [
    "", "x", "ftp://127.0.0.1", "http://", "http://127.0.0.1:1", "http://[::1", "http://a b", "\x00",
    "http://127.0.0.1:99999", "http://127.0.0.1:x", "http://\x1b[31m", "a" * 5000,
]  # fmt: skip
_ARGUMENTS = [
    [], ["--help", "--json"], ["frobnicate"], ["run"], ["run", "--stage"], ["run", "x", "y"], ["run", ""],
    ["run", "\x00"],
    ["run", "a" * 5000], ["run", "/dev/null"], ["run", "/dev/zero/x"], ["run", "\x1b[31m"], ["run", "--jsno", "x"],
    ["check", "/proc/self/mem"], ["check", "/"], ["sphere", "/dev/null"], ["sphere", "x", "--diameter-mm", "nan"],
    ["sphere", "x", "--diameter-mm", DIGITS], ["sphere", "x", "--unit", "furlong"], ["simulate"],
    ["simulate", "tcp"],
    ["simulate", "tcp", "--seed", "x", "--out", "new"], ["simulate", "tcp", "--seed", DIGITS, "--out", "new"],
    ["simulate", "tcp", "--seed", "-1", "--out", "new"], ["simulate", "\x00", "--seed", "1", "--out", "new"],
    ["simulate", "tcp", "--seed", "1", "--out", "/proc/new"], ["simulate", "tcp", "--seed", "1", "--out", "\x00"],
    ["simulate", "dance", "--seed", "1", "--out", "new"], ["schema", "none"], ["schema", "\x00"],
    ["bench", "none"],
    ["serve", "--port", "-1"], ["serve", "--port", "99999"], ["serve", "--port", "x"], ["serve", "--host", "\x00"],
    ["serve", "--host", "256.1.1.1"], ["serve", "--data", "/dev/null"], ["doctor", "--data", "none"],
    ["doctor", "--data", "/dev/null"],
    ["backup", "--out", "/dev/null", "--data", "none"], ["restore", "none", "--data", "new"],
    ["restore", "/dev/null", "--data", "new"],
    ["token"], ["token", "create"], ["token", "create", "--role", "king", "--name", "x"],
    ["token", "revoke", "x", "--data", "none"],
    ["audit", "--limit", "x"], ["audit", "--limit", "-5", "--data", "none"], ["completion", "tcsh"],
    ["poses", "none"],
    ["poses", "/dev/null"], ["poses", "/", "--brand", "kuka"], ["poses", "\x00"], ["archive"], ["archive", "pack"],
    ["archive", "unpack", "none", "--out", "new"], ["archive", "verify", "/dev/null"],
    ["archive", "verify", "\x00"],
    ["next"], ["next", "none"], ["next", "/dev/null"], ["next", "good", "--count", "x"],
    ["next", "good", "--count", "-1"], ["next", "good", "--count", DIGITS], ["next", "\x00"],
    ["recheck"], ["recheck", "none"], ["recheck", "/"], ["recheck", "\x1b[31m"],
    ["drift"], ["drift", "none"], ["drift", "/dev/null", "good"], ["drift", "\x00"], ["drift", "pipe/x"],
    ["plan", "none"], ["plan", "/dev/null"], ["plan", "--near-mm", "nan"], ["plan", "--near-mm", "-1"],
    ["plan", "--near-mm", "100", "--far-mm", "50"], ["plan", "--arm", "wooden"], ["plan", "--noise-mm", DIGITS],
    ["plan"], ["plan", "plan.json"], ["plan", "plan.json", "--near-mm", "90", "--table", "--tilt-deg", "3"],
    ["plan", "--sphere-mm", "0"], ["plan", "--wanted-mm", "inf"], ["plan", "precious"], ["plan", "\x00"],
    ["retention"], ["retention", "--days", "x", "--data", "none"], ["retention", "--days", "-1", "--data", "none"],
    ["retention", "--quota-mb", "nan", "--data", "none"], ["retention", "--days", "1", "--data", "/dev/null"],
    ["retention", "--remove", "--data", "none"], ["retention", "--cell", "\x00", "--data", "none"],
    ["read-back"], ["read-back", "good"], ["read-back", "good", "none"], ["read-back", "good", "/dev/null"],
    ["read-back", "good", "--numbers", ""], ["read-back", "good", "--numbers", "1 2"],
    ["read-back", "good", "--numbers", "nan " * 7], ["read-back", "good", "--numbers", DIGITS],
    ["read-back", "good", "--numbers", "1 2 3 4 5 6", "--convention", "klingon"],
    ["read-back", "good", "precious", "--brand", "acme"], ["read-back", "good", "precious", "--tool", "\x00"],
    ["archive", "replay", "/"], ["read-back", "none", "--numbers", "1 2"], ["warm", "x"], ["demo", "--seed", "x"],
]  # fmt: skip


@dataclass(frozen=True)
class Odd:
    """What was called, what it said, and what is wrong with that (nothing where all is well)."""

    words: list[str]
    status: int
    said: str
    wrong: str


def invocations(seed: int, count: int) -> Iterator[Odd]:
    """Call the command line oddly so many times, in a folder of its own; yield each outcome."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        os.chdir(place)
        try:
            _prepare(place)
            calls = [
                *((words, {BAD, GOOD} if "--help" in words else {BAD}) for words in _ARGUMENTS),
                *(([*_command(c, "x"), "--server", url], {BAD}) for c in _ON_SERVERS for url in _SERVERS),
                *_sessions(place),
                *_outs(place),
            ]
            random.Random(seed).shuffle(calls)
            for words, allowed in itertools.islice(calls, count):
                yield _called(place, words, allowed)
        finally:
            os.chdir(before)


def _prepare(place: Path) -> None:
    cell = simulate("tcp", 3)
    for folder in ("good", "kept"):
        for file, content in {**cell.files, "session.json": json.dumps(cell.session.to_json()).encode()}.items():
            (place / folder / file).parent.mkdir(parents=True, exist_ok=True)
            (place / folder / file).write_bytes(content)
    (place / "loop").symlink_to("loop")
    (place / "round").mkdir()
    (place / "round" / "again").symlink_to("..")
    (place / "to-kept").symlink_to("kept/session.json")
    (place / "dangling").symlink_to("nowhere")
    os.mkfifo(place / "pipe")
    (place / "precious").write_bytes(b"precious")
    (place / "plan.json").write_text('{"scanner": 3, "table": "big", "limits": []}')
    (place / "locked").mkdir(mode=0o500)
    assert main(["run", "good", "--quiet"]) == GOOD


def _sessions(place: Path) -> Iterator[tuple[list[str], set[int]]]:
    """Yield commands on sessions of which one thing is odd: what is odd may be harmless, but is never a fault."""
    whole = json.loads((place / "good" / "session.json").read_bytes())
    commands = itertools.cycle(["check", "answer", "report", "export", "run", "archive"])
    number = 0
    for path, values in _EDITS.items():
        for value in values:
            number += 1
            name = _odd_session(place, f"s{number}", whole, path, value)
            for _ in range(3):
                yield _command(next(commands), name), {GOOD, NOT_ACCEPTED, BAD}
    for text in _TEXTS:
        for command in ("check", "run", "export"):
            number += 1
            folder = place / f"s{number}"
            folder.mkdir()
            (folder / "session.json").write_bytes(text)
            yield _command(command, folder.name), {BAD}
    for content in _PROFILES:
        (place / f"scan{number}.csv").write_bytes(content)
        yield ["sphere", f"scan{number}.csv"], {BAD}
        yield ["poses", f"scan{number}.csv"], {GOOD, BAD}
        yield ["archive", "verify", f"scan{number}.csv"], {BAD}
        yield ["run", f"scan{number}.csv"], {BAD}
        number += 1
    for name in (
        "loop",
        "round",
        "round/again/loop",
        "dangling",
        "pipe/x",
        "locked",
        "precious",
        "good/session.json/x",
    ):
        for command in ("check", "run", "answer", "report", "export", "archive"):
            yield _command(command, name), {BAD}


def _odd_session(place: Path, name: str, whole: dict[str, Any], path: str, value: Any) -> str:
    folder = place / name
    shutil.copytree(place / "good", folder, symlinks=True)
    (folder / "loop").symlink_to("loop")
    record = json.loads(json.dumps(whole))
    *parents, last = path.split(".")
    here: Any = record
    for parent in parents:
        here = here[int(parent)] if parent.isdecimal() else here.setdefault(parent, {})
    here[last] = value
    (folder / "session.json").write_text(json.dumps(record), encoding="utf-8")
    return name


def _outs(place: Path) -> Iterator[tuple[list[str], set[int]]]:
    """Yield commands that would write over something that is no plain file, or where nothing can be written."""
    bad = [
        "loop",
        "to-kept",
        "dangling",
        "round",
        "round/again",
        "precious/x",
        "/proc/x",
        "",
        ".",
        "a\x00b",
        "x" * 300,
    ]
    for out in bad:
        for words in (
            ["export", "good", "--format", "json"],
            ["report", "good"],
            ["archive", "pack", "good", "--no-scene"],
        ):
            yield [*words, "--out", out], {BAD}
    for out in ("/dev/null", "-"):
        yield ["export", "good", "--format", "json", "--out", out], {GOOD}
        yield ["report", "good", "--out", out], {GOOD}
    for allow in ("old", "stale,", "fail,stale", "STALE", "\x00", ","):
        yield ["export", "good", "--format", "json", "--allow", allow], {GOOD, BAD}
    for name in ("json", "urdf", "kuka", "abb", "smoke", "", "\x00", "stl", "ply"):
        for pair in (None, "tool=1", "tool", "=", "tool=\x00", f"tool={DIGITS}", "tool=-1"):
            yield ["export", "good", "--format", name, *([] if pair is None else ["--set", pair])], {GOOD, BAD}


def _command(command: str, session: str) -> list[str]:
    more = {
        "export": ["--format", "json"],
        "report": ["--out", "-"],
        "archive": ["--no-scene", "--out", f"{session.replace('/', '_')}.zip"],
    }
    return [*(["archive", "pack"] if command == "archive" else [command]), session, *more.get(command, [])]


def _called(place: Path, words: list[str], allowed: set[int]) -> Odd:
    kept = _kept(place)
    out, err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8"), io.StringIO()
    wrong = ""
    status = -1
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(words)
        except BaseException as error:  # an escape is what is looked for
            wrong = f"{type(error).__name__}: {error}"
    said = err.getvalue()
    sentences = [line for line in said.splitlines() if " error: " in line or "unexpected" in line]
    if not wrong and "fault of the program" in said:
        wrong = "a fault of the program"
    if not wrong and status not in allowed:
        wrong = f"status {status}, not {sorted(allowed)}"
    if not wrong and status == BAD and len(sentences) != 1:
        wrong = f"{len(sentences)} sentences"
    if not wrong and any(ord(c) < 32 and c not in "\n\t" for c in said):
        wrong = "control characters on the terminal"
    if not wrong and kept != _kept(place):
        wrong = "something was written over"
    return Odd(words, status, said, wrong)


def _kept(place: Path) -> list[Any]:
    """Return what must never change: files that nobody names as a place to write to, and what is no plain file."""
    links = [(place / name).readlink() for name in ("loop", "to-kept", "dangling", "round/again")]
    files = [(place / name).read_bytes() for name in ("kept/session.json", "precious", "good/session.json")]
    return [*links, *files, (place / "pipe").is_fifo(), os.stat("/dev/null").st_rdev]  # noqa: PTH116
