"""What the still sphere's captures are worth at the workpiece so far, and the pose that helps most."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from calib_core.cell.found import SCANNER_FRAMES, of_scanner
from calib_core.chain.undetermined import open_directions
from calib_core.evidence.numbers import COVERAGE, plus_minus, quantity_text
from calib_core.guidance.arm_plan import arm_worth
from calib_core.guidance.candidates import Candidates
from calib_core.guidance.design import Design, worst_sigma
from calib_core.guidance.planner import NextPose, Situation, next_pose, still_needed
from calib_core.guidance.prior import (
    MOST_TAKEN,
    Contradiction,
    in_hand,
    known_of,
    several_balls_seen,
    situation_of,
)
from calib_core.messages import message
from calib_core.records import ArmTable, Capture, Cell, Measured, Meter, MeterPoint, ResultsData, Session
from calib_core.steps import steps_that_show, table_stages, tool_stages

_OPEN_MM = 20.0  # beyond it ± is no figure yet
_PLENTY, _LITTLE = 10, 0.95
_WEAK = 0.2  # of the limits of what is undetermined: what a result warns of
_HISTORY = 24
_TO_VERIFY = 150  # candidates: the best of fewer is good enough to verify by
_NEWEST = 2 * MOST_TAKEN
_OF_CAPTURE = (
    "id",
    "step",
    "kind",
    "files",
    "center_mm",
    "pose",
    "side",
    "excluded",
    "table_deg",
    "mount",
    "joints_deg",
    "joints_mm",
    "scanner",
)
_OF_MEASURED = (
    "capture", "kind", "verdict", "center_mm", "radius_mm", "point_sigma_mm", "points_per_independent",
    "extent_deg", "on_sphere",
)  # fmt: skip
_OF_RESULT = (
    "stage", *SCANNER_FRAMES, "sphere_center_in_base_mm", "sphere_center_in_tool0_mm", "variance_components",
    "workpiece", "stale", "angle_sigma_deg", "verdict", "undetermined", "arm_model",
)  # fmt: skip


@dataclass(frozen=True)
class ArmAdvice:
    """What the next pose is for, where the arm's own errors are solved with the tool.

    Attributes
    ----------
    term : str
        The one of `arms.errors.arm_terms` of which it tells most.
    worth_from : int or None
        How many captures it takes until they are worth solving on such an arm; None where there are as many.
    """

    term: str
    worth_from: int | None


@dataclass(frozen=True, eq=False)
class Advice:
    """What the captures are worth by now, and what to do next.

    Attributes
    ----------
    meter : Meter
    open_directions : list of str
        What the captures do not determine, by the same rule as a result's `undetermined`.
    next : NextPose or None
        None where there is enough, or no pose is allowed.
    apart : tuple of str
        Captures that the others contradict.
    contradicted : bool
        Whether no tool lets most captures agree: then there is no figure, and no pose to advise.
    arm : ArmAdvice or None
        None where the arm's own errors are not to be solved.
    """

    meter: Meter
    open_directions: list[str]
    next: NextPose | None
    apart: tuple[str, ...] = ()
    contradicted: bool = False
    arm: ArmAdvice | None = None

    def words(self) -> str:
        """Return ``± 0.9 mm, wanted ± 0.2 mm``."""
        wanted = self.meter.wanted_mm
        now = amount(self.meter.uncertainty_mm)
        return now if wanted is None else message("{now}, wanted {wanted_mm}", now=now, wanted_mm=amount(wanted))


def amount(expanded_mm: float | None) -> str:
    """Return an expanded uncertainty as text; where there is none yet, that."""
    return (
        message("not determined yet")
        if expanded_mm is None
        else quantity_text(plus_minus(expanded_mm / COVERAGE, "mm"))
    )


def tcp_advice(session: Session, measured: Sequence[Measured], results: ResultsData) -> Advice | None:
    """Return what to do next for the TCP, None where too little is known for a pose to be chosen.

    The same captures give the same advice; it is kept, because page, scene and command line ask for it at once.
    """
    session = in_hand(session)
    own = {stage: of_scanner(result, session.cell) for stage, result in results.items()}
    advice = _advised(inputs_of(session, measured, own, ("tcp",), _NEWEST))
    accused = advice is not None and (advice.contradicted or advice.apart)
    if accused and several_balls_seen(session.cell, measured):
        return None  # of several balls any one may have been taken: the result tells them apart
    return advice


def verify_pose(session: Session, measured: Sequence[Measured], results: ResultsData) -> NextPose | None:
    """Return the verification's next pose: away from the calibration's, and telling most beside its own."""
    return _to_verify(inputs_of(session, measured, results, steps_that_show("sphere")))


def inputs_of(
    session: Session,
    measured: Sequence[Measured],
    results: ResultsData,
    steps: tuple[str, ...],
    newest: int | None = None,
) -> str:
    """Return all that an advice rests on, as text: the same captures give the same advice, which is kept by it.

    With `newest` of many captures the first, which says how the scanner is held, and so many of the last.
    """
    told = [capture for capture in session.captures if capture.step in steps]
    if newest is not None and len(told) > newest:
        told = [told[0], *told[-newest:]]
    captures = [capture.model_dump(include=set(_OF_CAPTURE)) for capture in told]
    names = {c["id"] for c in captures}
    seen = [m.model_dump(include=set(_OF_MEASURED)) for m in measured if m.capture in names]
    known = {*tool_stages(), *table_stages()}
    solved = {stage: _told(result) for stage, result in results.items() if stage in known}
    told = {"cell": session.cell.model_dump(mode="json"), "captures": captures, "seen": seen, "results": solved}
    return json.dumps(told, sort_keys=True)


def inputs_read(told: str) -> tuple[Session, list[Measured], dict[str, Any]]:
    """Return session, what was seen and results from that text."""
    data = json.loads(told)
    captures = [Capture.model_validate(capture) for capture in data["captures"]]
    session = Session(cell=Cell.model_validate(data["cell"]), captures=captures)
    return session, [Measured.model_validate(one) for one in data["seen"]], data["results"]


@lru_cache(maxsize=8)
def _to_verify(told: str) -> NextPose | None:
    situation = situation_of(*inputs_read(told), "verify")
    return None if situation is None else next_pose(situation, _TO_VERIFY, until=0)


def _told(result: Mapping[str, Any]) -> dict[str, Any]:
    rows = [{"capture": row["capture"], "used": row.get("used", True)} for row in result.get("residuals", [])]
    return {name: result.get(name) for name in _OF_RESULT} | {"residuals": rows}


@lru_cache(maxsize=16)
def _advised(told: str) -> Advice | None:
    session, measured, results = inputs_read(told)
    known = known_of(session, measured, results)
    if isinstance(known, Contradiction):
        meter = Meter(uncertainty_mm=None, wanted_mm=session.cell.wanted_mm)
        return Advice(meter, [], None, contradicted=True)
    return None if known is None else advice_in(known, session.cell.wanted_mm, _stated(results))


def _stated(results: ResultsData) -> float | None:
    """Return the ± (k = 2) at the workpiece that a result states which is up to date."""
    for stage in tool_stages():
        result = results.get(stage)
        if result is None or result.get("stale") or result.get("verdict") == "fail":
            continue
        if result.get("workpiece"):
            covariance = np.array(result["workpiece"]["covariance"], dtype=float)
            return COVERAGE * float(worst_sigma(covariance))
    return None


def advice_in(situation: Situation, wanted_mm: float | None, stated_mm: float | None = None) -> Advice:
    """Return what to do next in a situation; ± are k = 2, `stated_mm` is a result's own."""
    count = len(situation.taken)
    design = Design(situation.taken, situation.assumed)
    after_each = [float(worst_sigma(design.workpiece(range(n + 1)))) for n in range(count)]
    # The figure of a solve, or of one behind the guide, is the better one: what a capture gains is a share of it.
    solved_mm = stated_mm if stated_mm is not None else promised_mm(situation)
    scale = 1.0 if solved_mm is None or not count else solved_mm / (COVERAGE * after_each[-1])
    history = [
        MeterPoint(capture=o.capture, uncertainty_mm=expanded(scale * sigma))
        for o, sigma in zip(situation.taken, after_each, strict=True)
    ]
    covariance = design.tool(range(count))
    still_open = [str(d.description) for d in open_directions(covariance, _WEAK)]
    now = stated_mm if stated_mm is not None else history[-1].uncertainty_mm if count else None
    meter = Meter(
        uncertainty_mm=now, wanted_mm=wanted_mm, stated=stated_mm is not None, history=history[-_HISTORY:]
    )
    agreed = not still_open and (situation.agreed or stated_mm is not None)
    apart = situation.apart if stated_mm is None else ()
    if agreed and now is not None and wanted_mm is not None and now <= wanted_mm:
        return Advice(meter.model_copy(update={"enough": True, "still_needed": 0}), [], None)
    chosen = next_pose(situation)
    if chosen is None:
        return Advice(meter, still_open, None, apart)
    update: dict[str, Any] = {"after_next_mm": expanded(chosen.after_mm * scale)}
    enough = False
    if wanted_mm is not None:
        more = still_needed(situation, wanted_mm / COVERAGE / scale)
        update["still_needed"] = None if more is None else max(more, 1)
    else:
        little = chosen.after_mm > _LITTLE * chosen.before_mm
        enough = agreed and (count >= _PLENTY or little)
        update["still_needed"] = 0 if enough else max(_PLENTY - count, 1)
    meter, arm = meter.model_copy(update={**update, "enough": enough}), _of_arm(situation, chosen)
    return Advice(meter, still_open, chosen, apart, arm=arm)


