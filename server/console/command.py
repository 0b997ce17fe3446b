"""What a command is: a name, a line of help, its arguments, and what runs it."""

import argparse
import importlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

OK: Final = 0
NOT_ACCEPTED: Final = 1
BAD_INPUT: Final = 2

GROUPS: Final = {
    "session": "a session",
    "files": "files and simulation",
    "workbench": "the workbench and its store",
    "installation": "this installation",
}
"""The headings of `scancell --help`, in their order."""


def no_arguments(_parser: argparse.ArgumentParser) -> None:
    """Add none."""


def late(module: str, function: str) -> Callable[[argparse.Namespace], int]:
    """Return a function that imports the one that does the work when it is called."""
    return lambda options: getattr(importlib.import_module(module), function)(options)


@dataclass(frozen=True)
class Command:
    """A command, or an action of one.

    Parameters
    ----------
    name : str
        What users type.
    help : str
        One line, without a capital and a full stop.
    group : str
        A key of `GROUPS`; of no meaning for an action.
    arguments : callable
        Adds the arguments; called only where the command is used or its own help is asked for, so it may import
        what lists their choices.
    run : callable, optional
        Gets the parsed arguments and returns the exit status; it imports late.
    actions : tuple of Command, optional
        The words that follow the name, as in `archive pack`; without one `run` is done, where there is one.
    uses_server : bool
        Whether it asks the server of --server itself; others get its session as an archive.
    """

    name: str
    help: str
    group: str = ""
    arguments: Callable[[argparse.ArgumentParser], None] = no_arguments
    run: Callable[[argparse.Namespace], int] | None = None
    actions: tuple["Command", ...] = ()
    uses_server: bool = False


def session_argument(parser: argparse.ArgumentParser) -> None:
    """Add SESSION."""
    parser.add_argument(
        "session",
        type=Path,
        metavar="SESSION",
        help="a session folder or archive; - reads an archive from standard input; with --server an id or a name",
    )
    server_argument(parser, "work with a session of this running server")


def server_argument(parser: argparse.ArgumentParser, what: str = "ask this running server") -> None:
    """Add --server."""
    told = f"{what}; SCANCELL_TOKEN holds the token where it asks for one"
    parser.add_argument("--server", metavar="URL", help=told)


def data_argument(parser: argparse.ArgumentParser) -> None:
    """Add --data."""
    parser.add_argument(
        "--data", type=Path, default=Path("sessions"), metavar="DIR", help="the workbench's data (%(default)s)"
    )


def address_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --host, --port, --data and what encryption needs."""
    host, port = os.environ.get("SCANCELL_HOST", "127.0.0.1"), os.environ.get("SCANCELL_PORT", "8000")
    parser.add_argument("--host", default=host, metavar="HOST", help="address to serve on (%(default)s)")
    parser.add_argument("--port", type=int, default=port, metavar="PORT", help="0: any that is free (%(default)s)")
    data_argument(parser)
    parser.add_argument("--open", action="store_true", help="open it in the browser, also where it runs already")
    parser.add_argument("--tls-cert", type=Path, metavar="FILE", help="a certificate with its chain, PEM: https")
    parser.add_argument("--tls-key", type=Path, metavar="FILE", help="its private key, PEM")
