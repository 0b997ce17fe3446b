"""What a scanner sees of a sphere: its field of view, and the points that a capture will have."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.carriers import ball_on_flange
from calib_core.cell.walk import Carriers
from calib_core.chain.observations import SCANNER_ON_FLANGE, SphereObservation
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Cell, Measured

LEAST_OFFSET, MOST_OFFSET = 0.25, 0.88
"""How far a stripe should run beside the sphere's middle, in radii: circles of r/R from 0.47 to 0.97."""

_ARC_RAD = np.deg2rad(65.0)
_POINTS = 48  # of an arc in a prediction: more say the same
_NEAR_MM, _FAR_MM, _HALF_WIDTH_MM = 150.0, 250.0, 30.0  # where nothing is known of the scanner
_POINT_SIGMA_MM, _PITCH_MM = 0.03, 0.2
_LEAST_DEPTH_MM = 40.0
_BESIDE = 0.55  # radii: where a stripe that may run elsewhere still cuts the sphere


@dataclass(frozen=True)
class Sight:
    """A scanner's field of view in the plane of light, a trapezoid, and how it sees a sphere.

    Attributes
    ----------
    kind : {"profile", "cloud", "center"}
    near_mm, far_mm : float
        The distances that it measures, both positive: along z or against it.
    near_half_width_mm, far_half_width_mm : float
        Half the width there.
    facing : {1, -1}
        +1 where z grows away from the scanner.
    pitch_mm, point_sigma_mm : float
        Of the points along the stripe; across the surface.
    points_per_independent : float
        How many points say as much as one that errs by itself.
    arc_rad : float
        Up to which angle from its nearest point the sphere returns light.
    carriers : Carriers
        What carries scanner and sphere.
    """

    kind: str = "profile"
    near_mm: float = _NEAR_MM
    far_mm: float = _FAR_MM
    near_half_width_mm: float = _HALF_WIDTH_MM
    far_half_width_mm: float = _HALF_WIDTH_MM
    facing: int = 1
    pitch_mm: float = _PITCH_MM
    point_sigma_mm: float = _POINT_SIGMA_MM
    points_per_independent: float = 1.0
    arc_rad: float = _ARC_RAD
    carriers: Carriers = SCANNER_ON_FLANGE

    @property
    def middle_mm(self) -> FloatArray:
        """The middle of the field, (3,), in L."""
        return np.array([0.0, 0.0, self.facing * (self.near_mm + self.far_mm) / 2])

    def safest(self, radius_mm: float, side: float) -> FloatArray:
        """Return the place of the sphere's centre, (3,), from which its arc is farthest from the field's edges."""
        y = side * _BESIDE * radius_mm if self.kind == "profile" else 0.0
        circle = np.sqrt(radius_mm**2 - y**2)
        depth = (self.near_mm + self.far_mm) / 2 + circle * (1 + np.cos(self.arc_rad)) / 2
        return np.array([0.0, y, self.facing * depth])

    def half_width_at(self, depth_mm: FloatArray) -> FloatArray:
        """Return half the width of the field at distances (N,), mm."""
        span = max(self.far_mm - self.near_mm, 1e-9)
        share = np.clip((depth_mm - self.near_mm) / span, 0.0, 1.0)
        return self.near_half_width_mm + share * (self.far_half_width_mm - self.near_half_width_mm)

    def sees(self, centers: FloatArray, radius_mm: float, doubt_mm: FloatArray | float = 0.0) -> np.ndarray:
        """Return for which places of the sphere's centre in L, (N, 3), a capture will be good, (N,) bool.

        The arc must lie in the field wholly; of a profile the stripe must cut the sphere beside its middle, within
        `LEAST_OFFSET` and `MOST_OFFSET` radii.  Each place may be off by `doubt_mm` (N, 3).
        """
        doubt = np.broadcast_to(np.asarray(doubt_mm, dtype=float), centers.shape)
        x, y, z = np.abs(centers[:, 0]), np.abs(centers[:, 1]), centers[:, 2] * self.facing
        circle = np.sqrt(np.maximum(radius_mm**2 - y**2, 0.0)) if self.kind == "profile" else radius_mm
        nearest = z - circle - doubt[:, 2]
        farthest = z - circle * np.cos(self.arc_rad) + doubt[:, 2]
        across = x + circle * np.sin(self.arc_rad) + doubt[:, 0]
        inside = (nearest >= self.near_mm) & (farthest <= self.far_mm) & (across <= self.half_width_at(nearest))
        if self.kind == "profile":
            return inside & (y + doubt[:, 1] <= MOST_OFFSET * radius_mm) & (y >= LEAST_OFFSET * radius_mm)
        beside = y + radius_mm * np.sin(self.arc_rad) + doubt[:, 1]
        return inside & (beside <= self.half_width_at(nearest))

    def observation(
        self, name: str, base_from_tool0: RigidTransform, center: FloatArray, radius_mm: float
    ) -> SphereObservation:
        """Return what a capture will show, without noise, of a sphere at a place of L (3,)."""
        return replace(self._seen(name, base_from_tool0, center, radius_mm), carriers=self.carriers)

    def _seen(
        self, name: str, base_from_tool0: RigidTransform, center: FloatArray, radius_mm: float
    ) -> SphereObservation:
        if self.kind == "center":
            own = self.point_sigma_mm**2 * np.eye(3)
            none = np.empty((0, 3))
            return SphereObservation(name, base_from_tool0, "center", none, center, own, point_sigma_mm=0.0)
        if self.kind == "cloud":
            points, measured = self._cap(center, radius_mm)
            each = self.points_per_independent * len(points) / max(measured, 1.0)
            return SphereObservation(
                name, base_from_tool0, "cloud", points, center, 1e-6 * np.eye(3),
                point_sigma_mm=self.point_sigma_mm, points_per_independent=each,
            )  # fmt: skip
        circle = float(np.sqrt(max(radius_mm**2 - center[1] ** 2, (0.1 * radius_mm) ** 2)))
        # Evenly in x, as the sensor's columns are.
        sine = np.sin(self.arc_rad) * np.linspace(-1.0, 1.0, _POINTS)
        angle = np.arcsin(sine)
        x = center[0] + circle * np.sin(angle)
        z = center[2] - self.facing * circle * np.cos(angle)
        measured = 2 * circle * np.sin(self.arc_rad) / self.pitch_mm
        return SphereObservation(
            name, base_from_tool0, "profile", np.column_stack([x, np.zeros(_POINTS), z]),
            np.array([center[0], 0.0, center[2]]), 1e-6 * np.eye(3), circle, self.point_sigma_mm,
            1 if center[1] >= 0 else -1, self.points_per_independent * _POINTS / max(measured, 1.0),
        )  # fmt: skip

    def _cap(self, center: FloatArray, radius_mm: float) -> tuple[FloatArray, float]:
        """Return a few points (n, 3) of the cap that an area scanner sees, and how many it measures."""
        reach = radius_mm * np.sin(self.arc_rad)
        steps = np.linspace(-reach, reach, 9)
        across = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        across = across[np.hypot(*across.T) <= reach]
        height = np.sqrt(radius_mm**2 - np.sum(across**2, axis=1))
        points = center + np.column_stack([across, -self.facing * height])
        return points, np.pi * (reach / self.pitch_mm) ** 2


