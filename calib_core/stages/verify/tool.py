"""The tool that is verified."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.captures.placement import sheet_per_mm_of, sheets_per_mm_of
from calib_core.cell.found import as_used, mounts_of
from calib_core.chain.bend import in_one_plane
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records.results import FoundFrame
from calib_core.stages.tcp.record import ToolResult
from calib_core.stages.undetermined_places import FAR_MM
from calib_core.stages.verify.arm_scatter import ArmScatter
from calib_core.stages.verify.scanner_scatter import ScannerScatter


@dataclass(frozen=True, eq=False)
class Tool:
    """The tool that is verified.

    Parameters
    ----------
    mount_from_laser : RigidTransform
    covariance : (6, 6)
        Rotation perturbing on the right, rad and mm; zeros where it is taken as exact.
    position_sigma_mm, orientation_sigma_rad : float
        Of the robot's poses.
    axis_moves : mapping
        By captures, how one sigma of each error of the cell's axes turns and shifts the robot (6, n), rad and mm,
        as seen from what carries the ball.
    others : mapping
        Of several scanners, the pose of each on what carries it by its name, and its covariance.
    sheet_per_mm : float
        How far the light lies off its plane along y, over the square of x.
    sheets_per_mm : mapping
        The same of several scanners by their names.
    arm : ArmScatter or None
        What the arm's errors put into captures together.
    scatter_freedom : float
        From how many degrees of freedom the robot's scatter is known; infinite where nothing of it is open.
    scanner : ScannerScatter or None
        What the scanner's own errors put into captures together.
    others_scatter : mapping
        The same of several scanners by their names.
    spheres : sequence of (str, str, (3,))
        The balls that the answer has, by name: what carries each, and where its centre is there.
    left_open : (m, 3)
        Along what the answer leaves the scanner's place open, on what carries it: nothing needs it there.
    """

    mount_from_laser: RigidTransform
    covariance: FloatArray
    position_sigma_mm: float = 0.0
    orientation_sigma_rad: float = 0.0
    axis_moves: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    others: Mapping[str, tuple[RigidTransform, FloatArray]] = field(
        default_factory=dict[str, tuple[RigidTransform, FloatArray]]
    )
    sheet_per_mm: float = 0.0
    sheets_per_mm: Mapping[str, float] = field(default_factory=dict[str, float])
    arm: ArmScatter | None = None
    scatter_freedom: float = np.inf
    scanner: ScannerScatter | None = None
    others_scatter: Mapping[str, ScannerScatter] = field(default_factory=dict[str, ScannerScatter])
    spheres: Sequence[tuple[str, str, FloatArray]] = ()
    left_open: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    @classmethod
    def of(cls, answer: ToolResult) -> "Tool":
        """Return the tool of a stage's answer."""
        parts, used = answer.variance_components, as_used(answer.model_dump())
        return cls(
            answer.mount_from_laser,
            np.array(used["covariance"], dtype=float),
            parts.position_sigma_mm,
            parts.orientation_sigma_rad,
            others=mounts_of(map(FoundFrame.model_validate, used["frames"])),
            sheet_per_mm=sheet_per_mm_of(used),
            sheets_per_mm=sheets_per_mm_of(used),
            arm=ArmScatter.of(answer),
            scanner=None if isinstance(answer.scanner, str | None) else ScannerScatter.of(answer.scanner),
            others_scatter={name: ScannerScatter.of(one) for name, one in (answer.scanner_errors or {}).items()},
            spheres=[(one.name, one.carrier, np.array(one.center_mm)) for one in answer.spheres],
            scatter_freedom=np.inf if parts.degrees_of_freedom is None else parts.degrees_of_freedom,
            left_open=np.reshape(answer.up_to_shift.directions if answer.up_to_shift else [], (-1, 3)),
        )._without_far()

    def straightened(
        self, observations: Observations, center_mm: FloatArray, radius_mm: float
    ) -> list[SphereObservation]:
        """Return profiles in one plane where the light is bent, of balls (3,) or (K, 3) on what carries them."""
        found: list[SphereObservation] = []
        for o, at in zip(observations, np.broadcast_to(center_mm, (len(observations), 3)), strict=True):
            own = self.of_scanner(o.scanner)
            seen = (o.ball_from_scanner @ own.mount_from_laser).inverse().apply(at)
            found += in_one_plane([o], own.sheet_per_mm, seen[None], radius_mm) if own.sheet_per_mm else [o]
        return found

    @property
    def exact(self) -> "Tool":
        """The same taken as exact: nothing of the arm's errors cancels with its own."""
        return replace(self, covariance=np.zeros((6, 6)), scanner=None, arm=self.arm and self.arm.of_other())

    def places(self, seen: SphereObservation) -> bool:
        """Return whether it says where the scanner of an observation is."""
        return self.of_scanner(seen.scanner).mount_from_laser.into == seen.carriers.scanner and (
            not self.others or not seen.scanner or seen.scanner in self.others
        )

    def ball_of(self, seen: SphereObservation, sphere: SphereSize) -> str:
        """Return which of several balls of the answer an observation shows where it stood; empty where none."""
        there = [name for name, carrier, _ in self.spheres if carrier == seen.carriers.ball]
        nearest, away_mm, _ = self.nearest_ball(seen, sphere)
        return nearest if len(there) > 1 and away_mm < seen.size(sphere).radius_mm else ""

    def nearest_ball(self, seen: SphereObservation, sphere: SphereSize) -> tuple[str, float, FloatArray]:
        """Return the answer's ball nearest to what was seen: name, how far off, centre on its carrier.

        Where the answer has none there, it is what was seen.
        """
        way = seen.ball_from_scanner @ self.of_scanner(seen.scanner).mount_from_laser
        sides = (seen.side,) if seen.side else (1, -1)
        centers = [way.apply(seen.sphere_center_in_laser_mm(sphere, side)) for side in sides]
        there = [
            (min(float(np.linalg.norm(one - at)) for one in centers), name, at)
            for name, carrier, at in self.spheres
            if carrier == seen.carriers.ball and np.isfinite(at).all()
        ]
        away_mm, name, at = min(there, key=lambda one: one[0], default=(np.inf, "", centers[0]))
        return name, away_mm, at

    def of_scanner(self, name: str) -> "Tool":
        """Return the same for another scanner's own mount; the first one's where that is not known."""
        if name not in self.others:
            return self
        mount, covariance = self.others[name]
        return replace(
            self,
            mount_from_laser=mount,
            covariance=covariance,
            sheet_per_mm=self.sheets_per_mm.get(name, 0.0),
            scanner=self.others_scatter.get(name),
            arm=self.arm and self.arm.of_other(),
            left_open=self.left_open if mount.into == self.mount_from_laser.into else np.empty((0, 3)),
        )._without_far()

    def _without_far(self) -> "Tool":
        """Return the same with what is known to metres alone left open: nothing that it is used for needs it."""
        variances, turn = np.linalg.eigh(self.covariance[3:, 3:])
        far = turn[:, variances > FAR_MM**2].T
        if not len(far):
            return self
        kept = np.eye(6)
        kept[3:, 3:] -= far.T @ far
        return replace(
            self,
            covariance=kept @ self.covariance @ kept.T,
            left_open=np.vstack([self.left_open, far]),
            scanner=self.scanner and replace(self.scanner, with_tool=kept @ self.scanner.with_tool),
            arm=self.arm and self.arm.of_other(),
        )
