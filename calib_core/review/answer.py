"""A session's answer in one record: frames, covariance, verdict, date, hashes, and whether it is stale."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from pydantic import Field

from calib_core.cell.axes import names_axes
from calib_core.cell.carriers import scanner_names
from calib_core.cell.layout import Carrier
from calib_core.errors import CalibrationError, ConflictError, InputError
from calib_core.exports.answer import Answer, answer_of
from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.exports.workpiece import at_workpiece
from calib_core.findings import findings_as_read, judgement
from calib_core.findings.codes.circumstances import CERTIFICATE_OVERDUE
from calib_core.findings.codes.faults import FAULT_CODES
from calib_core.findings.codes.provenance import SEAL_BROKEN
from calib_core.frames import FloatArray, RigidTransform
from calib_core.graph.keys import Graph
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records import Finding, Finite, Matrix4, ReadFile, Record, ResultsData, Session, Severity, Verdict
from calib_core.records.base import Open, Rows
from calib_core.records.decided_before import DecidedBefore
from calib_core.records.policy import Equipment
from calib_core.records.results import FoundFrame

_FORMAT: Final = "scancell-answer/1"


class AnsweredFrame(Record):
    """A frame: 4×4 rows in mm, its covariance, and the same as the cell's controller writes it.

    `covariance` is 6×6 of rx ry rz tx ty tz in rad and mm, the rotation perturbing on the right.
    """

    matrix: Matrix4
    covariance: Rows
    numbers: list[Finite]
    number_sigmas: list[Finite]


class SessionAnswer(Record):
    """The answer of a session: of `chain` or, without a table, of `tcp`.

    Of a table that is known to its scanner alone it is `turntable`'s, has `laser_from_turntable` and no frame in
    base; both sigmas are that frame's then. `faults` says what speaks against using it, by name, if anything;
    `findings` the same, and what its results notice; `inputs_sha256` are the hashes of what its stages were
    solved from; `solved` is when, ISO 8601, where that is known; `budget` what each source of error contributes,
    where the stage says it; `decision` that of the latest verification, `limits_changed` which of its limits were
    changed after its first capture; `frames` are all transforms of a cell of several scanners or named axes;
    `workpiece_sigma_mm` how well a point at the workpiece is known in its worst
    direction (one sigma); `verified` is when the latest verification was solved, `equipment` what it was found
    with; `decided_before` tells decisions after which captures were left out or added, or limits changed.
    """

    format: str = _FORMAT
    session: str
    cell: str
    stage: str
    verdict: Verdict
    stale: bool
    faults: list[str]
    findings: list[Finding] = Field(default_factory=list[Finding])
    warnings: list[str]
    undetermined: list[Any]
    solved: str | None
    software: str
    inputs_sha256: dict[str, str]
    pose_convention: str
    names: list[str]
    units: str
    tool0_from_laser: AnsweredFrame | None
    base_from_laser: AnsweredFrame | None = None
    base_from_turntable: AnsweredFrame | None
    laser_from_turntable: AnsweredFrame | None = None
    position_sigma_mm: Open
    rotation_sigma_deg: Open
    budget: Any = None
    decision: str | None = None
    limits_changed: list[str] = Field(default_factory=list[str])
    frames: list[FoundFrame] = Field(default_factory=list[FoundFrame])
    workpiece_sigma_mm: float | None = None
    verified: str | None = None
    decided_before: list[DecidedBefore] = Field(default_factory=list[DecidedBefore])
    equipment: list[Equipment] = Field(default_factory=list[Equipment])

    @property
    def tool(self) -> AnsweredFrame | None:
        """The scanner on the flange."""
        return self.tool0_from_laser


def cell_id(session: Session) -> str:
    """Return the cell's `id`, or one that is made from the session's name where it has none."""
    return cell_id_of(getattr(session.cell, "id", None), session.name)


def cell_id_of(given: str | None, name: str) -> str:
    """Return the cell's id that was given, or one that is made from a session's name."""
    return given or re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:64] or "cell"


def answer_record(answer: Answer) -> SessionAnswer:
    """Return what exports write as the record that programs act on."""
    session, result = answer.session, answer.results[answer.stage]
    convention = CONVENTIONS[session.cell.pose_convention]
    stages = [answer.stage]
    if answer.stage == "tcp" and answer.base_from_turntable is not None:
        stages.append("turntable")
    record = SessionAnswer(
        session=session.name,
        cell=cell_id(session),
        stage=answer.stage,
        verdict=answer.verdict,
        stale=answer.stale,
        faults=list(answer.all_faults),
        findings=answer.findings,
        warnings=list(answer.warnings),
        undetermined=list(result.get("undetermined", [])),
        solved=answer.date or None,
        software=str(result.get("software", "")),
        inputs_sha256={stage: str(answer.results[stage].get("inputs_sha256", "")) for stage in stages},
        pose_convention=convention.name,
        names=convention.numbers.split(),
        units=convention.units,
        tool0_from_laser=_scanner(convention.name, answer, "tool0"),
        base_from_laser=_scanner(convention.name, answer, "base"),
        base_from_turntable=_table(convention.name, answer),
        laser_from_turntable=_seen(convention.name, answer),
        position_sigma_mm=answer.position_sigma_mm,
        rotation_sigma_deg=answer.rotation_sigma_deg,
        budget=_budget(answer),
        decision=answer.decision,
        limits_changed=answer.results.get("verify", {}).get("limits_changed") or [],
        workpiece_sigma_mm=_workpiece_sigma_mm(answer),
        verified=answer.results.get("verify", {}).get("solved"),
        equipment=session.cell.equipment or [],
        decided_before=list(answer.decided_before),
    )
    several = len(scanner_names(session.cell)) > 1 or names_axes(session.cell)
    return record.model_copy(update={"frames": list(answer.frames)}) if several else record


def answer_as_read(
    answer: SessionAnswer, language: str = "en", severities: Mapping[str, Severity] | None = None
) -> SessionAnswer:
    """Return an answer as it is read: in a language, with a cell's own severities; its faults stay."""
    if language == "en" and not severities:
        return answer
    found = findings_as_read(answer.findings, language, severities)
    others = (*FAULT_CODES.values(), CERTIFICATE_OVERDUE, SEAL_BROKEN)  # not the result's own
    beside = {code.name for code in others}
    told = judgement(finding for finding in found if finding.code not in beside)
    made = {"findings": found, "verdict": told["verdict"], "warnings": told["warnings"]}
    return answer.model_copy(update=made)


