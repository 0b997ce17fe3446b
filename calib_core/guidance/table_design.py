"""What captures of the sphere on the table will tell of tool and table, before they are taken.

As `guidance.design` for the still sphere: nothing of the model is written a second time.  What is compared is a
point of the workpiece, measured from all around and brought into the table's frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib_core.arms.alike import visits
from calib_core.cell.layout import Layout, MovedAxis
from calib_core.chain.arrays import chain_data
from calib_core.chain.likelihood import linearised_at
from calib_core.chain.model import ChainState
from calib_core.chain.observations import TABLE, Observations, TableObservations
from calib_core.chain.table import TableState
from calib_core.chain.table_frame import TableFrame, frame_by_rule, pose_by_unknowns
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.guidance.budget import calibrated_rows
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.guidance.design import Assumed, with_tool, worst_sigma

_VIEWS_RAD = (0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi)
_MOST_ROTATIONS = 6


@dataclass(frozen=True, eq=False)
class TableGuess:
    """About where the table stands, by the solver's own unknowns.

    Attributes
    ----------
    state : TableState
        With one mounting for each of `names`.
    names : tuple of str
    direction : {1, -1} or None
        The cell's.
    """

    state: TableState
    names: tuple[str, ...]
    direction: int | None = None

    @cached_property
    def frame(self) -> TableFrame:
        """The frame T by its rule."""
        return frame_by_rule(self.state, self.direction)

    @cached_property
    def pose_by_unknowns(self) -> FloatArray:
        """How base_from_turntable follows the table's unknowns, (6, size)."""
        return pose_by_unknowns(self.state, self.direction)

    def center_in_base(self, mount: int, angle_rad: float) -> FloatArray:
        """Return where a mounting's sphere stands in base, (3,), with the table at an angle as read."""
        turned = rotation_from_vector(np.array([0.0, 0.0, angle_rad])) @ self.state.mounts[mount]
        return self.state.rotation @ turned + self.state.origin

    def with_mount(self, name: str, place: FloatArray) -> "TableGuess":
        """Return the same with one mounting more, at a place (3,) of the state's own frame."""
        mounts = np.vstack([self.state.mounts, place])
        return replace(self, state=replace(self.state, mounts=mounts), names=(*self.names, name))


class TableDesign:
    """Captures of the still sphere and of the table, taken or only thought of."""

    def __init__(
        self,
        still: Observations,
        on_table: TableObservations,
        assumed: Assumed,
        table: TableGuess,
        points_in_turntable: FloatArray,
    ) -> None:
        self._still, self._assumed = len(still), assumed
        places = (("base", ""), *((TABLE, name) for name in table.names))
        layout = Layout(places=places, axes=(MovedAxis(TABLE),))
        spheres = [*still, *(o.placed for o in on_table)]
        self._data = chain_data(spheres, assumed.sphere, None, assumed.priors, layout)
        self._columns = layout.axis_and_places(0)
        self._table, self._by_rule = table.state, table.pose_by_unknowns
        self._rows = self._moves(table, points_in_turntable)

    def sigma_mm(self, chosen: Sequence[int]) -> float:
        """Return the standard deviation at the workpiece in its worst direction and place, in T, mm.

        All captures of the still sphere count, and of those on the table the chosen ones, by their places in the
        list; the first mounting must be among them, from which T has its origin.
        """
        covariance = self._covariance(chosen)[: self._data.width, : self._data.width]
        # The mean over the views: errors that turn with the table average out over scans from all around.
        each = self._rows @ covariance @ np.swapaxes(self._rows, -1, -2)
        return float(worst_sigma(each.mean(axis=1)).max())

    def pose_covariance(self, chosen: Sequence[int]) -> FloatArray:
        """Return the covariance (6, 6) of base_from_turntable with the chosen captures, as of `sigma_mm`."""
        table = np.ix_(self._columns, self._columns)
        return self._by_rule @ self._covariance(chosen)[table] @ self._by_rule.T

    def _covariance(self, chosen: Sequence[int]) -> FloatArray:
        """Return the covariance (P, P) of all unknowns."""
        mask = np.zeros(self._data.count, dtype=bool)
        mask[: self._still] = True
        mask[self._still + np.array(chosen, dtype=int)] = True
        data = self._data.chosen(mask)
        still = visits(data.rotations[: self._still], data.translations[: self._still])
        data = replace(
            data,
            order=np.linspace(-1.0, 1.0, data.count),
            pose_scale=np.concatenate([still, np.ones(data.count - self._still)]),
        )
        tool = self._assumed.mount_from_laser
        center = self._assumed.center_mm
        state = ChainState.predicted(data, tool.rotation, tool.translation_mm, center, self._table)
        return covariance_of(with_tool(linearised_at(data, state, self._assumed.sigmas).hessian))

    def _moves(self, table: TableGuess, points: FloatArray) -> FloatArray:
        """Return how measured points move in T with every unknown, (points, views, 3, width)."""
        data, assumed, frame = self._data, self._assumed, table.frame
        active = tuple(int(k) for k in data.active)
        known = Calibrated(
            mount_from_laser=assumed.mount_from_laser,
            base_from_turntable=frame.base_from_turntable,
            direction=frame.direction,
            nuisances=active,
            covariance=np.zeros((12 + len(active), 12 + len(active))),
            half_width_mm=data.half_width_mm,
            facing=assumed.facing,
            point_in_laser_mm=assumed.point_in_laser_mm,
            sigmas=assumed.sigmas,
            point_sigma_mm=0.0,
        )
        by_rule = table.pose_by_unknowns
        rotations = data.rotations[: self._still] if self._still else data.rotations
        rotations = rotations[:: max(1, len(rotations) // _MOST_ROTATIONS)]
        views = [View(rotation, angle) for rotation in rotations for angle in _VIEWS_RAD]
        rows = np.zeros((len(points), len(views), 3, data.width))
        for p, point in enumerate(points):
            for v, view in enumerate(views):
                own, _ = calibrated_rows(known, view, point)
                rows[p, v, :, :6] = own[:, :6]
                rows[p, v][:, self._columns] = own[:, 6:12] @ by_rule
                rows[p, v, :, data.unknowns :] = own[:, 12:]
        return rows