def _of_arm(situation: Situation, chosen: NextPose) -> ArmAdvice | None:
    given, count = situation.with_arm, len(situation.taken)
    if given is None or given.arm is None:
        return None
    seen = Candidates((chosen.base_from_tool0,), chosen.center_in_laser_mm[None])
    design = Design([*situation.taken, *situation.seen_from(given.arm.reached(seen))], given)
    better = design.arm_terms(range(len(design))) / design.arm_terms(range(count))
    told = given.arm.table.model_dump_json(), given.sigmas.position_mm, float(np.rad2deg(situation.room.tilt_rad))
    first = _worth_from(*told)
    later = first if first is not None and first > count else None
    return ArmAdvice(given.arm.terms[int(np.argmin(better))].name, later)


@lru_cache(maxsize=8)
def _worth_from(arm: str, own_mm: float, tilt_deg: float) -> int | None:
    """Return from how many captures on an arm's errors are worth solving, None: more than are usual."""
    worth = arm_worth(ArmTable.model_validate_json(arm), own_mm, tilt_deg)
    return next((one.captures for one in worth if one.worth_it), None)


def promised_mm(situation: Situation) -> float | None:
    """Return the ± (k = 2) at the workpiece that a solve of the captures will state; None of too few."""
    found = situation.workpiece
    return None if found is None else COVERAGE * float(worst_sigma(found))


def expanded(sigma_mm: float) -> float | None:
    """Return an expanded uncertainty; None where it is too large to be one yet."""
    return COVERAGE * sigma_mm if sigma_mm < _OPEN_MM else None
