"""Stages solved: one, or all that a session has captures for."""

from numpy.linalg import LinAlgError

from calib_core.captures.solved_optics import remembered
from calib_core.cell.consistency import require_consistent
from calib_core.errors import InputError, MeasurementError, MotionError
from calib_core.findings import judged
from calib_core.findings.bridge import complete
from calib_core.graph.keys import Graph, stage_captures
from calib_core.graph.registry import STAGES, answer_stages, stages
from calib_core.graph.stage import Stage
from calib_core.graph.stage_input import FindCrew, Kept, StageInput
from calib_core.graph.temperature import temperature_findings
from calib_core.messages import message
from calib_core.records import Capture, Progress, ReadFile, Result, Session, StoreFile
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.stages.evidence import with_evidence
from calib_core.stages.found import found_frames
from calib_core.steps import optics_stages


def run(
    session: Session,
    read: ReadFile,
    stage: str = "all",
    progress: Progress | None = None,
    store: StoreFile | None = None,
    results: dict[str, Result] | None = None,
) -> dict[str, Result]:
    """Return the results of a stage, or of all that the session has captures for, by stage.

    Those of all are put into `results` one by one: what is solved is there though a later stage is refused.

    Raises
    ------
    InputError
        If the stage is unknown, brought by the user, or has no captures.
    CalibrationError
        What a stage's solver says.
    """
    if stage != "all":
        if stage not in STAGES.names():
            raise InputError.unknown(stage, ("all", *(one.name for one in stages())), "stage")
        return {stage: solve_stage(session, stage, read, progress, store)}
    results = {} if results is None else results
    kept = Kept(results=results)
    for name in stages_to_solve(session):
        try:
            results[name] = solve_stage(session, name, read, progress, store, kept)
        except (MeasurementError, MotionError) as error:
            if not results or not STAGES.get(name, "stage").is_second_opinion:
                raise
            if progress:
                progress(1.0, message("{name} is left out: {error}", name=name, error=error))
    return results


def stages_to_solve(session: Session) -> list[str]:
    """Return the stages that `all` means, in their order: with captures, and not brought by the user.

    Raises
    ------
    InputError
        If no stage has captures.
    """
    if not any(stage_captures(session, stage.name) for stage in stages()):
        _require_captures([], answer_stages()[-1])
    some = [s for s in stages() if not s.is_brought(session) and s.has_captures(session)]
    return [s.name for s in some if s.is_wanted(session) or not s.optional]


def solve_stage(
    session: Session,
    stage: str,
    read: ReadFile,
    progress: Progress | None = None,
    store: StoreFile | None = None,
    kept: Kept | None = None,
    crew: FindCrew | None = None,
) -> Result:
    """Return the result of one stage.

    Parameters
    ----------
    session : Session
    stage : str
        The stage's name.
    read : callable
        Returns the bytes of a file by its name in the capture.
    progress : callable, optional
        Called with the fraction done and what is being done.
    store : callable, optional
        Takes the files that a stage makes beside its result, by name and in pieces: the merged cloud, its mesh.
    kept : Kept, optional
        What other stages have solved of the same session meanwhile.
    crew : callable, optional
        Gives who does the work of a merge; this process if left out.

    Raises
    ------
    InputError
        If the stage is unknown, brought by the user, or has no captures; or a file or pose is of no use.
    CalibrationError
        What the stage's solver says.
    """
    given = stage_input(session, stage, read, progress, store, kept, crew)
    try:
        entry = STAGES.get(stage, "stage")
        result = entry.solve(given).model_copy(update={"method_revision": entry.method_revision})
        result = result.model_copy(update={"frames": found_frames(entry, result)})
    except (InputError, MeasurementError) as error:
        from calib_core.causes.session import explained

        raise explained(error, session, read) from None
    except LinAlgError:
        to_do = message(
            "Correct sigmas that are far too large or too small; `scancell check` names doubtful captures."
        )
        need = "captures and sigmas that determine an answer"
        raise MotionError(need, "equations without one", to_do, stage) from None
    result = _believed(judged(result, temperature_findings(session, entry)))
    return with_evidence(session, complete(result))


def _believed(result: Result) -> Result:
    """Return a result that states no interval where it failed: the model that tells it does not hold."""
    failed = result.verdict == "fail" and hasattr(result, "confidence_95")
    return result.model_copy(update={"confidence_95": {}}) if failed else result


def stage_input(
    session: Session,
    stage: str,
    read: ReadFile,
    progress: Progress | None = None,
    store: StoreFile | None = None,
    kept: Kept | None = None,
    crew: FindCrew | None = None,
) -> StageInput:
    """Return what the solver of a stage gets; parameters as of `solve_stage`.

    Raises
    ------
    InputError
        If the stage is unknown, brought by the user, or has no captures.
    """
    entry = STAGES.get(stage, "stage")
    if entry.is_brought(session):
        need = "a stage to solve, not '{stage}'"
        to_do = "Remove it from cell.known to solve it."
        raise InputError(need, "its result in cell.known", to_do, "cell.known", stage=stage)
    _require_captures(stage_captures(session, stage), entry)
    if stage not in optics_stages():
        require_consistent(session.cell, session.captures)
    solved = kept or Kept()
    graph = solved.graph = solved.graph or Graph.of_files(session, read)
    for name in optics_stages():
        result = solved.results.get(name)
        if isinstance(result, CameraResult | LaserPlaneResult):
            remembered(name, graph.key(name), result)
    tell: Progress = progress or (lambda _fraction, _message: None)
    reduced = graph.session_for(stage)

    def solve_other(other: str, progress: Progress) -> Result:
        return solved.results.get(other) or solve_stage(session, other, read, progress, kept=solved)

    captures = stage_captures(reduced, stage)
    return StageInput(reduced, captures, read, graph.key(stage), tell, store, solved, solve_other, crew)


def _require_captures(captures: list[Capture], stage: Stage) -> None:
    if not captures:
        step = stage.step or next(
            other.step for other in stages() if other.step and other.step.name in stage.steps
        )
        steps = [f"'{name}'" for name in stage.steps]
        raise InputError("captures with step {steps:or}", "none", step.to_capture, "captures", steps=steps)