def answer_of_folder(
    session: Session, results: ResultsData, read: ReadFile, date: str = "", **beside: Any
) -> SessionAnswer | None:
    """Return the answer of a session whose files can be read; None where nothing that can be one is solved.

    `beside` is what is known beside its results, as `decided_before`.
    """
    stale = Graph.of_files(session, read).stale(results)
    try:
        return answer_record(replace(answer_of(session, results, stale, date), **beside))
    except ConflictError:
        return None


def _budget(answer: Answer) -> Any:
    """Return the error budget at the workpiece as JSON data; None of results that have no covariances for it.

    None of a stale answer, too: what it was solved from may be gone, and with other captures it is another one.
    """
    from calib_core.guidance.part_budget import budget_at

    if answer.stale:
        return None
    try:
        return budget_at(answer.session, answer.results).to_json()
    except (CalibrationError, KeyError, TypeError, ValueError):
        return None


def _workpiece_sigma_mm(answer: Answer) -> float | None:
    """Return the standard deviation at the workpiece in its worst direction; None where a budget would be none."""
    if answer.stale:
        return None
    try:
        places = at_workpiece(answer.session, answer.results[answer.stage])
    except (InputError, KeyError, TypeError, ValueError):
        return None
    sigmas = {of: [place.worst_sigma_mm for place in places if place.of == of] for of in ("both", "tool", "table")}
    return max(sigmas["both"] or sigmas["tool"] or sigmas["table"], default=None)


def _frame(convention: str, frame: RigidTransform, covariance: FloatArray) -> AnsweredFrame:
    return AnsweredFrame(
        matrix=frame.to_rows(),
        covariance=covariance.tolist(),
        numbers=tool_numbers(convention, frame),
        number_sigmas=tool_number_sigmas(convention, frame, covariance),
    )


def _scanner(convention: str, answer: Answer, mount: Carrier) -> AnsweredFrame | None:
    if answer.is_open:
        return None
    if answer.mount_from_laser.into != mount:
        return None
    return _frame(convention, answer.mount_from_laser, answer.tool_covariance)


def _seen(convention: str, answer: Answer) -> AnsweredFrame | None:
    seen = answer.laser_from_turntable
    return seen and _frame(convention, seen, answer.tool_covariance)


def _table(convention: str, answer: Answer) -> AnsweredFrame | None:
    if answer.is_open:
        return None
    if answer.base_from_turntable is None or answer.table_covariance is None:
        return None
    return _frame(convention, answer.base_from_turntable, answer.table_covariance)
