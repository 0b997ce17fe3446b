"""`scancell demo`: the whole chain on the simulated cell beside its truth, then the workbench."""

import argparse
from collections.abc import Callable

from server.console.command import Command, address_arguments


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--no-serve", action="store_true", help="end after printing")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the simulated cell (default 1)")
    address_arguments(parser)


def parts(options: argparse.Namespace) -> tuple[Callable[[argparse.Namespace], int], ...]:
    """Return what is done one after the other, each where the one before succeeded."""
    from server.commands.demo.chain import demo
    from server.commands.serve import serve

    return (demo,) if options.no_serve else (demo, serve)


def _run(options: argparse.Namespace) -> int:
    return next((status for part in parts(options) if (status := part(options))), 0)


COMMAND = Command(
    "demo", "run the chain on the simulated cell beside its truth, then serve", "workbench", _arguments, _run
)
