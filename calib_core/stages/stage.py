"""What a stage is: the captures and fields it reads, what it rests on, and what it can do.

Each folder beside this file holds one: its `__init__.py` has the constant `STAGE`, and is light to import.
"""

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from calib_core import __version__

if TYPE_CHECKING:
    from calib_core.records import Capture, GuideNow, Result, Session
    from calib_core.records.evidence import AnyBlock
    from calib_core.stages.given import StageInput
    from calib_core.stages.guide import GuideView

ReadFile = Callable[[str], bytes]

Progress = Callable[[float, str], None]

StoreFile = Callable[[str, Iterable[bytes | memoryview]], object]

SOFTWARE = f"scancell {__version__}"

FRAME_FIELDS = ("kind", "files", "excluded")
"""What is read of a capture that shows the board."""

SCAN_FIELDS = (
    *FRAME_FIELDS, "format", "format_settings", "scanner", "pose", "poses", "timestamps_s", "pose_track",
    "joints_deg", "joints_mm", "active_tool", "active_frame", "moving",
)  # fmt: skip
"""What is read of a capture that the robot's pose gives its place."""

SPHERE_FIELDS = (*SCAN_FIELDS, "center_mm", "side")
"""What is read of a capture of the sphere."""

SPHERE_READS = (
    "pose_convention", "sphere_diameter_mm", "sphere_diameter_sigma_mm", "sphere_class",
    "scanner.point_sigma_mm", "scanner.z_axis", "scanner.errors", "scanners", "arrangement",
    "robot.position_sigma_mm", "robot.orientation_sigma_deg", "robot.arm",
)  # fmt: skip
"""What is read of the cell by a stage that finds the sphere."""

_OF_EXCLUDED = ("kind", "excluded")
_OF_JOINTS = ("joints_deg", "joints_mm")

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


class Stage:
    """One calibration, or what is made with it.

    Attributes
    ----------
    name, title : str
        As records and as people call it.
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

    @property
    def result(self) -> "type[Result]":
        """The record of its result: the one in its folder's record.py that bears its name."""
        for kind in vars(self._own("record")).values():
            stage = getattr(kind, "model_fields", {}).get("stage")
            if stage is not None and stage.default == self.name:
                return kind
        raise LookupError(self.name)

    def solve(self, given: "StageInput") -> "Result":
        """Return its result, by its folder's solve.py; raises CalibrationError."""
        return self._own("solve").solve(given)

    def is_brought(self, session: "Session") -> bool:
        """Return whether the user brings what it would give, so that it is not solved."""
        return any(getattr(session.cell.known, field) is not None for field in self.known)

    def is_wanted(self, session: "Session") -> bool:
        """Return whether a session has a use for it."""
        del session
        return True

    def rests_on(self, session: "Session") -> tuple[str, ...]:
        """Return the stages whose results, solved or brought, it rests on in a session."""
        del session
        return self.after

    def reads_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the cell's fields that it reads in a session."""
        del session
        return self.reads

    def reads_of_captures(self, session: "Session") -> "Iterator[tuple[Capture, tuple[str, ...]]]":
        """Give the captures that it reads in a session, each with the fields that it reads of it."""
        for capture in session.captures:
            if capture.step in self.takes:  # of an excluded one that it is, for its row in the result
                yield capture, read_fields(session, capture, self.takes[capture.step])

    def guide(self, view: "GuideView") -> "GuideNow | None":
        """Return what to do now for it, None where it asks for nothing or its folder has no guide.py."""
        own = self._own("guide")
        return None if own is None else own.guide(view)

    def evidence(self, session: "Session", result: "Result") -> "list[AnyBlock] | None":
        """Return a result's evidence as blocks, None where its folder has no evidence.py."""
        own = self._own("evidence")
        return None if own is None else own.evidence(session, result)

    def _own(self, file: str) -> Any:
        """Return a module of its folder, None where there is none of that name."""
        name = f"{type(self).__module__}.{file}"
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name != name:
                raise
            return None


def read_fields(session: "Session", capture: "Capture", fields: tuple[str, ...]) -> tuple[str, ...]:
    """Return what is read of a capture: of an excluded one almost nothing, and no joints where no arm is named."""
    if capture.excluded:
        return tuple(name for name in fields if name in _OF_EXCLUDED)
    if session.cell.robot.arm is None:
        return tuple(name for name in fields if name not in _OF_JOINTS)
    return fields
