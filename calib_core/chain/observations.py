"""What one capture tells the chain about the sphere: the solvers' input, already measured in frame L."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib_core.cell.walk import Carriers
from calib_core.frames import FloatArray, RigidTransform

SCANNER_ON_FLANGE = Carriers()
TABLE = "table"
"""The axis of `cell.turntable`."""


@dataclass(frozen=True)
class SphereSize:
    """The sphere's diameter and its standard uncertainty (zero: taken as exact)."""

    diameter_mm: float
    sigma_mm: float = 0.0

    @property
    def radius_mm(self) -> float:
        """Half the diameter."""
        return self.diameter_mm / 2


@dataclass(frozen=True, eq=False)
class SphereObservation:
    """The sphere as one capture saw it, and where the robot stood.

    Attributes
    ----------
    capture : str
        The capture's id.
    base_from_tool0 : RigidTransform
        The robot's pose as recorded.
    kind : {"profile", "cloud", "center"}
    points_in_laser_mm : (N, 3)
        The points on the sphere (y = 0 for a profile; none for a center).
    center_in_laser_mm : (3,)
        The sphere's centre; for a profile the centre of the circle that its plane cuts, (x, 0, z).
    center_covariance : (3, 3)
        Of that centre, mm²; for a profile of the circle's x, z and radius.
    circle_radius_mm : float or None
        Of a profile's circle.
    point_sigma_mm : float
        Standard deviation of a point across the surface, from the fit's residuals.
    side : {1, -1} or None
        The sign of the sphere centre's y, where the user fixed it.
    points_per_independent : float
        How many of its points say as much as one that errs by itself (`chain.effective`).
    bent : float
        By how many times more of them it takes as a scanner's scale, shear and bow, alike in all arcs, bend them.
    without_ray : int
        How many stripe centres of its frame were dropped, as they lie beyond the fold of the camera's distortion.
    carriers : Carriers
        What carries scanner and ball.
    scanner, ball : str
        The names of the scanner and of the ball's place; empty where there is one of each.
    listed : int
        How many scanners the cell lists before this one: the first that is solved is the answer's own.
    readings : mapping
        Where the axes stood, by their names, rad and mm.
    sphere : SphereSize or None
        The ball's size, where it is not that of all.
    sizes : tuple of SphereSize
        The sizes of the balls that it may show, where which one is not told; empty where all are alike.
    common_sigma_mm : float or None
        The points' standard deviation in all profiles of this scanner, where scanners differ.
    arm_moves : (6, p) or None
        How the flange moves in base with each term of the arm's errors, mm and rad (`arms.errors.arm_moves`).
    """

    capture: str
    base_from_tool0: RigidTransform
    kind: Literal["profile", "cloud", "center"]
    points_in_laser_mm: FloatArray
    center_in_laser_mm: FloatArray
    center_covariance: FloatArray
    circle_radius_mm: float | None = None
    point_sigma_mm: float = 0.0
    side: int | None = None
    points_per_independent: float = 1.0
    bent: float = 1.0
    without_ray: int = 0
    carriers: Carriers = SCANNER_ON_FLANGE
    scanner: str = ""
    listed: int = 0
    ball: str = ""
    readings: Mapping[str, float] = field(default_factory=dict[str, float])
    sphere: SphereSize | None = None
    sizes: tuple[SphereSize, ...] = ()
    common_sigma_mm: float | None = None
    arm_moves: FloatArray | None = None

    @property
    def ball_from_scanner(self) -> RigidTransform:
        """From what carries the scanner into what carries the ball."""
        return self.carriers.ball_from_scanner(self.base_from_tool0)

    def size(self, common: SphereSize) -> SphereSize:
        """Return the ball's size: its own, else the one that all have."""
        return self.sphere or common

    def sphere_center_in_laser_mm(self, sphere: SphereSize, side: int) -> FloatArray:
        """Return the sphere's centre (3,) in L; `side` is the sign of y, which only a profile leaves open."""
        if self.circle_radius_mm is None:
            return self.center_in_laser_mm
        height = np.sqrt(max(self.size(sphere).radius_mm ** 2 - self.circle_radius_mm**2, 0.0))
        return self.center_in_laser_mm + np.array([0.0, side * height, 0.0])


def named(captures: Sequence[str], used: NDArray[np.bool_]) -> str:
    """Return the ids of captures that are not used, each once; of a sweep, of how many profiles, too."""
    left_out = [name for name, good in zip(captures, used, strict=True) if not good]
    total, count = Counter(captures), Counter(left_out)
    return ", ".join(name if total[name] == 1 else f"{name} ({n}/{total[name]})" for name, n in count.items())


@dataclass(frozen=True, eq=False)
class TableObservation:
    """The sphere as one capture saw it on the turntable.

    Attributes
    ----------
    sphere : SphereObservation
    angle_rad : float
        The table's angle as read; mm of a linear axis.
    mount : str
        The name of the sphere's mounting; empty where the user gave none.
    axis : str
        Which axis carries it; where others stood is in the sphere's readings.
    """

    sphere: SphereObservation
    angle_rad: float
    mount: str
    axis: str = TABLE

    @property
    def placed(self) -> SphereObservation:
        """The sphere on the axis that carries it."""
        carriers = replace(self.sphere.carriers, ball=self.axis)
        readings = {**self.sphere.readings, self.axis: self.angle_rad}
        return replace(self.sphere, carriers=carriers, ball=self.mount, readings=readings)

    def seen_as(self, placed: SphereObservation) -> "TableObservation":
        """Return the same with points and pose of the sphere on the axis, where those were corrected."""
        own = self.sphere
        return replace(self, sphere=replace(placed, carriers=own.carriers, ball=own.ball, readings=own.readings))


Observations = Sequence[SphereObservation]
TableObservations = Sequence[TableObservation]


def by_scanner(observations: Observations) -> list[np.ndarray]:
    """Return which observations are of each scanner, in the order in which the cell lists scanners."""
    names = [(o.listed, o.scanner, o.carriers.scanner) for o in observations]
    in_order = sorted(dict.fromkeys(names), key=lambda name: name[0])
    return [np.flatnonzero([other == name for other in names]) for name in in_order]


def with_own_sigmas(
    observations: Observations, sphere: SphereSize, told_mm: float | None
) -> list[SphereObservation]:
    """Return observations of several scanners with the points' noise of each."""
    groups, found = by_scanner(observations), list(observations)
    if len(groups) > 1 and told_mm is None:
        for some in groups:
            pooled = pooled_point_sigma([observations[k] for k in some], sphere)
            for k in some:
                found[k] = replace(found[k], common_sigma_mm=found[k].common_sigma_mm or pooled)
    return found


def pooled_point_sigma(observations: Observations, sphere: SphereSize) -> float | None:
    """Return the points' noise across the sphere, pooled over the profiles; None without any.

    A profile meets the sphere's surface aslant: a distance in its plane is R/r times the distance to the sphere.
    """
    profiles = [o for o in observations if o.kind == "profile"]
    if not profiles:
        return None
    freedom = np.array([max(len(o.points_in_laser_mm) - 3, 1) for o in profiles])
    zones = np.array([min((o.circle_radius_mm or 0.0) / o.size(sphere).radius_mm, 1.0) for o in profiles])
    sigmas = zones * np.array([o.point_sigma_mm for o in profiles])
    return float(np.sqrt(np.average(sigmas**2, weights=freedom)))
