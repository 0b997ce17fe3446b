"""The TCP as it was solved, with its evidence by subject."""

from dataclasses import dataclass, field

import numpy as np

from calib_core.arms.errors import ArmTerm
from calib_core.cell.layout import KnownDistance, Layout, MovedAxis
from calib_core.chain.answer import Answer
from calib_core.chain.arm_model import ArmModel
from calib_core.chain.bend import Bends
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.encoder_scales import EncoderScales
from calib_core.chain.held import Held
from calib_core.chain.incidents import Happened
from calib_core.chain.influence import Influence
from calib_core.chain.moved import OpticsError
from calib_core.chain.observations import SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.chain.two_step import TwoStepAnswer
from calib_core.chain.undetermined import OpenDirection
from calib_core.chain.unmodelled import Unmodelled
from calib_core.chain.warm_up import WarmUp
from calib_core.chain.without_turns import OpenShifts
from calib_core.frames import FloatArray
from calib_core.messages import Value


@dataclass(frozen=True)
class TcpOptions:
    """Standard deviations that the user fixes (None: estimated), and what is believed of the scanner.

    `apply_scanner`: scale, shear and bow that are found are taken out of the points, and the tool is that of such
    points; otherwise it belongs to the files as they are, and the errors are in its covariance alone.
    `arm_terms`: those that observations' `arm_moves` are of; `apply_arm`: the arm's errors are taken out of the
    poses where other poses are predicted better by that, and the tool is that of such poses.
    `taken_at_s`: when captures were taken, by their ids.  `axes`: those that the cell names, with the standard
    deviations of their readings, rad or mm, and what is asked of each one's encoder.  `distances`: told ones of
    balls.
    """

    position_sigma_mm: float | None = None
    orientation_sigma_rad: float | None = None
    point_sigma_mm: float | None = None
    priors: ScannerPriors = field(default_factory=ScannerPriors)
    apply_scanner: bool = False
    taken_at_s: tuple[tuple[str, float], ...] = ()
    axes: tuple[MovedAxis, ...] = ()
    axis_sigmas: tuple[float | None, ...] = ()
    axis_scales: tuple[bool | None, ...] = ()
    arm_terms: tuple[ArmTerm, ...] = ()
    apply_arm: bool = False
    distances: tuple[KnownDistance, ...] = ()

    def sigmas_of(self, layout: Layout) -> list[float | None]:
        """Return what is told of the readings of some of the axes."""
        told = dict(zip((axis.name for axis in self.axes), self.axis_sigmas, strict=True))
        return [told[axis.name] for axis in layout.axes]

    def scales_of(self, layout: Layout) -> list[bool | None]:
        """Return what is asked of the encoders of some of the axes."""
        told = dict(zip((axis.name for axis in self.axes), self.axis_scales, strict=False))
        return [told.get(axis.name) for axis in layout.axes]


@dataclass(frozen=True)
class TcpGiven:
    """What a solution rests on: the sphere as told or assumed, and the options."""

    sphere: SphereSize
    options: TcpOptions


@dataclass(frozen=True, eq=False)
class TcpNoise:
    """What scatters.

    Attributes
    ----------
    sigmas : Sigmas
        Pose scatter, given or estimated.
    point_sigma_mm : float or None
        Noise of a profile's point, given or from the fits.
    measured_point_sigma_mm : float or None
        From the fits alone.
    points_per_independent : float
        How many of a capture's points say as much as an independent one (median).
    """

    sigmas: Sigmas
    point_sigma_mm: float | None
    measured_point_sigma_mm: float | None
    points_per_independent: float


@dataclass(frozen=True, eq=False)
class SidesChosen:
    """On which side of each profile the sphere's centre is taken to be.

    Attributes
    ----------
    rival_scatter_mm, scatter_mm
        How well the best other choice would fit, beside the chosen one.
    log_odds : float or None
        By how much (natural logarithm) all points find the chosen sides likelier than others; None: not in doubt.
    """

    rival_scatter_mm: float | None
    scatter_mm: float
    log_odds: float | None


