"""What the captures say, as arrays, the unknowns, and where these expect each capture's sphere.

Unknown are tool0_from_laser (6), the still sphere's centre in base (3), where captures of a turntable are among
them its axis and mountings (`chain.table`), and, where its diameter is uncertain, the radius: always last.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.table import TableReadings, TableState
from calib_core.frames import FloatArray, nearest_rotation, rotation_from_vector

_MOUNT_PRIOR = 1e-10  # 1/mm²: keeps a mounting finite all of whose captures were rejected


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, per axis, of a robot pose's position and orientation, and of the table's angle."""

    position_mm: float
    orientation_rad: float
    angle_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class ToolPrior:
    """What is known of tool0_from_laser beforehand: R (3, 3), T (3,), inverse covariance (6, 6) of rx … tz."""

    rotation: FloatArray
    translation: FloatArray
    information: FloatArray

    def deviation(self, state: "ChainState") -> FloatArray:
        """Return how far a state's tool is from it, (6,): small, so that the rotation counts as a vector."""
        turned = self.rotation.T @ state.tool_rotation
        turn = 0.5 * np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        return np.concatenate([turn, state.tool_translation - self.translation])


@dataclass(frozen=True, eq=False)
class ChainData:
    """All captures as arrays.

    Attributes
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0 as recorded.
    points, offsets, weights : (M, 3), (K + 1,), (K,)
        Profiles' points in L, where each capture's begin, and 1/σ² of a capture's points.
    anchors, anchor_information, anchor_gradient : (K, 3), (K, 4, 4), (K, 4)
        For clouds and centers, whose likelihood is quadratic in (centre, radius): where, how sharp, which slope.
    radius_mm, radius_sigma_mm : float
        The sphere's.
    table : TableReadings or None
        What the captures say of the turntable.
    held : (P,) bool or None
        Unknowns that keep their values, without the radius.
    tool_prior : ToolPrior or None
    """

    rotations: FloatArray
    translations: FloatArray
    points: FloatArray
    offsets: np.ndarray
    weights: FloatArray
    anchors: FloatArray
    anchor_information: FloatArray
    anchor_gradient: FloatArray
    radius_mm: float
    radius_sigma_mm: float
    table: TableReadings | None = None
    held: np.ndarray | None = None
    tool_prior: ToolPrior | None = None

    @property
    def count(self) -> int:
        """The number of captures."""
        return len(self.weights)

    @property
    def free_radius(self) -> bool:
        """Whether the sphere's radius is an unknown (with a prior) as well."""
        return self.radius_sigma_mm > 0

    @property
    def unknowns(self) -> int:
        """The number of unknowns, held ones included, without the radius."""
        return 9 + (self.table.size if self.table else 0)

    @property
    def free_unknowns(self) -> int:
        """The number of unknowns that are sought, without the radius."""
        return self.unknowns - (0 if self.held is None else int(self.held.sum()))

    def chosen(self, used: np.ndarray) -> "ChainData":
        """Return only the captures of a mask (K,)."""
        if used.all():
            return self
        lengths = np.diff(self.offsets)
        return replace(
            self,
            rotations=self.rotations[used],
            translations=self.translations[used],
            points=self.points[np.repeat(used, lengths)],
            offsets=np.concatenate([[0], np.cumsum(lengths[used])]),
            weights=self.weights[used],
            anchors=self.anchors[used],
            anchor_information=self.anchor_information[used],
            anchor_gradient=self.anchor_gradient[used],
            table=self.table and self.table.chosen(used),
        )


