"""A simulated cell of any topology: where its scanners, balls and axes truly are, and how it moves.

Its own forward model: what an axis carries is turned or shifted about a line that is fixed in base as all axes
read zero, and then by the axis that this one stands on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from calib_core.simulation.motion import FloatArray, back, pose, turn

Readings = Mapping[str, float]


@dataclass(frozen=True)
class AxisOptions:
    """An axis of a simulated cell.

    Parameters
    ----------
    name, kind, carries, on
        As the cell's record has them.
    direction_in_base, point_in_base_mm : tuple of float
        Where it nominally lies at zero; it leans from there by up to 0.03 rad and stands up to 40 mm beside.
    low, high : float
        Between which readings it moves, in degrees or mm.
    sigma : float
        Of its reading, in rad or mm.
    direction : {1, -1}
        Whether it moves along or against `direction_in_base` where readings grow.
    scale : float
        What it moves for each unit read.
    wobble_rad : float
        It leans by this, twice around at each turn, or once along the way of a linear axis.
    eccentric : float
        Its reading is off by this once around, in rad or mm.
    unit : float
        By which a recorded reading is multiplied; 0.001 where the user takes metres for mm.
    """

    name: str
    kind: Literal["rotary", "linear"]
    carries: Literal["object", "robot"] = "object"
    on: str | None = None
    direction_in_base: tuple[float, float, float] = (0.0, 0.0, 1.0)
    point_in_base_mm: tuple[float, float, float] = (1000.0, -250.0, 380.0)
    low: float = -180.0
    high: float = 180.0
    sigma: float = 5e-5
    direction: Literal[1, -1] = 1
    scale: float = 1.0
    wobble_rad: float = 0.0
    eccentric: float = 0.0
    unit: float = 1.0


@dataclass(frozen=True)
class BallOptions:
    """A ball of a simulated cell; balls of one `mount` stand there together.

    `at_mm` is its place in base, as all axes read zero, or on the flange.
    """

    name: str = "sphere"
    on: str = "base"
    at_mm: tuple[float, float, float] = (900.0, 150.0, 420.0)
    diameter_mm: float = 40.0
    mount: str | None = None


@dataclass(frozen=True)
class ScannerOptions:
    """A scanner of a simulated cell.

    On the flange it is turned by `beside_rad` about the axis across its plane of light through the middle of its
    range: two of them see one ball at once.  In base it looks at `aim_mm`, obliquely down; or with its plane of
    light lying flat, at the balls on axes, so that one on a table stays in its light.
    """

    name: str = ""
    on: Literal["tool0", "base"] = "tool0"
    beside_rad: float = 0.0
    aim_mm: tuple[float, float, float] = (900.0, 150.0, 420.0)


@dataclass(frozen=True, eq=False)
class AxisTruth:
    """Where an axis truly lies in base at zero, (3,) both, and its options."""

    options: AxisOptions
    direction: FloatArray
    point_mm: FloatArray

    def motion(self, reading: float) -> FloatArray:
        """Return how it moves what it carries, (4, 4) in base, at a true reading in degrees or mm."""
        o = self.options
        amount = o.direction * o.scale * reading
        if o.kind == "linear":
            lean = turn(o.wobble_rad * reading / max(o.high - o.low, 1.0) * np.array([0.0, 0.0, 1.0]))
            return pose(lean, amount * self.direction + self.point_mm - lean @ self.point_mm)
        angle = float(np.deg2rad(amount))
        across = np.cross(self.direction, [0.3, 0.5, 0.8])
        wobble = turn(o.wobble_rad * (turn(2 * angle * self.direction) @ across))
        rotation = wobble @ turn(angle * self.direction)
        return pose(rotation, self.point_mm - rotation @ self.point_mm)

    def frame(self, beside: FloatArray | None) -> FloatArray:
        """Return base_from_axis (4, 4): z along it, x across z in the plane of z and the base's x (or its y).

        Its origin is on the axis, beside the first ball (3,) that it carries itself.
        """
        aside = np.eye(3)[0 if abs(self.direction[0]) < 0.9 else 1]
        across = aside - (aside @ self.direction) * self.direction
        across = across / float(np.sqrt(across @ across))
        rotation = np.array([across, np.cross(self.direction, across), self.direction], dtype=float).T
        along = 0.0 if beside is None else (beside - self.point_mm) @ self.direction
        return pose(rotation, self.point_mm + along * self.direction)


@dataclass(frozen=True, eq=False)
class TopologyWorld:
    """The truth of a simulated cell.

    Parameters
    ----------
    scanners : dict
        carrier_from_laser (4, 4) by the scanner's name.
    balls : dict
        Where each ball is (3,), in base as all axes read zero, or on the flange.
    radii_mm : dict
    axes : dict
        In the order of the cell, each after the one that carries it.
    """

    scanners: Mapping[str, tuple[ScannerOptions, FloatArray]]
    balls: Mapping[str, tuple[BallOptions, FloatArray]]
    radii_mm: Mapping[str, float]
    axes: Mapping[str, AxisTruth]

    def under(self, axis: str) -> str:
        """Return what an axis stands on."""
        own = self.axes[axis].options
        before = [name for name, other in self.axes.items() if other.options.carries == own.carries]
        place = before.index(axis)
        return own.on or (before[place - 1] if place else "base")

    def moved(self, axis: str, where: Readings) -> FloatArray:
        """Return how what an axis carries has moved in base, (4, 4), at true readings."""
        own = self.axes[axis].motion(where.get(axis, 0.0))
        under = self.under(axis)
        return own if under == "base" else self.moved(under, where) @ own

    def base_from_foot(self, where: Readings) -> FloatArray:
        """Return where the robot's foot is in base, (4, 4); at zero readings it is there."""
        feet = [name for name, axis in self.axes.items() if axis.options.carries == "robot"]
        return self.moved(feet[-1], where) if feet else np.eye(4)

    def ball_in_base(self, ball: str, base_from_tool0: FloatArray, where: Readings) -> FloatArray:
        """Return where a ball's centre is in base, (3,), with base_from_tool0 as axes and robot stand."""
        options, at = self.balls[ball]
        carried = {"base": np.eye(4), "tool0": base_from_tool0}
        moved = carried[options.on] if options.on in carried else self.moved(options.on, where)
        return moved[:3, :3] @ at + moved[:3, 3]

    def laser_from_base(self, scanner: str, base_from_tool0: FloatArray) -> FloatArray:
        """Return where a scanner is, (4, 4)."""
        options, mounted = self.scanners[scanner]
        return back(base_from_tool0 @ mounted if options.on == "tool0" else mounted)

    def sees_move(self, scanner: str, carrier: str) -> bool:
        """Return whether anything moves between a scanner and what carries a ball."""
        on = self.scanners[scanner][0].on
        feet = any(axis.options.carries == "robot" for axis in self.axes.values())
        return carrier != on and (on == "base" or carrier != "tool0" or feet)

    def truth(self) -> dict[str, Any]:
        """Return the truth as JSON data."""
        frames: list[dict[str, Any]] = []
        for name, (scanner, mounted) in self.scanners.items():
            frames.append(
                {"into": scanner.on, "outof": "laser", "scanner": name or None, "matrix": mounted.tolist()}
            )
        for name, axis in self.axes.items():
            frame = "turntable" if name == "table" else name
            beside = next((at for ball, at in self.balls.values() if ball.on == name), None)
            frames.append({"into": "base", "outof": frame, "scanner": None, "matrix": axis.frame(beside).tolist()})
        first = next(iter(frames))
        plain = {f"{frame['into']}_from_{frame['outof']}": frame["matrix"] for frame in (*frames[1:], first)}
        return {
            **{
                name: matrix for name, matrix in plain.items() if name.endswith(("_from_laser", "_from_turntable"))
            },
            "frames": frames,
            "spheres": [
                {"name": name, "in": ball.on, "center_mm": at.tolist(), "diameter_mm": 2 * self.radii_mm[name]}
                for name, (ball, at) in self.balls.items()
            ],
            "axes": [self._axis_truth(name, axis) for name, axis in self.axes.items()],
        }

    def _axis_truth(self, name: str, axis: AxisTruth) -> dict[str, Any]:
        linear = axis.options.kind == "linear"
        return {
            "name": name,
            "kind": axis.options.kind,
            "in": "base",
            "on": self.under(name),
            "axis_direction": axis.direction.tolist(),
            "axis_point_mm": None if linear else axis.point_mm.tolist(),
            "direction": axis.options.direction,
            "scale": axis.options.scale,
        }


