"""Held-out captures of a still sphere, seen with a tool that they did not help to find."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.estimation import covariance_of, f_chance_of
from calib_core.frames import FloatArray, RigidTransform
from calib_core.stages.verify.seen import Seen, block_diagonal, linearised
from calib_core.stages.verify.sides import likeliest_sides
from calib_core.stages.verify.tool import Tool

_STEPS = 20
_CONVERGED_MM = 1e-6
_BELIEVED_MM, _RAD_PER_MM = 0.1, 1.5e-3  # of a robot of which nothing is told
_SCATTER_ROUNDS = 4
_MEDIAN_CHI2_3 = 2.366
_TOOL_STEPS, _OPEN = np.array([*[0.01] * 3, *[1.0] * 3]), 1e-4  # rad, mm; of what captures hardly see
_MOST_EXPLAINED = 0.95  # of the variance of an answer along any direction, by the arm at the captures
_PRIOR_RAD, _PRIOR_MM = 0.5, 300.0  # of the tool's error: only so that motions that leave it open have a large U
_HELD_MM = 1e-3  # of what answer and captures both leave open: nothing that the tool is used for depends on it


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The sphere over K held-out captures; its centre is in what carries it: base, or the flange.

    Attributes
    ----------
    center_mm : (3,)
    covariance : (3, 3)
    offsets_mm : (K, 3)
        Each capture's own centre minus the common one.
    expected_offsets_mm : (K,)
        Their root mean square length as the uncertainties predict it.
    squared_distances : (K,)
        Of each capture's figures, in units of their own and the tool's covariance; of 3 degrees of freedom.
    sides : (K,)
        The sign of the sphere's y in L.
    surface_rms_mm : (K,)
        Of its points' distances to the sphere at the common centre; NaN of a capture without points.
    chi_squared : float
        Over all captures together, of `degrees_of_freedom`.
    asked : Asked
        The tool that the captures ask for.
    sides_open : bool
        Whether other sides of the plane of light are nearly as likely and ask for another tool.
    spread : (3K, 3K)
        The covariance of all figures together; of several spheres the first one's.
    scatter_freedom : float
        See `Tool`.
    moved_squared, moved_freedom : float, int
        How much of χ² goes where the tool is another one, and of how many degrees of freedom that is.
    """

    center_mm: FloatArray
    covariance: FloatArray
    offsets_mm: FloatArray
    expected_offsets_mm: FloatArray
    squared_distances: FloatArray
    sides: FloatArray
    surface_rms_mm: FloatArray
    chi_squared: float
    degrees_of_freedom: int
    asked: "Asked"
    sides_open: bool = False
    spread: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    scatter_freedom: float = np.inf
    moved_squared: float = 0.0
    moved_freedom: int = 0

    @property
    def scatter_rms_mm(self) -> float:
        """Root mean square of the captures' distances to the common centre."""
        return float(np.sqrt(np.mean(np.sum(self.offsets_mm**2, axis=1))))

    @property
    def expected_scatter_rms_mm(self) -> float:
        """What the uncertainties predict of it."""
        return float(np.sqrt(np.mean(self.expected_offsets_mm**2)))

    @property
    def chance(self) -> float:
        """How often a right answer shows as large a chi-squared."""
        # Few captures know the robot's scatter roughly: 15 to an eighth, which is a quarter of a chi-squared.
        return f_chance_of(self.chi_squared, self.degrees_of_freedom, self.scatter_freedom)

    @property
    def rest_chance(self) -> float:
        """The same of what no other tool explains."""
        left = self.chi_squared - self.moved_squared
        return f_chance_of(left, max(self.degrees_of_freedom - self.moved_freedom, 1), self.scatter_freedom)

    @property
    def moved_chance(self) -> float:
        """How often a right answer lets another tool explain as much."""
        return f_chance_of(self.moved_squared, self.moved_freedom, self.scatter_freedom)


