"""What is wrong with a session, and what is still missing, without solving it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath

from calib_core.captures.content import diameter_sigma_mm, pose_of, read_as, sphere_of
from calib_core.captures.contradictions import unfit
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
from calib_core.errors import CalibrationError
from calib_core.evidence.words import alike, captures_text, listed
from calib_core.findings import reasons_of, sentence_of
from calib_core.frames import RigidTransform
from calib_core.graph.registry import STAGES, stages
from calib_core.graph.stage import Stage
from calib_core.records import Capture, Cell, CheckFinding, Measured, Record, Session
from calib_core.records.callbacks import ReadFile
from calib_core.stages.tcp.motion import LEAST_SHIFTS, LEAST_TURNS, motion_of
from calib_core.steps import step_names, steps_that_show

_DOUBTFUL = "The file is doubtful:"  # as measuring says it, too
_MOST_READ, _FILES_OF_SWEEP = 300, 3


def check_session(
    session: Session, read: ReadFile, measured: Mapping[str, Measured] | None = None
) -> list[CheckFinding]:
    """Return everything that was found, worst first; a finding of level `error` blocks solving.

    Parameters
    ----------
    session : Session
    read : callable
        Returns the bytes of a file by its name in the capture.
    measured : mapping, optional
        What was measured in each capture, by id; what is left out is measured now.
    """
    used = [capture for capture in session.captures if not capture.excluded]
    findings = [*_names(session), *_unfit(session), *_unsuited(session, used), *_doubtful(used, read)]
    findings += [*_missing(session, used), *_brought(session), *_cell(session, used)]
    for stage in stages():
        if stage.step is not None and not stage.is_brought(session):
            findings += _captures(session, stage, used, read, measured or {})
    tcp = [capture for capture in used if capture.step == "tcp"]
    if tcp and not STAGES.get("tcp").is_brought(session):
        findings += _poses(session, tcp)
    order = ("error", "warning", "note")
    return sorted(findings, key=lambda finding: order.index(finding.level))


def _names(session: Session) -> Iterator[CheckFinding]:
    """Name the fields that the format does not know: most are typing errors."""
    cell = session.cell
    parts = {name: part for name in Cell.model_fields if isinstance(part := getattr(cell, name), Record)}
    records = {"session.json": session, "cell": cell} | {f"cell.{name}": part for name, part in parts.items()}
    for where, record in [*records.items(), *((capture.id, capture) for capture in session.captures)]:
        for name in record.unknown_fields():
            yield _warning(where, f"The field '{name}' is unknown and has no effect: is it a typing error?")


def _unfit(session: Session) -> Iterator[CheckFinding]:
    """Name the captures that a stage keeps and doesn't use, since they contradict the others of their step."""
    for step in step_names():
        try:
            used = [c for c in session.captures if c.step == step and not c.excluded]
            left = reasons_of(unfit(session.cell, used))
        except CalibrationError as error:
            yield _found(error)
            return
        for name, reason in left.items():
            yield _warning(name, f"It is kept but not used: {reason}.")


def _unsuited(session: Session, used: Sequence[Capture]) -> Iterator[CheckFinding]:
    """Name the captures of stages that are not solved for what the robot carries."""
    for stage in stages():
        own = [c.id for c in used if stage.step is not None and c.step == stage.step.name]
        if own and not stage.suits(session):
            why = "its stage is not supported yet for a scanner that stands still"
            yield _warning("captures", f"{listed(own)} (step '{stage.name}') are kept but not used: {why}.")


def _is_said(measured: Measured) -> bool:
    return (measured.reason or "").startswith(_DOUBTFUL)


def _missing(session: Session, used: Sequence[Capture]) -> Iterator[CheckFinding]:
    """Say that nothing shows where the scanner is on the flange; what rests on it cannot be solved then."""
    steps = {capture.step for capture in used}
    if "tcp" in steps or STAGES.get("tcp").is_brought(session):
        return
    rests = not steps or "turntable" in steps or "scan" in steps
    sentence = "There is no capture with step 'tcp' yet: capture the sphere."
    yield (_error if rests else _note)("captures", sentence)


def _brought(session: Session) -> Iterator[CheckFinding]:
    for stage in stages():
        given = [field for field in stage.known if getattr(session.cell.known, field) is not None]
        if given:
            yield _note("cell.known", f"Given, so that the stage {stage.name} is not solved: {listed(given)}.")


def _cell(session: Session, used: Sequence[Capture]) -> Iterator[CheckFinding]:
    of_sphere = [c for c in used if c.step in steps_that_show("sphere", "sphere-on-table") and c.kind != "center"]
    if not of_sphere:
        return
    try:
        sphere_of(session.cell, of_sphere)
    except CalibrationError as error:
        yield _found(error)
    if session.cell.sphere_diameter_sigma_mm is None:
        assumed = f"{diameter_sigma_mm(session.cell):g} mm is assumed, as of its class (cell.sphere_class)"
        yield _note("cell", f"sphere_diameter_sigma_mm is left out: {assumed}.")


