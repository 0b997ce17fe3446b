"""`scancell demo`: the whole chain on the simulated cell beside its truth, then the workbench."""

import argparse

from server.console.command import Command, address_arguments


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--no-serve", action="store_true", help="end after printing")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the simulated cell (default 1)")
    address_arguments(parser)


def _run(options: argparse.Namespace) -> int:
    from server.commands.demo.chain import demo
    from server.commands.serve import serve

    status = demo(options)
    return status if options.no_serve or status else serve(options)


COMMAND = Command(
    "demo", "run the chain on the simulated cell beside its truth, then serve", "workbench", _arguments, _run
)
