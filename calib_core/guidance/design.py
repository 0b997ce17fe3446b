"""What a set of captures will tell, before it is taken: the covariance by the chain's own likelihood.

Nothing of the model is written here a second time: a planned capture is an observation without noise
(`guidance.sight`), and `chain.likelihood` is linearised about the state that is known.  One more capture is a
low-rank step of the covariance, so that thousands of candidates are compared at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.arms.alike import alike_factors, visits
from calib_core.cell.found import on_flange
from calib_core.chain.arrays import chain_data
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.held import point_rows
from calib_core.chain.likelihood import linearise, linearised_at, without_pose_errors
from calib_core.chain.model import ChainState, prior
from calib_core.chain.noise import NoiseShapes
from calib_core.chain.observations import Observations, SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.arm_unknowns import ArmUnknowns

TURN_RAD, MOUNTED_MM, SPHERE_MM = 1.0, 300.0, 3000.0
"""What is known of the tool's rotation and place and of the sphere's place before any capture."""

SIGMAS = Sigmas(0.055, 1.8e-4, (1e-4,), 0.033, 8e-5, 1.0, play_mm=0.01)
"""Of an ordinary arm and table, where nothing is told: what `chain.variance` believes, on average."""


@dataclass(frozen=True, eq=False)
class Assumed:
    """What a prediction rests on.

    Attributes
    ----------
    sphere : SphereSize
    mount_from_laser : RigidTransform
    center_mm : (3,)
        Of the sphere, in what carries it: base, or tool0 where the flange does.
    sigmas : Sigmas
    point_in_laser_mm : (3,)
        Where the scanner sees the workpiece.
    facing : {1, -1}
        +1 where z grows away from the scanner.
    priors : ScannerPriors or None
        None takes the scanner as exact.
    tool_sigma_mm, tool_sigma_rad : float
        How well the tool is known by a drawing, per axis: it says where the sphere will be seen, and counts for
        nothing in what the captures determine, as it does not in a result.
    arm : ArmUnknowns or None
        An arm whose own errors are among the unknowns; the point at the workpiece is then as of a right one.
    known : (6, 6) or None
        The tool's covariance by a result whose captures are not among those that are planned with.
    """

    sphere: SphereSize
    mount_from_laser: RigidTransform
    center_mm: FloatArray
    sigmas: Sigmas
    point_in_laser_mm: FloatArray
    facing: int = 1
    priors: ScannerPriors | None = field(default_factory=ScannerPriors)
    tool_sigma_mm: float = MOUNTED_MM
    tool_sigma_rad: float = TURN_RAD
    arm: ArmUnknowns | None = None
    known: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Added:
    """What each of some captures would do, one at a time.

    Attributes
    ----------
    workpiece : (N, 3, 3)
        The covariance at the workpiece with it, mm².
    doubt_mm : (N, 3)
        Twice the standard deviation of where it will see the sphere in L, by what is known without it.
    """

    workpiece: FloatArray
    doubt_mm: FloatArray


class Design:
    """Captures, taken or only thought of, of which any set's covariance can be asked for."""

    def __init__(self, observations: Observations, assumed: Assumed) -> None:
        self.assumed = assumed
        data = chain_data(observations, assumed.sphere, None, assumed.priors)
        tool, arm = assumed.mount_from_laser, assumed.arm
        self._tool = tool.rotation, tool.translation_mm
        if arm is not None:  # the lengths of its links are among its terms
            data = replace(data, arm_scale_sigma=0.0)
            data = replace(data, arm_columns=arm.columns(data, self._state(data), observations))
        self._data = data
        rows = point_rows(tool.rotation, assumed.point_in_laser_mm, data.half_width_mm, assumed.facing)
        self._rows = rows[:, :6], rows[:, 6 + data.active]
        self._by_lengths = data.arm_scale_sigma * tool.apply(assumed.point_in_laser_mm)

    def __len__(self) -> int:
        return self._data.count

    def covariance(self, chosen: Sequence[int]) -> FloatArray:
        """Return the covariance (P, P) of all unknowns that some captures will give together."""
        return covariance_of(self.hessian(chosen))

    def workpiece(self, chosen: Sequence[int]) -> FloatArray:
        """Return the covariance (3, 3), mm², of a point measured at the workpiece, along the flange's axes."""
        return self.at_workpiece(self.hessian(chosen))

    def at_workpiece(self, hessian: FloatArray) -> FloatArray:
        """Return the same for a Hessian (P, P) that is there already."""
        rows = self._moves(len(hessian))
        return rows @ covariance_of(hessian) @ rows.T

    def arm_terms(self, chosen: Sequence[int]) -> FloatArray:
        """Return the standard deviation of each of the arm's terms, (p,), of what is believed of it."""
        arm = self.assumed.arm
        return np.empty(0) if arm is None else np.sqrt(np.diag(self.covariance(chosen))[-len(arm.terms) :])

    def tool(self, chosen: Sequence[int]) -> FloatArray:
        """Return the covariance (6, 6) of mount_from_laser."""
        return self.covariance(chosen)[:6, :6]

    def adding(self, chosen: Sequence[int], others: Sequence[int]) -> Added:
        """Return what each of others would add to some captures."""
        return self.added(self.hessian(chosen), chosen, others)

    def added(self, hessian: FloatArray, chosen: Sequence[int], others: Sequence[int]) -> Added:
        """Return the same for a Hessian (P, P) of the chosen ones that is there already."""
        covariance = covariance_of(hessian)
        size = len(covariance)
        data = self._taken(others)
        here = self._state(data)
        chosen = sorted(chosen)
        rotations, translations = self._data.walk.poses
        poses = rotations[chosen], translations[chosen]
        sigmas = self.assumed.sigmas
        _, factor = alike_factors(poses, data.walk.poses, sigmas.reach)
        middle = (poses[1] if len(chosen) else data.walk.translations).mean(axis=0)
        noise = NoiseShapes.at(data, here.centers_in_laser, here, None, middle).noise(sigmas, factor)
        here = replace(here, shared=np.zeros(noise.shared.shape[2]))
        at = linearise(data, here, noise.spread, noise.precision, noise.shared)
        told, _ = without_pose_errors(at.information, at.vector, at.gain, at.share)
        own = np.zeros((len(others), told.shape[1] - 3, size))
        own[:, np.arange(own.shape[1]), np.arange(data.unknowns, data.width)] = 1.0
        jacobian = np.concatenate([at.jacobian, own], axis=1)
        reach = jacobian @ covariance
        between = reach @ np.swapaxes(jacobian, 1, 2)
        rows = self._moves(size)
        toward = reach @ rows.T
        gained = np.linalg.solve(np.eye(told.shape[1]) + told @ between, told @ toward)
        less = np.swapaxes(toward, 1, 2) @ gained
        by_drawing = with_tool(hessian, self.assumed.tool_sigma_rad, self.assumed.tool_sigma_mm)
        moves = at.jacobian.reshape(-1, size)
        variance = np.sum((moves @ covariance_of(by_drawing)) * moves, axis=1).reshape(-1, 3)
        doubt = 2 * np.sqrt(np.maximum(variance, 0.0))
        return Added(rows @ covariance @ rows.T - (less + np.swapaxes(less, 1, 2)) / 2, doubt)

    def _moves(self, size: int) -> FloatArray:
        """Return how the measured point moves with every unknown, (3, P)."""
        moves = np.zeros((3, size))
        moves[:, :6] = self._rows[0]
        moves[:, self._data.unknowns : self._data.width] = self._rows[1]
        if self._data.arm_scale_sigma > 0 and on_flange(self.assumed.mount_from_laser):
            moves[:, self._data.width] = self._by_lengths  # as `Held.at_workpiece`
        return moves

    def _taken(self, chosen: Sequence[int]) -> ChainData:
        """Return captures in the order they are named, as if taken last."""
        mask = np.zeros(self._data.count, dtype=bool)
        mask[list(chosen)] = True
        if np.any(np.diff(chosen) <= 0):
            raise ValueError("captures are to be named in ascending order, each once")
        return replace(self._data.chosen(mask), order=np.ones(len(chosen)))

    def _state(self, data: ChainData) -> ChainState:
        return ChainState.predicted(data, *self._tool, self.assumed.center_mm)

    def hessian(self, chosen: Sequence[int]) -> FloatArray:
        """Return the Hessian (P, P) of some captures with what is known beforehand."""
        chosen = sorted(chosen)
        data = self._taken(chosen)
        count = len(chosen)
        data = replace(
            data, order=np.linspace(-1.0, 1.0, count), pose_scale=visits(data.rotations, data.translations)
        )
        if count:
            hessian = linearised_at(data, self._state(data), self.assumed.sigmas).hessian
        else:
            shared = (1 if data.arm_scale_sigma > 0 else 0) + (3 if data.drift_sigma_mm > 0 else 0)
            shared += 0 if self.assumed.arm is None else len(self.assumed.arm.terms)
            state = replace(self._state(data), shared=np.zeros(shared))
            hessian = prior(data, state, shared)[2]
        found = with_tool(hessian)
        if self.assumed.known is not None:
            found[:6, :6] += np.linalg.inv(self.assumed.known)
        return found


def with_tool(hessian: FloatArray, turn_rad: float = TURN_RAD, shift_mm: float = MOUNTED_MM) -> FloatArray:
    """Return a Hessian with what is known of the tool beforehand, and of the sphere's place."""
    known = hessian.copy()
    sigmas = np.array([turn_rad] * 3 + [shift_mm] * 3 + [SPHERE_MM] * 3)
    known[np.arange(9), np.arange(9)] += 1 / sigmas**2
    return known


def worst_sigma(covariance: FloatArray) -> FloatArray:
    """Return the standard deviation in the worst direction of covariances (…, n, n), in their own unit."""
    return np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[..., -1], 0.0))