def held_out(observations: Observations, sphere: SphereSize, tool: Tool) -> HeldOut:
    """Return where held-out captures (at least two) see one still sphere.

    What is compared of a profile is its circle (x, z, radius), since its y, ± √(R² − r²), says nothing near a
    great circle; of a cloud or a centre its x, y, z.  The tool's error is common to all of them and moves each in
    its own way; it counts with its covariance, so that it is not taken for the captures' noise.
    """
    chosen = likeliest_sides(observations, sphere, tool)
    each = zip(observations, chosen.sides.tolist(), strict=True)
    seen = [Seen(observation, sphere, tool, side) for observation, side in each]
    center = center_as_asked = chosen.center_mm
    for _ in range(_STEPS):
        joint = _Joint(seen, center, tool)
        center = center + joint.step
        if np.linalg.norm(joint.step) < _CONVERGED_MM:
            break
    joint = _Joint(seen, center, tool)
    residuals = joint.residuals.reshape(-1, 3)
    moved_squared, moved_freedom = joint.by_another_tool()
    return HeldOut(
        center_mm=center,
        covariance=joint.covariance_of_center,
        offsets_mm=np.array([one.center_mm(center) for one in seen]) - center,
        expected_offsets_mm=joint.expected_offsets_mm(),
        squared_distances=np.array([e @ np.linalg.solve(joint.block(k), e) for k, e in enumerate(residuals)]),
        sides=np.array([one.side(center) for one in seen]),
        surface_rms_mm=np.array([one.surface_rms_mm(center) for one in seen]),
        chi_squared=float(joint.residuals @ np.linalg.solve(joint.covariance, joint.residuals)),
        degrees_of_freedom=3 * len(seen) - 3,
        asked=asked_with_scatter(observations, sphere.radius_mm, chosen.mount_from_laser, center_as_asked, tool),
        sides_open=chosen.open,
        spread=joint.covariance,
        scatter_freedom=tool.scatter_freedom,
        moved_squared=moved_squared,
        moved_freedom=moved_freedom,
    )


def in_one_plane(observations: Observations, sphere: SphereSize, tool: Tool) -> list[SphereObservation]:
    """Return captures of one sphere as they were in one plane, where the answer has the sheet of light bent."""
    if not tool.sheet_per_mm:
        return list(observations)
    return tool.straightened(observations, held_out(observations, sphere, tool).center_mm, sphere.radius_mm)


def together(parts: Sequence[HeldOut]) -> HeldOut:
    """Return what captures of several spheres show, each about its own; the centre is the first one's."""
    return HeldOut(
        center_mm=parts[0].center_mm,
        covariance=parts[0].covariance,
        offsets_mm=np.concatenate([part.offsets_mm for part in parts]),
        expected_offsets_mm=np.concatenate([part.expected_offsets_mm for part in parts]),
        squared_distances=np.concatenate([part.squared_distances for part in parts]),
        sides=np.concatenate([part.sides for part in parts]),
        surface_rms_mm=np.concatenate([part.surface_rms_mm for part in parts]),
        chi_squared=sum(part.chi_squared for part in parts),
        degrees_of_freedom=sum(part.degrees_of_freedom for part in parts),
        asked=parts[0].asked,
        sides_open=any(part.sides_open for part in parts),
        spread=parts[0].spread,
        scatter_freedom=parts[0].scatter_freedom,
        moved_squared=sum(part.moved_squared for part in parts),
        moved_freedom=sum(part.moved_freedom for part in parts),
    )


@dataclass(frozen=True, eq=False)
class Asked:
    """The tool that captures ask for, by themselves: what is verified is no evidence for itself.

    Attributes
    ----------
    mount_from_laser : RigidTransform
    center_mm : (3,)
    residuals, weights : (K, 3), (K, 3, 3)
        What is left of the captures' figures there, and the inverse of their own covariances.
    design : (K, 3, 9)
        How the figures follow the sphere's centre and the tool.
    covariance : (9, 9)
    points : (K, 3)
        The sphere's centre in L.
    given : Tool
        That is verified, with the robot's scatter as it counts here.
    """

    mount_from_laser: RigidTransform
    center_mm: FloatArray
    residuals: FloatArray
    weights: FloatArray
    design: FloatArray
    covariance: FloatArray
    points: FloatArray
    given: Tool

    @property
    def squares(self) -> FloatArray:
        """Each capture's squared length (K,) of what is left, in standard deviations."""
        return np.einsum("ki,kij,kj->k", self.residuals, self.weights, self.residuals)

    @property
    def squared(self) -> float:
        """The squared length of what is left, in standard deviations."""
        return float(self.squares.sum())

    def surface_rms_mm(self, observations: Observations, radius_mm: float) -> FloatArray:
        """Return how far each capture's points (K,) lie off the ball that all ask for; NaN without points."""
        tool, sphere = Tool(self.mount_from_laser, np.zeros((6, 6))), SphereSize(2 * radius_mm)
        return np.array([Seen(o, sphere, tool).surface_rms_mm(self.center_mm) for o in observations])


