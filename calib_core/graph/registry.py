"""The stages that exist, with all that they can do, in their order."""

from functools import cache

from calib_core.graph.stage import Stage
from calib_core.registry import Registry

STAGES: Registry[Stage] = Registry("a stage", "calib_core.stages", "STAGE", Stage, folders=True)


@cache
def stages() -> tuple[Stage, ...]:
    """Return all stages, each after those that it rests on."""
    return tuple(sorted(STAGES, key=lambda stage: stage.place))


def answer_stages() -> tuple[Stage, ...]:
    """Return the stages whose result can be the session's answer, the best first."""
    return tuple(stage for stage in reversed(stages()) if stage.is_answer)
