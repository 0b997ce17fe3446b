"""The command line: finds the commands, reads the arguments, and gives one sentence for whatever goes wrong.

Nothing heavy is imported before a command runs, so that `scancell --help` answers at once.
"""

import argparse
import errno
import gc
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn

from calib_core import __version__
from calib_core.disk import WINDOWS
from calib_core.registry import Registry
from server.console.command import BAD_INPUT, GROUPS, OK, Command
from server.console.output import from_standard_input, take_any_text, take_long_paths, with_matches
from server.console.remote import from_server

if TYPE_CHECKING:
    from calib_core.errors import CalibrationError
    from calib_core.messages import Catalogue

COMMANDS: Registry[Command] = Registry("a command", "server.commands", "COMMAND", Command)

_COMMON = {
    "--json": "print one JSON object on standard output",
    "--quiet": "print errors alone, and what --json asks for",
    "--debug": "show where an error comes from",
}

_LANGUAGE = "the language of texts (else SCANCELL_LANG)"
_USAGE = "scancell COMMAND …   (scancell COMMAND --help says more)"
_ABOUT = "Calibration workbench for laser scanning cells: scanner, robot and turntable, from a sphere."
_VERSION = "say what runs, and whose form the data folder has"
_EXITS = (
    "done, and accepted",
    "solved, but a verdict is `fail` (bench: a figure does not hold; replay: a number differs)",
    "bad input: one sentence on standard error says which file and what to do",
)
_LONGEST_LINE = 2000


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one sentence in the asked language, and whose options are written in full."""

    said: "ClassVar[Catalogue | None]" = None

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, allow_abbrev=False, **more)

    def error(self, message: str) -> NoReturn:
        from calib_core.messages import ENGLISH
        from calib_core.messages import message as made

        sentence = made("{error}. See {command} --help.", error=_one_line(message).rstrip("."), command=self.prog)
        self.exit(BAD_INPUT, f"scancell: error: {(self.said or ENGLISH).say(sentence)}\n")

    def refuse(self, unknown: Sequence[str]) -> NoReturn:
        """End with what is not known, and with the option that is most likely meant."""
        close = get_close_matches(unknown[0].partition("=")[0], self._option_string_actions, 1, 0.6)
        from calib_core.messages import ENGLISH, message

        said, words = self.said or ENGLISH, " ".join(unknown)
        if not close:
            self.error(said.say(message("unrecognized arguments: {words}", words=words)))
        self.error(
            said.say(
                message("unrecognized arguments: {words} (did you mean {close}?)", words=words, close=close[0])
            )
        )


class _Version(argparse.Action):
    """Prints the version, and what it means for the data folder that is here or that SCANCELL_DATA names."""

    def __init__(self, **given: Any) -> None:
        super().__init__(nargs=0, default=argparse.SUPPRESS, **given)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        data = os.environ.get("SCANCELL_DATA", "sessions")
        print(f"scancell {__version__} (Python {sys.version.split()[0]}, {sys.platform})")
        if os.path.isfile(f"{data}/scancell.db"):  # noqa: PTH113 (pathlib takes as long as all the rest)
            from server.commands.update import told

            print(f"{data}: {told(data)}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the solves are many and small
    take_any_text()
    if arguments is None:  # a process of its own, whose imports alone would be looked through 400 times
        gc.set_threshold(20_000)
    words = sys.argv[1:] if arguments is None else arguments
    if WINDOWS:
        words = with_matches(words)
    if "_ARGCOMPLETE" in os.environ:  # the shell asks how to go on
        return _complete()
    _speak(words)
    if any("\0" in word for word in words):
        return _refused("an argument with a NUL character. Remove it.")
    try:
        options, unknown = parser(words).parse_known_args(words)
        if unknown:
            options.parser.refuse(unknown)
    except SystemExit as end:  # --help, or a usage error that is printed already
        return int(end.code or 0)
    if WINDOWS and not getattr(options, "server", None):  # whose sessions are no paths
        take_long_paths(options)
    try:
        return _run(options)
    except BrokenPipeError:
        return _unread()
    except KeyboardInterrupt:
        print("scancell: stopped", file=sys.stderr)
        return 130


def _speak(words: Sequence[str]) -> None:
    """Let the parser's errors be in the language asked for; English, as nearly always, imports nothing."""
    if "SCANCELL_LANG" in os.environ or _Parser.said or any(word.startswith("--lang") for word in words):
        from server.console.texts import say_usage_errors

        _Parser.said = say_usage_errors(words)


