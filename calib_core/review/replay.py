"""Replay: solve a stored session afresh and compare every number with what it holds."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from calib_core.archive.folder import result_data
from calib_core.captures.observation_cache import plain
from calib_core.errors import CalibrationError, InputError
from calib_core.findings.codes.provenance import REPLAY_DIFFERS, REPLAYED_OTHER_REVISION
from calib_core.graph.keys import Graph
from calib_core.graph.stage import SOFTWARE
from calib_core.messages import message
from calib_core.records import Progress, ReadFile, Record, ResultsData, Session
from calib_core.review.same_numbers import SIGMAS, TOLERANCE, StageReplay, compare, frame_sigmas
from calib_core.stages.pipeline import solve_stage

_MOST_SIGMAS: Final = 1e9
_METHOD_MOVES_SIGMAS: Final = 10.0  # what another method cannot explain, whichever revision it claims to be of


class Replay(Record):
    """Whether a session's results come out again, within the stated tolerance."""

    session: str
    software: str
    tolerance: float
    equal: bool
    stages: list[StageReplay]


def replay(
    session: Session,
    read: ReadFile,
    results: ResultsData,
    progress: Progress | None = None,
    where: str = "",
    fresh: Callable[[str, dict[str, Any]], None] = lambda _stage, _result: None,
) -> Replay:
    """Solve afresh every stage that has a stored result, and compare.

    Parameters
    ----------
    session : Session
    read : callable
        Returns the bytes of a file by its name in the capture.
    results : mapping
        The stored results by stage, as JSON data.
    progress : callable, optional
        As of `pipeline.run`.
    where : str
        What messages call the session.
    fresh : callable, optional
        Called with each stage that could be solved, and its new result as JSON data.

    Raises
    ------
    InputError
        If no result is stored.
    """
    if not results:
        raise InputError("stored results to compare with", "none", "Solve the session first.", where)
    read = plain(read)  # afresh: what was kept may be what was wrong
    stages = [_stage(session, read, stage, stored, progress, fresh) for stage, stored in results.items()]
    equal = all(stage.equal for stage in stages)
    return Replay(session=session.name, software=SOFTWARE, tolerance=TOLERANCE, equal=equal, stages=stages)


def _stage(
    session: Session,
    read: ReadFile,
    stage: str,
    stored: Mapping[str, Any],
    progress: Progress | None,
    tell: Callable[[str, dict[str, Any]], None],
) -> StageReplay:
    try:
        fresh = result_data(solve_stage(session, stage, read, progress))
    except CalibrationError as error:
        why = [
            message("It cannot be solved any more: {error}", error=error),
            *_why(session, read, stage, stored, {}),
        ]
        return StageReplay(stage=stage, equal=False, why=why)
    tell(stage, fresh)
    compared = compare(stored, fresh)
    update: dict[str, Any] = {"stage": stage, "why": []}
    if not compared.equal:
        update["why"] = _why(session, read, stage, stored, fresh)
    if Graph.of_files(session, read).is_fresh(stage, stored.get("inputs_sha256")):
        update |= _judged(stage, compared, stored, fresh)
    return compared.model_copy(update=update)


def _judged(
    stage: str, compared: StageReplay, stored: Mapping[str, Any], fresh: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what a result is by its replay, with what is to be said of it."""
    if compared.equal:
        return {"provenance": "replayed"}
    sigmas = min(_sigmas(stage, stored, fresh), _MOST_SIGMAS)
    before, now = stored.get("method_revision", 1), fresh.get("method_revision", 1)
    if before != now and sigmas <= _METHOD_MOVES_SIGMAS:
        return {
            "provenance": "replayed",
            "finding": REPLAYED_OTHER_REVISION(before=before, now=now, sigmas=sigmas),
        }
    count = compared.difference_count
    frames = dict(frame_sigmas(stage, stored, fresh))
    what = max(frames, key=frames.__getitem__) if sigmas > SIGMAS else compared.differences[0].path
    how = "frames" if sigmas > SIGMAS else "values"
    return {"provenance": "differs", "finding": REPLAY_DIFFERS(how=how, what=what, sigmas=sigmas, count=count)}


def _why(
    session: Session, read: ReadFile, stage: str, stored: Mapping[str, Any], fresh: Mapping[str, Any]
) -> list[str]:
    """Return the reasons that the records themselves give for a difference."""
    reasons: list[str] = []
    software, method = stored.get("software"), stored.get("method")
    if software != SOFTWARE:
        reasons.append(
            message(
                "It was computed by {software}; this is {software_other}.",
                software=software,
                software_other=SOFTWARE,
            )
        )
    if fresh and method != fresh.get("method"):
        reasons.append(
            message("The method was {method!r}; it is {fresh!r} now.", method=method, fresh=fresh.get("method"))
        )
    before, revision = stored.get("method_revision", 1), fresh.get("method_revision", 1)
    graph, inputs_sha256 = Graph.of_files(session, read), stored.get("inputs_sha256")
    if fresh and not reasons and graph.is_of_first_release(stage, inputs_sha256):
        reasons.append(
            message(
                "It was computed by 0.1.0 as first released; the method has changed since, which is "
                "no damage. Now it lies up to {stage:.2f} standard deviations from it.",
                stage=_sigmas(stage, stored, fresh),
            )
        )
    elif before != revision:
        reasons.append(
            message(
                "Its method was of revision {before}; revision {revision} changed it on purpose.",
                before=before,
                revision=revision,
            )
        )
        if sigmas := _sigmas(stage, stored, fresh):
            reasons.append(message("Now it lies up to {sigmas:.2f} standard deviations from it.", sigmas=sigmas))
    if fresh and not graph.is_fresh(stage, inputs_sha256):
        reasons.append(
            "Cell, captures or files were changed after it was computed: the hashes of the inputs differ."
        )
    return reasons or [
        "Software and inputs are the same: the result was altered, or computed with other arithmetic "
        "(another processor, or other versions of numpy and scipy)."
    ]


def _sigmas(stage: str, stored: Mapping[str, Any], fresh: Mapping[str, Any]) -> float:
    """Return how far the frames lie apart at most along one of their axes, in the new result's sigmas."""
    return max([0.0, *(sigmas for _, sigmas in frame_sigmas(stage, stored, fresh))])
