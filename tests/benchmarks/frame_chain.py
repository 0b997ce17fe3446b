"""Simulated raw frames all the way to the TCP, their errors in units of what the results state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.simulation import SimulatedSession
from calib_core.stages.pipeline import run
from calib_core.stages.tcp.record import TcpResult


@dataclass(frozen=True)
class FrameChain:
    """One seed: normalised squared errors of camera (a parameter), plane (3) and TCP (6); what they amount to."""

    camera_nees: float
    plane_nees: float
    tcp_nees: float
    normal_error_deg: float
    tcp_error_mm: float


def frame_chain(simulated: SimulatedSession) -> FrameChain:
    """Return what simulated frames give, beside the truth."""
    results = run(simulated.session, simulated.files.__getitem__)
    camera, plane, tcp = results["camera"], results["laser-plane"], results["tcp"]
    assert isinstance(camera, CameraResult)
    assert isinstance(plane, LaserPlaneResult)
    assert isinstance(tcp, TcpResult)
    truth = simulated.truth
    true_plane = truth["plane_in_camera"]
    normal = np.array(plane.plane_in_camera.normal)
    plane_error = np.array(
        [*(normal - true_plane["normal"]), plane.plane_in_camera.distance_mm - true_plane["distance_mm"]]
    )
    plane_inverse = np.linalg.pinv(np.array(plane.plane_covariance), rcond=1e-10, hermitian=True)
    tcp_error = RigidTransform.from_rounded(tcp.tool0_from_laser, "tool0", "laser").difference(
        RigidTransform.from_rounded(truth["tool0_from_laser"], "tool0", "laser")
    )
    return FrameChain(
        camera_nees=_camera_nees(camera, truth["camera"]),
        plane_nees=float(plane_error @ plane_inverse @ plane_error),
        tcp_nees=float(tcp_error @ np.linalg.solve(np.array(tcp.covariance), tcp_error)),
        normal_error_deg=float(np.rad2deg(np.linalg.norm(np.cross(normal, true_plane["normal"])))),
        tcp_error_mm=float(np.linalg.norm(tcp_error[3:])),
    )


def mean_interval(freedom: int, count: int, holds: float = 0.95) -> tuple[float, float]:
    """Return the interval that holds the mean of `count` values of χ² with some degrees of freedom so often."""
    from scipy.stats import chi2

    low, high = chi2.ppf([0.5 - holds / 2, 0.5 + holds / 2], freedom * count) / count
    return float(low), float(high)


def mean_of(chains: Sequence[FrameChain], field: str) -> float:
    """Return the mean of one figure over seeds."""
    return float(np.mean([getattr(chain, field) for chain in chains]))


def _camera_nees(result: CameraResult, truth: dict[str, object]) -> float:
    true_matrix, found_matrix = np.array(truth["camera_matrix"]), np.array(result.camera_matrix)
    true_lens = truth["distortion"]
    assert isinstance(true_lens, dict)
    places = {"fx": (0, 0), "fy": (1, 1), "cx": (0, 2), "cy": (1, 2)}
    own = [k for k, name in enumerate(result.parameters) if not name.startswith("board")]
    error: FloatArray = np.array(
        [
            found_matrix[places[name]] - true_matrix[places[name]]
            if name in places
            else result.distortion[name] - true_lens.get(name, 0.0)
            for name in (result.parameters[k] for k in own)
        ]
    )
    return float(error @ np.linalg.solve(np.array(result.covariance)[np.ix_(own, own)], error)) / len(error)