def asked_by(
    observations: Observations, radius_mm: float, start: RigidTransform, center_mm: FloatArray, tool: Tool
) -> Asked:
    """Return the tool that captures of one still sphere ask for.

    Parameters
    ----------
    observations : K captures, none of which helped to find the tool
    radius_mm : float
    start, center_mm
        Near it.
    tool : Tool
        That is verified.  Its covariance is not used, but that it is off by more than 0.5 rad or 300 mm is not
        believed: motions that leave it open have a large uncertainty.  Where the answer leaves its place open too,
        as a machine that does not turn must, it is held.
    """
    believed = np.diag([0.0] * 3 + [1 / _PRIOR_RAD**2] * 3 + [1 / _PRIOR_MM**2] * 3)
    at, center, best = start, center_mm, np.inf
    step = np.zeros(9)
    found: Asked | None = None
    for _ in range(_STEPS):
        trial, place = at.perturbed(step[3:]), center + step[:3]
        residuals, covariances, by_center, by_tool, points = linearised(
            observations, radius_mm, place, replace(tool, mount_from_laser=trial)
        )
        design = np.concatenate([by_center, by_tool], axis=2)
        weights: FloatArray = np.asarray(np.linalg.inv(covariances), dtype=float)
        turned = np.swapaxes(design, 1, 2) @ weights
        if found is None and len(tool.left_open):
            believed[6:, 6:] += _held(covariance_of((turned @ design).sum(axis=0) + believed), tool)
        covariance = covariance_of((turned @ design).sum(axis=0) + believed)
        deviation = np.concatenate([np.zeros(3), tool.mount_from_laser.difference(trial)])
        here = Asked(trial, place, residuals, weights, design, covariance, points, tool)
        cost = here.squared + float(deviation @ believed @ deviation)
        if found is not None and cost > best + 1e-9:
            step = step / 2
        else:
            at, center, best, found = trial, place, cost, here
            step = covariance @ ((turned @ residuals[..., None]).sum(axis=0)[:, 0] - believed @ deviation)
        if float(np.abs(step * np.array([1.0] * 3 + [1e3] * 3 + [1.0] * 3)).max()) < _CONVERGED_MM:
            break
    assert found is not None
    return found


def _held(covariance: FloatArray, tool: Tool) -> FloatArray:
    """Return the weight (3, 3) by which a tool's place is held where captures leave it open as the answer does."""
    along = tool.left_open
    variances, turn = np.linalg.eigh(along @ covariance[6:, 6:] @ along.T)
    held = turn[:, variances > (_PRIOR_MM / 10) ** 2].T @ along
    return held.T @ held / _HELD_MM**2


def asked_with_scatter(
    observations: Observations, radius_mm: float, start: RigidTransform, center_mm: FloatArray, tool: Tool
) -> Asked:
    """Return the same; a robot of which nothing is told scatters as half of the captures do about that tool.

    Weighed by the profiles' own noise alone, along x ten times as heavily as across, the errors of right poses
    contradict each other.
    """
    if tool.position_sigma_mm or tool.orientation_sigma_rad:
        return asked_by(observations, radius_mm, start, center_mm, tool)
    sigma_mm, usual = _BELIEVED_MM, _MEDIAN_CHI2_3 * max(1 - 3 / len(observations), 0.25)
    asked = None
    for _ in range(_SCATTER_ROUNDS):
        scattering = replace(tool, position_sigma_mm=sigma_mm, orientation_sigma_rad=_RAD_PER_MM * sigma_mm)
        asked = asked_by(observations, radius_mm, start, center_mm, scattering)
        start, center_mm = asked.mount_from_laser, asked.center_mm
        sigma_mm *= max(float(np.sqrt(np.median(asked.squares) / usual)), 0.1)
    assert asked is not None
    return asked


