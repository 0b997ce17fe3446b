"""What `scancell token` does."""

import argparse
from datetime import timedelta

from calib_core.errors import InputError
from calib_core.messages import message, templates
from server.auth.logins import Logins
from server.console.audited_store import audited_store
from server.console.command import OK
from server.console.language import spoken
from server.console.output import print_result, remark
from server.console.remote import connected
from server.store.models import Data
from server.store.tokens import list_tokens, revoke_token, token_data

_MAY = templates(
    {
        "read": "look at everything",
        "capture": "look, capture and solve",
        "release": "look, capture, solve and release answers",
        "admin": "do everything, also remove sessions and manage tokens",
    }
)


def create(options: argparse.Namespace) -> int:
    """Make a token and print it, alone, on standard output."""
    days, role = options.days, options.role
    if days is not None and not 0 < days <= 36525:
        to_do = "Leave it out for a token without end."
        raise InputError("a time of up to 36525 days", f"{days:g}", to_do, "--days")
    if options.server is None:
        with audited_store(options.data, f"token create {role}", make=True) as store, store.write() as db:
            lifetime = None if days is None else timedelta(days=days)
            record, token = Logins(options.data, store).make_token(db, options.name, role, lifetime)
            record = {**record, "token": token}
    else:
        with connected(options) as api:
            record = api.access_make({"name": options.name, "role": role, "days": days})
    if options.json:
        print_result(options, "", record)
    else:
        print(record["token"])  # also with --quiet: it is shown this once
    values = {"name": record["name"], "what": _MAY[role]}
    if record["expires"]:
        text = message(
            "Keep it: it is not shown again. Until {until} {name} may: {what}.", until=record["expires"], **values
        )
    else:
        text = message("Keep it: it is not shown again. Until it is revoked {name} may: {what}.", **values)
    remark(options, text)
    return OK


def show(options: argparse.Namespace) -> int:
    """Print all tokens, without what is secret in them."""
    if options.server is None:
        with audited_store(options.data, "token list") as store, store.read() as db:
            rows = [token_data(row) for row in list_tokens(db)]
    else:
        with connected(options) as api:
            rows = api.access_list_all()["items"]
    said = spoken(options)
    lines = [f"{row['id']}  {row['role']:8} {said.say(_state(row)):34} {row['name']}" for row in rows]
    if rows or options.json:
        print_result(options, "\n".join(lines), {"tokens": rows})
    else:
        remark(options, message("There are no tokens."))
    return OK


def revoke(options: argparse.Namespace) -> int:
    """End a token; a server that runs follows within seconds."""
    if options.server is None:
        with audited_store(options.data, f"token revoke {options.id}") as store, store.write() as db:
            revoke_token(db, options.id)
    else:
        with connected(options) as api:
            api.access_revoke(options.id)
    if options.json:
        print_result(options, "", {"revoked": options.id})
    return OK


def _state(row: Data) -> str:
    if row["revoked"]:
        return message("revoked {date}", date=row["revoked"])
    return message("until {date}", date=row["expires"]) if row["expires"] else message("good")
