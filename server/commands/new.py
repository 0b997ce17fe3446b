"""`scancell new`: a session folder of files as they lie."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from server.console.command import NOT_ACCEPTED, OK, Command
from server.console.language import spoken
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.library.new_session import NewSession
    from calib_core.messages import Catalogue


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="with the scanner's and controller's files")
    parser.add_argument("--out", type=Path, metavar="DIR", help="the session folder (FOLDER-session beside it)")
    parser.add_argument("--convention", metavar="NAME", help="in which the poses are written, as a cell names it")
    parser.add_argument("--sphere-mm", type=float, metavar="D", help="the sphere's diameter in mm")
    unit_help = "of a laser tracker's points where their file states none"
    parser.add_argument("--unit", choices=("mm", "cm", "m", "um", "in"), help=unit_help)
    arm = "the robot's arm by its name: joints follow where controllers' files say how it stands"
    parser.add_argument("--arm", metavar="NAME", help=arm)


def _run(options: argparse.Namespace) -> int:
    """Make the session; exit status 1 where something is still missing in it."""
    from calib_core.errors import InputError
    from calib_core.library.new_session import new_session

    if options.sphere_mm is not None and not 0 < options.sphere_mm < 1e5:
        raise InputError("a positive diameter in mm", f"{options.sphere_mm:g}", "Give it in mm.", "--sphere-mm")
    made = new_session(
        options.folder, options.out, options.convention, options.sphere_mm, None, options.unit, options.arm
    )
    print_result(options, _text(made, spoken(options)), made.to_json())
    return NOT_ACCEPTED if made.missing else OK


def _text(made: "NewSession", said: "Catalogue") -> str:
    from calib_core.counted import captures, files
    from calib_core.messages import message
    from calib_core.recognition.taken import TAKEN_FOR_WORDS

    lines: list[str] = [
        message(
            "{folder}: {captures} of {files}",
            folder=str(made.folder),
            captures=captures(made.captures),
            files=files(len(made.files)),
        )
    ]
    for file in made.files:
        capture = f" ({file['capture']})" if file["capture"] else ""
        kind = said.say(TAKEN_FOR_WORDS[file["taken_for"]])
        lines.append(f"  {file['name']}: {kind}{capture}. {said.say(file['why'])}")
    return "\n".join([*lines, *made.notes, *made.missing])


COMMAND = Command("new", "make a session folder of files as they lie", "session", _arguments, _run)
