"""The paper's calibrations in their order: which captures each stage takes, and what solves it."""

from collections.abc import Callable

from calib_core.errors import InputError
from calib_core.records import Capture, Result, Session
from calib_core.stages.evidence import with_evidence
from calib_core.stages.graph import STAGES, inputs_sha256, stage_captures, stage_entry
from calib_core.stages.stage import Kept, Progress, ReadFile, StageInput, StoreFile
from calib_core.stages.tcp.solve import solve_tcp_stage

_TO_CAPTURE = {
    "camera": "Capture the board, tilted differently in each frame, and add the frames to the session.",
    "turntable": "Fix the sphere on the table, capture it at 8 angles, and again at a second height.",
    "merge": "Scan the object from around, with the robot's pose and the table's angle of each scan.",
    "laser-plane": "Capture the board with the stripe on it, near and far, and add the frames to the session.",
}


def _solve_camera(given: StageInput) -> Result:
    from calib_core.stages.camera.solve import solve_camera_stage  # brings numba, which other stages may not need

    return solve_camera_stage(given)


def _solve_laser_plane(given: StageInput) -> Result:
    from calib_core.stages.laser_plane.solve import solve_laser_plane_stage

    return solve_laser_plane_stage(given)


def _solve_turntable(given: StageInput) -> Result:
    from calib_core.stages.turntable.solve import solve_turntable_stage

    return solve_turntable_stage(given)


def _solve_chain(given: StageInput) -> Result:
    from calib_core.stages.turntable.solve import solve_chain_stage

    return solve_chain_stage(given)


def _solve_merge(given: StageInput) -> Result:
    from calib_core.stages.merge.solve import solve_merge_stage

    return solve_merge_stage(given)


_SOLVERS: dict[str, Callable[[StageInput], Result]] = {
    "camera": _solve_camera,
    "laser-plane": _solve_laser_plane,
    "tcp": solve_tcp_stage,
    "turntable": _solve_turntable,
    "chain": _solve_chain,
    "merge": _solve_merge,
}


def run(
    session: Session,
    read: ReadFile,
    stage: str = "all",
    progress: Progress | None = None,
    store: StoreFile | None = None,
) -> dict[str, Result]:
    """Return the results of a stage, or of all that the session has captures for, by stage.

    Raises
    ------
    InputError
        If the stage is unknown, brought by the user, or has no captures.
    CalibrationError
        What a stage's solver says.
    """
    if stage != "all":
        return {stage: solve_stage(session, stage, read, progress, store)}
    results: dict[str, Result] = {}
    todo = [name for name, entry in STAGES.items() if entry.known(session.cell.known) is None]
    with_captures = [name for name in todo if _has_captures(session, name)]
    if not any(stage_captures(session, name) for name in STAGES):
        _require_captures([], "tcp")
    kept = Kept(results=results)
    for name in with_captures:
        results[name] = solve_stage(session, name, read, progress, store, kept)
    return results


def solve_stage(
    session: Session,
    stage: str,
    read: ReadFile,
    progress: Progress | None = None,
    store: StoreFile | None = None,
    kept: Kept | None = None,
) -> Result:
    """Return the result of one stage.

    Parameters
    ----------
    session : Session
    stage : str
        A name in `STAGES`.
    read : callable
        Returns the bytes of a file by its name in the capture.
    progress : callable, optional
        Called with the fraction done and what is being done.
    store : callable, optional
        Takes the files that a stage makes beside its result, by name and in pieces: the merged cloud, its mesh.
    kept : Kept, optional
        What other stages have solved of the same session meanwhile.

    Raises
    ------
    InputError
        If the stage is unknown, brought by the user, or has no captures; or a file or pose is of no use.
    CalibrationError
        What the stage's solver says.
    """
    given = stage_input(session, stage, read, progress, store, kept)
    return with_evidence(session, _SOLVERS[stage](given))


def stage_input(
    session: Session,
    stage: str,
    read: ReadFile,
    progress: Progress | None = None,
    store: StoreFile | None = None,
    kept: Kept | None = None,
) -> StageInput:
    """Return what the solver of a stage gets; parameters as of `solve_stage`.

    Raises
    ------
    InputError
        If the stage is unknown, brought by the user, or has no captures.
    """
    entry = stage_entry(stage)
    if entry.known(session.cell.known) is not None:
        raise InputError(
            f"a stage to solve, not '{stage}'",
            "its result in cell.known",
            "Remove it from cell.known to solve it.",
            "cell.known",
        )
    captures = stage_captures(session, stage)
    _require_captures(captures, stage)
    inputs = inputs_sha256(session, stage, read)
    tell: Progress = progress or (lambda _fraction, _message: None)
    solved = kept or Kept()

    def solve_other(other: str, progress: Progress) -> Result:
        return solve_stage(session, other, read, progress, kept=solved)

    return StageInput(session, captures, read, inputs, tell, store, solved, solve_other)


def _has_captures(session: Session, stage: str) -> bool:
    steps = {capture.step for capture in session.captures}
    entry = stage_entry(stage)
    return (all if entry.every_step else any)(step in steps for step in entry.steps)


def _require_captures(captures: list[Capture], stage: str) -> None:
    if not captures:
        steps = " or ".join(f"'{step}'" for step in stage_entry(stage).steps)
        raise InputError(
            f"captures with step {steps}",
            "none",
            _TO_CAPTURE.get(stage, "Capture the sphere from several robot poses and add them to the session."),
            "captures",
        )
