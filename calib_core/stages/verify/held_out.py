"""Held-out captures of a still sphere, seen with a tool that they did not help to find."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.estimation import covariance_of, f_chance_of
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.stages.verify.sides import likeliest_sides
from calib_core.stages.verify.tool import Tool

_STEPS = 20
_CONVERGED_MM = 1e-6
_BELIEVED_MM, _RAD_PER_MM = 0.1, 1.5e-3  # of a robot of which nothing is told
_SCATTER_ROUNDS = 4
_MEDIAN_CHI2_3 = 2.366
_PRIOR_RAD, _PRIOR_MM = 0.5, 300.0  # of the tool's error: only so that motions that leave it open have a large U


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


def held_out(observations: Observations, sphere: SphereSize, tool: Tool) -> HeldOut:
    """Return where held-out captures (at least two) see one still sphere.

    What is compared of a profile is its circle (x, z, radius), since its y, ± √(R² − r²), says nothing near a
    great circle; of a cloud or a centre its x, y, z.  The tool's error is common to all of them and moves each in
    its own way; it counts with its covariance, so that it is not taken for the captures' noise.
    """
    chosen = likeliest_sides(observations, sphere, tool)
    each = zip(observations, chosen.sides.tolist(), strict=True)
    seen = [_Seen(observation, sphere, tool, side) for observation, side in each]
    center = center_as_asked = chosen.center_mm
    for _ in range(_STEPS):
        joint = _Joint(seen, center, tool)
        center = center + joint.step
        if np.linalg.norm(joint.step) < _CONVERGED_MM:
            break
    joint = _Joint(seen, center, tool)
    residuals = joint.residuals.reshape(-1, 3)
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
    )


def linearised(
    observations: Observations, radius_mm: float, center: FloatArray, tool: Tool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return K captures' figures at a centre on what carries the ball, and how they follow it and the tool.

    Returns
    -------
    residuals, covariances : (K, 3), (K, 3, 3)
        Measured minus predicted, and the captures' and the robot's noise in them.
    by_center, by_tool : (K, 3, 3), (K, 3, 6)
    points : (K, 3)
        The centre in L.
    """
    seen = [_Seen(observation, SphereSize(2 * radius_mm), tool) for observation in observations]
    return (
        np.array([one.residual(center) for one in seen]),
        np.array([one.covariance(center) for one in seen]),
        np.array([one.slope(center) @ one.moved_by_ball() for one in seen]),
        np.array([one.slope(center) @ one.moved_by_tool(center) for one in seen]),
        np.array([one.center_in_laser_mm(center) for one in seen]),
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
        return np.array([_Seen(o, sphere, tool).surface_rms_mm(self.center_mm) for o in observations])


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
        believed: motions that leave it open have a large uncertainty.
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


class _Seen:
    """One capture: what it measured (3,), and how that depends on the sphere's centre, the tool and the pose."""

    def __init__(self, observation: SphereObservation, sphere: SphereSize, tool: Tool, side: int = 0) -> None:
        self.observation, self._sphere, self._tool, self._side = observation, sphere, tool, side
        self._ball_from_laser = observation.ball_from_scanner @ tool.mount_from_laser
        self._laser_from_ball = self._ball_from_laser.inverse()
        center = observation.center_in_laser_mm
        radius = observation.circle_radius_mm
        self.measured = center if radius is None else np.array([center[0], center[2], radius])
        self.noise = observation.center_covariance

    def residual(self, center: FloatArray) -> FloatArray:
        """Return measured minus predicted."""
        center = self._laser_from_ball.apply(center)
        if self.observation.circle_radius_mm is None:
            return self.measured - center
        return self.measured - np.array([center[0], center[2], self._circle_radius_mm(center)])

    def slope(self, center: FloatArray) -> FloatArray:
        """Return how the prediction follows the sphere's centre in L (3, 3)."""
        if self.observation.circle_radius_mm is None:
            return np.eye(3)
        center = self._laser_from_ball.apply(center)
        slope = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
        slope[2, 1] = -center[1] / self._circle_radius_mm(center)
        return slope

    def moved_by_ball(self) -> FloatArray:
        """Return how the centre in L follows that on what carries the ball (3, 3)."""
        return self._laser_from_ball.rotation

    def moved_by_tool(self, center: FloatArray) -> FloatArray:
        """Return how the centre in L follows the tool (3, 6): q turns by −r × q, and shifts by −Rᵀδ."""
        center = self._laser_from_ball.apply(center)
        return np.hstack([skew(center), -self._tool.mount_from_laser.rotation.T])

    def pose_covariance(self, center: FloatArray) -> FloatArray:
        """Return the covariance (3, 3) of the centre in L by the errors of the robot's pose and of the axes."""
        over, base_from_tool0 = self.observation.carriers.over_robot, self.observation.base_from_tool0
        if over == 0:
            return np.zeros((3, 3))
        by_axes = np.zeros((3, 0))
        if (moves := self._tool.axis_moves.get(self.observation.capture)) is not None:
            in_base = center if over > 0 else base_from_tool0.apply(center)
            seen = self._laser_from_ball if over > 0 else self._tool.mount_from_laser.inverse()
            by_axes = seen.rotation @ (moves[3:] - skew(in_base) @ moves[:3])
        arm = skew(base_from_tool0.inverse().apply(center) if over > 0 else center)  # from the flange to the ball
        turning, shifting = self._tool.orientation_sigma_rad**2, self._tool.position_sigma_mm**2
        turned = self._tool.mount_from_laser.rotation.T if over > 0 else self._laser_from_ball.rotation
        return turned @ (turning * arm @ arm.T + shifting * np.eye(3)) @ turned.T + by_axes @ by_axes.T

    def covariance(self, center: FloatArray) -> FloatArray:
        """Return the covariance of what was measured, the pose's error with it."""
        slope = self.slope(center)
        return self.noise + slope @ self.pose_covariance(center) @ slope.T

    def center_in_laser_mm(self, center: FloatArray) -> FloatArray:
        """Return where the capture should see the centre in L."""
        return self._laser_from_ball.apply(center)

    def center_covariance(self, center: FloatArray) -> FloatArray:
        """Return the covariance (3, 3) of the capture's own centre in L; the radius bounds what is open."""
        slope = self.slope(center)
        known = slope.T @ np.linalg.solve(self.noise, slope) + np.eye(3) / self._sphere.radius_mm**2
        return np.linalg.inv(known) + self.pose_covariance(center)

    def center_mm(self, center: FloatArray) -> FloatArray:
        """Return the capture's own centre on what carries the ball, on the side where the common one is."""
        return self._in_carrier(int(self.side(center)) or 1)

    def side(self, center: FloatArray) -> float:
        """Return the sign of the centre's y in L, as it was chosen or as the centre says."""
        return self._side or float(np.sign(self._laser_from_ball.apply(center)[1]))

    def surface_rms_mm(self, center: FloatArray) -> float:
        """Return the root mean square distance of the points to the sphere; NaN without points."""
        points = self.observation.points_in_laser_mm
        if not len(points):
            return float("nan")
        off = points - self._laser_from_ball.apply(center)
        return float(np.sqrt(np.mean((np.linalg.norm(off, axis=1) - self._sphere.radius_mm) ** 2)))

    def _in_carrier(self, side: int) -> FloatArray:
        return self._ball_from_laser.apply(self.observation.sphere_center_in_laser_mm(self._sphere, side))

    def _circle_radius_mm(self, center: FloatArray) -> float:
        least = 0.05 * self._sphere.radius_mm  # beyond the sphere's edge there is no circle; near it no slope
        return float(np.sqrt(max(self._sphere.radius_mm**2 - center[1] ** 2, least**2)))


class _Joint:
    """All captures together, linearised at one centre of the sphere."""

    def __init__(self, seen: Sequence[_Seen], center: FloatArray, tool: Tool) -> None:
        self._seen, self._center = seen, center
        self.residuals = np.concatenate([one.residual(center) for one in seen])
        self._slope = block_diagonal(one.slope(center) for one in seen)
        self._by_tool = np.concatenate([one.moved_by_tool(center) for one in seen])
        self._by_ball = np.concatenate([one.moved_by_ball() for one in seen])
        own = block_diagonal(one.covariance(center) for one in seen)
        self._together = self._by_tool @ tool.covariance @ self._by_tool.T
        if tool.arm is not None:
            places = np.array([one.center_in_laser_mm(center) for one in seen])
            several = [one.observation for one in seen]
            self._together += tool.arm.covariance(several, tool.mount_from_laser, places, self._by_tool)
        self.covariance: FloatArray = own + self._slope @ self._together @ self._slope.T
        design = self._slope @ self._by_ball
        self._weighted = np.linalg.solve(self.covariance, design)
        self.covariance_of_center = np.asarray(np.linalg.inv(design.T @ self._weighted), dtype=np.float64)
        self.step = self.covariance_of_center @ self._weighted.T @ self.residuals

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


def block_diagonal(blocks: Iterable[FloatArray]) -> FloatArray:
    """Return blocks (n, m) on the diagonal of one matrix."""
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*blocks), dtype=float)
