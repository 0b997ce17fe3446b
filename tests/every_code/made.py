"""Cases that the rows of several rooms are made of; what is simulated or solved is so once."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from typing import Any

from calib_core.findings import Finding
from calib_core.records import Session, parse_session
from calib_core.review.check import check_session
from calib_core.simulation import SimulatedSession, simulate
from calib_core.stages.pipeline import solve_stage
from tests.trouble import all_table_troubles, all_troubles, troubled

Case = Callable[[], Iterable[Finding]]

CELL = simulate("turntable", 2)
TCP = [c for c in CELL.session.to_json()["captures"] if c["step"] == "tcp"]
TABLE = [c for c in CELL.session.to_json()["captures"] if c["step"] == "turntable"]


def session_of(captures: list[dict[str, Any]], **cell: Any) -> Session:
    """Return a session of these captures, with other fields of the cell."""
    data = CELL.session.to_json()
    return parse_session({**data, "cell": {**data["cell"], **cell}, "captures": captures})


@cache
def of_the_cell() -> list[Finding]:
    """Return what a check says of the cell as it is."""
    return check_session(session_of(TCP), CELL.files.__getitem__)


def check(captures: list[dict[str, Any]] | None = None, **cell: Any) -> Case:
    """Return what a check says of other captures, or another cell."""
    if captures is None and not cell:
        return of_the_cell
    given = TCP if captures is None else captures
    return lambda: check_session(session_of(given, **cell), CELL.files.__getitem__)


def changed(at: int, **fields: Any) -> list[dict[str, Any]]:
    """Return the captures of the still sphere, one of them with other fields."""
    return [{**c, **fields} if k == at else c for k, c in enumerate(TCP)]


@cache
def made(scenario: str, seed: int = 1) -> SimulatedSession:
    """Return a simulated session."""
    return simulate(scenario, seed)


@cache
def solved(scenario: str, stage: str, seed: int = 1) -> Any:
    """Return a stage's result of a simulated session."""
    simulated = made(scenario, seed)
    return solve_stage(simulated.session, stage, simulated.files.__getitem__)


def result_of(scenario: str, stage: str = "tcp", seed: int = 1) -> Case:
    """Return what a stage says of a simulated session."""
    return lambda: solved(scenario, stage, seed).findings


@cache
def tool_of(trouble: str, seed: int = 0) -> Case:
    """Return what the tcp stage says of a cell with a trouble."""

    @cache
    def case() -> Iterable[Finding]:
        cell = troubled(all_troubles()[trouble], seed)
        return solve_stage(cell.session, "tcp", cell.files.__getitem__).findings

    return case


@cache
def table_of(trouble: str, stage: str = "turntable", seed: int = 0) -> Case:
    """Return what a stage says of a cell with a table and a trouble."""

    @cache
    def case() -> Iterable[Finding]:
        cell = troubled(all_table_troubles()[trouble], seed)
        return solve_stage(cell.session, stage, cell.files.__getitem__).findings

    return case


def sides(
    noticed: Callable[[Any], Iterable[Finding]], base: Callable[[], Any], field: str, beyond: Any, within: Any
) -> tuple[Case, Case]:
    """Return what is noticed with a value at either side of its limit, all else alike."""
    return (
        lambda: noticed(with_value(base(), field, beyond)),
        lambda: noticed(with_value(base(), field, within)),
    )


def with_value(record: Any, field: str, value: Any) -> Any:
    """Return a record with another value of a field; dots in its name lead into records within it."""
    own, _, rest = field.partition(".")
    return replace(record, **{own: with_value(getattr(record, own), rest, value) if rest else value})
