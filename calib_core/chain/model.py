"""What the captures say, as arrays, the unknowns, and where these expect each capture's sphere.

Unknown are mount_from_laser (6), the still sphere's centre in what carries it (3), where captures of a turntable
are among them its axis and mountings (`chain.table`); then the sphere's radius and the scanner's errors, where
they are uncertain (`chain.scanner`); last what is drawn rather than fixed: pose errors that captures share, each
of unit variance.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.walk import Carrier, Walk
from calib_core.chain import scanner
from calib_core.chain.table import TableReadings, TableState
from calib_core.frames import (
    FloatArray,
    RigidTransform,
    nearest_rotation,
    rotation_from_vector,
    vector_from_rotation,
)

ARM_SCALE_SIGMA = 2e-4
"""How far an arm's lengths are off, as a share: beyond what its maker promises the captures must show it."""

DRIFT_SIGMA_MM = 0.04
"""How far the sphere drifts from a session's middle to its end, per axis: warmth, settling."""

_MOUNT_PRIOR = 1e-10  # 1/mm²: keeps a mounting finite all of whose captures were rejected


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, per axis, of a robot pose's position and orientation, and of the table's angle.

    `alike` are those of the part that captures share where their poses are alike; `reach` is a factor on the
    distances over which they are.
    """

    position_mm: float
    orientation_rad: float
    angle_rad: float = 0.0
    alike_position_mm: float = 0.0
    alike_orientation_rad: float = 0.0
    reach: float = 1.0

    @property
    def is_alike(self) -> bool:
        """Whether poses share errors where they are alike."""
        return self.alike_position_mm > 0 or self.alike_orientation_rad > 0

    @property
    def largest_position_mm(self) -> float:
        """The larger of a pose's own error and the one it shares."""
        return max(self.position_mm, self.alike_position_mm)


@dataclass(frozen=True, eq=False)
class ToolPrior:
    """What is known of mount_from_laser and of the scanner beforehand.

    R (3, 3), T (3,), the scanner's values (8,), and the inverse covariance (6 + n, 6 + n) of rx … tz and of
    those n nuisances that are sought.
    """

    rotation: FloatArray
    translation: FloatArray
    scanner: FloatArray
    information: FloatArray

    def without(self, held: np.ndarray) -> "ToolPrior":
        """Return what is known where some nuisances, a mask (n,), are nothing for sure."""
        kept = np.concatenate([np.ones(6, dtype=bool), ~held])
        return replace(self, information=self.information[np.ix_(kept, kept)])

    def deviation(self, state: "ChainState") -> FloatArray:
        """Return how far a state is from it, (6 + n,): small, so that the rotation counts as a vector."""
        turned = self.rotation.T @ state.tool_rotation
        turn = 0.5 * np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        off = (state.scanner - self.scanner)[state.active]
        return np.concatenate([turn, state.tool_translation - self.translation, off])


