"""The paper's calibrations in their order: which captures each stage takes, and what solves it."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

from calib_core.errors import InputError
from calib_core.records import Capture, Known, Result, Session, Stage, Step
from calib_core.session.measure import ReadFile
from calib_core.session.stage_tcp import Kept, Progress, StageInput, StoreFile, solve_tcp_stage

_TO_CAPTURE = {
    "camera": "Capture the board, tilted differently in each frame, and add the frames to the session.",
    "turntable": "Fix the sphere on the table, capture it at 8 angles, and again at a second height.",
    "merge": "Scan the object from around, with the robot's pose and the table's angle of each scan.",
    "laser-plane": "Capture the board with the stripe on it, near and far, and add the frames to the session.",
}
_OF_FRAMES: tuple[Step, ...] = ("camera", "laser-plane")  # what raw frames of later stages rest on


@dataclass(frozen=True)
class StageEntry:
    """One stage: the steps whose captures it takes, what it gives that a user may bring, and its solver.

    `tool_from` and `table_from` are the steps that its tool and its table come from, where the user brings none;
    with `every_step` it is solved only where there are captures of all its steps.
    """

    steps: tuple[Step, ...]
    known: Callable[[Known], object | None]
    solve: Callable[[StageInput], Result]
    tool_from: tuple[Step, ...] = ()
    table_from: tuple[Step, ...] = ()
    every_step: bool = False


def _solve_camera(given: StageInput) -> Result:
    from calib_core.session.stage_camera import solve_camera_stage  # brings numba, which other stages may not need

    return solve_camera_stage(given)


def _solve_laser_plane(given: StageInput) -> Result:
    from calib_core.session.stage_laser_plane import solve_laser_plane_stage

    return solve_laser_plane_stage(given)


def _solve_turntable(given: StageInput) -> Result:
    from calib_core.session.stage_turntable import solve_turntable_stage

    return solve_turntable_stage(given)


def _solve_chain(given: StageInput) -> Result:
    from calib_core.session.stage_turntable import solve_chain_stage

    return solve_chain_stage(given)


def _solve_merge(given: StageInput) -> Result:
    from calib_core.session.stage_merge import solve_merge_stage

    return solve_merge_stage(given)


STAGES: dict[Stage, StageEntry] = {
    "camera": StageEntry(("camera", "laser-plane"), lambda known: known.camera, _solve_camera),
    "laser-plane": StageEntry(("laser-plane",), lambda known: known.laser_plane, _solve_laser_plane),
    "tcp": StageEntry(("tcp",), lambda known: known.tool0_from_laser, solve_tcp_stage),
    "turntable": StageEntry(
        ("turntable",), lambda known: known.base_from_turntable, _solve_turntable, tool_from=("tcp",)
    ),
    "chain": StageEntry(
        ("tcp", "turntable"),
        lambda known: known.tool0_from_laser or known.base_from_turntable,
        _solve_chain,
        every_step=True,
    ),
    "merge": StageEntry(
        ("scan",), lambda _known: None, _solve_merge, tool_from=("tcp",), table_from=("turntable",)
    ),
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
    entry = _entry(stage)
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
    return entry.solve(StageInput(session, captures, read, inputs, tell, store, kept or Kept()))


def stage_captures(session: Session, stage: str) -> list[Capture]:
    """Return the captures that a stage takes, the excluded ones too."""
    steps = _entry(stage).steps
    return [capture for capture in session.captures if capture.step in steps]


def inputs_sha256(session: Session, stage: str, read: ReadFile, digest: Callable[[str], str] | None = None) -> str:
    """Return the hash of all that a stage's result depends on: cell, captures, and their files' contents.

    A stored result is stale where this differs from the one it carries.  Where a store knows the SHA-256 of its
    files, `digest` gives it by a file's name, and nothing is read.
    """
    digest = digest or (lambda name: hashlib.sha256(read(name)).hexdigest())
    captures = _captures_it_rests_on(session, stage)
    names = [name for capture in captures if not capture.excluded for name in capture.files]
    inputs = {
        "stage": stage,
        "cell": session.cell.model_dump(mode="json", exclude_defaults=True),
        "captures": [capture.model_dump(mode="json", exclude_defaults=True) for capture in captures],
        "files": {name: digest(name) for name in names},
    }
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _captures_it_rests_on(session: Session, stage: str) -> list[Capture]:
    """Return a stage's captures, and those that tell how its raw frames become points."""
    entry = _entry(stage)
    steps: set[Step] = {*entry.steps}
    if entry.tool_from and session.cell.known.tool0_from_laser is None:
        steps |= {*entry.tool_from}
    if entry.table_from and session.cell.known.base_from_turntable is None:
        steps |= {*entry.table_from}
    captures = [capture for capture in session.captures if capture.step in steps]
    if stage != "camera" and any(capture.kind in ("frame", "sweep") for capture in captures):
        steps |= {*_OF_FRAMES}
        return [capture for capture in session.captures if capture.step in steps]
    return captures


def _has_captures(session: Session, stage: str) -> bool:
    steps = {capture.step for capture in session.captures}
    entry = _entry(stage)
    return (all if entry.every_step else any)(step in steps for step in entry.steps)


def _entry(stage: str) -> StageEntry:
    for name, entry in STAGES.items():
        if name == stage:
            return entry
    got = f"'{stage}', which a later version will solve" if stage in get_args(Stage) else f"'{stage}'"
    raise InputError("a stage among all, " + ", ".join(STAGES), got, "Name one of these.", "stage")


def _require_captures(captures: list[Capture], stage: str) -> None:
    if not captures:
        steps = " or ".join(f"'{step}'" for step in _entry(stage).steps)
        raise InputError(
            f"captures with step {steps}",
            "none",
            _TO_CAPTURE.get(stage, "Capture the sphere from several robot poses and add them to the session."),
            "captures",
        )
