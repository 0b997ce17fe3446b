"""What is wrong with a session, and what is still missing, without solving it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath

from calib_core.captures.certificate import certificate_findings, overdue_certificates
from calib_core.captures.content import pose_of, read_as, sphere_of
from calib_core.captures.contradictions import unfit, without_scanner
from calib_core.captures.measure import measure_capture
from calib_core.captures.poses import (
    angles_look_like_radians,
    base_from_tool0_by_capture,
    duplicates,
    same_place,
)
from calib_core.captures.raw_frames import IMAGES
from calib_core.captures.sweep import sweep_poses
from calib_core.causes.flange import flange_findings
from calib_core.causes.likely import likely_columns, likely_convention
from calib_core.cell.consistency import require_consistent
from calib_core.cell.found import own_base, told_by_axes
from calib_core.errors import CalibrationError
from calib_core.findings import Finding, complete_measured, judgement, message_of_finding, sentence_of, to_do_of
from calib_core.findings.codes import check as codes
from calib_core.findings.codes.captures import CAPTURE_DUPLICATE
from calib_core.findings.codes.quality import FILE_DOUBTFUL
from calib_core.frames import RigidTransform
from calib_core.graph.registry import STAGES, stages
from calib_core.graph.stage import Stage
from calib_core.messages import ENGLISH, Catalogue, Value
from calib_core.moment import now
from calib_core.records import Capture, Cell, CheckLine, Measured, ReadFile, Record, Session
from calib_core.records.sphere_class import diameter_sigma_mm
from calib_core.stages.tcp.motion import LEAST_SHIFTS, LEAST_TURNS, motion_of
from calib_core.steps import step_names, steps_that_show

_MOST_READ, _FILES_OF_SWEEP = 300, 3


def check_session(
    session: Session, read: ReadFile, measured: Mapping[str, Measured] | None = None
) -> list[Finding]:
    """Return everything that was found, worst first; an error blocks solving.

    Parameters
    ----------
    session : Session
    read : callable
        Returns the bytes of a file by its name in the capture.
    measured : mapping, optional
        What was measured in each capture, by id; what is left out is measured now.
    """
    used = [capture for capture in session.captures if not capture.excluded]
    findings = [
        *_names(session),
        *_chain(session),
        *_unfit(session),
        *without_scanner(session.cell, used),
        *_doubtful(used, read),
        *overdue_certificates(session, now()),
        *certificate_findings(session, read),
    ]
    findings += [*_missing(session, used), *_brought(session), *_cell(session, used)]
    for stage in stages():
        if stage.step is not None and not stage.is_brought(session):
            findings += _captures(session, stage, used, read, measured or {})
    tcp = [capture for capture in used if capture.step == "tcp"]
    if tcp and not STAGES.get("tcp").is_brought(session):
        findings += _poses(session, tcp)
    return judgement(findings)["findings"]


def check_lines(findings: Iterable[Finding], language: Catalogue = ENGLISH) -> list[CheckLine]:
    """Return findings as lines: how severe, where, and what with what to do."""
    return [
        CheckLine(
            level=finding.severity,
            where=finding.where or language.captures(finding.captures) or "session.json",
            sentence=sentence_of(finding, language),
        )
        for finding in findings
    ]


def _names(session: Session) -> Iterator[Finding]:
    """Name the fields that the format does not know: most are typing errors."""
    cell = session.cell
    parts = {name: part for name in Cell.model_fields if isinstance(part := getattr(cell, name), Record)}
    records = {"session.json": session, "cell": cell} | {f"cell.{name}": part for name, part in parts.items()}
    for where, record in [*records.items(), *((capture.id, capture) for capture in session.captures)]:
        for name in record.unknown_fields():
            yield codes.UNKNOWN_FIELD(where=where, field=name)


def _chain(session: Session) -> Iterator[Finding]:
    """Say what contradicts itself in the cell's scanners, spheres and axes."""
    try:
        require_consistent(session.cell, session.captures)
    except CalibrationError as error:
        yield _found(error)


