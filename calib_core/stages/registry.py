"""The stages that exist, in their order, and the steps that captures are taken for."""

from functools import cache

from calib_core.registry import Registry
from calib_core.stages.stage import CaptureStep, Shows, Stage

STAGES: Registry[Stage] = Registry("a stage", "calib_core.stages", "STAGE", Stage, folders=True)


@cache
def stages() -> tuple[Stage, ...]:
    """Return all stages, each after those that it rests on."""
    return tuple(sorted(STAGES, key=lambda stage: stage.place))


@cache
def stage_names() -> tuple[str, ...]:
    """Return the names of all stages, in their order."""
    return tuple(stage.name for stage in stages())


@cache
def capture_steps() -> tuple[CaptureStep, ...]:
    """Return the steps that captures are taken for, in the order of their stages."""
    own = ((*(() if stage.step is None else (stage.step,)), *stage.further_steps) for stage in stages())
    return tuple(step for steps in own for step in steps)


@cache
def step_names() -> tuple[str, ...]:
    """Return the names that a capture's `step` may have."""
    return tuple(step.name for step in capture_steps())


@cache
def planned_steps() -> tuple[str, ...]:
    """Return the steps for whose captures poses are planned, the tool's first."""
    return tuple(stage.step.name for stage in stages() if stage.planned and stage.step is not None)


@cache
def guided_steps() -> tuple[str, ...]:
    """Return the steps that the guide leads through, in their order."""
    return tuple(step for stage in stages() for step in stage.guided)


@cache
def steps_that_show(*shown: Shows) -> tuple[str, ...]:
    """Return the steps whose captures show one of these."""
    return tuple(step.name for step in capture_steps() if step.shows in shown)


@cache
def optics_stages() -> tuple[str, ...]:
    """Return the names of the stages that turn raw frames into points."""
    return tuple(stage.name for stage in stages() if stage.step is not None and stage.step.shows == "board")


def answer_stages() -> tuple[Stage, ...]:
    """Return the stages whose result can be the session's answer, the best first."""
    return tuple(stage for stage in reversed(stages()) if stage.is_answer)


@cache
def tool_stages() -> tuple[str, ...]:
    """Return the names of the stages whose result has the scanner's pose on the flange, the best first."""
    return tuple(stage.name for stage in answer_stages())


@cache
def table_stages() -> tuple[str, ...]:
    """Return the names of the stages whose result has the turntable's frame, the best first."""
    return tuple(stage.name for stage in reversed(stages()) if "base_from_turntable" in stage.frames)
