"""`scancell service`: on Windows, the workbench as a task of the system, with an entry in the start menu."""

import argparse

from server.console.command import OK, Command, data_argument
from server.console.output import print_result


def _install_arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    parser.add_argument("--port", type=int, default=8000, metavar="PORT", help="to serve on (%(default)s)")
    whole = "run it from the machine's start on, whoever is logged on; needs an administrator"
    parser.add_argument("--system", action="store_true", help=whole)


def _install(options: argparse.Namespace) -> int:
    from server.windows_service import Service, install

    made = install(Service(options.data.absolute(), options.port, options.system))
    print_result(options, "\n".join(["installed:", *(f"  {one}" for one in made)]), {"installed": made})
    return OK


def _ask(action: str) -> "Command":
    def run(options: argparse.Namespace) -> int:
        from server import windows_service

        said = getattr(windows_service, action)()
        print_result(options, said, {"said": said})
        return OK

    return Command(action, _HELP[action], run=run)


_HELP = {
    "start": "start it now",
    "stop": "end it",
    "remove": "end it, and take its task and its entries out; the data folder stays",
    "status": "say what the system knows of it",
}
_INSTALL = Command("install", "make its task and its entry in the start menu", "", _install_arguments, _install)

COMMAND = Command(
    "service",
    "run the workbench in the background on Windows",
    "installation",
    actions=(_INSTALL, *map(_ask, _HELP)),
)
