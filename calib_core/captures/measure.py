"""What one capture says about the sphere: measured when it arrives, shown, and given to the solvers."""

from calib_core.captures.advice import arc_findings
from calib_core.captures.capture_observation import Seen
from calib_core.captures.content import diameter_in_sight_mm, pose_of, shows_board, shows_sphere, thinned
from calib_core.captures.lost_rays import lost_rays
from calib_core.captures.measured import figures_of, measured_of, not_seen
from calib_core.captures.observe import doubts_of, points_of, see_sphere
from calib_core.errors import MeasurementError
from calib_core.findings import Finding, measured_with
from calib_core.findings.codes.quality import FILE_DOUBTFUL
from calib_core.records import Capture, Cell, Measured, ReadFile, Session
from calib_core.sphere.arc import ArcFit


def measure_capture(session: Session, capture: Capture, read: ReadFile) -> Measured:
    """Return what is seen in a capture; where the sphere is not found, the verdict `fail`, why, and what to do.

    Parameters
    ----------
    session : Session
        Its cell says what to look for.
    capture : Capture
    read : callable
        Returns the bytes of a file by its name in the capture.

    Raises
    ------
    InputError
        If a file or the pose is of no use: missing, empty, not numbers, cut off.
    TooLargeError
        If a file is larger than the limits.
    """
    if capture.kind == "frame" and shows_board(capture):
        from calib_core.captures.measure_frame import measure_frame

        return measure_frame(session, capture, read)
    if capture.kind in ("frame", "sweep") and _waits_for_calibration(session, capture):
        from calib_core.captures.measure_frame import measure_stripe

        return measure_stripe(session, capture, read)
    if capture.kind == "sweep":
        from calib_core.captures.sweep_sphere import measure_sweep

        return measure_sweep(session, capture, read)
    if capture.pose is not None or shows_sphere(capture):
        pose_of(session.cell, capture)
    if capture.kind == "center":
        assert capture.center_mm is not None
        return measured_of(capture, [], center_mm=capture.center_mm)
    measured = _of_points(session, capture, read)
    doubts = doubts_of(capture, read) if capture.kind in ("profile", "cloud") else []
    told = [FILE_DOUBTFUL([capture.id], shown="told", doubt=doubt) for doubt in doubts]
    return measured_with(measured, [*told, *lost_rays(measured.without_ray)])


def _of_points(session: Session, capture: Capture, read: ReadFile) -> Measured:
    try:
        if shows_sphere(capture):
            return _measured(session.cell, capture, see_sphere(session, capture, read))
        found = points_of(session, capture, read)
    except MeasurementError as error:
        return _nothing_seen(session, capture, read, error)
    return measured_of(
        capture, [], points=len(found.points), without_ray=found.without_ray, preview=thinned(found.points)
    )


def _nothing_seen(session: Session, capture: Capture, read: ReadFile, error: MeasurementError) -> Measured:
    """Return why the sphere is not seen in a capture's points, or why there are none: a frame without a stripe."""
    try:
        found = points_of(session, capture, read)
    except MeasurementError:
        return not_seen(capture, error)
    preview = thinned(found.points)
    return not_seen(
        capture,
        error,
        points=len(found.points),
        without_ray=found.without_ray,
        preview=preview,
        preview_on_sphere=[False] * len(preview),
    )


def _waits_for_calibration(session: Session, capture: Capture) -> bool:
    """Return whether a capture is raw frames that nothing tells yet how to make points of."""
    from calib_core.captures.raw_frames import of_frames
    from calib_core.captures.stripe_frames import can_be_calibrated

    return of_frames(capture) and not can_be_calibrated(session)


def _measured(cell: Cell, capture: Capture, seen: Seen) -> Measured:
    fit, weak, per_independent = seen.fit, list[Finding](), None
    diameter_mm = diameter_in_sight_mm(cell, capture)
    if isinstance(fit, ArcFit):
        assert diameter_mm is not None
        weak = arc_findings(fit, seen.points, diameter_mm)
        per_independent = fit.points_per_independent
    return measured_of(
        capture,
        weak,
        points=len(seen.points),
        on_sphere=int(seen.on_sphere.sum()),
        without_ray=seen.without_ray,
        points_per_independent=per_independent,
        **figures_of(fit, seen.points, seen.on_sphere, diameter_mm),
    )
