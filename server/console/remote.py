"""`--server URL`: the session of a running server in place of a folder."""

import argparse
import os
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from calib_core.disk import temporary_folder
from calib_core.messages import message, plural

if TYPE_CHECKING:
    from server.console.client import Scancell

_TOKEN = "SCANCELL_TOKEN"
_PATIENCE_S = 5.0  # somebody waits before the terminal, and the address may be wrong


@contextmanager
def connected(options: argparse.Namespace) -> Generator["Scancell"]:
    """Give the client of the server that --server names.

    Raises
    ------
    InputError
        If it does not answer, or refuses something, in its own words.
    """
    import httpx

    from calib_core.errors import InputError
    from server.console.client import ProblemError, Scancell

    address: str = options.server
    if not address.startswith(("http://", "https://")):
        to_do = message("Write it as http://host:8000.")
        raise InputError("an address that begins with http:// or https://", repr(address), to_do, "--server")
    try:
        with Scancell(address.rstrip("/"), os.environ.get(_TOKEN), patience_s=_PATIENCE_S) as api:
            yield api
    except ProblemError as error:
        details: dict[str, Any] = {
            "need": "a request that it takes",
            "got": str(error),
            "to_do": "",
            **error.details,
        }
        to_do = details["to_do"]
        if error.status == 401:
            to_do = message("Set {token} to a token of that server.", token=_TOKEN)
        raise InputError(details["need"], details["got"], to_do, details.get("where") or address) from None
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        got = str(error) or type(error).__name__
        raise InputError("a server that answers", got, "Start it, or correct the address.", address) from None


@contextmanager
def from_server(options: argparse.Namespace) -> Generator[None]:
    """Put a session of the server that --server names into an archive for as long as a command works with it.

    What speaks against its answer at this moment is the cell's, and in no archive: `options.of_moment` has it.
    """
    options.of_moment = ()
    if getattr(options, "server", None) is None or getattr(options.command, "uses_server", False):
        yield
        return
    from calib_core.errors import CalibrationError

    name = str(options.session)
    with temporary_folder() as folder:
        file = folder / "session.zip"
        with connected(options) as api:
            found = session_id(api, name)
            file.write_bytes(api.archives_get_archive(found, scene=False))
            options.of_moment = _faults_of_moment(api, found)
        options.session = file
        try:
            yield
        except CalibrationError as error:
            place = error.where.replace(str(file), f"session {name}")
            raise type(error)(error.need, error.got, error.to_do, place) from None


def _faults_of_moment(api: "Scancell", session: str) -> tuple[str, ...]:
    from calib_core.records.faults import FAULTS
    from server.console.client import ProblemError

    try:
        told = api.answers_get_answer(session)["faults"]
    except ProblemError as error:
        if error.status == 409:  # nothing is solved yet
            return ()
        raise
    return tuple(name for name in told if name in FAULTS and FAULTS[name].of == "moment")


def session_id(api: "Scancell", name: str) -> str:
    """Return the id of a session that is named by its id, or by its name where only one has it.

    Raises
    ------
    InputError
        If there is none, or several have this name.
    """
    from calib_core.errors import InputError
    from server.console.client import ProblemError

    try:
        return str(api.sessions_get(name)["id"])
    except ProblemError as error:
        if error.status != 404:
            raise
    found = [one["id"] for one in api.sessions_list_all(search=name, limit=1000)["items"] if one["name"] == name]
    if len(found) != 1:
        got = (
            message("no such session")
            if not found
            else plural(
                "{count} session of this name", "{count} sessions of this name", by="count", count=len(found)
            )
        )
        raise InputError("the id of a session, or its name", got, "Take the id that the page's address has.", name)
    return str(found[0])
