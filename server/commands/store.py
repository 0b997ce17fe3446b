"""`scancell doctor`, `backup` and `restore`: is what was stored still there, and how it comes back."""

import json
from dataclasses import asdict
from pathlib import Path

from calib_core.errors import InputError
from server.commands.progress import progress_bar
from server.settings import Settings
from server.store.backup import Backup, back_up
from server.store.backup import restore as restore_store
from server.store.doctor import Examination, Finding, examine
from server.store.repair import repair


def doctor(data: Path, mend: bool, backup: Path | None, as_json: bool) -> int:
    """Say what is wrong with a store, and mend what can be if asked to; returns 1 where something is lost."""
    if backup is not None and not mend:
        raise InputError("--repair with --backup", "--backup alone", "Add --repair: only it changes anything.")
    settings = Settings(data=data)
    found = _examined(settings)
    done: list[str] = []
    if mend:
        done = repair(settings, found, backup)
        found = _examined(settings)
    if as_json:
        print(json.dumps({**asdict(found), "repaired": done, "damaged": found.damaged}, ensure_ascii=False))
    else:
        print("\n".join([*(f"repaired: {line}" for line in done), *map(_line, found.findings), _sum(found)]))
    return int(found.damaged)


def backup(data: Path, out: Path) -> int:
    """Write a store as it is at one moment; a server may use it meanwhile."""
    with progress_bar() as progress:
        made = back_up(Settings(data=data), out, progress)
    print(f"{out}: {_facts(made)}, as of {made.created}")
    return 0


def restore(source: Path, data: Path) -> int:
    """Make a store of a backup, where there is none yet."""
    made = restore_store(source, Settings(data=data))
    print(f"{data}: {_facts(made)}, as of {made.created}")
    return 0


def _examined(settings: Settings) -> Examination:
    with progress_bar() as progress:
        return examine(settings, progress)


def _facts(made: Backup) -> str:
    return f"{made.rows['sessions']} sessions, {made.rows['captures']} captures, {made.blobs} files"


def _line(finding: Finding) -> str:
    place = f"session {finding.session}" if finding.session else "store"
    if finding.capture:
        place += f", capture {finding.capture}"
    return f"{finding.kind}: {place}: {finding.what}"


def _sum(found: Examination) -> str:
    looked = f"{found.sessions} sessions, {found.captures} captures, {found.files} files"
    damage = sum(finding.kind == "damage" for finding in found.findings)
    return f"{looked}: " + (f"{damage} damaged" if damage else "nothing is damaged")
