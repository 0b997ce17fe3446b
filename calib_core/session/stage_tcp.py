"""The tcp stage: every capture of the sphere observed, the joint solve, one row of residuals a capture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core import __version__
from calib_core.chain.observations import SphereObservation
from calib_core.errors import MeasurementError, MotionError
from calib_core.records import Capture, Session, TcpResidual, TcpResult
from calib_core.session.measure import ReadFile, observe_capture, sphere_of
from calib_core.session.poses import base_from_tool0_by_capture, duplicates, same_place

Progress = Callable[[float, str], None]

SOFTWARE = f"scancell {__version__}"

_MEASURING_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class StageInput:
    """What a stage's solver gets: the session, the stage's captures, their files, and whom to tell progress."""

    session: Session
    captures: list[Capture]
    read: ReadFile
    inputs_sha256: str
    progress: Progress


def solve_tcp_stage(given: StageInput) -> TcpResult:
    """Return the scanner's pose on the flange from all tcp captures that are not excluded.

    Raises
    ------
    InputError
        If a file or a pose is of no use.
    MeasurementError
        If most captures do not show the sphere: then the cell's description is at fault, not a capture.
    MotionError
        If the motions do not determine the answer.
    """
    from calib_core.chain.tcp import TcpOptions, solve_tcp

    cell = given.session.cell
    captures = [capture for capture in given.captures if not capture.excluded]
    sphere = sphere_of(cell, captures)
    base_from_tool0_by_capture(cell, captures)
    unused = {capture.id: "excluded by the user" for capture in given.captures if capture.excluded}
    unused |= _copies(captures, given.read)
    observations, failed = _observe_all(given, [c for c in captures if c.id not in unused])
    degrees = cell.robot.orientation_sigma_deg
    options = TcpOptions(
        position_sigma_mm=cell.robot.position_sigma_mm,
        orientation_sigma_rad=None if degrees is None else float(np.deg2rad(degrees)),
        point_sigma_mm=cell.scanner.point_sigma_mm,
    )
    try:
        solution = solve_tcp(observations, sphere, options, _later(given.progress))
    except MotionError as error:
        raise _with_failures(error, failed) from None
    from calib_core.chain.tcp_result import tcp_result

    unused |= {name: _why(error) for name, error in failed.items()}
    return _with_unused(tcp_result(solution, SOFTWARE, given.inputs_sha256), given.captures, unused)


def _observe_all(
    given: StageInput, captures: Sequence[Capture]
) -> tuple[list[SphereObservation], dict[str, MeasurementError]]:
    observations: list[SphereObservation] = []
    failed: dict[str, MeasurementError] = {}
    for number, capture in enumerate(captures):
        given.progress(_MEASURING_SHARE * number / len(captures), f"Finding the sphere in {capture.id}")
        try:
            observations.append(observe_capture(given.session, capture, given.read))
        except MeasurementError as error:
            failed[capture.id] = error
    if len(failed) > len(observations):
        first = next(iter(failed.values()))
        got = f"{first.got} ({len(failed)} of {len(captures)} captures do not show the sphere)"
        raise MeasurementError(first.need, got, first.to_do, first.where)
    return observations, failed


def _copies(captures: Sequence[Capture], read: ReadFile) -> dict[str, str]:
    """Return why captures that repeat another are left out; a copy at another pose is left to the solver."""
    by_id = {capture.id: capture for capture in captures}
    return {
        copy: f"a duplicate of {original}: the same file and pose, counted once"
        for copy, original in duplicates(captures, read).items()
        if same_place(by_id, copy, original)
    }


def _later(progress: Progress) -> Progress:
    return lambda fraction, message: progress(_MEASURING_SHARE + (1 - _MEASURING_SHARE) * fraction, message)


def _with_failures(error: MotionError, failed: dict[str, MeasurementError]) -> MotionError:
    """Return the error with the captures that would have been there, had the sphere been found in them."""
    if not failed:
        return error
    names = "; ".join(f"{name}: {why.got}" for name, why in failed.items())
    return MotionError(error.need, f"{error.got} ({names})", error.to_do, error.where)


def _why(error: MeasurementError) -> str:
    return f"need {error.need}, got {error.got}. {error.to_do.removesuffix('.')}"


def _with_unused(result: TcpResult, captures: Sequence[Capture], unused: dict[str, str]) -> TcpResult:
    """Return the result with a row for every capture, in their order, and a warning for those of no use."""
    rows = {row.capture: row for row in result.residuals}
    for capture in captures:
        if capture.id in unused:
            rows[capture.id] = TcpResidual(capture=capture.id, used=False, reason=unused[capture.id])
    warnings = list(result.warnings)
    warnings += [f"{c.id} is not used: {unused[c.id]}." for c in captures if c.id in unused and not c.excluded]
    return result.model_copy(
        update={
            "residuals": [rows[capture.id] for capture in captures],
            "warnings": warnings,
            "verdict": "warn"
            if result.verdict == "pass" and len(warnings) > len(result.warnings)
            else result.verdict,
        }
    )