_AT_MM = (0.0, 0.0, 190.0)
_ON_FLANGE_MM = (35.0, -120.0, 140.0)


def build_topology(
    scanners: tuple[ScannerOptions, ...],
    balls: tuple[BallOptions, ...],
    axes: tuple[AxisOptions, ...],
    diameter_sigma_mm: float,
    rng: np.random.Generator,
) -> TopologyWorld:
    """Return a cell that is built as well as one builds it, all drawn from `rng`."""
    shift = {carrier: rng.uniform(-30, 30, 3) for carrier in sorted({ball.on for ball in balls})}
    shift["tool0"] = rng.uniform(-10, 10, 3)
    sizes = {ball.name: ball.diameter_mm + diameter_sigma_mm * rng.standard_normal() for ball in balls}
    world = TopologyWorld(
        {},
        {ball.name: (ball, np.array(ball.at_mm) + shift[ball.on] + rng.uniform(-0.5, 0.5, 3)) for ball in balls},
        {name: float(size) / 2 for name, size in sizes.items()},
        {axis.name: _axis(axis, rng) for axis in axes},
    )
    flange = turn([0.0, 0.0, -1.6]) @ turn([0.35, 0.0, 0.0]) @ turn(rng.uniform(-0.1, 0.1, 3))
    on_flange = pose(flange, np.array(_ON_FLANGE_MM) + rng.uniform(-5, 5, 3))
    middle = _middle_of_ways(world, rng)
    mounted = {one.name: (one, _mounted(one, k, on_flange, middle, rng)) for k, one in enumerate(scanners)}
    return replace(world, scanners=mounted)


