"""Decisions of a verification that were followed by other captures or other limits: told beside the last one."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from calib_core.records import Session
from calib_core.records.decided_before import DecidedBefore, LeftOut

Solved = tuple[Mapping[str, Any], Session | None]
"""A result of `verify` as JSON data, and the session that it was solved from as far as that is known."""


def decided_before(verifications: Sequence[Solved], now: Session) -> list[DecidedBefore]:
    """Return the decisions after which the evidence was changed.

    Parameters
    ----------
    verifications : sequence of Solved
        All that the session had, the oldest first: their sessions say who changed what, and why.
    now : Session
        As it is now, for those without one.
    """
    found: list[DecidedBefore] = []
    for (before, _), (after, solved_from) in pairwise(verifications):
        if before.get("decision") is None:
            continue
        captures = {capture.id: capture for capture in (solved_from or now).captures}
        out = {name: one.excluded_because for name, one in captures.items()}
        back = {name: one.included_because for name, one in captures.items() if one.included_because}
        used, then = _used(before), _used(after)
        added = [name for name in then if name not in used]
        told = DecidedBefore(
            decision=before["decision"],
            solved=before.get("solved"),
            left_out=[LeftOut(capture=name, because=out.get(name)) for name in used if name not in then],
            added=added,
            limits=[name for name, mm in _limits(before).items() if _limits(after).get(name) != mm],
            taken_back=[LeftOut(capture=name, because=back[name]) for name in added if name in back],
        )
        if told.left_out or told.added or told.limits:
            found.append(told.model_copy(update={"text": told.said()}))
    return found


def _used(result: Mapping[str, Any]) -> list[str]:
    return [row["capture"] for row in result.get("residuals", []) if row.get("used")]


def _limits(result: Mapping[str, Any]) -> dict[str, float | None]:
    return {check["name"]: check.get("limit_mm") for check in result.get("checks", [])}
