"""Decisions of a verification that were followed by other captures or other limits: told beside the last one."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from calib_core.records import Session
from calib_core.records.decided_before import DecidedBefore, LeftOut


def decided_before(verifications: Sequence[Mapping[str, Any]], session: Session) -> list[DecidedBefore]:
    """Return the decisions after which the evidence was changed.

    Parameters
    ----------
    verifications : sequence of mapping
        All results of `verify` that the session had, as JSON data, the oldest first.
    session : Session
        As it is now: it says who left a capture out.
    """
    because = {capture.id: capture.excluded_because for capture in session.captures}
    found: list[DecidedBefore] = []
    for before, after in pairwise(verifications):
        if before.get("decision") is None:
            continue
        used, now = _used(before), _used(after)
        told = DecidedBefore(
            decision=before["decision"],
            solved=before.get("solved"),
            left_out=[LeftOut(capture=name, because=because.get(name)) for name in used if name not in now],
            added=[name for name in now if name not in used],
            limits=[name for name, mm in _limits(before).items() if _limits(after).get(name) != mm],
        )
        if told.left_out or told.added or told.limits:
            found.append(told)
    return found


def _used(result: Mapping[str, Any]) -> list[str]:
    return [row["capture"] for row in result.get("residuals", []) if row.get("used")]


def _limits(result: Mapping[str, Any]) -> dict[str, float | None]:
    return {check["name"]: check.get("limit_mm") for check in result.get("checks", [])}
