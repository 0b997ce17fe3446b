"""`scancell token`: who may use a server that others can reach."""

import argparse

from server.console.command import Command, data_argument, late, server_argument


def _place_arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    server_argument(parser)


def _create_arguments(parser: argparse.ArgumentParser) -> None:
    _place_arguments(parser)
    parser.add_argument("--name", required=True, metavar="NAME", help="who or what it is for")
    parser.add_argument(
        "--role", required=True, choices=("read", "capture", "release", "admin"), help="what it may do"
    )
    parser.add_argument("--days", type=float, metavar="D", help="how long it is good (default: until revoked)")


def _revoke_arguments(parser: argparse.ArgumentParser) -> None:
    _place_arguments(parser)
    parser.add_argument("id", metavar="ID", help="as in the list")


_ACTIONS = "server.commands.token.actions"
_LIST, _REVOKE = "print all tokens, without what is secret in them", "end a token and the logins made with it"
_CREATE = "make a token and print it: this once, for only a hash is kept"

COMMAND = Command(
    "token",
    "manage who may use a server that others can reach",
    "workbench",
    actions=(
        Command("create", _CREATE, "", _create_arguments, late(_ACTIONS, "create"), uses_server=True),
        Command("list", _LIST, "", _place_arguments, late(_ACTIONS, "show"), uses_server=True),
        Command("revoke", _REVOKE, "", _revoke_arguments, late(_ACTIONS, "revoke"), uses_server=True),
    ),
)