@dataclass(frozen=True, eq=False)
class ChainData:
    """All captures as arrays.

    Attributes
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        From what carries the scanner into what carries the ball, poses as recorded.
    walk : Walk
        Where the robot stands on the way between them.
    mount : Carrier
        What carries the scanner.
    points, counts, basis : (M, 3), (M,), (M, 4)
        Profiles' points in L, neighbours merged; how many measured points each stands for; what a bow moves it
        along z and the shapes of the error by incidence (`chain.scanner`).
    offsets, weights, effective : (K + 1,), (K,), (K,)
        Where each capture's points begin, 1/σ² of one, and how many independent ones one counts as (N_eff / N).
    anchors, anchor_information, anchor_gradient : (K, 3), (K, 11, 11), (K, 11)
        For clouds and centers, whose likelihood is quadratic in (centre, nuisances): where, how sharp, how steep.
    radius_mm, nuisance_sigmas : float, (8,)
        The sphere's; how uncertain it and the scanner's errors are, 0: exact.
    half_width_mm : float
        Half the width that the scanner's points fill.
    arm_scale_sigma, drift_sigma_mm : float
        Of the arm's lengths, as a share, and of a slow drift of the sphere to the session's end, per axis.
    order : (K,)
        When each was taken, from −1 (first) to 1 (last).
    pose_scale : (K,)
        By how much a capture's pose variance is larger than the sigmas say: captures that lie off count less.
    points_per_independent : (K,)
        How many of a capture's points say as much as one that errs by itself.
    table : TableReadings or None
        What the captures say of the turntable.
    held : (P,) bool or None
        Unknowns that keep their values, without the radius.
    tool_prior : ToolPrior or None
    """

    rotations: FloatArray
    translations: FloatArray
    walk: Walk
    mount: Carrier
    points: FloatArray
    counts: FloatArray
    basis: FloatArray
    offsets: np.ndarray
    weights: FloatArray
    effective: FloatArray
    anchors: FloatArray
    anchor_information: FloatArray
    anchor_gradient: FloatArray
    radius_mm: float
    nuisance_sigmas: FloatArray
    half_width_mm: float
    order: FloatArray
    pose_scale: FloatArray
    points_per_independent: FloatArray
    arm_scale_sigma: float = 0.0
    drift_sigma_mm: float = 0.0
    table: TableReadings | None = None
    held: np.ndarray | None = None
    tool_prior: ToolPrior | None = None

    @property
    def count(self) -> int:
        """The number of captures."""
        return len(self.weights)

    @property
    def active(self) -> np.ndarray:
        """Which of the eight nuisances are unknowns (with a prior) as well."""
        return np.flatnonzero(self.nuisance_sigmas > 0)

    @property
    def unknowns(self) -> int:
        """The number of unknowns, held ones included, without the nuisances."""
        return 9 + (self.table.size if self.table else 0)

    @property
    def width(self) -> int:
        """The number of unknowns with the nuisances."""
        return self.unknowns + len(self.active)

    @property
    def free_unknowns(self) -> int:
        """The number of unknowns that are sought, without the nuisances."""
        return self.unknowns - (0 if self.held is None else int(self.held.sum()))

    def silent(self, used: np.ndarray) -> "ChainData":
        """Return the same captures, of which those outside a mask (K,) say nothing."""
        if used.all():
            return self
        return replace(
            self,
            weights=np.where(used, self.weights, 0.0),
            effective=np.where(used, self.effective, 0.0),
            anchor_information=self.anchor_information * used[:, None, None],
            anchor_gradient=self.anchor_gradient * used[:, None],
        )

    def chosen(self, used: np.ndarray) -> "ChainData":
        """Return only the captures of a mask (K,)."""
        if used.all():
            return self
        lengths = np.diff(self.offsets)
        return replace(
            self,
            rotations=self.rotations[used],
            translations=self.translations[used],
            walk=self.walk.chosen(used),
            points=self.points[np.repeat(used, lengths)],
            counts=self.counts[np.repeat(used, lengths)],
            basis=self.basis[np.repeat(used, lengths)],
            offsets=np.concatenate([[0], np.cumsum(lengths[used])]),
            weights=self.weights[used],
            effective=self.effective[used],
            order=self.order[used],
            pose_scale=self.pose_scale[used],
            points_per_independent=self.points_per_independent[used],
            anchors=self.anchors[used],
            anchor_information=self.anchor_information[used],
            anchor_gradient=self.anchor_gradient[used],
            table=self.table and self.table.chosen(used),
        )


