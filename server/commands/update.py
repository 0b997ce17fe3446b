"""`scancell update`: what an update means for a data folder, and the way back."""

import argparse
from pathlib import Path

from calib_core.messages import explained, message, templates
from server.console.command import NOT_ACCEPTED, OK, Command, data_argument
from server.console.output import print_result

_TOLD = templates(
    {
        "none": "no database in it yet",
        "current": "written by this version",
        "older": "written by an older version; a copy is kept and it is updated when it is served",
        "newer": "written by a newer version, which this one cannot use",
    }
)


def told(data: str | Path) -> str:
    """Return in words which version has written a data folder."""
    from server.store.updates import state_of

    return _TOLD[state_of(Path(data))]


def _arguments(parser: argparse.ArgumentParser) -> None:
    data_argument(parser)
    back = "give the database the form before its last update, for the earlier version; a copy of it is kept"
    parser.add_argument("--back", action="store_true", help=back)


def _run(options: argparse.Namespace) -> int:
    """Say which version has written the data folder, or take it back; returns 1 where a newer one has."""
    from server.store.updates import go_back, state_of

    if options.back:
        went = go_back(options.data)
        text = message(
            "{data}: the database has the form of revision {now} again (before: {before}). Now install the "
            "earlier version of scancell; what only the newer one can store is kept in {copy}.",
            data=str(options.data),
            now=went.now,
            before=went.before,
            copy=str(went.copy),
        )
        print_result(options, text, {"revision": went.now, "before": went.before, "copy": str(went.copy)})
        return OK
    state = state_of(options.data)
    print_result(options, explained(str(options.data), _TOLD[state]), {"state": state})
    return NOT_ACCEPTED if state == "newer" else OK


COMMAND = Command("update", "which version has written a data folder; the way back", "workbench", _arguments, _run)
