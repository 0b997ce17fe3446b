"""What exports write: tool and table of a solved session, with what is known about them."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from calib_core.archive.folder import result_data
from calib_core.archive.stored_results import require_result
from calib_core.captures.certificate import overdue_certificates
from calib_core.cell.carriers import scanner_name
from calib_core.cell.found import answering, of_scanner, placed_table, scanner_answered, table_seen
from calib_core.errors import ConflictError, InputError
from calib_core.findings import Finding, findings_in, judgement, worst_of
from calib_core.findings.codes.faults import FAULT_CODES
from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import message
from calib_core.moment import now
from calib_core.records import Record, ResultsData, Session, Verdict
from calib_core.records.decided_before import DecidedBefore
from calib_core.records.faults import NOT_CONFIRMED, in_order, refuse_faults
from calib_core.records.results import FoundFrame


@dataclass(frozen=True, eq=False)
class Answer:
    """Tool and table, with uncertainty and origin.

    Parameters
    ----------
    session : Session
    results : mapping
        Results as JSON data, for exports that tell more: those of the answer, and of others what is not stale.
    stage : str
        The stage whose tool this is: `chain` or, without a table, `tcp`; `turntable` of a table that is known to
        its scanner alone, `hand-eye` of a scanner that boards alone tell.
    mount_from_laser : RigidTransform
        The scanner's pose on the flange, or in base where it stands still.
    tool_covariance : (6, 6)
        Of rx ry rz tx ty tz, rad and mm; where there is one, of `laser_from_turntable`.
    base_from_turntable : RigidTransform or None
    table_covariance : (6, 6) or None
    verdict : str
    inputs_sha256 : str
    date : str
        When it was solved, ISO 8601, or empty.
    stale : bool
        Whether its inputs have changed since.
    decision : str or None
        Of the latest verification; of one that is stale only that it failed, so that nothing undoes it but
        another verification.
    of_moment : tuple of str
        The faults that were worked out when somebody asked; not stored with it.
    decided_before : tuple of DecidedBefore
        Decisions after which the verification's evidence was changed.
    provenance : tuple of str
        How the results that it rests on came to be here, each kind once.
    altered : bool
        Whether somebody changed stored records of its session by other ways than the server.
    """

    session: Session
    results: ResultsData
    stage: str
    mount_from_laser: RigidTransform
    tool_covariance: FloatArray
    base_from_turntable: RigidTransform | None = None
    table_covariance: FloatArray | None = None
    verdict: Verdict = "pass"
    inputs_sha256: str = ""
    date: str = ""
    stale: bool = False
    warnings: tuple[str, ...] = field(default=())
    decision: str | None = None
    of_moment: tuple[str, ...] = ()
    decided_before: tuple[DecidedBefore, ...] = ()
    provenance: tuple[str, ...] = ()
    altered: bool = False

    @property
    def is_open(self) -> bool:
        """Whether the motions leave open where scanner and table are."""
        return bool(self.results.get(self.stage, {}).get("up_to_shift"))

    @property
    def laser_from_turntable(self) -> RigidTransform | None:
        """Where a table is that is known to its scanner alone; None of all others, which are in base."""
        seen = table_seen(self.results.get(self.stage, {}))
        return seen and RigidTransform.from_rounded(seen.matrix, "laser", "turntable")

    @property
    def tool(self) -> RigidTransform:
        """The scanner's pose on the flange; raises ConflictError where it stands still: it is no tool then."""
        if self.mount_from_laser.into != "tool0":
            need = "a scanner on the flange, which a controller knows as a tool"
            to_do = "Export it as a user frame of its brand, or as json, csv or for ROS."
            raise ConflictError(need, "one that stands still: base_from_laser", to_do, self.stage)
        return self.mount_from_laser

    tool0_from_laser = tool  # by the name of the field, for exports of others

    @property
    def frames(self) -> tuple[FoundFrame, ...]:
        """All transforms that its stages found, of every scanner and axis: each by the stage that answers."""
        found: dict[tuple[str, str, str | None], FoundFrame] = {}
        for result in self.results.values():
            for one in map(FoundFrame.model_validate, result.get("frames") or ()):
                found.setdefault((one.into, one.outof, one.scanner), one)
        return tuple(found.values())

    def scanners(self) -> dict[str, tuple[RigidTransform, FloatArray]]:
        """Return by name where each scanner of a cell that names them is, with its covariance (6, 6).

        Not those whose place the captures leave open.
        """
        found: dict[str, tuple[RigidTransform, FloatArray]] = {}
        for frame in self.frames:
            placed = np.isfinite(np.array(frame.matrix, dtype=float)).all()
            if frame.outof == "laser" and frame.scanner is not None and placed:
                on: Literal["tool0", "base"] = "tool0" if frame.into == "tool0" else "base"
                covariance = np.array(frame.covariance or np.full((6, 6), np.nan), dtype=float)
                found.setdefault(
                    frame.scanner, (RigidTransform.from_rounded(frame.matrix, on, "laser"), covariance)
                )
        return found

    def of_scanner(self, name: str | None) -> "Answer":
        """Return the answer, and what was captured for it, of one of several scanners.

        Raises InputError where there is no such one.
        """
        if name is None:
            return self
        scanners = self.scanners()
        if name not in scanners:
            known = ", ".join(scanners) or message("none by name")
            raise InputError("a scanner that was solved", "'{name}'", "Name one of these: {known}.", "of_scanner",
                             name=name, known=known)  # fmt: skip
        frame, covariance = scanners[name]
        cell, told = self.session.cell, self.session.cell.scanners or {}
        own = cell.model_copy(update={"scanners": {name: told[name]}}) if name in told else cell
        captures = [one for one in self.session.captures if scanner_name(cell, one) in ("", name)]
        return replace(
            self,
            session=self.session.model_copy(update={"cell": own, "captures": captures}),
            results={**self.results, self.stage: of_scanner(self.results[self.stage], own)},
            mount_from_laser=frame,
            tool_covariance=covariance,
        )

    @property
    def faults(self) -> tuple[str, ...]:
        """What speaks against using it, of its own."""
        holds = {
            "stale": self.stale,
            "fail": self.verdict == "fail",
            "altered": self.altered,
            "verify-fail": self.decision in NOT_CONFIRMED,
            "not-replayed": "imported" in self.provenance,
            "differs": "differs" in self.provenance,
        }
        return in_order(name for name, held in holds.items() if held)

    @property
    def all_faults(self) -> tuple[str, ...]:
        """Its own, and those of the moment."""
        return in_order((*self.faults, *self.of_moment))

    @property
    def position_sigma_mm(self) -> float:
        """The standard deviation of the tool's origin in its worst direction."""
        return _worst(self.tool_covariance[3:6, 3:6])

    @property
    def rotation_sigma_deg(self) -> float:
        """The standard deviation of the tool's orientation about its worst axis."""
        return float(np.rad2deg(_worst(self.tool_covariance[:3, :3])))

    @property
    def findings(self) -> list[Finding]:
        """What speaks against using it, certificates that were overdue, and all that its results notice."""
        table = () if self.base_from_turntable is None or self.stage == "chain" else ("turntable",)
        noticed = [one for part in (self.stage, *table) for one in findings_in(self.results[part])]
        overdue = overdue_certificates(self.session, self.date or now())
        return judgement([*(FAULT_CODES[name]() for name in self.all_faults), *overdue, *noticed])["findings"]

    def require_usable(self, allow: Collection[str] = ()) -> None:
        """Raise NotUsableError where the answer has faults of its own that are not allowed."""
        refuse_faults(self.faults, allow, self.stage)

    def require_placed(self) -> None:
        """Raise ConflictError where it is open where in base, or on the flange, scanner and table are."""
        if self.laser_from_turntable is not None:
            raise ConflictError(
                "scanner and table in the robot's base",
                "both determined to each other alone",
                "Capture a sphere on the flange with step 'tcp'; or export it as json, csv, for ROS or OpenCV.",
                self.stage,
            )
        if self.is_open:
            need = "a scanner whose position on the flange is determined"
            to_do = "Tilt the flange by 10 to 30° about two axes and capture again, or measure the position."
            raise ConflictError(need, "one whose position the motions leave open", to_do, self.stage)


