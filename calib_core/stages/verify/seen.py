"""A held-out capture beside what sphere, tool and pose predict of it."""

from collections.abc import Iterable

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.frames import FloatArray, skew
from calib_core.stages.verify.tool import Tool


class Seen:
    """One capture: what it measured (3,), and how that depends on the sphere's centre, the tool and the pose."""

    def __init__(self, observation: SphereObservation, sphere: SphereSize, tool: Tool, side: int = 0) -> None:
        self.observation, self._sphere, self._tool, self._side = observation, sphere, tool, side
        self._ball_from_laser = observation.ball_from_scanner @ tool.mount_from_laser
        self._laser_from_ball = self._ball_from_laser.inverse()
        center = observation.center_in_laser_mm
        radius = observation.circle_radius_mm
        self.measured = center if radius is None else np.array([center[0], center[2], radius])
        self.noise = observation.center_covariance

    @property
    def radius_mm(self) -> float:
        """The sphere's."""
        return self._sphere.radius_mm

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


def linearised(
    observations: Observations, radius_mm: float, center: FloatArray, tool: Tool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return K captures' figures at a centre on what carries the ball, and how they follow it and the tool.

    `center` is (3,), or (K, 3) where captures show several balls.

    Returns
    -------
    residuals, covariances : (K, 3), (K, 3, 3)
        Measured minus predicted, and the captures' and the robot's noise in them.
    by_center, by_tool : (K, 3, 3), (K, 3, 6)
    points : (K, 3)
        The centre in L.
    """
    common = SphereSize(2 * radius_mm)
    seen = [Seen(one, one.size(common), tool) for one in observations]
    each = list(zip(seen, np.broadcast_to(center, (len(seen), 3)), strict=True))
    return (
        np.array([one.residual(at) for one, at in each]),
        np.array([one.covariance(at) for one, at in each]),
        np.array([one.slope(at) @ one.moved_by_ball() for one, at in each]),
        np.array([one.slope(at) @ one.moved_by_tool(at) for one, at in each]),
        np.array([one.center_in_laser_mm(at) for one, at in each]),
    )


def block_diagonal(blocks: Iterable[FloatArray]) -> FloatArray:
    """Return blocks (n, m) on the diagonal of one matrix."""
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*blocks), dtype=float)
