"""What the TCP's result says of drift within its session: whether all had settled, and what to take again."""

from typing import Any, Final

import numpy as np

from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.warm_up import WarmUp
from calib_core.evidence.numbers import quantity
from calib_core.findings import Code, Finding, sentence_of
from calib_core.findings.codes.tcp import DRIFT_COVERED, DRIFTED
from calib_core.records.evidence import AnyBlock, Axis, Figure, Plot, Series
from calib_core.stages.tcp.record import SessionDrift, SessionDriftPoint, TcpResult

_LARGE_MM: Final = 0.5
_MINUTE_S: Final = 60.0
_WHOLE: Final = 3.0  # minutes from which on no tenths are told
_SETTLED_AFTER: Final = 3.0  # time constants


def session_drift(solution: TcpSolution) -> SessionDrift | None:
    """Return the drift within a session as a record, None where there are too few captures to tell."""
    found = solution.beside.warm_up
    if found is None:
        return None
    code = DRIFT_COVERED if _is_covered(found, solution) else DRIFTED
    return SessionDrift(
        moved=found.moved,
        drift_mm=found.drift_mm,
        uncertainty_mm=found.uncertainty_mm,
        found=found.found,
        settled=found.settled,
        over_s=float(np.ptp(found.at)) if found.timed else None,
        settling_s=found.constant if found.timed else None,
        again=list(found.captures) if found.found and found.settled and code is DRIFTED else [],
        sentence=sentence_of(_finding(code, found)) if found.found else "",
        points=[
            SessionDriftPoint(
                capture=name,
                at_s=float(at) if found.timed else None,
                offset_mm=float(offset),
                sigma_mm=float(sigma),
                course_mm=float(course),
            )
            for name, at, offset, sigma, course in zip(
                found.names, found.at, found.offset_mm, found.sigma_mm, found.course_mm, strict=True
            )
        ],
    )


def _is_covered(drift: WarmUp, solution: TcpSolution) -> bool:
    """Return whether the answer's uncertainty may have room for it: the answer is that of the session's middle."""
    stated_mm = solution.in_view.stated_mm
    surely_mm = drift.drift_mm - drift.uncertainty_mm
    return surely_mm <= min(2 * stated_mm, _LARGE_MM)


def drift_findings(solution: TcpSolution) -> list[Finding]:
    """Return a drift that chance does not explain: a note where the answer's uncertainty has room for it."""
    found = solution.beside.warm_up
    if found is None or not found.found:
        return []
    code = DRIFT_COVERED if _is_covered(found, solution) else DRIFTED
    return [_finding(code, found)]


def _finding(code: Code, found: WarmUp) -> Finding:
    values: dict[str, Any] = {
        "moved": found.moved,
        "drift_mm": found.drift_mm,
        "uncertainty_mm": found.uncertainty_mm,
    }
    if found.settled and found.constant is not None:
        how: dict[str, Any] = (
            {"course": "first-minutes", "minutes": _minutes(_SETTLED_AFTER * found.constant)}
            if found.timed
            else {"course": "first-captures", "first": len(found.captures)}
        )
        return code(found.captures, **values, **how)
    how = (
        {"course": "all-minutes", "minutes": _minutes(float(np.ptp(found.at)))}
        if found.timed
        else {"course": "all-captures", "count": len(set(found.names))}
    )
    return code(**values, **how)


def _minutes(seconds: float) -> str:
    minutes = seconds / _MINUTE_S
    return f"{minutes:.0f}" if minutes >= _WHOLE else f"{minutes:.1f}"


def drift_blocks(result: TcpResult) -> list[AnyBlock]:
    """Return the drift within the session as a figure and a plot over time.

    Of captures that do not fit together, a drift that explains nothing explains what chance and their errors made.
    """
    drift, failed = result.warm_up, result.verdict == "fail"
    if drift is None or (failed and not drift.found):
        return []
    timed = drift.over_s is not None
    minutes = [p.at_s / _MINUTE_S for p in drift.points if p.at_s is not None]
    x = minutes if timed else [float(k + 1) for k in range(len(drift.points))]
    names = [p.capture for p in drift.points]
    remark = ""
    if drift.found:
        remark = "settled by the end" if drift.settled else "not settled"
    return [
        Figure(
            label="Drift within the session",
            quantity=quantity(drift.drift_mm, "mm", None if failed else drift.uncertainty_mm / 2),
            remark=remark or "none beyond doubt",
            detail=not drift.found,
        ),
        Plot(
            id="drift",
            title="Drift within the session",
            detail=not drift.found,
            shape="xy",
            caption="How far each capture lies along the drift, from where the session ends, and the drift that "
            "explains them best: what warms up bends towards zero, what is loose goes on.",
            x=Axis(label="Time", unit="min") if timed else Axis(label="Capture"),
            y=Axis(label="Offset", unit="mm"),
            series=[
                Series(label="captures", x=x, y=[p.offset_mm for p in drift.points], captures=names),
                Series(label="drift", x=x, y=[p.course_mm for p in drift.points]),
            ],
        ),
    ]
