"""One answer to "where is the scanner?", and how the captures lie about it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.cell.layout import Carrier
from calib_core.chain.chain_data import ChainData
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.frames import FloatArray, RigidTransform


@dataclass(frozen=True, eq=False)
class Answer:
    """One answer to "where is the scanner?", and how the captures lie about it.

    Attributes
    ----------
    mount_from_laser : RigidTransform
    ball : Carrier
        What carries the sphere.
    center_mm : (3,)
        Where it is there.
    surface_rms_mm : float
        Of all used points' distances to the sphere, robot poses taken as recorded.
    center_scatter_rms_mm : float
        RMS distance of the used captures' own sphere centres to the solved one.
    capture_rms_mm, offset_mm : (K,), (K, 3)
        Per capture (used or not): its points' RMS distance, its own centre minus the solved one, along the axes
        of what carries the ball.
    leave_one_out_rms_mm : (K,)
        RMS distance of a used capture's points to the sphere found without it; NaN elsewhere.
    """

    mount_from_laser: RigidTransform
    ball: Carrier
    center_mm: FloatArray
    surface_rms_mm: float
    center_scatter_rms_mm: float
    capture_rms_mm: FloatArray
    offset_mm: FloatArray
    leave_one_out_rms_mm: FloatArray

    @property
    def leave_one_out_surface_rms_mm(self) -> float | None:
        """Root of the mean, over used captures, of the left-out captures' mean squared distances."""
        known = self.leave_one_out_rms_mm[np.isfinite(self.leave_one_out_rms_mm)]
        return float(np.sqrt(np.mean(known**2))) if len(known) else None


def answer_of(
    observations: Observations,
    used: np.ndarray,
    sides: np.ndarray,
    state: ChainState,
    left_out: Sequence[ChainState | None],
    data: ChainData,
) -> Answer:
    """Return how all captures, of which `data` has arrays, lie about one state of the unknowns."""
    walk = data.walk
    expected = walk.seen(state.position)
    radii = radii_of(data, state)
    distances = [surface_distances(*each) for each in zip(observations, expected, radii, strict=True)]
    own = [
        o.sphere_center_in_laser_mm(SphereSize(2 * r), int(side)) - q
        for o, q, r, side in zip(observations, expected, radii, sides, strict=True)
    ]
    turned = walk.ball_from_mount(state.position) @ state.position.mount_rotations[walk.scanner]
    offsets = np.einsum("kij,kj->ki", turned, np.array(own))
    used_distances = np.concatenate([d for d, u in zip(distances, used, strict=True) if u])
    scatter = np.linalg.norm(offsets[used], axis=1)
    without = [
        np.nan if s is None else _rms_of(o, k, data, s)
        for k, (o, s) in enumerate(zip(observations, left_out, strict=True))
    ]
    return Answer(
        mount_from_laser=state.mount_from_laser,
        ball="tool0" if walk.layout.places[0][0] == "tool0" else "base",
        center_mm=state.center,
        surface_rms_mm=_rms(used_distances),
        center_scatter_rms_mm=_rms(scatter),
        capture_rms_mm=np.array([_rms(d) for d in distances]),
        offset_mm=offsets,
        leave_one_out_rms_mm=np.array(without),
    )


def radii_of(data: ChainData, state: ChainState) -> list[float]:
    """Return each capture's ball's radius by a state, mm."""
    return (data.radii_mm + state.scanner[data.nuisance_of[:, 0]]).tolist()


def _rms_of(observation: SphereObservation, capture: int, data: ChainData, state: ChainState) -> float:
    here = data.walk.chosen(np.array([capture])).seen(state.position)[0]
    radius = float(data.radii_mm[capture] + state.scanner[data.nuisance_of[capture, 0]])
    return _rms(surface_distances(observation, here, radius))


def surface_distances(
    observation: SphereObservation, center_in_laser_mm: FloatArray, radius_mm: float
) -> FloatArray:
    """Return the signed distances (N,) of a capture's points to a sphere in L, mm.

    A capture that reports only a centre gives the one distance between the centres.
    """
    if len(observation.points_in_laser_mm) == 0:
        return np.array([float(np.linalg.norm(observation.center_in_laser_mm - center_in_laser_mm))])
    offsets = observation.points_in_laser_mm - center_in_laser_mm
    return np.sqrt(np.einsum("ij,ij->i", offsets, offsets)) - radius_mm


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