def _unfit(session: Session) -> Iterator[Finding]:
    """Name the captures that a stage keeps and doesn't use, since they contradict the others of their step."""
    for step in step_names():
        try:
            used = [c for c in session.captures if c.step == step and not c.excluded]
            yield from unfit(session.cell, used)
        except CalibrationError as error:
            yield _found(error)
            return


def _missing(session: Session, used: Sequence[Capture]) -> Iterator[Finding]:
    """Say that nothing shows where the scanner is on the flange; what rests on it cannot be solved then."""
    steps = {capture.step for capture in used}
    alone = own_base(session.cell, used) is not None or told_by_axes(session.cell, used)
    if "tcp" in steps or alone or STAGES.get("tcp").is_brought(session):
        return
    rests = not steps or "turntable" in steps or "scan" in steps
    yield (codes.NO_SPHERE_CAPTURES if rests else codes.NO_SPHERE_CAPTURES_YET)(where="captures")


def _brought(session: Session) -> Iterator[Finding]:
    for stage in stages():
        given = [field for field in stage.known if getattr(session.cell.known, field) is not None]
        if given:
            yield codes.STAGE_BROUGHT(where="cell.known", stage=stage.name, fields=given)


def _cell(session: Session, used: Sequence[Capture]) -> Iterator[Finding]:
    of_sphere = [c for c in used if c.step in steps_that_show("sphere", "sphere-on-table") and c.kind != "center"]
    if not of_sphere:
        return
    try:
        sphere_of(session.cell, of_sphere)
    except CalibrationError as error:
        yield _found(error)
    if session.cell.sphere_diameter_sigma_mm is None:
        yield codes.DIAMETER_SIGMA_ASSUMED(where="cell", sigma_mm=diameter_sigma_mm(session.cell))


def _captures(
    session: Session, stage: Stage, used: Sequence[Capture], read: ReadFile, known: Mapping[str, Measured]
) -> Iterator[Finding]:
    """Say what captures of a stage's own step lack, one finding a cause, and whether enough can be used."""
    step = stage.step
    assert step is not None
    captures = [capture for capture in used if capture.step == step.name]
    if not captures:
        return
    usable = 0
    seen: list[Measured] = []
    for capture in [c for c in used if c.step in stage.takes and c.step in steps_that_show(step.shows)]:
        try:
            measured = known.get(capture.id) or measure_capture(session, capture, read)
        except CalibrationError as error:
            if capture.step == step.name:
                yield _found(error)
            continue
        usable += measured.profiles or 0 if measured.kind == "sweep" else measured.verdict != "fail"
        seen += [measured] if capture.step == step.name else []
    if usable < step.least:
        where = f"captures: {step.name}"
        yield codes.TOO_FEW_CAPTURES(where=where, count=usable, least=step.least, to_do=step.to_capture)
    yield from _weak(seen)
    yield from _duplicates(captures, read)


def _weak(seen: Sequence[Measured]) -> Iterator[Finding]:
    """Name the captures in which nothing is seen, and those that are weak: one finding a cause."""
    causes: dict[tuple[str, str], dict[str, dict[str, Value]]] = {}
    for measured in seen:
        told = [one for one in complete_measured(measured).findings if one.severity != "note"]
        worst = next((one for one in told if one.code != FILE_DOUBTFUL.name), None)
        if worst is not None:
            own: dict[str, Value] = {"why": message_of_finding(worst), "to_do": to_do_of(worst)}
            causes.setdefault((worst.severity, worst.code), {})[measured.capture] = own
    for (severity, _), each in causes.items():
        code = codes.BLIND_CAPTURES if severity == "error" else codes.WEAK_CAPTURES
        yield code(list(each), each=each, first=next(iter(each)))