@dataclass(frozen=True, eq=False)
class ChainState:
    """One guess of the unknowns, and of where each capture's own sphere centre lies in L.

    `scanner` (8,) holds what is added to the nominal radius and the scanner's errors, of which `active` (n,) are
    sought; `shared` (L,) the pose errors that captures share; `mount` carries the scanner.
    """

    tool_rotation: FloatArray
    tool_translation: FloatArray
    center: FloatArray
    nominal_radius_mm: float
    centers_in_laser: FloatArray
    scanner: FloatArray
    active: np.ndarray
    table: TableState | None = None
    shared: FloatArray | None = None
    mount: Carrier = "tool0"

    @classmethod
    def predicted(
        cls,
        data: ChainData,
        tool_rotation: FloatArray,
        tool_translation: FloatArray,
        center: FloatArray,
        table: TableState | None = None,
    ) -> "ChainState":
        """Return a guess in which every pose is taken as exact."""
        none = np.empty((0, 3)), np.zeros(scanner.COUNT), data.active
        guess = cls(tool_rotation, tool_translation, center, data.radius_mm, *none, table, mount=data.mount)
        return replace(guess, centers_in_laser=prediction(data, guess).centers_in_laser)

    def moved(self, step: FloatArray) -> "ChainState":
        """Return the unknowns after a step (P,); the captures' own centres stay."""
        width = 9 if self.table is None else 14 + self.table.mounts.size
        last = width + len(self.active)
        values = self.scanner.copy()
        values[self.active] += step[width:last]
        return replace(
            self,
            tool_rotation=nearest_rotation(self.tool_rotation @ rotation_from_vector(step[:3])),
            tool_translation=self.tool_translation + step[3:6],
            center=self.center + step[6:9],
            scanner=values,
            shared=None if self.shared is None else self.shared + step[last:],
            table=self.table and self.table.moved(step[9:width]),
        )

    def still_difference(self, other: "ChainState") -> FloatArray:
        """Return rx ry rz tx ty tz of the tool and the sphere's centre, (9,), from this state to another one."""
        turn = vector_from_rotation(self.tool_rotation.T @ other.tool_rotation)
        shift = other.tool_translation - self.tool_translation
        return np.concatenate([turn, shift, other.center - self.center])

    @property
    def radius_mm(self) -> float:
        """The sphere's radius."""
        return self.nominal_radius_mm + float(self.scanner[0])

    @property
    def mount_from_laser(self) -> RigidTransform:
        """The scanner's pose on what carries it."""
        return RigidTransform.of(self.tool_rotation, self.tool_translation, self.mount, "laser")

    @property
    def tool_in_laser(self) -> FloatArray:
        """The arm from the flange to the origin of L, in L, (3,), mm."""
        return self.tool_rotation.T @ self.tool_translation


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where the unknowns expect each capture's sphere.

    Attributes
    ----------
    centers_in_laser : (K, 3)
    jacobian : (K, 3, P)
        Of these by the unknowns; zero for held ones.
    levers : (K, 3) or None
        Of these by the table's angle, mm/rad.
    """

    centers_in_laser: FloatArray
    jacobian: FloatArray
    levers: FloatArray | None


def prediction(data: ChainData, state: ChainState) -> Prediction:
    """Return where the unknowns expect each capture's sphere in L, poses and angles taken as recorded."""
    from calib_core.kernels.chain import predict_centers

    count = data.count
    centers = np.empty((count, 3))
    centers[:] = state.center
    places = None
    if data.table is not None and state.table is not None:
        places = state.table.places(data.table)
        centers[places.on_table] = places.centers
    predicted, jacobian = np.empty((count, 3)), np.empty((count, 3, 9))
    # A transform's own arrays are read-only and strided: numba would compile another kernel for them.
    tool = np.require(state.tool_rotation, None, ["C", "W"]), np.require(state.tool_translation, None, ["C", "W"])
    predict_centers(data.rotations, data.translations, *tool, centers, predicted, jacobian)
    levers = None
    if places is not None:
        narrow, jacobian = jacobian, np.zeros((count, 3, data.unknowns))
        on_table, by_center = places.on_table, narrow[places.on_table, :, 6:9]
        jacobian[:, :, :6] = narrow[:, :, :6]
        jacobian[~on_table, :, 6:9] = narrow[~on_table, :, 6:9]
        jacobian[on_table, :, 9:] = by_center @ places.jacobian
        levers = np.zeros((count, 3))
        levers[on_table] = np.einsum("kij,kj->ki", by_center, places.levers)
    if data.held is not None:
        jacobian[:, :, data.held] = 0.0
    return Prediction(predicted, jacobian, levers)


def prior(data: ChainData, state: ChainState, shared: int) -> tuple[float, FloatArray, FloatArray]:
    """Return cost, gradient (P,) and Hessian (P, P) of what is known beside the captures.

    A held unknown gets a one in the Hessian, so that its row does not vanish.
    """
    active = data.active
    width, last = data.unknowns, data.unknowns + len(active)
    diagonal = np.zeros(last + shared)
    if data.table is not None:
        diagonal[14:width] = _MOUNT_PRIOR
    if data.held is not None:
        diagonal[:width][data.held] = 1.0
    cost, gradient = 0.0, np.zeros_like(diagonal)
    if data.tool_prior is None:
        sigmas = data.nuisance_sigmas[active]
        off = state.scanner[active] / sigmas
        cost += 0.5 * float(off @ off)
        gradient[width:last] = off / sigmas
        diagonal[width:last] = 1 / sigmas**2
    if state.shared is not None and shared:
        cost += 0.5 * float(state.shared @ state.shared)
        gradient[last:] = state.shared
        diagonal[last:] = 1.0
    hessian = np.diag(diagonal)
    if data.tool_prior is not None:
        at = np.concatenate([np.arange(6), np.arange(width, last)])
        deviation = data.tool_prior.deviation(state)
        gradient[at] += data.tool_prior.information @ deviation
        cost += 0.5 * float(deviation @ data.tool_prior.information @ deviation)
        hessian[np.ix_(at, at)] += data.tool_prior.information
    return cost, gradient, hessian