def chain_data(
    observations: Sequence[SphereObservation], sphere: SphereSize, profile_sigma_mm: float | None
) -> ChainData:
    """Return observations as arrays; `profile_sigma_mm` is the points' standard deviation in every profile."""
    count = len(observations)
    profiles = [o.points_in_laser_mm if o.kind == "profile" else np.empty((0, 3)) for o in observations]
    anchors = np.zeros((count, 3))
    information = np.zeros((count, 4, 4))
    gradient = np.zeros((count, 4))
    for k, o in enumerate(observations):
        if o.kind == "profile":
            continue
        anchors[k] = o.center_in_laser_mm
        if o.kind == "center" or len(o.points_in_laser_mm) == 0:
            information[k, :3, :3] = np.linalg.inv(o.center_covariance)
        else:
            information[k], gradient[k] = _cloud_information(o, sphere.radius_mm)
    sigmas = np.array([profile_sigma_mm or o.point_sigma_mm or 1.0 for o in observations])
    return ChainData(
        rotations=np.array([o.base_from_tool0.rotation for o in observations]).reshape(-1, 3, 3),
        translations=np.array([o.base_from_tool0.translation_mm for o in observations]).reshape(-1, 3),
        points=np.ascontiguousarray(np.concatenate(profiles) if profiles else np.empty((0, 3))),
        offsets=np.concatenate([[0], np.cumsum([len(p) for p in profiles])]).astype(np.int64),
        weights=1 / sigmas**2,
        anchors=anchors,
        anchor_information=information,
        anchor_gradient=gradient,
        radius_mm=sphere.radius_mm,
        radius_sigma_mm=sphere.sigma_mm / 2,
    )


def _cloud_information(observation: SphereObservation, radius_mm: float) -> tuple[FloatArray, FloatArray]:
    offsets = observation.points_in_laser_mm - observation.center_in_laser_mm
    distances = np.linalg.norm(offsets, axis=1)
    jacobian = -np.column_stack([offsets / distances[:, None], np.ones(len(distances))])
    weight = 1 / observation.point_sigma_mm**2
    return weight * jacobian.T @ jacobian, weight * jacobian.T @ (distances - radius_mm)


@dataclass(frozen=True, eq=False)
class ChainState:
    """One guess of the unknowns, and of where each capture's own sphere centre lies in L."""

    tool_rotation: FloatArray
    tool_translation: FloatArray
    center: FloatArray
    radius_mm: float
    centers_in_laser: FloatArray
    table: TableState | None = None

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
        guess = cls(tool_rotation, tool_translation, center, data.radius_mm, np.empty((0, 3)), table)
        return replace(guess, centers_in_laser=prediction(data, guess).centers_in_laser)

    def moved(self, step: FloatArray) -> "ChainState":
        """Return the unknowns after a step (P,), the radius last; the captures' own centres stay."""
        width = 9 if self.table is None else 14 + self.table.mounts.size
        return replace(
            self,
            tool_rotation=nearest_rotation(self.tool_rotation @ rotation_from_vector(step[:3])),
            tool_translation=self.tool_translation + step[3:6],
            center=self.center + step[6:9],
            radius_mm=self.radius_mm + (float(step[width]) if len(step) > width else 0.0),
            table=self.table and self.table.moved(step[9:width]),
        )

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
    tool = state.tool_rotation, state.tool_translation
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


def prior(data: ChainData, state: ChainState) -> tuple[float, FloatArray, FloatArray]:
    """Return cost, gradient (P',) and Hessian (P', P') of what is known beside the captures, the radius included.

    A held unknown gets a one in the Hessian, so that its row does not vanish.
    """
    diagonal = np.zeros(data.unknowns + data.free_radius)
    if data.table is not None:
        diagonal[14 : data.unknowns] = _MOUNT_PRIOR
    if data.held is not None:
        diagonal[: data.unknowns][data.held] = 1.0
    cost, gradient, hessian = 0.0, np.zeros_like(diagonal), np.diag(diagonal)
    if data.tool_prior is not None:
        deviation = data.tool_prior.deviation(state)
        gradient[:6] = data.tool_prior.information @ deviation
        cost += 0.5 * float(deviation @ gradient[:6])
        hessian[:6, :6] += data.tool_prior.information
    if data.free_radius:
        off = (state.radius_mm - data.radius_mm) / data.radius_sigma_mm
        cost += 0.5 * off**2
        gradient[-1] += off / data.radius_sigma_mm
        hessian[-1, -1] += 1 / data.radius_sigma_mm**2
    return cost, gradient, hessian
