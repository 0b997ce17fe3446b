"""What is wrong with a session, and what is still missing, without solving it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePosixPath

from calib_core.captures.content import diameter_sigma_mm, pose_of, read_as, sphere_of
from calib_core.captures.measure import measure_capture
from calib_core.captures.poses import (
    angles_look_like_radians,
    base_from_tool0_by_capture,
    duplicates,
    same_place,
)
from calib_core.captures.raw_frames import IMAGES
from calib_core.captures.sweep import sweep_poses
from calib_core.captures.unfit import told_by_joints, unfit
from calib_core.errors import CalibrationError
from calib_core.frames import RigidTransform
from calib_core.records import Capture, Cell, Finding, Measured, Record, Session
from calib_core.stages.graph import stage_captures
from calib_core.stages.registry import step_names
from calib_core.stages.stage import ReadFile
from calib_core.stages.tcp.motion import LEAST_SHIFTS, LEAST_TURNS, motion_of

_LEAST_CAPTURES = 5
_MOST_READ, _FILES_OF_SWEEP = 300, 3


def check_session(
    session: Session, read: ReadFile, measured: Mapping[str, Measured] | None = None
) -> list[Finding]:
    """Return everything that was found, worst first; a finding of level `error` blocks solving.

    Parameters
    ----------
    session : Session
    read : callable
        Returns the bytes of a file by its name in the capture.
    measured : mapping, optional
        What was measured in each capture, by id; what is left out is measured now.
    """
    captures = [capture for capture in stage_captures(session, "tcp") if not capture.excluded]
    used = [capture for capture in session.captures if not capture.excluded]
    findings = [*_names(session), *_unfit(session), *_doubtful(used, read)]
    if session.cell.known.tool0_from_laser is not None:
        findings.append(_note("cell.known", "tool0_from_laser is given: the stage tcp is not solved."))
    elif not captures:
        findings.append(_error("captures", "There is no capture with step 'tcp' yet: capture the sphere."))
    else:
        findings += [
            *_cell(session, captures),
            *_captures(session, captures, read, measured or {}),
            *_poses(session, captures),
        ]
    order = ("error", "warning", "note")
    return sorted(findings, key=lambda finding: order.index(finding.level))


def _names(session: Session) -> Iterator[Finding]:
    """Name the fields that the format does not know: most are typing errors."""
    cell = session.cell
    parts = {name: part for name in Cell.model_fields if isinstance(part := getattr(cell, name), Record)}
    records = {"session.json": session, "cell": cell} | {f"cell.{name}": part for name, part in parts.items()}
    for where, record in [*records.items(), *((capture.id, capture) for capture in session.captures)]:
        for name in record.unknown_fields():
            yield _warning(where, f"The field '{name}' is unknown and has no effect: is it a typing error?")


def _unfit(session: Session) -> Iterator[Finding]:
    """Name the captures that a stage keeps and doesn't use, since they contradict the others of their step."""
    for step in step_names():
        try:
            left = unfit(session.cell, [c for c in session.captures if c.step == step and not c.excluded])
        except CalibrationError as error:
            yield _found(error)
            return
        for name, reason in left.items():
            yield _warning(name, f"It is kept but not used: {reason}.")


def _cell(session: Session, captures: Sequence[Capture]) -> Iterator[Finding]:
    try:
        sphere_of(session.cell, captures)
    except CalibrationError as error:
        yield _found(error)
    if session.cell.sphere_diameter_sigma_mm is None:
        assumed = f"{diameter_sigma_mm(session.cell):g} mm is assumed, as of its class (cell.sphere_class)"
        yield _note("cell", f"sphere_diameter_sigma_mm is left out: {assumed}.")


def _captures(
    session: Session, captures: Sequence[Capture], read: ReadFile, known: Mapping[str, Measured]
) -> Iterator[Finding]:
    usable = 0
    for capture in captures:
        try:
            measured = known.get(capture.id) or measure_capture(session, capture, read)
        except CalibrationError as error:
            yield _found(error)
            continue
        usable += measured.profiles or 0 if measured.kind == "sweep" else measured.verdict != "fail"
        yield from _measured(measured)
    if usable < _LEAST_CAPTURES:
        sentence = f"{usable} captures show the sphere, {_LEAST_CAPTURES} are needed at least, 10 to 15 are good."
        yield _error("captures", sentence)
    yield from _duplicates(captures, read)


def _doubtful(captures: Sequence[Capture], read: ReadFile) -> Iterator[Finding]:
    """Name the files that a reader is not sure of; one finding a doubt."""
    by_doubt: dict[str, list[str]] = {}
    taken: dict[str, str] = {}
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
                taken.setdefault(doubt, reading.sentence())
                by_doubt.setdefault(doubt, []).append(capture.id)
    for doubt, ids in by_doubt.items():
        names = list(dict.fromkeys(ids))
        others = f" So are those of {len(names) - 1} others." if len(names) > 1 else ""
        to_do = "Say otherwise in the capture's format and format_settings."
        yield _warning(names[0], f"Its file is doubtful: {doubt}{others} Taken: {taken[doubt]}. {to_do}")


def _measured(measured: Measured) -> Iterator[Finding]:
    if measured.verdict != "pass":
        finding = _warning if measured.verdict == "fail" else _note
        yield finding(measured.capture, f"{measured.reason} {measured.to_do or ''}".strip())


def _duplicates(captures: Sequence[Capture], read: ReadFile) -> Iterator[Finding]:
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


def _poses(session: Session, captures: Sequence[Capture]) -> Iterator[Finding]:
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
    if whose := told_by_joints(session.cell, captures):
        yield _warning("captures: pose", whose)
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
    return _error(error.where or "session.json", f"Need {error.need}, got {error.got}. {error.to_do}")


def _error(where: str, sentence: str) -> Finding:
    return Finding(level="error", where=where, sentence=sentence)


def _warning(where: str, sentence: str) -> Finding:
    return Finding(level="warning", where=where, sentence=sentence)


def _note(where: str, sentence: str) -> Finding:
    return Finding(level="note", where=where, sentence=sentence)
