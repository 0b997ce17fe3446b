"""What a drawing depends on beside the facts."""

from dataclasses import dataclass, field

from calib_core.frames import FloatArray, RigidTransform
from server.scenes.cloud_view import CloudView
from server.scenes.colors import residual_limit_mm
from server.scenes.deviation import CloudDeviation
from server.scenes.scene_model import CaptureFacts, SceneFacts


@dataclass(frozen=True, eq=False)
class RobotNow:
    """The flange in the base, and the profile (N, 2), x and z in L, mm, that the scanner sees from there."""

    base_from_tool0: RigidTransform
    profile_mm: FloatArray


@dataclass(frozen=True)
class Look:
    """The scale of residuals, the capture that was picked, and how the merged cloud is shown.

    With `alone` the cell is shown as it stood at the picked capture, its table turned, without the other captures.
    `deviation` is what the cloud is coloured by where the view asks for that, or the sentence why it cannot be.
    `trial` are poses that are being read, `robot` is where a live robot stands.
    """

    limit_mm: float
    picked: str | None = None
    alone: bool = False
    cloud: CloudView = field(default_factory=CloudView)
    deviation: CloudDeviation | str | None = None
    trial: tuple[RigidTransform, ...] = ()
    robot: RobotNow | None = None

    def shown(self, facts: SceneFacts) -> tuple[CaptureFacts, ...]:
        """Return the captures whose robot and scanner are drawn."""
        return tuple(c for c in facts.captures if not self.alone or c.id == self.picked)

    def table(self, facts: SceneFacts) -> RigidTransform | None:
        """Return where the frame of what carries the object is shown: at the one capture, else at zero."""
        there = [c.base_from_turntable for c in self.shown(facts)] if self.alone else []
        return next(filter(None, there), None if facts.table is None else facts.table.base_from_turntable)


def look_at(
    facts: SceneFacts,
    picked: str | None = None,
    *,
    alone: bool = False,
    cloud: CloudView | None = None,
    deviation: CloudDeviation | str | None = None,
) -> Look:
    """Return the look of a scene: its scale comes from the captures that the result used."""
    used = [facts.residuals_mm(c) for c in facts.captures if c.state == "used"]
    limit_mm = residual_limit_mm([r for r in used if r is not None and r.size])
    return Look(limit_mm, picked, alone and picked is not None, cloud or CloudView(), deviation)
