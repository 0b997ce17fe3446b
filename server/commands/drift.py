"""`scancell drift`: how a cell's answers moved from session to session."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from calib_core.messages import explained, message, plural
from server.console.command import NOT_ACCEPTED, OK, Command, server_argument
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.records.policy import Environment
    from calib_core.review.between_sessions import SolvedSession
    from calib_core.review.drift import CellDrift, DriftPoint


def _arguments(parser: argparse.ArgumentParser) -> None:
    of_one = "of one cell, the oldest first; with --server the cell's id"
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION", help=of_one)
    server_argument(parser)


def _run(options: argparse.Namespace) -> int:
    """Print each figure over the sessions; return 1 where one changed by more than its uncertainty."""
    from calib_core.review.drift import cell_drift

    found = cell_drift(_of_one_cell(options.sessions)) if options.server is None else _of_server(options)
    print_result(options, _text(found), found.to_json())
    return NOT_ACCEPTED if found.flags else OK


def _of_server(options: argparse.Namespace) -> "CellDrift":
    from calib_core.errors import InputError
    from calib_core.review.drift import CellDrift
    from server.console.remote import connected

    if len(options.sessions) != 1:
        got = plural("{count} name", "{count} names", by="count", count=len(options.sessions))
        raise InputError("one cell's id with --server", got, "Name the cell; its sessions are known.", "SESSION")
    with connected(options) as api:
        return CellDrift.model_validate(api.cells_get_drift(str(options.sessions[0])))


def _of_one_cell(paths: Sequence[Path]) -> list["SolvedSession"]:
    """Return the sessions; those that name their cell must name the same one."""
    from calib_core.errors import InputError

    found = [_solved(path) for path in paths]
    cells = list(dict.fromkeys(cell for _, cell in found if cell))
    if len(cells) > 1:
        to_do = message("Name sessions of one cell: drift of two cells says nothing.")
        need = "sessions whose cell.id is the same"
        raise InputError(need, "'{one}' and '{other}'", to_do, "SESSION", one=cells[0], other=cells[1])
    return [session for session, _ in found]


def _solved(path: Path) -> tuple["SolvedSession", str | None]:
    """Return a session's results and its cell's id, None where it has none."""
    from calib_core.archive.archive import is_archive, opened
    from calib_core.archive.dates import solved_when
    from calib_core.archive.folder import load_session
    from calib_core.archive.stored_results import stored_results
    from calib_core.graph.keys import Graph
    from calib_core.review.between_sessions import solved_session

    with opened(path) as folder:
        session, read = load_session(folder)
        results = stored_results(folder)
        stale = Graph.stale_of(session, read, results)
        date = solved_when(folder, results, unpacked=is_archive(path))
    return solved_session(str(path), date, session, results, stale, path.name), session.cell.id


def _text(found: "CellDrift") -> str:
    lines: list[str] = []
    for series in found.series:
        lines.append(
            message(
                "{title}, {unit} (change from the mean of those before, k = 2)",
                title=series.title,
                unit=series.unit,
            )
        )
        for point in series.points:
            limit = "" if point.limit is None else message("limit {limit:.4f}", limit=point.limit)
            mark = message("OUTLIER") if point.outlier else message("CHANGED") if point.flagged else ""
            numbers = f"{point.name:<24} {point.change:10.4f} ± {point.uncertainty:.4f}"
            lines.append("  " + _row(numbers, limit, mark, _temperatures(point.environment).strip()))
    if found.within:
        lines.append(message("Drift within each session, mm (first capture to last, k = 2)"))
    for one in found.within:
        mark = (message("settled") if one.settled else message("NOT SETTLED")) if one.found else ""
        lines.append("  " + _row(f"{one.name:<24} {one.drift_mm:10.4f} ± {one.uncertainty_mm:.4f}", mark))
    lines += [explained(one.name, one.sentence) for one in found.within if one.found]
    lines += found.flags or _unchanged(found)
    lines += found.trends
    lines += [said for series in found.series[:1] if (said := _found_at_once(series.points[-1]))]
    lines += [explained(session, why) for session, why in found.left_out.items()]
    return "\n".join(lines)


def _row(numbers: str, *marks: str) -> str:
    """Return a line of a table, numbers and what stands behind them, each where there is one."""
    said = [mark for mark in marks if mark]
    return message("{numbers}  {marks:,}", numbers=numbers, marks=said) if said else numbers


def _found_at_once(newest: "DriftPoint") -> str:
    if newest.finds is None:
        return ""
    if newest.like:
        return message("A step of {finds:.2f} mm is found at once in 95 of 100 cases.", finds=newest.finds)
    return message(
        "A step of {finds:.2f} mm is found at once in 95 of 100 cases: sessions at other poses differ by what the "
        "arm does there. At the same poses each time, or with more captures, a smaller one is.",
        finds=newest.finds,
    )


def _temperatures(told: "Environment | None") -> str:
    known = told.to_json() if told is not None else {}
    return "".join(f"  {name.removesuffix('_c')} {value:g} °C" for name, value in known.items())


def _unchanged(found: "CellDrift") -> list[str]:
    if any(len(series.points) > 1 for series in found.series):
        return [message("Nothing changed by more than its uncertainty.")]
    return [message("A change is told from the second solved session on.")]


COMMAND = Command(
    "drift", "say how a cell's answers moved over its sessions", "session", _arguments, _run, uses_server=True
)