def _worst(covariance: FloatArray) -> float:
    if not np.isfinite(covariance).all():  # some of it is not determined
        return float("nan")
    return float(np.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0)))


def answer_of(
    session: Session,
    results: Mapping[str, Record | Mapping[str, Any]],
    stale: Collection[str] = (),
    date: str = "",
) -> Answer:
    """Return tool and table of a session's results: those of `chain`, or of `tcp` and `turntable`.

    Parameters
    ----------
    session : Session
    results : mapping
        The stages' results by stage, as records or as their JSON data.
    stale : collection of str
        The stages whose results are stale.
    date : str, optional
        When it was solved.

    The numbers are in the pose convention that they were solved with, whatever the cell says now.

    Raises
    ------
    ConflictError
        If neither `chain` nor `tcp` is solved, nor a table that is known to its scanner alone.
    InputError
        If a result is none.
    """
    data = {
        stage: result_data(result) if isinstance(result, Record) else dict(result)
        for stage, result in results.items()
    }
    stage = answering(data)
    if stage is None:
        raise ConflictError("a solved tcp stage", "none", "Solve the session first.", "tcp")
    table_stage = stage if stage == "chain" else "turntable"
    parts = list(dict.fromkeys(part for part in (stage, table_stage) if part in data))
    for part in [*parts, *(["verify"] if "verify" in data else [])]:
        require_result(part, data[part], f"results/{part}.json")
    result, table = data[stage], data.get(table_stage)
    seen, (scanner, covariance) = table_seen(result), scanner_answered(result)
    verdicts = [data[part]["verdict"] for part in parts]
    decision = data.get("verify", {}).get("decision")
    covariance_name = "turntable_covariance" if stage == "chain" else "covariance"
    table_covariance = None if table is None else np.array(table[covariance_name], dtype=float)[:6, :6]
    turntable = None
    if table is not None:
        turntable = placed_table(table)
    decided = decision if "verify" not in stale or decision in NOT_CONFIRMED else decision and "undecided"
    of_others = [*parts, *(["verify"] if decided == decision is not None else [])]
    others = [name for name in data if name not in parts and name not in stale]
    return Answer(
        session=_as_solved(session, result),
        results={name: data[name] for name in (*parts, *others)},
        stage=stage,
        mount_from_laser=scanner,
        tool_covariance=(np.array(seen.covariance, dtype=float) if seen else covariance)[:6, :6],
        base_from_turntable=turntable,
        table_covariance=table_covariance,
        verdict=worst_of(verdicts),
        inputs_sha256=str(result.get("inputs_sha256", "")),
        date=date,
        stale=any(part in stale for part in parts),
        warnings=tuple(result.get("warnings", ())),
        decision=decided,
        provenance=tuple(dict.fromkeys(data[part].get("provenance") or "solved" for part in of_others)),
    )


def _as_solved(session: Session, result: Mapping[str, Any]) -> Session:
    """Return a session with the pose convention that a result was solved with, where it says so."""
    convention = result.get("pose_convention")
    if convention is None or convention == session.cell.pose_convention:
        return session
    return session.model_copy(update={"cell": session.cell.model_copy(update={"pose_convention": convention})})