@dataclass(frozen=True, eq=False)
class EachCapture:
    """What is known of each capture (K).

    Attributes
    ----------
    ids, points, used, sides, squared_distance
        Its id, its points, whether it is used, the sign of y (0: none), Mahalanobis distance² from the others.
    zones : list of float or None
        Of a profile its circle's radius beside the sphere's.
    reasons : dict
        By id, why those that are not used are not.
    weights : (K,)
        By how much its pose counts less than that of one that lies well, 1 … 0.
    influence : Influence
        How the answer would move without it.
    side_choice : SidesChosen
        How clear the sides are.
    """

    ids: list[str]
    points: list[int]
    used: np.ndarray
    sides: np.ndarray
    zones: list[float | None]
    reasons: dict[str, dict[str, Value]]
    squared_distance: FloatArray
    weights: FloatArray
    influence: Influence
    side_choice: SidesChosen


@dataclass(frozen=True, eq=False)
class LeftOpen:
    """What the captures leave open; `shifts`: along which the scanner's place is open, as nothing turned."""

    undetermined: list[OpenDirection]
    weak: list[OpenDirection]
    shifts: OpenShifts


@dataclass(frozen=True, eq=False)
class TwoStep:
    """The paper's method on the same captures.

    Attributes
    ----------
    answer : Answer or None
    covariance, beside_joint : (6, 6) or None
        Of that answer, and of how it differs from the joint one.
    groups : TwoStepAnswer
        Its groups of pure translations, or the reason why there is no answer.
    """

    answer: Answer | None
    covariance: FloatArray | None
    beside_joint: FloatArray | None
    groups: TwoStepAnswer


@dataclass(frozen=True, eq=False)
class BesideModel:
    """What happened beside what the model has.

    Attributes
    ----------
    excess : float
        By how much the captures scatter more than the sigmas say (variance ratio).
    causes : list of Happened
        What happened to the captures, where one cause explains several.
    warm_up : WarmUp or None
        How far scanner or sphere drifted meanwhile.
    bends : tuple of Bend
        Of the sheets of light, where the captures show it.
    unmodelled : Unmodelled or None
        What the answer has no room for, beyond chance.
    optics : tuple of OpticsError
        What camera and plane of light put into it, where the session's own frames gave them.
    """

    excess: float
    causes: list[Happened]
    warm_up: WarmUp | None
    bends: Bends
    unmodelled: Unmodelled | None
    optics: tuple[OpticsError, ...] = ()


@dataclass(frozen=True, eq=False)
class InView:
    """What the answer means for a point that is measured.

    Attributes
    ----------
    seen_mm, at_point : (3,), (3, 3)
        `seen_point`, and the covariance of a point that is measured there, along the flange's axes, mm and mm².
    at_workpiece : (3, 3)
        The same in base as the arm tells it.
    """

    seen_mm: FloatArray
    at_point: FloatArray
    at_workpiece: FloatArray

    @property
    def stated_mm(self) -> float:
        """How far off a point measured at the workpiece may be in the worst direction (k = 2)."""
        return 2 * float(np.sqrt(np.linalg.eigvalsh(self.at_point)[-1]))


@dataclass(frozen=True, eq=False)
class TcpSolution:
    """The TCP with its evidence.

    Attributes
    ----------
    joint : Answer
        The joint maximum likelihood: the answer.
    covariance : (9, 9)
        rx ry rz tx ty tz of mount_from_laser, the sphere's centre.
    held : Held
        What was found of the scanner, whether the tool has it, and how both are correlated.
    arm : ArmModel or None
        The arm's own errors, where its joints are known.
    encoders : dict
        What the captures say of the axes under the robot.
    as_told : Held or None
        The answer for the controller's own poses, where those of this one are corrected by the arm's errors.
    """

    joint: Answer
    covariance: FloatArray
    held: Held
    noise: TcpNoise
    each: EachCapture
    left_open: LeftOpen
    by_two_steps: TwoStep
    beside: BesideModel
    in_view: InView
    given: TcpGiven
    encoders: EncoderScales
    arm: ArmModel | None = None
    as_told: Held | None = None
