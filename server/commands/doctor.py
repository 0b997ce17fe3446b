"""`scancell doctor`: is what a server stored still there."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from calib_core.messages import templates
from server.console.command import NOT_ACCEPTED, OK, Command, data_argument
from server.console.output import print_result
from server.console.progress import progress_bar

if TYPE_CHECKING:
    from server.settings import Settings
    from server.store.doctor import Examination, Finding


def _arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    parser.add_argument("--repair", action="store_true", help="repair what can be repaired; no server may run")
    parser.add_argument(
        "--accept",
        action="store_true",
        help="sign what was changed in the database as it stands; no server may run",
    )
    parser.add_argument("--backup", type=Path, metavar="DIR", help="where --repair takes damaged files from")


def _run(options: argparse.Namespace) -> int:
    """Say what is wrong with a store, and mend what can be if asked to; returns 1 where something is lost."""
    from dataclasses import asdict

    from calib_core.errors import InputError
    from calib_core.messages import message
    from server.settings import Settings
    from server.store.changed_rows import accept
    from server.store.repair import repair

    if options.backup is not None and not options.repair:
        raise InputError("--repair with --backup", "--backup alone", "Add --repair: only it changes anything.")
    settings = Settings(data=options.data)
    found = _examined(options, settings)
    done: list[str] = []
    if options.repair:
        done = repair(settings, found, options.backup)
    if options.accept:
        done += accept(settings)
    if options.repair or options.accept:
        found = _examined(options, settings)
    mended = (message("repaired: {what}", what=line) for line in done)
    lines = [*mended, *map(_line, found.findings), _sum(found)]
    print_result(options, "\n".join(lines), {**asdict(found), "repaired": done, "damaged": found.damaged})
    return NOT_ACCEPTED if found.damaged else OK


def _examined(options: argparse.Namespace, settings: "Settings") -> "Examination":
    from server.store.doctor import examine

    with progress_bar(options) as progress:
        return examine(settings, progress)


_LINES: Final = templates({
    "damage": "damage: {place}: {what}",
    "leftover": "leftover: {place}: {what}",
    "note": "note: {place}: {what}",
})  # fmt: skip


def _line(finding: "Finding") -> str:
    from calib_core.messages import message

    place = message("store")
    if finding.session:
        place = message("session {session}", session=finding.session)
    if finding.capture:
        place = message("session {session}, capture {capture}", session=finding.session, capture=finding.capture)
    return message(_LINES[finding.kind], place=place, what=finding.what)


def _sum(found: "Examination") -> str:
    from calib_core.counted import captures, files, sessions
    from calib_core.messages import message

    looked = {
        "sessions": sessions(found.sessions),
        "captures": captures(found.captures),
        "files": files(found.files),
    }
    damage = sum(finding.kind == "damage" for finding in found.findings)
    if damage:
        return message("{sessions}, {captures}, {files}: {damage} damaged", **looked, damage=damage)
    return message("{sessions}, {captures}, {files}: nothing is damaged", **looked)


COMMAND = Command("doctor", "say what is wrong with what a server has stored", "workbench", _arguments, _run)