def _unread() -> int:
    """End quietly: whoever read the output has gone, as in `scancell run … | head`."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return OK


def _complete() -> int:
    import argcomplete

    words = os.environ.get("COMP_LINE", "").split()
    argcomplete.autocomplete(parser(words))
    return OK


def parser(used: Iterable[str]) -> argparse.ArgumentParser:
    """Return the parser; of the commands, only those among the words that are used have their arguments."""
    top = _Parser(
        prog="scancell",
        usage=_said_in_help(_USAGE),
        description=_said_in_help(_ABOUT),
        epilog=f"{_listed()}\n\n{_exit_status()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action=_Version, help=_said_in_help(_VERSION))
    _add_common(top.add_argument, default=False)
    _add(top, COMMANDS, frozenset(used))
    return top


def _listed() -> str:
    """Return the list of commands under the headings of their groups."""
    parts = [
        f"{_said_in_help(heading)}:\n"
        + "\n".join(f"    {c.name:12} {_said_in_help(c.help)}" for c in COMMANDS if c.group == group)
        for group, heading in GROUPS.items()
    ]
    return "\n\n".join(parts)


def _exit_status() -> str:
    lines = [f"{number}  {_said_in_help(text)}" for number, text in enumerate(_EXITS)]
    return "\n  ".join([f"{_said_in_help('exit status')}:", *lines])


def _said_in_help(text: str) -> str:
    """Return a text of help in the language asked for; English imports nothing."""
    return _Parser.said.say(text) if _Parser.said else text


def _add(
    parent: argparse.ArgumentParser, commands: Iterable[Command], used: frozenset[str], *, required: bool = True
) -> None:
    """Add commands, or the actions of one; where the one has something to do by itself they are not `required`."""
    is_top = commands is COMMANDS  # whose list stands under the headings
    within = parent.add_subparsers(
        title="actions",
        help=argparse.SUPPRESS if is_top else None,
        metavar="COMMAND",
        required=required,
        parser_class=_Parser,
        prog=parent.prog,
    )
    for command in commands:
        added = within.add_parser(
            command.name,
            help=_said_in_help(command.help),
            description=_described(command.help),
            epilog=_exit_status(),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if command.name not in used:
            continue
        if command.actions:
            _add(added, command.actions, used, required=command.run is None)
        if command.actions and command.run is None:
            continue
        command.arguments(added)
        common = added.add_argument_group(_said_in_help("common options"))
        _add_common(common.add_argument, default=argparse.SUPPRESS)
        added.set_defaults(command=command, parser=added)


def _described(text: str) -> str:
    """Return a command's line of help as a sentence."""
    said = _said_in_help(text)
    end = "。" if _Parser.said and _Parser.said.language == "zh" else "."
    return said[0].upper() + said[1:] + end


def _add_common(add: Callable[..., Any], *, default: Any) -> None:
    """Add what is taken before a command's name and after it; the default of one must not undo the other."""
    for name, told in _COMMON.items():
        add(name, action="store_true", default=default, help=_said_in_help(told))
    asked = default or None  # suppressed, or not asked for
    add("--lang", choices=("en", "de", "zh"), default=asked, help=_said_in_help(_LANGUAGE))


def _run(options: argparse.Namespace) -> int:
    from calib_core.errors import CalibrationError
    from calib_core.messages import ENGLISH, message

    command: Command = options.command
    assert command.run is not None
    try:
        with from_standard_input(options), from_server(options):
            status = command.run(options)
        sys.stdout.flush()
    except CalibrationError as error:
        if options.debug:
            raise
        return _refused(_said(options, error))
    except (BrokenPipeError, KeyboardInterrupt):
        raise
    except OSError as error:  # a name that is too long, a folder that is a file, a disk that is full
        if options.debug:
            raise
        if error.errno == errno.EINVAL and not error.filename and not sys.stdout.isatty():
            return _unread()  # so Windows says that whoever read a pipe has gone
        said = (error.strerror or type(error).__name__).lower()
        what = message("need files and folders that can be used, got {error}. Correct the name, or make room.",
                       error=said)  # fmt: skip
        place = f"{error.filename}: " if error.filename else ""
        return _refused(place + (_Parser.said or ENGLISH).say(what))
    except Exception as error:
        if options.debug:
            raise
        what = message("a fault of the program ({name}: {why}). Add --debug for details.",
                       name=type(error).__name__, why=str(error))  # fmt: skip
        return _refused((_Parser.said or ENGLISH).say(what), "unexpected error, ")
    return status


def _said(options: argparse.Namespace, error: "CalibrationError") -> str:
    """Return an error in the language that is asked for; in English where that is the error."""
    from calib_core.errors import CalibrationError
    from server.console.language import spoken

    try:
        return error.said(spoken(options))
    except CalibrationError:
        return str(error)


def _refused(sentence: str, kind: str = "error: ") -> int:
    """Say why nothing was done, on standard error; return the exit status."""
    print(f"scancell: {kind}{_one_line(sentence)}", file=sys.stderr)
    return BAD_INPUT


def _one_line(text: str) -> str:
    """Return text as a terminal may show it: in one line, and nothing in it that would steer the terminal."""
    shown = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in " ".join(text.split()))
    return (
        shown if len(shown) <= _LONGEST_LINE else f"{shown[: _LONGEST_LINE // 2]} … {shown[-_LONGEST_LINE // 2 :]}"
    )


if __name__ == "__main__":
    sys.exit(main())
