"""What a scene draws that takes long to work out: the pose to take next, and what is known so far and how well."""

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from calib_core.frames import FloatArray
from calib_core.graph.registry import stages
from calib_core.records import Measured, Result, Session
from calib_core.steps import steps_that_show, table_stages, tool_stages
from server.scenes.scene_input import SceneAdvice, SceneInput

if TYPE_CHECKING:
    from calib_core.guidance.interim_estimate import KnownSoFar, TableSoFar
    from server.jobs.page_process import PageProcess

_KNOWN_MM = 150.0  # where the sphere's place is less certain than that (k = 2), nothing is drawn of it


class SceneAdviser:
    """Has scenes' advice worked out in the process that works for pages.

    Parameters
    ----------
    process : PageProcess
    """

    def __init__(self, process: "PageProcess") -> None:
        self._process = process

    def __call__(self, scene: SceneInput) -> SceneAdvice:
        """Return what `advice_for` does."""
        return self._process.ask(
            _advice_on_texts,
            scene.session.model_dump_json(exclude_unset=True),
            [seen.model_dump_json(exclude_unset=True) for seen in scene.measured],
            {stage: result.model_dump_json(exclude_unset=True) for stage, result in scene.results.items()},
            scene.stale,
        )


def advice_for(scene: SceneInput) -> SceneAdvice:
    """Return the advice for a scene, worked out here."""
    return _advice(scene.session, scene.measured, scene.results, scene.stale)


def no_advice(_: SceneInput) -> SceneAdvice:
    """Return none: for what does not draw it."""
    return SceneAdvice()


def _advice_on_texts(
    session: str, measured: Sequence[str], results: Mapping[str, str], stale: frozenset[str]
) -> SceneAdvice:
    from server.page_questions import seen_in

    solved = {
        stage.name: stage.result.model_validate_json(results[stage.name])
        for stage in stages()
        if stage.name in results
    }
    return _advice(Session.model_validate_json(session), [seen_in(text) for text in measured], solved, stale)


def _advice(
    session: Session, measured: Sequence[Measured], results: Mapping[str, Result], stale: Collection[str]
) -> SceneAdvice:
    from calib_core.stages.guide import guide

    return SceneAdvice(
        guide(session, measured, results, stale).current.suggested_pose,
        _tool_so_far(session, measured, results, stale),
        _table_so_far(session, measured, results, stale),
    )


def _tool_so_far(
    session: Session, measured: Sequence[Measured], results: Mapping[str, Result], stale: Collection[str]
) -> "KnownSoFar | None":
    """Return what the captures tell by now where no result does, None before they tell where the sphere is."""
    if any(stage in results and stage not in stale for stage in tool_stages()):
        return None
    from calib_core.guidance.interim_estimate import known_so_far

    found = known_so_far(session, measured, {name: _told(result) for name, result in results.items()})
    if found is None or 2.0 * _worst(found.center) > _KNOWN_MM:
        return None
    return found


def _table_so_far(
    session: Session, measured: Sequence[Measured], results: Mapping[str, Result], stale: Collection[str]
) -> "TableSoFar | None":
    """Return what the captures on the table tell by now where no result does, None before they tell its axis."""
    if any(stage in results and stage not in stale for stage in table_stages()):
        return None
    if not any(capture.step in steps_that_show("sphere-on-table") for capture in session.captures):
        return None
    from calib_core.guidance.interim_estimate import table_so_far

    return table_so_far(session, measured, {name: _told(r, name in stale) for name, r in results.items()})


def _told(result: Result, stale: bool = True) -> dict[str, Any]:
    return {**result.to_json(), "stale": stale}


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(max(np.linalg.eigvalsh((covariance + covariance.T) / 2)[-1], 0.0)))
