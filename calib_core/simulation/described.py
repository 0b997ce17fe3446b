"""A described cell to be simulated: its edges; where nothing is told, as the other simulated cells have it."""

from dataclasses import replace

from calib_core.records.described import DescribedAxis, DescribedCell, DescribedSphere
from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.topology import AxisOptions, BallOptions, ScannerOptions
from calib_core.simulation.topology_wanted import TopologyScenario

_STILL_MM = ((900.0, 150.0, 420.0), (850.0, 60.0, 470.0), (960.0, 250.0, 380.0), (770.0, 190.0, 440.0))
_OFF_AXIS_MM = ((35.0, 10.0, 60.0), (-25.0, 20.0, 75.0), (15.0, -30.0, 66.0), (-20.0, -25.0, 70.0))


def scenario_of(told: DescribedCell) -> TopologyScenario:
    """Return how a described cell is simulated."""
    still = told.arrangement == "sphere-on-robot"
    named = told.scanners or {}
    scanners = tuple(ScannerOptions(name, one.on, 0.3 * n) for n, (name, one) in enumerate(named.items())) or (
        ScannerOptions(on="base" if still else "tool0"),
    )
    axes = tuple(_axis(axis, told.axes or []) for axis in told.axes or ())
    ends = dict.fromkeys(one.on for one in scanners)
    objects = [axis.name for axis in axes if axis.carries == "object"]
    usual = "tool0" if scanners[0].on == "base" else "base"
    carriers = [ball.on or usual for ball in told.spheres or ()] or [
        *("base" for on in ends if on == "tool0"), *("tool0" for on in ends if on == "base"), *objects[-1:] * 2
    ]  # fmt: skip
    spheres = told.spheres or [DescribedSphere(name=f"ball{n + 1}") for n in range(len(carriers))]
    balls = tuple(
        _ball(ball, on, carriers[:n].count(on), axes, told.sphere_diameter_mm)
        for n, (ball, on) in enumerate(zip(spheres, carriers, strict=True))
    )
    cell = TcpScenario(
        window_x_mm=100.0, kinds=(told.kind,), point_sigma_mm=told.point_sigma_mm,
        sphere_diameter_mm=told.sphere_diameter_mm,
    )  # fmt: skip
    if told.machine in ("gantry", "linear"):
        cell = replace(cell, translations=14, orientations=0)
    names = "names" if told.spheres else "nothing"
    before_axes = bool(objects) and "base" in ends
    return TopologyScenario(
        "a described cell", scanners, balls, axes, cell, names, machine=told.machine,
        side_told=before_axes or told.machine == "linear", scans=told.scans,
    )  # fmt: skip


def _axis(axis: DescribedAxis, axes: list[DescribedAxis]) -> AxisOptions:
    turning = [one.name for one in axes if one.kind == "rotary" and one.carries == "object"]
    tilts = axis.name in turning[:-1] or (axis.kind, axis.carries) == ("linear", "robot")
    usual = (0.0, 1.0, 0.0) if tilts else (1.0, 0.0, 0.0) if axis.kind == "linear" else (0.0, 0.0, 1.0)
    low, high = axis.ways(
        180.0 if axis.name in turning[-1:] else 40.0, 500.0 if axis.carries == "robot" else 120.0
    )
    found = AxisOptions(
        axis.name, axis.kind, axis.carries, axis.on, low=low, high=high, direction=axis.direction or 1,
        direction_in_base=_three(axis.axis_direction, usual), sigma=0.02 if axis.kind == "linear" else 5e-5,
    )  # fmt: skip
    return replace(found, point_in_base_mm=_three(axis.axis_point_mm, found.point_in_base_mm))


def _ball(
    ball: DescribedSphere, on: str, before: int, axes: tuple[AxisOptions, ...], diameter_mm: float
) -> BallOptions:
    """Return a ball on what carries it, `before` others there already."""
    place = _STILL_MM[before % 4]
    if on == "tool0":
        place = (25.0, -40.0 + 50.0 * before, 130.0)
    elif on != "base":
        under = next(axis for axis in axes if axis.name == on).point_in_base_mm
        place = tuple(a + b for a, b in zip(under, _OFF_AXIS_MM[before % 4], strict=True))
    mount = None if on in ("base", "tool0") else ball.name
    return BallOptions(ball.name, on, _three(ball.center_mm, place), ball.diameter_mm or diameter_mm, mount)


def _three(told: list[float] | None, usual: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = told or usual
    return x, y, z