def _doubtful(captures: Sequence[Capture], read: ReadFile) -> Iterator[Finding]:
    """Name the files that a reader is not sure of; one finding a doubt."""
    doubts: dict[str, dict[str, dict[str, Value]]] = {}
    for capture in [c for c in captures if c.kind in ("profile", "cloud", "sweep")][:_MOST_READ]:
        middle = len(capture.files) // 2  # a sweep begins and ends beside the sphere
        for name in capture.files[middle : middle + _FILES_OF_SWEEP]:
            if PurePosixPath(name).suffix.lower() in IMAGES:
                continue
            try:
                reading = read_as(capture, name, read, "cloud" if capture.kind == "cloud" else "profile")
            except CalibrationError:
                continue  # measuring it says so
            for doubt in reading.doubts:
                own: dict[str, Value] = {"doubt": doubt, "reading": reading.sentence()}
                doubts.setdefault(getattr(doubt, "template", doubt), {}).setdefault(capture.id, own)
    for each in doubts.values():
        yield FILE_DOUBTFUL(list(each), each=each, shown="read")


def _duplicates(captures: Sequence[Capture], read: ReadFile) -> Iterator[Finding]:
    by_id = {capture.id: capture for capture in captures}
    try:
        copies = duplicates(captures, read)
    except CalibrationError:
        return  # a file that cannot be read is a finding of its own
    for code, is_whole in ((CAPTURE_DUPLICATE, True), (codes.FILE_REPEATED, False)):
        each: dict[str, dict[str, Value]] = {
            copy: {"original": original}
            for copy, original in copies.items()
            if same_place(by_id, copy, original) == is_whole
        }
        if each:
            yield code(list(each), each=each)


def _poses(session: Session, captures: Sequence[Capture]) -> Iterator[Finding]:
    try:
        base_from_tool0_by_capture(session.cell, captures)
        poses = [pose for capture in captures for pose in _ends(session, capture)]
    except CalibrationError as error:
        if not any(_pose_fails(session, capture) for capture in captures):
            yield _found(error)  # else the captures' own findings say it already
        return
    where = "captures: pose"
    if angles_look_like_radians(session.cell, captures):
        yield codes.ANGLES_IN_RADIANS(where=where)
    yield from flange_findings(session.cell, captures)
    yield from _convention(session.cell, captures)
    motion = motion_of(poses)
    tilts, shifts = len(motion.turns_rad), len(motion.shifts_mm)
    if not motion.turns_differ:
        yield codes.TOO_FEW_TILTS(where=where, count=tilts, least=LEAST_TURNS)
    if not motion.shifts_differ:
        yield codes.FEW_SHIFTS(where=where, count=shifts, least=LEAST_SHIFTS)
    yield codes.CAPTURES_COUNTED(where=where, count=len(captures), shifts=shifts, tilts=tilts)


def _convention(cell: Cell, captures: Sequence[Capture]) -> Iterator[Finding]:
    """Doubt convention and order of the poses, where another lets all captures look at one place far better."""
    rows = [capture.pose for capture in captures if capture.pose is not None]
    if (columns := likely_columns(cell, rows)) is not None:
        order = ", ".join(str(1 + place) for place in columns.order)
        yield codes.COLUMNS_SWAPPED(
            where="captures: pose",
            order=order,
            spread_mm=columns.spread_mm,
            told_spread_mm=columns.told_spread_mm,
        )
    elif (likely := likely_convention(cell, rows)) is not None:
        yield codes.CONVENTION_LIKELY(
            where="cell.pose_convention",
            as_told="unread" if likely.told_spread_mm is None else "differs",
            spread_mm=likely.spread_mm,
            told_spread_mm=likely.told_spread_mm or 0.0,
            likely=likely.convention,
            told=cell.pose_convention,
        )


def _ends(session: Session, capture: Capture) -> list[RigidTransform]:
    """Return a capture's pose, or where a sweep begins and ends."""
    if capture.kind != "sweep":
        return [pose_of(session.cell, capture)]
    poses = sweep_poses(session.cell, capture)
    return [poses[0], poses[-1]]


def _pose_fails(session: Session, capture: Capture) -> bool:
    try:
        _ends(session, capture)
    except CalibrationError:
        return True
    return False


def _found(error: CalibrationError) -> Finding:
    where = error.where or "session.json"
    return codes.NOT_USABLE(where=where, need=error.need, got=error.got, to_do=error.to_do)
