"""What `scancell trust` does."""

import argparse
from dataclasses import asdict
from datetime import date as calendar_date
from datetime import datetime, time
from pathlib import Path

from calib_core.archive.folder import read_bytes
from calib_core.archive.keys import TrustedKey, distrust, key_file, keys, trust, trusted_key
from calib_core.archive.keys import renew as renew_key
from calib_core.errors import InputError
from calib_core.messages import message, templates
from calib_core.moment import text_of
from server.console.command import OK
from server.console.language import spoken
from server.console.output import print_result, remark

_TOLD = templates(
    {
        "trusted": "{key}  {name}: trusted from now on",
        "ends": "{key}  {name}: trusted until {until}",
        "no-end": "{key}  {name}: has no end",
        "distrusted": "{key}  {name}: not trusted any more",
        "signs": "{key}  {name}: signs from now on",
    }
)


def show(options: argparse.Namespace) -> int:
    """Print the trusted keys, this installation's own first."""
    here = keys()
    rows = sorted(here.trusted, key=lambda one: (one.key != here.own_key, one.added))
    said = spoken(options)
    text = "\n".join(f"{one.key}  {said.say(_state(one, here.own_key)):24} {one.name}" for one in rows)
    data = {"own": here.own_key, "file": str(key_file()), "trusted": [asdict(one) for one in rows]}
    print_result(options, text, data)
    if here.trouble:
        told = message("Warning: {trouble}: what is signed now is not known later.", trouble=here.trouble)
        remark(options, told)
    return OK


def add(options: argparse.Namespace) -> int:
    """Trust the key of another installation."""
    key = options.key
    if len(key) < 256 and Path(key).is_file():
        key = read_bytes(Path(key), "Name the file with the public key.", 100_000).decode(errors="replace")
    return _told(options, trust(key, options.name), "trusted")


def date(options: argparse.Namespace) -> int:
    """Give a key an end, or none."""
    found = trusted_key(options.key)
    until = None if options.until is None else _end_of(options.until)
    return _told(options, trust(found.key, found.name, until), "ends" if until else "no-end")


def remove(options: argparse.Namespace) -> int:
    """Trust a key no longer."""
    return _told(options, distrust(options.key), "distrusted")


def renew(options: argparse.Namespace) -> int:
    """Sign with a new key."""
    return _told(options, renew_key(), "signs")


def _told(options: argparse.Namespace, key: TrustedKey, what: str) -> int:
    print_result(options, message(_TOLD[what], key=key.key, name=key.name, until=key.until or ""), asdict(key))
    return OK


def _end_of(text: str) -> str:
    """Return the last moment of a day; raises InputError."""
    try:
        return text_of(datetime.combine(calendar_date.fromisoformat(text), time.max).astimezone())
    except ValueError:
        raise InputError("a date", repr(text[:40]), "Write it as 2026-11-24.", "--until") from None


def _state(key: TrustedKey, own: str | None) -> str:
    if key.key == own:
        return message("signs here")
    if key.until:
        return message("until {date}", date=key.until[:10])
    return message("since {date}", date=key.added[:10])
