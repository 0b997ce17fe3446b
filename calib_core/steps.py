"""What the stages declare, and the steps that captures are taken for: records and advice ask for names here."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Literal

from calib_core.registry import Registry

Shows = Literal["board", "sphere", "sphere-on-table", "object"]
"""What a step's captures show."""


@dataclass(frozen=True)
class CaptureStep:
    """A step that captures are taken for.

    Attributes
    ----------
    name : str
        As the captures' field `step` has it.
    title : str
        As people read it.
    shows : str
        What the captures show.
    to_capture : str
        What to do where there is none, as a sentence.
    least : int
        So many must be of use, or its stage is not solved.
    letter : str
        What the ids of its captures begin with where nobody names them.
    """

    name: str
    title: str
    shows: Shows
    to_capture: str
    least: int = 1
    letter: str = "p"


class StageDeclaration:
    """What one calibration, or what is made with it, says of itself.

    Attributes
    ----------
    name, title : str
        As records and as people call it.
    method_revision : int
        Raised where the same inputs give other numbers or another verdict on purpose.
    place : int
        Where it stands among the stages; what it rests on stands before it.
    step : CaptureStep or None
        The step whose captures are its own.
    further_steps : tuple of CaptureStep
        Others whose captures are its own too.
    takes : mapping
        The steps whose captures it takes, its own first, each with the capture's fields that it reads.
    reads : tuple of str
        The cell's fields that it reads itself, by dotted names.
    known : tuple of str
        The fields of `cell.known` that make it needless: the user brings what it would give.
    after : tuple of str
        The stages whose results it may rest on; `rests_on` says on which of them in a session.
    guided : tuple of str
        The steps of the guide that it answers for, in their order.
    answers : tuple of str
        Other stages whose question its result answers too, and better.
    is_answer : bool
        Whether its result can be the session's answer: tool, and table where there is one.
    frames : mapping
        The transforms that its result finds, `into_from_outof`, each with the field of its covariance.
    optional : bool
        Whether later stages can do without it.
    is_second_opinion : bool
        Whether `all` goes on where its captures do not determine it.
    needs_every_step : bool
        Whether it is solved only where each of its steps has captures.
    planned : bool
        Whether poses are planned for its own captures.
    settings_field : str or None
        The field of the cell that holds its settings.
    layers : tuple of str
        The names of the scene's layers that show it.
    """

    name: str
    title: str
    place: int
    method_revision: int = 1
    step: CaptureStep | None = None
    further_steps: tuple[CaptureStep, ...] = ()
    takes: ClassVar[Mapping[str, tuple[str, ...]]]
    reads: tuple[str, ...] = ()
    known: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    guided: tuple[str, ...] = ()
    answers: tuple[str, ...] = ()
    is_answer: bool = False
    frames: ClassVar[Mapping[str, str]] = {}
    optional: bool = False
    is_second_opinion: bool = False
    needs_every_step: bool = False
    planned: bool = False
    settings_field: str | None = None
    layers: tuple[str, ...] = ()

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps whose captures it takes, its own first."""
        return tuple(self.takes)


_STAGES: Registry[StageDeclaration] = Registry(
    "a stage", "calib_core.stages", "STAGE", StageDeclaration, folders=True
)


@cache
def declared_stages() -> tuple[StageDeclaration, ...]:
    """Return what all stages declare, each after those that it rests on."""
    return tuple(sorted(_STAGES, key=lambda stage: stage.place))


@cache
def stage_names() -> tuple[str, ...]:
    """Return the names of all stages, in their order."""
    return tuple(stage.name for stage in declared_stages())


@cache
def capture_steps() -> tuple[CaptureStep, ...]:
    """Return the steps that captures are taken for, in the order of their stages."""
    own = ((*(() if stage.step is None else (stage.step,)), *stage.further_steps) for stage in declared_stages())
    return tuple(step for steps in own for step in steps)


@cache
def step_names() -> tuple[str, ...]:
    """Return the names that a capture's `step` may have."""
    return tuple(step.name for step in capture_steps())


@cache
def planned_steps() -> tuple[str, ...]:
    """Return the steps for whose captures poses are planned, the tool's first."""
    return tuple(stage.step.name for stage in declared_stages() if stage.planned and stage.step is not None)


@cache
def guided_steps() -> tuple[str, ...]:
    """Return the steps that the guide leads through, in their order."""
    return tuple(step for stage in declared_stages() for step in stage.guided)


@cache
def steps_that_show(*shown: Shows) -> tuple[str, ...]:
    """Return the steps whose captures show one of these."""
    return tuple(step.name for step in capture_steps() if step.shows in shown)


@cache
def optics_stages() -> tuple[str, ...]:
    """Return the names of the stages that turn raw frames into points."""
    return tuple(
        stage.name for stage in declared_stages() if stage.step is not None and stage.step.shows == "board"
    )


@cache
def tool_stages() -> tuple[str, ...]:
    """Return the names of the stages whose result has the scanner's pose on the flange, the best first."""
    return tuple(stage.name for stage in reversed(declared_stages()) if stage.is_answer)


@cache
def table_stages() -> tuple[str, ...]:
    """Return the names of the stages whose result has the turntable's frame, the best first."""
    return tuple(stage.name for stage in reversed(declared_stages()) if "base_from_turntable" in stage.frames)
