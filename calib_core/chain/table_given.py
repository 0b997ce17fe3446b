"""What the turntable's solver is given beside captures: the tool of the stage before, and what the user fixes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from calib_core.cell.layout import KnownDistance, MovedAxis
from calib_core.chain.arm_model import ArmModel
from calib_core.chain.bend import Bends
from calib_core.chain.held import Held
from calib_core.chain.model import ChainState
from calib_core.chain.scanner import ScannerPriors
from calib_core.chain.table_start import Mounts
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.variance import GivenSigmas
from calib_core.frames import RigidTransform


@dataclass(frozen=True)
class KnownTool:
    """The tool of the stage before, what was found of the scanner with it (None: both exact), and the two steps'.

    `mount_from_laser` is the answer of that stage, `arm` what its poses were corrected by, `bends` its points.
    Beside an exact one `late` has by name where others are about, whose places are sought with the table.  Where
    nothing places any, all of it is sought, beginning with what balls on axes say of themselves.
    """

    mount_from_laser: RigidTransform
    held: Held | None = None
    two_step: RigidTransform | None = None
    arm: ArmModel | None = None
    bends: Bends = ()
    late: Mapping[str, RigidTransform] = field(default_factory=dict[str, RigidTransform])
    sought: TcpSolution | None = None

    @property
    def state(self) -> ChainState | None:
        """All that is known of scanners and of axes under the robot, or that a search begins with."""
        known = self.held or (self.sought and self.sought.held)
        return known and known.state

    @property
    def mounts(self) -> Mounts:
        """The answer of that stage, of several scanners by their names."""
        if self.late:
            return self.late
        state = self.state
        if state is None or len(state.walk.layout.mounts) == 1:
            return self.mount_from_laser
        return {name: state.mount(n) for n, (name, _) in enumerate(state.walk.layout.mounts)}


@dataclass(frozen=True)
class TurntableOptions:
    """Standard deviations that the user fixes (None: estimated), and what is asked of the encoder.

    `direction` is the cell's; `encoder_scale` asks for the encoder's scale as an unknown (False: never; None: if
    the captures leave no doubt that it is off).  `angles_unknown`: the angles were found from the captures.
    `axes`: those of the cell where it names them, with the standard deviations of their readings, rad or mm, and
    what is asked of each one's encoder.
    `distances`: known ones of balls on them.
    """

    position_sigma_mm: float | None = None
    orientation_sigma_rad: float | None = None
    point_sigma_mm: float | None = None
    angle_sigma_rad: float | None = None
    direction: int | None = None
    encoder_scale: bool | None = None
    angles_unknown: bool = False
    axes: tuple[MovedAxis, ...] = ()
    axis_sigmas: tuple[float | None, ...] = ()
    axis_scales: tuple[bool | None, ...] = ()
    distances: tuple[KnownDistance, ...] = ()
    priors: ScannerPriors = field(default_factory=ScannerPriors)

    def scale_asked(self, axis: int) -> bool | None:
        """Return what is asked of an axis's encoder, by the axis's number."""
        return self.axis_scales[axis] if self.axes else self.encoder_scale

    @property
    def sigmas(self) -> GivenSigmas:
        """Position, orientation, and the readings of all axes."""
        readings = self.axis_sigmas if self.axes else (self.angle_sigma_rad,)
        return self.position_sigma_mm, self.orientation_sigma_rad, *readings
