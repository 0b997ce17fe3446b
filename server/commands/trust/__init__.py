"""`scancell trust`: whose signatures count here."""

import argparse

from server.console.command import Command, late


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", metavar="KEY", help="64 hex digits, or a file with the public key (PEM)")
    parser.add_argument("--name", required=True, metavar="NAME", help="whose it is")


def _key(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", metavar="KEY", help="its name, or its first digits")


def _date_arguments(parser: argparse.ArgumentParser) -> None:
    _key(parser)
    parser.add_argument("--until", metavar="DATE", help="signatures of later days do not count (left out: no end)")


_ACTIONS = "server.commands.trust.actions"

COMMAND = Command(
    "trust",
    "show and manage the keys whose signatures on results count here",
    "workbench",
    run=late(_ACTIONS, "show"),
    actions=(
        Command("add", "trust the key of another installation", "", _add_arguments, late(_ACTIONS, "add")),
        Command("date", "give a key an end, or none", "", _date_arguments, late(_ACTIONS, "date")),
        Command("remove", "trust a key no longer", "", _key, late(_ACTIONS, "remove")),
        Command("renew", "sign with a new key; what the former signed counts on", run=late(_ACTIONS, "renew")),
    ),
)
