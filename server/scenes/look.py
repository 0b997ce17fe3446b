"""What a drawing depends on beside the facts."""

from dataclasses import dataclass
from typing import Literal, get_args

from server.scenes.colors import residual_limit_mm
from server.scenes.facts import CaptureFacts, SceneFacts

CloudColors = Literal["by scan", "by height"]
CLOUD_COLORS: tuple[CloudColors, ...] = get_args(CloudColors)


@dataclass(frozen=True)
class Look:
    """The scale of residuals, the capture that was picked, and how scans are coloured.

    With `alone` the cell is shown as it stood at the picked capture, its table turned, without the other captures.
    """

    limit_mm: float
    picked: str | None = None
    alone: bool = False
    cloud_colors: CloudColors = "by scan"

    def shown(self, facts: SceneFacts) -> tuple[CaptureFacts, ...]:
        """Return the captures whose robot and scanner are drawn."""
        return tuple(c for c in facts.captures if not self.alone or c.id == self.picked)

    def table_deg(self, facts: SceneFacts) -> float:
        """Return the angle at which the table is shown, as its encoder reads it."""
        there = [c.table_deg for c in self.shown(facts)] if self.alone else []
        return (there[0] if there else None) or 0.0


def look_at(
    facts: SceneFacts, picked: str | None = None, *, alone: bool = False, cloud_colors: CloudColors = "by scan"
) -> Look:
    """Return the look of a scene: its scale comes from the captures that the result used."""
    used = [facts.residuals_mm(c) for c in facts.captures if c.state == "used"]
    limit_mm = residual_limit_mm([r for r in used if r is not None and r.size])
    return Look(limit_mm, picked, alone and picked is not None, cloud_colors)