def sight_of(cell: Cell, captures: Sequence[Capture] = (), measured: Sequence[Measured] = ()) -> Sight:
    """Return a cell's sight: as its record tells it, else as its captures show it, else a common one."""
    scanner = cell.scanner
    kinds = [c.kind for c in captures if c.kind in ("profile", "cloud", "center")]
    kind = kinds[0] if kinds else scanner.kind if scanner.kind in ("cloud", "center") else "profile"
    seen = [m for m in measured if m.center_mm is not None and m.verdict != "fail"]
    carriers = Carriers("base", "tool0") if ball_on_flange(cell) else SCANNER_ON_FLANGE
    sight = replace(Sight(), kind=kind, carriers=carriers)
    depths = np.array([(m.center_mm or [0.0])[-1] for m in seen])
    facing = -1 if len(depths) and np.median(depths) < 0 else 1
    if scanner.z_axis is not None and not len(depths):
        facing = -1 if scanner.z_axis == "toward" else 1
    sight = replace(sight, facing=facing)
    if seen:
        sight = _as_seen(sight, seen, (cell.sphere_diameter_mm or 50.0) / 2)
    field = scanner.field_of_view
    if field is not None:
        sight = replace(
            sight,
            near_mm=field.near_mm,
            far_mm=field.far_mm,
            near_half_width_mm=field.near_width_mm / 2,
            far_half_width_mm=(field.far_width_mm or field.near_width_mm) / 2,
        )
    if scanner.pitch_mm is not None:
        sight = replace(sight, pitch_mm=scanner.pitch_mm)
    if scanner.point_sigma_mm is not None:
        sight = replace(sight, point_sigma_mm=scanner.point_sigma_mm)
    return sight


def _as_seen(sight: Sight, seen: Sequence[Measured], radius_mm: float) -> Sight:
    """Return the field that captures show to be there: where spheres were seen, and some way around."""
    # A profile's centre is (x, z), a cloud's (x, y, z).
    centers = np.array([(m.center_mm[0], m.center_mm[-1]) for m in seen if m.center_mm], dtype=float)
    z = np.abs(centers[:, -1])
    depth = max(float(np.ptp(z)), _LEAST_DEPTH_MM)
    middle = float(z.min() + z.max()) / 2
    half = max(float(np.abs(centers[:, :-1]).max()), 10.0) + radius_mm
    arcs = [np.deg2rad(m.extent_deg) / 2 for m in seen if m.extent_deg]
    sigmas = [m.point_sigma_mm for m in seen if m.point_sigma_mm]
    alike = [m.points_per_independent for m in seen if m.points_per_independent]
    pitches = [
        2 * m.radius_mm * np.sin(min(np.deg2rad(m.extent_deg) / 2, np.pi / 2)) / m.on_sphere
        for m in seen
        if m.radius_mm and m.extent_deg and m.on_sphere and m.kind == "profile"
    ]
    return replace(
        sight,
        near_mm=max(middle - depth / 2 - radius_mm, 1.0),
        far_mm=middle + depth / 2,
        near_half_width_mm=half,
        far_half_width_mm=half,
        arc_rad=float(np.clip(np.median(arcs), 0.5, 1.3)) if arcs else sight.arc_rad,
        point_sigma_mm=float(np.median(sigmas)) if sigmas else sight.point_sigma_mm,
        pitch_mm=float(np.median(pitches)) if pitches else sight.pitch_mm,
        points_per_independent=float(np.median(alike)) if alike else sight.points_per_independent,
    )
