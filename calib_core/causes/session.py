"""The root causes of a session: those of its results or, where it cannot be solved, those its files tell."""

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.captures.poses import base_from_tool0_by_capture
from calib_core.causes.apply import applied, changes_for
from calib_core.causes.poses import LEAST_CAPTURES, pose_causes
from calib_core.causes.table import table_causes
from calib_core.cell.carriers import diameters_by_name, with_diameter
from calib_core.cell.found import known_scanner
from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.start import centers_of, find_start
from calib_core.errors import CalibrationError, InputError, MeasurementError
from calib_core.findings import Finding, causes_of, has
from calib_core.findings.codes import causes as codes
from calib_core.frames import RigidTransform
from calib_core.messages import message
from calib_core.records import BeforeAfter, Capture, Changes, ReadFile, ResultsData, RootCause, Session

_NO_POSE = np.eye(4).ravel().tolist()
_ASKED = 12  # captures that a hypothesis on files is tried on
_ENOUGH = 0.7
_USUAL_DIAMETERS_MM = (3.0, 1000.0)
_DIAMETERS = {2.0: "radius", 1000.0: "metres", 25.4: "inches"}
_UNITS = ("m", "cm", "in", "um")


def session_causes(
    session: Session, read: ReadFile, results: ResultsData, stale: Collection[str] = ()
) -> list[RootCause]:
    """Return the root causes of a session with all that applying them would change, the likeliest first.

    Parameters
    ----------
    session : Session
    read : callable
        Returns the bytes of a file by its name in the capture; asked only where there is no result of the tcp.
    results : mapping
        From stage to the JSON data of its result.
    stale : collection of str
        Stages whose results are stale: they count for nothing.
    """
    found: list[RootCause] = []
    fresh = {stage: result for stage, result in results.items() if stage not in stale}
    for result in fresh.values():
        found += [RootCause.model_validate(cause) for cause in result.get("causes") or []]
    if not found and "tcp" not in fresh:
        found = causes_of(unsolved_findings(session, read))
    if not found and "turntable" not in fresh:
        found = causes_of(unsolved_table_findings(session, read))
    whole: list[RootCause] = []
    for cause in found:
        if any(cause.id == other.id for other in whole):
            continue
        try:
            changes = None if cause.changes is None else changes_for(session, cause)
        except InputError:  # its captures are gone
            continue
        whole.append(cause.model_copy(update={"changes": changes}))
    return whole


def explained(error: CalibrationError, session: Session, read: ReadFile) -> CalibrationError:
    """Return why a session cannot be solved, with what is found to be at fault."""
    try:
        found = unsolved_findings(session, read) or unsolved_table_findings(session, read)
    except (CalibrationError, ValueError):  # what cannot be solved may not be explained either
        return error
    return error.explained_by(found) if found else error


def unsolved_findings(session: Session, read: ReadFile) -> list[Finding]:
    """Return why the tcp captures cannot be solved: poses not to be read, files in another unit, the diameter."""
    captures = [c for c in session.captures if c.step == "tcp" and not c.excluded]
    if not captures:
        return []
    neutral = _without_poses(session)
    observations, failed = _observed(neutral, captures, read)
    if len(failed) > len(observations):
        found = _file_causes(neutral, captures, read)
        if has(found, codes.POINT_UNIT):
            return found
        return _wrong_lengths(session, captures, read) or found
    try:
        base_from_tool0_by_capture(session.cell, captures)
    except CalibrationError:
        if any(capture.kind == "sweep" for capture in captures):
            return []
        sphere = sphere_of(session.cell, captures)
        return pose_causes(session.cell, session.captures, observations, sphere)
    return []


def unsolved_table_findings(session: Session, read: ReadFile) -> list[Finding]:
    """Return why the captures of the sphere on the table cannot be solved: their angles."""
    captures = [c for c in session.captures if c.step == "turntable" and not c.excluded]
    if session.cell.turntable.angles == "unknown" or any(c.table_deg is None for c in captures):
        return []
    try:
        turned, _ = _observed(session, captures, read)
        if not turned:
            return []
        sphere = sphere_of(session.cell, captures)
        tool = _tool(session, read, sphere)
    except CalibrationError:
        return []
    if tool is None:
        return []
    by_id = {capture.id: capture for capture in captures}
    observations = [
        TableObservation(o, float(np.deg2rad(by_id[o.capture].table_deg or 0.0)), by_id[o.capture].mount or "")
        for o in turned
    ]
    return table_causes(session.captures, observations, sphere, tool)


