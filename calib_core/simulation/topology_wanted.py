"""What is simulated of a cell of any topology."""

from dataclasses import dataclass, field
from typing import Literal

from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.topology import (
    AxisOptions,
    BallOptions,
    ScannerOptions,
)


@dataclass(frozen=True)
class TopologyScenario:
    """A session of a cell of any topology; noise, robot and sensor are those of `cell`.

    Parameters
    ----------
    description : str
    scanners, balls, axes : tuple
    told : {"nothing", "names", "distances"}
        What the session says of its balls.
    distance_sigma_mm : float
        Of the distances between balls that the session tells.
    at_once : bool
        Every scanner captures at each stop; otherwise one after the other.
    machine : {"arm", "gantry", "scara", "linear"}
        What moves the flange: six axes, three translations, those and a turn about base's z, or one translation.
    on_axes : int
        Captures of each mounting of balls on an axis.
    scanner_scale : float
        By which a scanner's files are too large.
    scanners_err : float
        How much of what scanners err by each one does, as a share of 0.5 % of scale in x and z, 1 % of
        shear, 0.1 % of bow, 0.02 mm of each of three shapes by the angle of incidence.
    side_told : bool
        The session tells of one capture of each step on which side of the plane of light its ball is.
    scans : int
        Of the part, by each scanner before which anything moves it.
    """

    description: str
    scanners: tuple[ScannerOptions, ...] = (ScannerOptions(),)
    balls: tuple[BallOptions, ...] = (BallOptions(),)
    axes: tuple[AxisOptions, ...] = ()
    cell: TcpScenario = field(default_factory=TcpScenario)
    told: Literal["nothing", "names", "distances"] = "nothing"
    distance_sigma_mm: float = 0.01
    at_once: bool = False
    machine: Literal["arm", "gantry", "scara", "linear"] = "arm"
    on_axes: int = 16
    scanner_scale: float = 1.0
    scanners_err: float = 0.0
    side_told: bool = False
    scans: int = 0
