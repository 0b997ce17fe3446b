"""How the captures of a turntable lie about the solved axis: along it, across it and around it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.cell.walk import Walk
from calib_core.chain.answer import surface_distances
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereSize, TableObservation
from calib_core.chain.table_frame import TableFrame
from calib_core.chain.table_start import both_centers_in_base
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class TableResiduals:
    """Measured minus expected, per capture (used or not), poses and angles taken as recorded.

    Attributes
    ----------
    sides : (K,)
        The sign of y of each profile's sphere centre in L; 0 for other kinds.
    both_in_base : (K, 2, 3)
        The capture's own sphere centre on the +y and on the −y side, mm.
    centers_in_base, expected_in_base : (K, 3)
        The capture's own sphere centre, and where the solution expects it, mm.
    radial_mm, tangential_mm, axial_mm : (K,)
        Their difference away from the axis, around it (as angles count up), and along it (T's z).
    angle_rad : (K,)
        The tangential part as an angle of the table.
    surface_rms_mm : (K,)
        RMS distance of the capture's points from the expected sphere.
    """

    sides: np.ndarray
    both_in_base: FloatArray
    centers_in_base: FloatArray
    expected_in_base: FloatArray
    radial_mm: FloatArray
    tangential_mm: FloatArray
    axial_mm: FloatArray
    angle_rad: FloatArray
    surface_rms_mm: FloatArray

    @property
    def distance_mm(self) -> FloatArray:
        """The distance between own and expected centre, (K,)."""
        return np.linalg.norm(self.centers_in_base - self.expected_in_base, axis=1)


def table_residuals(
    observations: Sequence[TableObservation],
    walk: Walk,
    state: ChainState,
    frame: TableFrame,
) -> TableResiduals:
    """Return how captures of the table lie about a solution; each profile's side is the nearer one.

    Parameters
    ----------
    observations : K captures of the table
    walk : Walk
        Of the same captures.
    state : ChainState
    frame : TableFrame
        The state's.
    """
    expected = walk.balls(state.position)[0]
    layout = state.walk.layout
    mounts = {name: state.mount(n) for n, (name, _) in enumerate(layout.mounts)}
    both = both_centers_in_base(observations, SphereSize(2 * state.radius_mm), mounts)
    first = np.linalg.norm(both[:, 0] - expected, axis=1) <= np.linalg.norm(both[:, 1] - expected, axis=1)
    centers = np.where(first[:, None], both[:, 0], both[:, 1])
    sides = np.where(first, 1, -1) * [o.sphere.circle_radius_mm is not None for o in observations]
    arms = frame.base_from_turntable.inverse().apply(expected)
    offsets = (centers - expected) @ frame.base_from_turntable.rotation
    radius = np.maximum(np.hypot(arms[:, 0], arms[:, 1]), 1e-9)
    away = arms[:, :2] / radius[:, None]
    around = np.column_stack([-away[:, 1], away[:, 0]]) * frame.direction
    tangential = np.einsum("ki,ki->k", offsets[:, :2], around)
    laser = [(o.sphere.ball_from_scanner @ mounts[o.sphere.scanner]).inverse() for o in observations]
    rms = [
        float(np.sqrt(np.mean(surface_distances(o.sphere, t.apply(c), state.radius_mm) ** 2)))
        for o, t, c in zip(observations, laser, expected, strict=True)
    ]
    return TableResiduals(
        sides=sides,
        both_in_base=both,
        centers_in_base=centers,
        expected_in_base=expected,
        radial_mm=np.einsum("ki,ki->k", offsets[:, :2], away),
        tangential_mm=tangential,
        axial_mm=offsets[:, 2],
        angle_rad=tangential / radius,
        surface_rms_mm=np.array(rms),
    )
