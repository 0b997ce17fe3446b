"""What the TCP's solver is given beside captures: what the user fixes, and what is believed."""

from dataclasses import dataclass, field

from calib_core.arms.errors import ArmTerm
from calib_core.cell.layout import KnownDistance, Layout, MovedAxis
from calib_core.chain.observations import SphereSize
from calib_core.chain.scanner import ScannerPriors


@dataclass(frozen=True)
class TcpOptions:
    """Standard deviations that the user fixes (None: estimated), and what is believed of the scanner.

    `apply_scanner`: scale, shear and bow that are found are taken out of the points, and the tool is that of such
    points; otherwise it belongs to the files as they are, and the errors are in its covariance alone.
    `arm_terms`: those that observations' `arm_moves` are of; `apply_arm`: the arm's errors are taken out of the
    poses where other poses are predicted better by that, and the tool is that of such poses.
    `taken_at_s`: when captures were taken, by their ids.  `axes`: those that the cell names, with the standard
    deviations of their readings, rad or mm.  `distances`: told ones of balls.
    """

    position_sigma_mm: float | None = None
    orientation_sigma_rad: float | None = None
    point_sigma_mm: float | None = None
    priors: ScannerPriors = field(default_factory=ScannerPriors)
    apply_scanner: bool = False
    taken_at_s: tuple[tuple[str, float], ...] = ()
    axes: tuple[MovedAxis, ...] = ()
    axis_sigmas: tuple[float | None, ...] = ()
    arm_terms: tuple[ArmTerm, ...] = ()
    apply_arm: bool = False
    distances: tuple[KnownDistance, ...] = ()

    def sigmas_of(self, layout: Layout) -> list[float | None]:
        """Return what is told of the readings of some of the axes."""
        told = dict(zip((axis.name for axis in self.axes), self.axis_sigmas, strict=True))
        return [told[axis.name] for axis in layout.axes]


@dataclass(frozen=True)
class TcpGiven:
    """What a solution rests on: the sphere as told or assumed, and the options."""

    sphere: SphereSize
    options: TcpOptions
