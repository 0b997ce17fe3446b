"""`scancell archive`: pack, unpack, verify and replay a session's archive."""

import argparse
from pathlib import Path

from server.console.command import Command, late, server_argument, session_argument


def _pack_arguments(parser: argparse.ArgumentParser) -> None:
    session_argument(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="the zip to write; - is standard output"
    )
    parser.add_argument("--no-scene", action="store_true", help="leave out the 3-D scene")


def _file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="the zip; - is standard input")


def _file_there(parser: argparse.ArgumentParser) -> None:
    _file(parser)
    server_argument(parser, "have this running server do it")


def _unpack_arguments(parser: argparse.ArgumentParser) -> None:
    _file(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="a new folder")


_ACTIONS = "server.commands.archive.actions"
_PACK, _UNPACK = "write a session's archive, with its report and scene", "write an archive's files as a folder"
_VERIFY, _REPLAY = (
    "check that an archive is whole and unaltered",
    "solve an archive afresh and compare every number",
)

COMMAND = Command(
    "archive",
    "pack a session into one zip; unpack, verify or replay one",
    "session",
    actions=(
        Command("pack", _PACK, "", _pack_arguments, late(_ACTIONS, "pack")),
        Command("unpack", f"{_UNPACK}, all or nothing", "", _unpack_arguments, late(_ACTIONS, "unpack")),
        Command("verify", _VERIFY, "", _file_there, late(_ACTIONS, "verify"), uses_server=True),
        Command("replay", _REPLAY, "", _file_there, late(_ACTIONS, "replay"), uses_server=True),
    ),
)
