"""`scancell check`: what is wrong with a session, and what is still missing."""

import argparse
import sys

from server.console.command import BAD_INPUT, OK, Command, session_argument
from server.console.output import print_result


def _run(options: argparse.Namespace) -> int:
    """Print the findings; return 2 where something blocks solving."""
    from calib_core.archive.archive import opened
    from calib_core.archive.folder import load_session
    from calib_core.findings.reading import findings_as_read
    from calib_core.messages import message, plural
    from calib_core.review.check import check_lines, check_session
    from server.console.language import spoken
    from server.console.texts import severity_said

    with opened(options.session) as folder:
        session, read = load_session(folder)
        findings = check_session(session, read)
    said = spoken(options)
    read = findings_as_read(findings, said.language, session.cell.findings)
    errors = sum(finding.severity == "error" for finding in findings)
    items = check_lines(read, said)
    lines = [f"{severity_said(item.level, said)} {item.where}: {item.sentence}" for item in items]
    lines += [] if errors else [message("Nothing blocks solving.")]
    data = [{**f.to_json(), **item.to_json()} for f, item in zip(read, items, strict=True)]
    print_result(options, "\n".join(lines), {"session": session.name, "findings": data})
    if not errors:
        return OK
    what = plural(
        "{errors} finding blocks solving; fix it first.",
        "{errors} findings block solving; fix them first.",
        by="errors",
        errors=errors,
    )
    print(f"scancell: error: {options.session}: {said.say(what)}", file=sys.stderr)
    return BAD_INPUT


COMMAND = Command(
    "check", "say what is wrong with a session and what is still missing", "session", session_argument, _run
)
