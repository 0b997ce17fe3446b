"""What a stage can do: its modules are found by their names in its folder.

Each folder of `calib_core/stages` holds one: its `__init__.py` has the constant `STAGE`, and is light to import.
"""

import importlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from calib_core import __version__
from calib_core.steps import StageDeclaration

if TYPE_CHECKING:
    from calib_core.records import Capture, GuideNow, Result, Session
    from calib_core.records.evidence import AnyBlock, Plot

SOFTWARE = f"scancell {__version__}"

FRAME_FIELDS = ("kind", "files", "excluded")
"""What is read of a capture that shows the board."""

SCAN_FIELDS = (
    *FRAME_FIELDS, "format", "format_settings", "scanner", "pose", "poses", "timestamps_s", "pose_track",
    "joints_deg", "joints_mm", "active_tool", "active_frame", "moving", "axes_deg", "axes_mm",
)  # fmt: skip
"""What is read of a capture that the robot's pose gives its place."""

SPHERE_FIELDS = (*SCAN_FIELDS, "center_mm", "side")
"""What is read of a capture of the sphere."""

SPHERE_READS = (
    "pose_convention", "sphere_diameter_mm", "sphere_diameter_sigma_mm", "sphere_class",
    "scanner.point_sigma_mm", "scanner.z_axis", "scanner.errors", "scanners", "arrangement",
    "robot.position_sigma_mm", "robot.orientation_sigma_deg", "robot.arm", "robot.errors",
    "spheres", "sphere_distances", "axes", "known.frames",
)  # fmt: skip
"""What is read of the cell by a stage that finds the sphere."""

_OF_EXCLUDED = ("kind", "excluded")
_OF_JOINTS = ("joints_deg", "joints_mm")


class Stage(StageDeclaration):
    """One calibration, or what is made with it: what it declares, and its modules."""

    @property
    def result(self) -> "type[Result]":
        """The record of its result: the one in its folder's record.py that bears its name."""
        for kind in vars(self._own("record")).values():
            stage = getattr(kind, "model_fields", {}).get("stage")
            if stage is not None and stage.default == self.name:
                return kind
        raise LookupError(self.name)

    def solve(self, given: Any) -> "Result":
        """Return its result from a `StageInput`, by its folder's solve.py; raises CalibrationError."""
        return self._own("solve").solve(given)

    def is_brought(self, session: "Session") -> bool:
        """Return whether the user brings what it would give, so that it is not solved."""
        return any(getattr(session.cell.known, field) is not None for field in self.known)

    def has_captures(self, session: "Session") -> bool:
        """Return whether a session has captures that it can be solved from."""
        steps = {capture.step for capture in session.captures}
        return (all if self.needs_every_step else any)(step in steps for step in self.steps)

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

    def files_of_cell(self, session: "Session") -> tuple[str, ...]:
        """Return the files beside those of captures that it reads in a session, named by the cell."""
        del session
        return ()

    def reads_of_captures(self, session: "Session") -> "Iterator[tuple[Capture, tuple[str, ...]]]":
        """Give the captures that it reads in a session, each with the fields that it reads of it."""
        for capture in session.captures:
            if capture.step in self.takes:  # of an excluded one that it is, for its row in the result
                yield capture, read_fields(session, capture, self.takes[capture.step])

    def guide(self, view: Any) -> "GuideNow | None":
        """Return what to do now by a `GuideView`, None where it asks for nothing or its folder has no guide.py."""
        own = self._own("guide")
        return None if own is None else own.guide(view)

    def evidence(self, session: "Session", result: "Result") -> "list[AnyBlock] | None":
        """Return a result's evidence as blocks, None where its folder has no evidence.py."""
        own = self._own("evidence")
        return None if own is None else own.evidence(session, result)

    def difference(self, left: "Mapping[str, Any]", right: "Mapping[str, Any]") -> "list[Plot]":
        """Return how far two of its results, given as JSON data, lie apart as plots, where its folder says so."""
        own = self._own("difference")
        return [] if own is None else own.difference(left, right)

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
