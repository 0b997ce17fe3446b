"""One answer to "where is the scanner?", and how the captures lie about it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.cell.walk import Carrier
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereObservation, SphereSize
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


def expected_in_laser(observations: Sequence[SphereObservation], state: ChainState) -> FloatArray:
    """Return where each capture should see the sphere's centre in L, its pose taken as recorded, (K, 3)."""
    rotations = np.array([o.ball_from_scanner.rotation for o in observations])
    translations = np.array([o.ball_from_scanner.translation_mm for o in observations])
    arms = np.einsum("kji,kj->ki", rotations, state.center - translations)
    return (arms - state.tool_translation) @ state.tool_rotation


def answer_of(
    observations: Sequence[SphereObservation],
    used: np.ndarray,
    sides: np.ndarray,
    state: ChainState,
    left_out: Sequence[ChainState | None],
) -> Answer:
    """Return how all captures lie about one state of the unknowns."""
    expected = expected_in_laser(observations, state)
    radius = state.radius_mm
    sphere = SphereSize(2 * radius)
    distances = [surface_distances(o, q, radius) for o, q in zip(observations, expected, strict=True)]
    offsets = np.array(
        [
            (o.ball_from_scanner @ state.mount_from_laser).apply(o.sphere_center_in_laser_mm(sphere, int(side)))
            - state.center
            for o, side in zip(observations, sides, strict=True)
        ]
    )
    used_distances = np.concatenate([d for d, u in zip(distances, used, strict=True) if u])
    scatter = np.linalg.norm(offsets[used], axis=1)
    without = [
        np.nan if s is None else _rms(surface_distances(o, expected_in_laser([o], s)[0], s.radius_mm))
        for o, s in zip(observations, left_out, strict=True)
    ]
    return Answer(
        mount_from_laser=state.mount_from_laser,
        ball=observations[0].carriers.ball,
        center_mm=state.center,
        surface_rms_mm=_rms(used_distances),
        center_scatter_rms_mm=_rms(scatter),
        capture_rms_mm=np.array([_rms(d) for d in distances]),
        offset_mm=offsets,
        leave_one_out_rms_mm=np.array(without),
    )


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