def _tool(session: Session, read: ReadFile, sphere: SphereSize) -> RigidTransform | None:
    """Return the tool that is known, or about the one that the tcp captures give."""
    if (known := known_scanner(session.cell)) is not None:
        return known
    still = [c for c in session.captures if c.step == "tcp" and not c.excluded]
    observations, _ = _observed(session, still, read)
    if len(observations) < LEAST_CAPTURES:
        return None
    start = find_start(centers_of(observations, sphere))
    return RigidTransform.of(start.rotation, start.translation, "tool0", "laser")


def _wrong_lengths(session: Session, captures: Sequence[Capture], read: ReadFile) -> list[Finding]:
    """Return wrong lengths of files that cannot be solved, by the poses as they are; none without these."""
    from calib_core.causes.scales import scale_causes

    try:
        return scale_causes(session, captures, read, sphere_of(session.cell, captures))
    except InputError:
        return []


def _without_poses(session: Session) -> Session:
    """Return the session with all poses alike: what a capture shows does not depend on them."""
    cell = session.cell.model_copy(update={"pose_convention": "matrix"})
    captures = [c.model_copy(update={"pose": _NO_POSE}) for c in session.captures]
    return session.model_copy(update={"cell": cell, "captures": captures})


def _observed(
    session: Session, captures: Sequence[Capture], read: ReadFile
) -> tuple[list[SphereObservation], list[MeasurementError]]:
    by_id = {capture.id: capture for capture in session.captures}
    found: list[SphereObservation] = []
    failed: list[MeasurementError] = []
    for capture in captures:
        if capture.kind in ("frame", "sweep"):
            continue
        try:
            found.append(observe_capture(session, by_id[capture.id], read))
        except MeasurementError as error:
            failed.append(error)
    return found, failed


def _file_causes(session: Session, captures: Sequence[Capture], read: ReadFile) -> list[Finding]:
    """Return the unit of the files or the diameter of the sphere by which most captures show it."""
    asked = captures[:: max(1, len(captures) // _ASKED)]
    before = len(_observed(session, asked, read)[0])
    found: list[tuple[int, bool, Finding]] = []
    for one in (*_units(session, captures), *_diameters(session)):
        assert one.remedy is not None
        assert one.remedy.changes is not None
        trial, _ = applied(session, one.remedy.changes)
        seen = len(_observed(trial, asked, read)[0])
        if seen >= _ENOUGH * len(asked) and seen > before:
            evidence = BeforeAfter(
                label=message("Captures that show the sphere, of {count}", count=len(asked)),
                before=float(before),
                after=float(seen),
            )
            remedy = one.remedy.model_copy(update={"evidence": [evidence]})
            found.append((seen, _is_usual(trial), one.model_copy(update={"remedy": remedy})))
    # A diameter a thousand times smaller shows the sphere as well as points a thousand times larger do.
    if any(usual for _, usual, _ in found):
        found = [one for one in found if one[1]]
    return [finding for _, _, finding in sorted(found, key=lambda one: -one[0])]


def _is_usual(session: Session) -> bool:
    """Return whether anyone calibrates with a sphere of the session's diameter, or it is not told."""
    told = session.cell.sphere_diameter_mm
    return told is None or _USUAL_DIAMETERS_MM[0] <= told <= _USUAL_DIAMETERS_MM[1]


def _units(session: Session, captures: Sequence[Capture]) -> Iterator[Finding]:
    for unit in _UNITS:
        patch = {"format_settings": {"unit": unit}}
        files = [c for c in session.captures if c.kind in ("profile", "cloud")]
        if not all(c.kind in ("profile", "cloud") for c in captures):
            return
        remedy = RootCause(
            id=f"point-unit-{unit}",
            kind="point-unit",
            changes=Changes(captures={capture.id: patch for capture in files}),
        )
        yield codes.POINT_UNIT(remedy=remedy, unit=unit)


def _diameters(session: Session) -> Iterator[Finding]:
    own = [*diameters_by_name(session.cell).values()]
    told = own[0] if own else session.cell.sphere_diameter_mm
    if told is None:
        return
    for factor, why in _DIAMETERS.items():
        diameter = round(told * factor, 6)
        remedy = RootCause(
            id=f"sphere-diameter-{diameter:g}",
            kind="sphere-diameter",
            changes=Changes(cell=with_diameter(session.cell, told, diameter)),
        )
        yield codes.SPHERE_DIAMETER_WRONG(remedy=remedy, compared=why, diameter_mm=diameter, told_mm=told)
