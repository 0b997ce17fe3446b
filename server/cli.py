"""The command line: arguments, exit status, and one sentence for whatever goes wrong.

Nothing heavy is imported before a command needs it, so that `scancell --help` answers at once.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from calib_core import __version__

OK, NOT_ACCEPTED, BAD_INPUT = 0, 1, 2

_EXIT_STATUS = """exit status:
  0  done, and accepted
  1  solved, but a verdict is `fail` (bench: a figure does not hold; replay: a number differs)
  2  bad input: one sentence on standard error says which file and what to do"""


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one sentence."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: error: {message}. See {self.prog} --help.\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the solves are many and small
    try:
        options = _parser().parse_args(arguments)
    except SystemExit as end:  # --help, or a usage error that is printed already
        return int(end.code or 0)
    try:
        return _run(options)
    except BrokenPipeError:  # whoever read the output has gone, as in `scancell run … | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt:
        print("scancell: stopped", file=sys.stderr)
        return 130


def _run(options: argparse.Namespace) -> int:
    from calib_core.errors import CalibrationError

    try:
        status: int = options.command(options)
        sys.stdout.flush()
    except CalibrationError as error:
        if options.debug:
            raise
        print(f"scancell: error: {_one_line(str(error))}", file=sys.stderr)
        return BAD_INPUT
    except (BrokenPipeError, KeyboardInterrupt):
        raise
    except Exception as error:
        if options.debug:
            raise
        what = f"{type(error).__name__}: {_one_line(str(error))}"
        print(
            f"scancell: unexpected error, a fault of the program ({what}). Add --debug for details.",
            file=sys.stderr,
        )
        return BAD_INPUT
    return status


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="scancell",
        description="Calibration workbench for laser scanning cells: scanner, robot and turntable, from a sphere.",
        epilog=_EXIT_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"scancell {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=_Parser)

    def add(name: str, text: str, command: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
        added = commands.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + ".",
            epilog=_EXIT_STATUS,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        added.add_argument("--debug", action="store_true", help="show where an error comes from")
        added.set_defaults(command=command)
        return added

    _solving(add)
    _tools(add)
    _workbench(add)
    return parser


_Add = Callable[[str, str, Callable[[argparse.Namespace], int]], argparse.ArgumentParser]


def _solving(add: _Add) -> None:
    command = add("run", "solve a session folder or archive, no server needed", _command_run)
    _session(command)
    stages = "all (default), or one of camera, laser-plane, tcp, turntable, chain, merge"
    command.add_argument("--stage", default="all", metavar="STAGE", help=stages)
    command.add_argument("--out", type=Path, metavar="DIR", help="write results/ here instead of into the session")
    command.add_argument("--json", action="store_true", help="print one JSON object on standard output")
    _session(add("check", "say what is wrong with a session and what is still missing", _command_check))
    command = add("export", "write tool and table, or the merged cloud, for another program", _command_export)
    _session(command)
    formats = "json: tool and table; ply, pcd, xyz, e57: the merged cloud; stl: its mesh"
    command.add_argument("--format", required=True, metavar="NAME", help=formats)
    command.add_argument("--out", type=Path, metavar="FILE", help="the file to write (default standard output)")
    command = add("report", "write a session's report: one HTML page that needs nothing else", _command_report)
    _session(command)
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the HTML file to write")
    _archive(add("archive", "pack a session into one zip; unpack, verify or replay one", _command_archive_pack))


def _archive(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, parser_class=_Parser)

    def add(name: str, text: str, command: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
        added = actions.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        added.add_argument("--debug", action="store_true", help="show where an error comes from")
        added.set_defaults(command=command)
        return added

    command = add("pack", "write a session's archive, with its report and scene", _command_archive_pack)
    _session(command)
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the zip to write")
    command.add_argument("--no-scene", action="store_true", help="leave out the 3-D scene")
    command = add("unpack", "write an archive's files as a folder, all or nothing", _command_archive_unpack)
    _archive_file(command)
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="a new folder")
    _archive_file(add("verify", "check that an archive is whole and unaltered", _command_archive_verify))
    command = add("replay", "solve an archive afresh and compare every number", _command_archive_replay)
    _archive_file(command)
    command.add_argument("--json", action="store_true", help="print one JSON object")


def _archive_file(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, metavar="FILE", help="the zip")


def _tools(add: _Add) -> None:
    command = add("sphere", "fit the sphere in one cloud or profile", _command_sphere)
    command.add_argument("file", type=Path, metavar="FILE", help="profile: csv, npy; cloud: ply, pcd, xyz, npy")
    command.add_argument("--diameter-mm", type=float, metavar="D", help="the sphere's diameter, where it is known")
    command.add_argument("--unit", choices=("mm", "m"), help="the file's unit of length (default mm)")
    command.add_argument("--json", action="store_true", help="print one JSON object")
    command = add(
        "simulate", "write the session folder of a simulated cell, truth.json beside it", _command_simulate
    )
    command.add_argument("scenario", metavar="SCENARIO", help="tcp, or one of its variants")
    command.add_argument("--seed", type=int, required=True, metavar="N", help="the same seed gives the same files")
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to write")
    command = add("schema", "print the JSON Schema of a session or of a result", _command_schema)
    command.add_argument("record", metavar="RECORD", help="session, or result-STAGE such as result-tcp")
    command = add("bench", "run the benchmarks, side by side with peers", _command_bench)
    command.add_argument("names", nargs="*", metavar="NAME", help="which ones (default all)")
    command.add_argument("--full", action="store_true", help="with all seeds and sizes: takes minutes")


def _workbench(add: _Add) -> None:
    command = add("serve", "serve the workbench", _command_serve)
    _address(command)
    command = add("demo", "run the chain on the simulated cell beside its truth, then serve", _command_demo)
    command.add_argument("--no-serve", action="store_true", help="end after printing")
    command.add_argument("--seed", type=int, default=1, metavar="N", help="of the simulated cell (default 1)")
    _address(command)
    command = add("doctor", "say what is wrong with what a server has stored", _command_doctor)
    _data(command)
    command.add_argument("--repair", action="store_true", help="mend what can be; no server may run")
    command.add_argument("--backup", type=Path, metavar="DIR", help="where --repair takes damaged files from")
    command.add_argument("--json", action="store_true", help="print one JSON object")
    command = add("backup", "write all that a server has stored; it may run meanwhile", _command_backup)
    _data(command)
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="new, or an earlier backup")
    command = add("restore", "make a data folder (or a database) of a backup", _command_restore)
    command.add_argument("backup", type=Path, metavar="BACKUP", help="the folder that `scancell backup` wrote")
    _data(command)
    _tokens(add("token", "manage who may use a server that others can reach", _command_token_list))
    command = add("audit", "print who did what on a server, the newest first", _command_audit)
    command.add_argument("--limit", type=int, default=100, metavar="N", help="how many rows (%(default)s)")
    _data(command)


def _tokens(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True, parser_class=_Parser)

    def add(name: str, text: str, command: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
        added = actions.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        added.add_argument("--debug", action="store_true", help="show where an error comes from")
        added.set_defaults(command=command)
        _data(added)
        return added

    command = add("create", "make a token and print it: this once, for only a hash is kept", _command_token_create)
    command.add_argument("--name", required=True, metavar="NAME", help="who or what it is for")
    command.add_argument("--role", required=True, choices=("read", "capture", "admin"), help="what it may do")
    command.add_argument("--days", type=float, metavar="D", help="how long it is good (default: until revoked)")
    add("list", "print all tokens, without what is secret in them", _command_token_list)
    command = add("revoke", "end a token and the logins made with it", _command_token_revoke)
    command.add_argument("id", metavar="ID", help="as in the list")


def _session(command: argparse.ArgumentParser) -> None:
    command.add_argument("session", type=Path, metavar="SESSION", help="a session folder or archive")


def _address(command: argparse.ArgumentParser) -> None:
    command.add_argument("--host", default="127.0.0.1", metavar="HOST", help="address to serve on (%(default)s)")
    command.add_argument(
        "--port", type=int, default=8000, metavar="PORT", help="0: any that is free (%(default)s)"
    )
    _data(command)


def _data(command: argparse.ArgumentParser) -> None:
    command.add_argument("--data", type=Path, default=Path("sessions"), metavar="DIR", help="%(default)s")


def _command_run(options: argparse.Namespace) -> int:
    from server.commands.solving import run

    return run(options.session, options.stage, options.out, options.json)


def _command_check(options: argparse.Namespace) -> int:
    from server.commands.solving import check

    return check(options.session)


def _command_export(options: argparse.Namespace) -> int:
    from server.commands.solving import export

    return export(options.session, options.format, options.out)


def _command_report(options: argparse.Namespace) -> int:
    from server.commands.solving import report

    return report(options.session, options.out)


def _command_archive_pack(options: argparse.Namespace) -> int:
    from server.commands.archive import pack

    return pack(options.session, options.out, not options.no_scene)


def _command_archive_unpack(options: argparse.Namespace) -> int:
    from server.commands.archive import unpack

    return unpack(options.file, options.out)


def _command_archive_verify(options: argparse.Namespace) -> int:
    from server.commands.archive import verify

    return verify(options.file)


def _command_archive_replay(options: argparse.Namespace) -> int:
    from server.commands.archive import replay

    return replay(options.file, options.json)


def _command_sphere(options: argparse.Namespace) -> int:
    from server.commands.sphere import sphere

    return sphere(options.file, options.diameter_mm, options.unit, options.json)


def _command_simulate(options: argparse.Namespace) -> int:
    from server.commands.simulate import simulate

    return simulate(options.scenario, options.seed, options.out)


def _command_schema(options: argparse.Namespace) -> int:
    from server.commands.schema import schema_text

    sys.stdout.write(schema_text(options.record))
    return OK


def _command_bench(options: argparse.Namespace) -> int:
    from server.commands.bench import bench

    return bench(options.names, options.full)


def _command_serve(options: argparse.Namespace) -> int:
    from server.commands.serve import serve

    return serve(options.host, options.port, options.data)


def _command_doctor(options: argparse.Namespace) -> int:
    from server.commands.store import doctor

    return doctor(options.data, options.repair, options.backup, options.json)


def _command_backup(options: argparse.Namespace) -> int:
    from server.commands.store import backup

    return backup(options.data, options.out)


def _command_restore(options: argparse.Namespace) -> int:
    from server.commands.store import restore

    return restore(options.backup, options.data)


def _command_demo(options: argparse.Namespace) -> int:
    from server.commands.demo import demo
    from server.commands.serve import serve

    status = demo(options.seed, None if options.no_serve else options.data)
    return status if options.no_serve or status else serve(options.host, options.port, options.data)


def _command_token_create(options: argparse.Namespace) -> int:
    from server.commands.tokens import create

    return create(options.name, options.role, options.days, options.data)


def _command_token_list(options: argparse.Namespace) -> int:
    from server.commands.tokens import show

    return show(options.data)


def _command_token_revoke(options: argparse.Namespace) -> int:
    from server.commands.tokens import revoke

    return revoke(options.id, options.data)


def _command_audit(options: argparse.Namespace) -> int:
    from server.commands.tokens import audit

    return audit(options.limit, options.data)


if __name__ == "__main__":
    sys.exit(main())
