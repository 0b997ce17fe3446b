"""The error budget over the table: points, and the ± (k = 2) that one scan has at each."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray
from server.scenes.scene_input import SceneInput

_EVEN = 0.8  # colours must not make much of little


@dataclass(frozen=True, eq=False)
class TableField:
    """Points (P, 3) of T, mm, and the ± (k = 2) of one scan at each, (P,), mm."""

    points_mm: FloatArray
    uncertainty_mm: FloatArray

    @property
    def range_mm(self) -> tuple[float, float]:
        """The ends of the colours' scale: the largest ± and the smallest, or less where both hardly differ."""
        highest = float(self.uncertainty_mm.max())
        return min(float(self.uncertainty_mm.min()), _EVEN * highest), highest


def table_field(scene: SceneInput) -> TableField | None:
    """Return the field of a whole chain's answer, None where there is none that holds."""
    result = scene.results.get("chain")
    if result is None or "chain" in scene.stale:
        return None
    from calib_core.guidance.part_budget import field_of

    try:
        found = field_of(scene.session, result.to_json())
    except CalibrationError:
        return None  # the answer has no budget then either, and says why
    points = np.array([point.point_mm for point in found])
    return TableField(points, np.array([point.uncertainty_mm for point in found]))
