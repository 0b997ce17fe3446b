"""Simulated TCP cells as the solver sees them, and errors against their truth: shared by benchmarks and tests."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calib_core.captures.observe import observe_capture
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.tcp import solve_tcp
from calib_core.chain.tcp_solution import TcpOptions, TcpSolution
from calib_core.frames import FloatArray, RigidTransform
from calib_core.simulation import SimulatedSession, simulate
from tests.bound import Beliefs, tcp_bound

SPHERE = SphereSize(40.0)
GIVEN = TcpOptions(position_sigma_mm=0.05, orientation_sigma_rad=2e-4, point_sigma_mm=0.02)
ESTIMATED = TcpOptions()


@dataclass(frozen=True, eq=False)
class Cell:
    """One simulated session, measured."""

    simulated: SimulatedSession
    observations: list[SphereObservation]
    truth: RigidTransform
    spoiled: np.ndarray

    @classmethod
    @lru_cache(maxsize=100)
    def of(cls, scenario: str, seed: int) -> "Cell":
        """Return a scenario's session; the same one each time it is asked for."""
        simulated = simulate(scenario, seed)
        session = simulated.session
        observations = [observe_capture(session, c, simulated.files.__getitem__) for c in session.captures]
        truth = RigidTransform(np.array(simulated.truth["tool0_from_laser"]), "tool0", "laser")
        spoiled = np.array([c.id in simulated.truth["spoiled"] for c in session.captures])
        return cls(simulated, observations, truth, spoiled)

    @lru_cache(maxsize=200)  # noqa: B019 (few, and the process ends with them)
    def solve(self, options: TcpOptions) -> TcpSolution:
        """Return the solution; it is solved once."""
        return solve_tcp(self.observations, SPHERE, options)

    def error(self, tool0_from_laser: RigidTransform) -> FloatArray:
        """Estimate minus truth as rx ry rz tx ty tz, rad and mm, in the covariance's convention."""
        return tool0_from_laser.difference(self.truth)

    def bound(self) -> FloatArray:
        """The Cramér–Rao bound, (6, 6), of a solver that knows no more of scanner and arm than ours does."""
        return tcp_bound(self.simulated, Beliefs())


def rms(vectors: FloatArray) -> float:
    """Root mean square length of rows."""
    return float(np.sqrt(np.mean(np.sum(np.square(vectors), axis=1))))


def bound_rms(bounds: FloatArray, part: slice) -> float:
    """Root of the mean trace of a block of bounds (N, 6, 6)."""
    return float(np.sqrt(np.mean(np.trace(bounds[:, part, part], axis1=1, axis2=2))))
