"""`scancell completion`: what makes a shell complete commands, options and names."""

import argparse

from server.console.command import OK, Command


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="whose script to print")


def _run(options: argparse.Namespace) -> int:
    from argcomplete.shell_integration import shellcode

    print(shellcode(["scancell"], shell=options.shell))
    return OK


COMMAND = Command(
    "completion", "print a script by which bash, zsh or fish completes commands", "installation", _arguments, _run
)
