"""The simulated cells by name: what is measured, how noisy it is, and what goes wrong."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

CaptureKind = Literal["profile", "cloud", "center"]
Fault = Literal["moved-sphere", "wrong-pose"]


@dataclass(frozen=True)
class TcpScenario:
    """A session of TCP captures on the simulated cell; the defaults are the cell of the method.

    Lengths in millimetres.  Sigmas are standard deviations per axis.

    Parameters
    ----------
    translations : int
        Captures at one orientation (the first ones).
    orientations : int
        Captures at orientations of their own.
    kinds : tuple of str
        What the scanner delivers, in turn over the captures.
    orientation_range_rad : float
        The components of an orientation's rotation vector are uniform in plus or minus this.
    pivot : bool
        Hold the sphere at one place of the scanner's frame, so that only orientation changes.
    point_sigma_mm : float
        Of a measured point's distance to the sphere.  The error acts along the scanner's ray at the exact x of the
        column, as large as it takes to give this distance: the residuals of all points are alike.
    center_sigma_mm : float
        Per axis, of the centres that a scanner of kind `center` reports.
    position_sigma_mm, orientation_sigma_rad : float
        The robot's pose errors: the recorded pose is the commanded one, the true pose is off by these.
    equal_orientation_sigma_rad : float
        How far the commanded orientations of "equal" orientation are apart.
    sphere_diameter_mm : float
        The diameter that the session states.
    sphere_diameter_sigma_mm : float
        The standard deviation of the true diameter about the stated one; stated only where it is not zero.
    lateral_mm, near_mm, far_mm : float
        Where the sphere's centre is seen: within ±lateral along x, near to far along z.
    offset_low, offset_high : float
        The centre's distance from the plane of light, in radii, on either side.
    arc_deg : float
        The sphere returns light up to this angle from the point nearest to the scanner, on the stripe's circle.
    pitch_mm, window_x_mm, window_near_mm, window_far_mm : float
        The sensor's columns (x from −window to +window) and the z range in which it measures.
    background : bool
        The sphere's stand and the table below it are seen too.
    stray_fraction : float
        The fraction of empty columns with a stray point; a fifth of it replaces points of the arc.
    faults : tuple of str
        What is wrong, one capture each: the sphere has `moved_mm`, or the recorded pose is another capture's.
    sigmas : {"given", "estimated"}
        Whether the session states the sigmas or leaves them to the solver.
    length_unit : {"mm", "m"}
        The unit of the numbers in the files; metres are the user's mistake to be found.
    ball_on_flange : bool
        The robot carries the sphere before a scanner that stands still.
    """

    description: str = "profiles of a 40 mm sphere: 4 translations and 10 orientations"
    translations: int = 4
    orientations: int = 10
    kinds: tuple[CaptureKind, ...] = ("profile",)
    orientation_range_rad: float = 0.6
    pivot: bool = False
    point_sigma_mm: float = 0.02
    center_sigma_mm: float = 0.02
    position_sigma_mm: float = 0.05
    orientation_sigma_rad: float = 0.0002
    equal_orientation_sigma_rad: float = 1e-5
    sphere_diameter_mm: float = 40.0
    sphere_diameter_sigma_mm: float = 0.0
    lateral_mm: float = 20.0
    near_mm: float = 150.0
    far_mm: float = 230.0
    offset_low: float = 0.2
    offset_high: float = 0.8
    arc_deg: float = 65.0
    pitch_mm: float = 0.1
    window_x_mm: float = 50.0
    window_near_mm: float = 80.0
    window_far_mm: float = 400.0
    background: bool = False
    stray_fraction: float = 0.0
    faults: tuple[Fault, ...] = ()
    moved_mm: float = 3.0
    sigmas: Literal["given", "estimated"] = "given"
    length_unit: Literal["mm", "m"] = "mm"
    ball_on_flange: bool = False


SCENARIOS: Mapping[str, TcpScenario] = MappingProxyType(
    {
        "tcp": TcpScenario(),
        "tcp-unknown-sigmas": TcpScenario("the same; noise and repeatability are not told", sigmas="estimated"),
        "tcp-background": TcpScenario("the same with the sphere's stand and the table in view", background=True),
        "tcp-stray": TcpScenario("the same with stray points on every profile", stray_fraction=0.25),
        "tcp-clipped": TcpScenario(
            "the same with a small measuring range that cuts many arcs", window_x_mm=20.0, window_near_mm=137.0
        ),
        "tcp-moved-sphere": TcpScenario("in one capture the sphere stood 3 mm beside", faults=("moved-sphere",)),
        "tcp-wrong-pose": TcpScenario("one capture has the pose of another", faults=("wrong-pose",)),
        "tcp-spoiled": TcpScenario(
            "one moved sphere and one wrong pose among 14 captures", faults=("moved-sphere", "wrong-pose")
        ),
        "tcp-rotation-only": TcpScenario(
            "12 orientations with the sphere always at one place of the profile",
            translations=0,
            orientations=12,
            pivot=True,
        ),
        "tcp-translation-only": TcpScenario("8 captures of one orientation", translations=8, orientations=0),
        "tcp-metres": TcpScenario("the files are in metres though they say millimetres", length_unit="m"),
        "tcp-clouds": TcpScenario("an area scanner: clouds of the sphere", kinds=("cloud",)),
        "tcp-centers": TcpScenario("a scanner that reports the sphere's centre itself", kinds=("center",)),
        "fixed-scanner": TcpScenario("the scanner stands still, the robot moves the ball", ball_on_flange=True),
        "fixed-scanner-unknown-sigmas": TcpScenario(
            "the same; noise and repeatability are not told", ball_on_flange=True, sigmas="estimated"
        ),
        "fixed-scanner-spoiled": TcpScenario(
            "the same; once the ball had slipped, once the pose is another capture's",
            ball_on_flange=True,
            faults=("moved-sphere", "wrong-pose"),
        ),
        "tcp-mixed": TcpScenario("profiles, clouds and centres in turn", kinds=("profile", "cloud", "center")),
    }
)
