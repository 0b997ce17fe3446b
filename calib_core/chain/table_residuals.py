"""How the captures of a turntable lie about the solved axis: along it, across it and around it."""

from dataclasses import dataclass

import numpy as np

from calib_core.cell.walk import Walk
from calib_core.chain.answer import surface_distances
from calib_core.chain.axes_start import moved_back
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereSize, TableObservations
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
    centers_in_base, expected_in_base : (K, 3)
        The capture's own sphere centre, and where the solution expects it, mm.
    places_mm : (K, 2, 3)
        Both moved back by all axes, in T at zero; NaN where another axis carries the sphere.
    radial_mm, tangential_mm, axial_mm : (K,)
        Their difference away from the axis, around it (as angles count up), and along it (T's z); of a linear axis
        the first two are along T's x and y.
    angle_rad : (K,)
        The tangential part as an angle of the table.
    surface_rms_mm : (K,)
        RMS distance of the capture's points from the expected sphere.
    """

    sides: np.ndarray
    places_mm: FloatArray
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
    observations: TableObservations, walk: Walk, state: ChainState, frame: TableFrame
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
    layout, at = state.walk.layout, state.position
    expected = walk.balls(at)[0]
    mounts = {name: state.mount(n) for n, (name, _) in enumerate(layout.mounts)}
    found = SphereSize(2 * state.radius_mm)
    both = both_centers_in_base(observations, found, mounts)
    first = np.linalg.norm(both[:, 0] - expected, axis=1) <= np.linalg.norm(both[:, 1] - expected, axis=1)
    centers = np.where(first[:, None], both[:, 0], both[:, 1])
    sides = np.where(first, 1, -1) * [o.sphere.circle_radius_mm is not None for o in observations]
    places, own = moved_back(walk, both, at), at.places[walk.place]
    local = np.where(first[:, None], places[:, 0], places[:, 1]) - own
    away = own[:, :2].copy()
    for a, axis in enumerate(layout.axes):
        some = np.isin(walk.place, layout.on_axis(a))
        if axis.kind == "linear":
            local[some], away[some] = local[some] @ at.axes[a].rotation, [1.0, 0.0]
    on_table = np.isin(walk.place, layout.on_axis(layout.table))
    if state.table.shifts:
        local[on_table] = (local[on_table] @ at.axes[layout.table].rotation.T) @ frame.base_from_turntable.rotation
    else:
        places = places @ state.table.rotation.T + state.table.origin
        local[on_table, 2] *= frame.direction
    radius = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
    away /= radius[:, None]
    tangential = local[:, 1] * away[:, 0] - local[:, 0] * away[:, 1]
    laser = [(o.sphere.ball_from_scanner @ mounts[o.sphere.scanner]).inverse() for o in observations]
    rms = [
        float(np.sqrt(np.mean(surface_distances(o.sphere, t.apply(c), o.sphere.size(found).radius_mm) ** 2)))
        for o, t, c in zip(observations, laser, expected, strict=True)
    ]
    return TableResiduals(
        sides=sides,
        centers_in_base=centers,
        expected_in_base=expected,
        places_mm=frame.base_from_turntable.inverse().apply(np.where(on_table[:, None, None], places, np.nan)),
        radial_mm=np.einsum("ki,ki->k", local[:, :2], away),
        tangential_mm=tangential,
        axial_mm=local[:, 2],
        angle_rad=tangential / radius,
        surface_rms_mm=np.array(rms),
    )