def _captures(
    session: Session, stage: Stage, used: Sequence[Capture], read: ReadFile, known: Mapping[str, Measured]
) -> Iterator[CheckFinding]:
    """Say what captures of a stage's own step lack, one finding a cause, and whether enough can be used."""
    step = stage.step
    assert step is not None
    captures = [capture for capture in used if capture.step == step.name]
    if not captures:
        return
    usable = 0
    notes: dict[str, str] = {}
    doubts: dict[str, str] = {}
    for capture in [c for c in used if c.step in stage.takes and c.step in steps_that_show(step.shows)]:
        try:
            measured = known.get(capture.id) or measure_capture(session, capture, read)
        except CalibrationError as error:
            if capture.step == step.name:
                yield _found(error)
            continue
        usable += measured.profiles or 0 if measured.kind == "sweep" else measured.verdict != "fail"
        if measured.verdict != "pass" and capture.step == step.name and not _is_said(measured):
            told = doubts if measured.verdict == "fail" else notes
            told[capture.id] = f"{measured.reason} {measured.to_do or ''}".strip()
    if usable < step.least:
        sentence = f"Captures that can be used: {usable}. At least {step.least} are needed. {step.to_capture}"
        yield _error(f"captures: {step.name}", sentence)
    yield from _told(_warning, doubts, captures)
    yield from _told(_note, notes, captures)
    yield from _duplicates(captures, read)


def _doubtful(captures: Sequence[Capture], read: ReadFile) -> Iterator[CheckFinding]:
    """Name the files that a reader is not sure of; one finding a doubt."""
    doubts: dict[str, str] = {}
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
                doubts.setdefault(capture.id, f"{_DOUBTFUL} {doubt} Taken: {reading.sentence()}.")
    to_do = "Say otherwise in the capture's format and format_settings."
    for finding in _told(_warning, doubts, captures):
        yield finding.model_copy(update={"sentence": f"{finding.sentence} {to_do}"})


def _told(
    level: Callable[[str, str], CheckFinding], reasons: Mapping[str, str], captures: Sequence[Capture]
) -> Iterator[CheckFinding]:
    """Return one finding a cause, which names its captures."""
    order = [capture.id for capture in captures]
    for one in alike(reasons, order):
        numbers = f" (numbers of {one.first})" if one.differ else ""
        yield level(f"{captures_text(one.captures, order)}{numbers}", one.reason)


def _duplicates(captures: Sequence[Capture], read: ReadFile) -> Iterator[CheckFinding]:
    by_id = {capture.id: capture for capture in captures}
    try:
        copies = duplicates(captures, read)
    except CalibrationError:
        return  # a file that cannot be read is a finding of its own
    for copy, original in copies.items():
        if same_place(by_id, copy, original):
            sentence = f"It is a duplicate of {original}, the same file and pose: it is counted once. Remove it."
        else:
            sentence = (
                f"Its file is that of {original}, byte for byte, but its pose is another: "
                "one of the two is a copy. Give it its own file, or remove it."
            )
        yield _warning(copy, sentence)


def _poses(session: Session, captures: Sequence[Capture]) -> Iterator[CheckFinding]:
    try:
        base_from_tool0_by_capture(session.cell, captures)
        poses = [pose for capture in captures for pose in _ends(session, capture)]
    except CalibrationError as error:
        if not any(_pose_fails(session, capture) for capture in captures):
            yield _found(error)  # else the captures' own findings say it already
        return
    if angles_look_like_radians(session.cell, captures):
        sentence = "All angles are below 3.15: if they are radians, convert them to degrees."
        yield _warning("captures: pose", sentence)
    for finding in flange_findings(session.cell, captures):
        yield _warning("captures: pose", sentence_of(finding))
    yield from _convention(session.cell, captures)
    motion = motion_of(poses)
    if not motion.turns_differ:
        sentence = (
            f"The flange was tilted {len(motion.turns_rad)} times; at least {LEAST_TURNS} tilts of 10 to 30° "
            "about axes that are not parallel are needed: they fix the scanner's position."
        )
        yield _error("captures: pose", sentence)
    if not motion.shifts_differ:
        sentence = (
            f"There are {len(motion.shifts_mm)} shifts without turning; {LEAST_SHIFTS} that are not parallel let "
            "the paper's two steps be computed beside the joint answer."
        )
        yield _warning("captures: pose", sentence)
    sentence = f"{len(captures)} captures, {len(motion.shifts_mm)} shifts and {len(motion.turns_rad)} tilts."
    yield _note("captures: pose", sentence)


def _convention(cell: Cell, captures: Sequence[Capture]) -> Iterator[CheckFinding]:
    """Doubt convention and order of the poses, where another lets all captures look at one place far better."""
    rows = [capture.pose for capture in captures if capture.pose is not None]
    if (columns := likely_columns(cell, rows)) is not None:
        order = ", ".join(str(1 + place) for place in columns.order)
        sentence = (
            f"The poses look at one place within {columns.spread_mm:.3g} mm if their numbers stand in the order "
            f"{order}, and within {columns.told_spread_mm:.3g} mm as they are: are columns swapped?"
        )
        yield _warning("captures: pose", sentence)
    elif (likely := likely_convention(cell, rows)) is not None:
        told_mm = likely.told_spread_mm
        sentence = (
            f"The poses look at one place within {likely.spread_mm:.3g} mm if they are written as "
            f"'{likely.convention}', and cannot be read as '{cell.pose_convention}': compare one with the pendant."
            if told_mm is None
            else f"The poses look at one place within {likely.spread_mm:.3g} mm if they are written as "
            f"'{likely.convention}', and within {told_mm:.3g} mm as '{cell.pose_convention}': compare one with "
            "the pendant."
        )
        yield _warning("cell.pose_convention", sentence)


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


def _found(error: CalibrationError) -> CheckFinding:
    return _error(error.where or "session.json", f"Need {error.need}, got {error.got}. {error.to_do}")


def _error(where: str, sentence: str) -> CheckFinding:
    return CheckFinding(level="error", where=where, sentence=sentence)


def _warning(where: str, sentence: str) -> CheckFinding:
    return CheckFinding(level="warning", where=where, sentence=sentence)


def _note(where: str, sentence: str) -> CheckFinding:
    return CheckFinding(level="note", where=where, sentence=sentence)