class _Joint:
    """All captures together, linearised at one centre of the sphere."""

    def __init__(self, seen: Sequence[Seen], center: FloatArray, tool: Tool) -> None:
        self._seen, self._center = seen, center
        self.residuals = np.concatenate([one.residual(center) for one in seen])
        self._slope = block_diagonal(one.slope(center) for one in seen)
        self._by_tool = np.concatenate([one.moved_by_tool(center) for one in seen])
        self._by_ball = np.concatenate([one.moved_by_ball() for one in seen])
        self._together, self.covariance = _by_answer(seen, center, tool, self._slope, self._by_tool)
        design = self._slope @ self._by_ball
        self._weighted = np.linalg.solve(self.covariance, design)
        self.covariance_of_center = np.asarray(np.linalg.inv(design.T @ self._weighted), dtype=np.float64)
        self.step = self.covariance_of_center @ self._weighted.T @ self.residuals

    def by_another_tool(self) -> tuple[float, int]:
        """Return how much of χ² another tool explains, wherever the sphere is, and its degrees of freedom."""
        low = np.linalg.cholesky(self.covariance)
        both = np.hstack([self._slope @ self._by_ball, self._slope @ self._by_tool * _TOOL_STEPS])
        white = np.linalg.solve(low, np.column_stack([both, self.residuals]))
        by_center = np.linalg.qr(white[:, :3])[0]
        rest = white[:, 3:] - by_center @ (by_center.T @ white[:, 3:])
        along, sizes, _ = np.linalg.svd(rest[:, :6], full_matrices=False)
        seen = along[:, sizes > _OPEN * max(float(sizes[0]), 1.0)]
        return float(np.sum((seen.T @ rest[:, 6]) ** 2)), seen.shape[1]

    def block(self, capture: int) -> FloatArray:
        """Return the covariance (3, 3) of one capture's figures."""
        place = slice(3 * capture, 3 * capture + 3)
        return self.covariance[place, place]

    def expected_offsets_mm(self) -> FloatArray:
        """Return how far each capture's own centre is expected from the common one (K,), root mean square."""
        into_carrier = block_diagonal(one.moved_by_ball().T for one in self._seen)
        own = block_diagonal(one.center_covariance(self._center) for one in self._seen)
        spread = into_carrier @ (own + self._together) @ into_carrier.T
        # The common centre follows the captures' own ones by these weights (3, 3K).
        follow = self.covariance_of_center @ self._weighted.T @ self._slope @ into_carrier.T
        apart = np.eye(len(spread)) - np.tile(follow, (len(self._seen), 1))
        return np.sqrt(np.diag(apart @ spread @ apart.T).reshape(-1, 3).sum(axis=1))


def _by_answer(
    seen: Sequence[Seen], center: FloatArray, tool: Tool, slope: FloatArray, by_tool: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of where captures see the centre, without their own noise, and of their figures.

    Parameters
    ----------
    seen, center, tool
    slope, by_tool : (3K, 3K), (3K, 6)
        How figures follow the centre in L, and how that follows the tool.

    Returns
    -------
    (3K, 3K), (3K, 3K)
    """
    observations = [one.observation for one in seen]
    own = block_diagonal(one.covariance(center) for one in seen)
    known, centers, figures = tool.covariance, -by_tool, -slope @ by_tool
    columns = np.arange(6)
    if (errors := tool.scanner) is not None and len(errors.kinds):
        moved, moved_centers = errors.moved(observations, np.array([one.radius_mm for one in seen]))
        known = np.block([[known, errors.with_tool], [errors.with_tool.T, errors.covariance]])
        centers, figures = np.hstack([centers, moved_centers]), np.hstack([figures, moved])
        columns = np.concatenate([columns, 6 + errors.columns])
    together, whole = centers @ known @ centers.T, own + figures @ known @ figures.T
    if tool.arm is None:
        return together, whole
    places = np.array([one.center_in_laser_mm(center) for one in seen])
    by_arm, with_answer = tool.arm.covariance(observations, tool.mount_from_laser, places)
    together, whole = together + by_arm, whole + slope @ by_arm @ slope.T
    if len(with_answer):
        common = with_answer[columns]
        common = common * _believable(known, common @ slope.T, own + slope @ by_arm @ slope.T)
        both = centers @ common, figures @ common @ slope.T
        together, whole = together + both[0] + both[0].T, whole + both[1] + both[1].T
    return together, whole


def _believable(first: FloatArray, common: FloatArray, second: FloatArray) -> float:
    """Return by what a covariance between two is to be taken less, 1 or a little less, so that both have one.

    It is told of poses that stand for all, and averaged over what the sigmas may be.
    """
    sizes, along = np.linalg.eigh(first)
    good = sizes > 1e-12 * sizes[-1]
    white = (along[:, good] / np.sqrt(sizes[good])).T @ common
    explained = float(np.linalg.eigvalsh(white @ np.linalg.solve(second, white.T))[-1])
    return min(1.0, float(np.sqrt(_MOST_EXPLAINED / max(explained, 1e-12))))