def _middle_of_ways(world: TopologyWorld, rng: np.random.Generator) -> FloatArray | None:
    """Return the middle of where the axes bring their balls, (3,) in base; None where they carry none."""
    carried = [name for name, (ball, _) in world.balls.items() if ball.on in world.axes]
    ends = [{n: rng.uniform(a.options.low, a.options.high) for n, a in world.axes.items()} for _ in range(200)]
    places = [world.ball_in_base(name, np.eye(4), where) for name in carried for where in ends]
    return (np.min(places, axis=0) + np.max(places, axis=0)) / 2 if places else None


def _mounted(
    scanner: ScannerOptions, place: int, on_flange: FloatArray, middle: FloatArray | None, rng: np.random.Generator
) -> FloatArray:
    """Return carrier_from_laser (4, 4) of a cell's scanner, the first one in `place` 0."""
    if scanner.on == "tool0":
        about = turn([0.0, scanner.beside_rad, 0.0]) @ turn(rng.uniform(-0.01, 0.01, 3))
        return on_flange @ pose(about, np.array(_AT_MM) - about @ _AT_MM) if scanner.beside_rad else on_flange
    aim = np.array(scanner.aim_mm) if middle is None else middle
    aside = turn([0.0, 0.0, 0.5 + 0.8 * place])
    looking = aside @ turn([0.0, -2.0, 0.0]) @ turn(rng.uniform(-0.1, 0.1, 3))
    if middle is not None:  # x level, z towards the balls, y upright
        level = aside @ turn([0.0, -np.pi / 2, 0.0]) @ turn([0.0, 0.0, np.pi / 2])
        looking = level @ turn(rng.uniform(-0.01, 0.01, 3))
    return pose(looking, aim - looking @ _AT_MM)


def _axis(axis: AxisOptions, rng: np.random.Generator) -> AxisTruth:
    direction = turn(rng.uniform(-0.03, 0.03, 3)) @ np.array(axis.direction_in_base)
    point = np.array(axis.point_in_base_mm) + rng.uniform(-40, 40, 3) * (1 - np.abs(axis.direction_in_base))
    return AxisTruth(axis, direction / np.sqrt(direction @ direction), point)
