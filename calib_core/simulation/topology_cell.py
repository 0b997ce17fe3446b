"""Captures of the balls of a simulated cell of any topology: poses that show them, what was recorded and seen."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import FloatArray, pose, turn
from calib_core.simulation.profile_cell import draw_centers, pose_numbers, rounded_pose, true_pose
from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.sensor import arc_points, cap_points, columns, noisy
from calib_core.simulation.topology import (
    AxisOptions,
    BallOptions,
    Readings,
    TopologyWorld,
    build_topology,
)
from calib_core.simulation.topology_record import cell_record, names_axes
from calib_core.simulation.topology_wanted import TopologyScenario
from calib_core.simulation.writing import cloud_xyz, profile_csv

_TRIES = 4000
_LOOKING_DOWN = turn([np.pi, 0.0, 0.0]) @ turn([0.0, 0.0, 0.4])
_NOMINAL = turn([0.35, 0.0, 0.0]).T
_TRAVEL = np.array([0.88, -0.47, 0.06]) / np.linalg.norm([0.88, -0.47, 0.06])
_BEFORE_MM = 240.0


@dataclass(frozen=True, eq=False)
class _Stop:
    """Where robot and axes stood for one or more captures: as commanded or read, and as they truly were."""

    commanded: FloatArray
    actual: FloatArray
    read: Readings
    true: Readings
    mount: str | None
    aimed: str


def simulate_topology(
    options: TopologyScenario, name: str, seed: int
) -> tuple[Session, dict[str, bytes], dict[str, Any]]:
    """Return the session record, its files and the truth of a cell of any topology."""
    rng = np.random.default_rng([seed, 20_268])
    world = world_of(options, rng)
    err = {scanner: _ScannerErrors.drawn(options, seed, n) for n, scanner in enumerate(world.scanners)}
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    seen: dict[str, list[str]] = {}
    actual: dict[str, Any] = {}
    for stop in _stops(world, options, rng):
        here = world.scanners if options.at_once else [stop.aimed]
        for scanner in here:
            capture = f"p{len(captures) + 1:02d}"
            points, balls = _points(world, options, stop, scanner, err[scanner].by_incidence_mm, rng)
            if not balls:
                continue
            record, content = _written(options, stop, scanner, capture, points, err[scanner])
            if options.side_told and not any("side" in one and one["step"] == record["step"] for one in captures):
                record |= _side(world, stop, scanner, balls)
            captures.append(record)
            files |= content
            seen[capture] = balls
            actual[capture] = stop.actual.tolist()
    cell = options.cell
    truth = {
        **world.truth(),
        "sphere_diameter_mm": 2 * next(iter(world.radii_mm.values())),
        "base_from_tool0": actual,
        "balls_seen": seen,
        "sigmas": {
            "point_sigma_mm": cell.point_sigma_mm,
            "position_sigma_mm": cell.position_sigma_mm,
            "orientation_sigma_rad": cell.orientation_sigma_rad,
            "orientation_sigma_deg": float(np.rad2deg(cell.orientation_sigma_rad)),
        },
        "scanner_scale": options.scanner_scale,
        "in_files": {scanner: one.in_files.tolist() for scanner, one in err.items()},
        "spoiled": [],
        "seed": seed,
        "scenario": name,
    }
    record = {
        "format": "scancell-session/1",
        "name": f"simulated {name}, seed {seed}",
        "cell": cell_record(world, options),
        "captures": captures,
    }
    return Session.model_validate(record), files, truth


def world_of(options: TopologyScenario, rng: np.random.Generator) -> TopologyWorld:
    """Return the cell itself, the same for the same state of `rng`."""
    return build_topology(
        options.scanners, options.balls, options.axes, options.cell.sphere_diameter_sigma_mm, rng
    )


def captured_again(
    options: TopologyScenario, seed: int, step: str, name: str, rng: np.random.Generator
) -> tuple[dict[str, Any], dict[str, bytes]] | None:
    """Return one more capture of a ball for a step, its record and files; None where no scanner sees one."""
    world = world_of(options, np.random.default_rng([seed, 20_268]))
    shown = [
        (number, scanner, ball)
        for number, scanner in enumerate(world.scanners)
        for ball in options.balls
        if (ball.on in world.axes) == (step == "turntable") and world.sees_move(scanner, ball.on)
    ]
    if not shown or step not in ("tcp", "turntable", "verify"):
        return None
    number, scanner, ball = shown[int(rng.integers(len(shown)))]
    err = _ScannerErrors.drawn(options, seed, number)
    stop = stop_at(world, options, scanner, ball, False, rng)
    points, _ = _points(world, options, stop, scanner, err.by_incidence_mm, rng)
    record, files = _written(options, stop, scanner, name, points, err)
    return {**record, "step": step}, files


def _stops(world: TopologyWorld, options: TopologyScenario, rng: np.random.Generator) -> Iterator[_Stop]:
    """Give stops at which each scanner sees each mounting of balls that it can."""
    aimed = [next(iter(world.scanners))] if options.at_once else [*world.scanners]
    for scanner in aimed:
        for mount in dict.fromkeys(ball.mount for ball in options.balls):
            balls = [ball for ball in options.balls if ball.mount == mount and world.sees_move(scanner, ball.on)]
            on_axis = any(ball.on in world.axes for ball in balls)
            orientations = options.on_axes if on_axis else options.cell.orientations
            first = 0 if on_axis else options.cell.translations
            for number in range((first + orientations) if balls else 0):
                ball = balls[number % len(balls)]
                yield stop_at(world, options, scanner, ball, number < first, rng)


def stop_at(
    world: TopologyWorld,
    options: TopologyScenario,
    scanner: str,
    ball: BallOptions,
    equal: bool,
    rng: np.random.Generator,
) -> _Stop:
    """Return a stop that shows a ball to a scanner; `equal` at the nominal orientation."""
    for _ in range(_TRIES):
        read = {name: _reading(world, name, ball.on, rng) for name in world.axes}
        true = {name: _true_reading(world.axes[name].options, value, rng) for name, value in read.items()}
        commanded = _aimed(world, options, scanner, ball, read, equal, rng)
        actual = true_pose(commanded, options.cell, rng)
        stop = _Stop(commanded, actual, read, true, ball.mount, scanner)
        if len(_arc(world, options, stop, scanner, ball.name)) > 30:
            return stop
    raise AssertionError(f"the scanner '{scanner}' never sees the ball '{ball.name}'")


def _reading(world: TopologyWorld, name: str, carrier: str, rng: np.random.Generator) -> float:
    """Return where an axis is sent; one that carries the object stays at zero where it does not carry the ball."""
    axis = world.axes[name].options
    under = carrier
    while under in world.axes and under != name:
        under = world.under(under)
    if axis.carries == "object" and under != name:
        return 0.0
    return round(float(rng.uniform(axis.low, axis.high)), 3 if axis.kind == "linear" else 2)


def _true_reading(axis: AxisOptions, read: float, rng: np.random.Generator) -> float:
    """Return where an axis truly stands, in degrees or mm of its own unit."""
    unit = 1.0 if axis.kind == "linear" else float(np.rad2deg(1.0))
    once_around = axis.eccentric * np.sin(2 * np.pi * read / (axis.high - axis.low))
    return read + unit * float(axis.sigma * rng.standard_normal() + once_around)


def _aimed(
    world: TopologyWorld,
    options: TopologyScenario,
    scanner: str,
    ball: BallOptions,
    where: Readings,
    equal: bool,
    rng: np.random.Generator,
) -> FloatArray:
    """Return the base_from_tool0 that a robot reports when it shows a ball to a scanner."""
    cell = options.cell
    on, mounted = world.scanners[scanner]
    foot = world.base_from_foot(where)
    at = draw_centers(1, cell, rng)[0]
    turned, about = _orientation(options, equal, rng)
    if on.on == "tool0":
        rotation = turned @ (about @ mounted[:3, :3].T if options.machine == "arm" else about @ _NOMINAL)
        in_tool0 = mounted[:3, :3] @ at + mounted[:3, 3]
        wanted = pose(rotation, world.ball_in_base(ball.name, np.eye(4), where) - rotation @ in_tool0)
    else:
        rotation = turned @ about
        held = world.balls[ball.name][1] if ball.on == "tool0" else np.array([0.0, 0.0, 400.0])
        wanted = pose(rotation, mounted[:3, :3] @ at + mounted[:3, 3] - rotation @ held)
    if options.machine == "linear":
        wanted[:3, 3] = _on_travel(world, mounted, wanted[:3, :3], ball, at[1], where)
    inverse = pose(foot[:3, :3].T, -foot[:3, :3].T @ foot[:3, 3])
    return rounded_pose(inverse @ wanted)


def _on_travel(
    world: TopologyWorld,
    mounted: FloatArray,
    rotation: FloatArray,
    ball: BallOptions,
    beside_mm: float,
    where: Readings,
) -> FloatArray:
    """Return where on its one line the flange shows a ball `beside_mm` from the plane of light, (3,) in base.

    The line leads past the first ball, which is then in the middle of the scanner's view.
    """
    first = world.ball_in_base(next(iter(world.balls)), np.eye(4), {})
    line = first - rotation @ (mounted[:3, :3] @ [0.0, 0.0, _BEFORE_MM] + mounted[:3, 3])
    normal = rotation @ mounted[:3, 1]
    off = world.ball_in_base(ball.name, np.eye(4), where) - line - rotation @ mounted[:3, 3]
    return line + (normal @ off - beside_mm) / (normal @ _TRAVEL) * _TRAVEL


def _orientation(
    options: TopologyScenario, equal: bool, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return the nominal orientation as the machine turns it in base, and a turn on its right, both (3, 3)."""
    cell = options.cell
    tiny = turn(rng.standard_normal(3) * cell.equal_orientation_sigma_rad)
    reach = cell.orientation_range_rad
    if equal or options.machine in ("gantry", "linear"):
        return _LOOKING_DOWN, tiny
    if options.machine == "scara":
        return turn([0.0, 0.0, rng.uniform(-2 * reach, 2 * reach)]) @ _LOOKING_DOWN, tiny
    return _LOOKING_DOWN, turn(rng.uniform(-reach, reach, 3))


def _arc(world: TopologyWorld, options: TopologyScenario, stop: _Stop, scanner: str, ball: str) -> FloatArray:
    """Return the points (N, 3) of a ball that a scanner sees at a stop, without noise."""
    center = _center(world, stop, scanner, ball)
    points = cap_points if options.cell.kinds[0] == "cloud" else arc_points
    return points(center, world.radii_mm[ball], options.cell)


def _center(world: TopologyWorld, stop: _Stop, scanner: str, ball: str) -> FloatArray:
    """Return where a ball's centre is in a scanner's frame, (3,)."""
    base_from_tool0 = world.base_from_foot(stop.true) @ stop.actual
    laser_from_base = world.laser_from_base(scanner, base_from_tool0)
    return laser_from_base[:3, :3] @ world.ball_in_base(ball, base_from_tool0, stop.true) + laser_from_base[:3, 3]


def _points(
    world: TopologyWorld,
    options: TopologyScenario,
    stop: _Stop,
    scanner: str,
    by_incidence: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, list[str]]:
    """Return what a scanner measures of all balls that stand there, (N, 3), and which of them it sees."""
    found: list[FloatArray] = []
    seen: list[str] = []
    for name, (ball, _) in world.balls.items():
        if ball.mount != stop.mount or not world.sees_move(scanner, ball.on):
            continue
        points = _arc(world, options, stop, scanner, name)
        if len(points) <= 30:
            continue
        center, radius_mm = _center(world, stop, scanner, name), world.radii_mm[name]
        errors = rng.standard_normal(len(points)) * options.cell.point_sigma_mm
        errors = errors + _by_incidence(points, center, radius_mm) @ by_incidence
        found.append(noisy(points, center, radius_mm, errors))
        seen.append(name)
    return np.concatenate([*found, np.zeros((0, 3))]), seen


def _by_incidence(points: FloatArray, center: FloatArray, radius_mm: float) -> FloatArray:
    """Return sin², sin⁴ and sin⁸ of the angle between light and a ball's surface at points (N, 3), less a mean."""
    square = 1 - ((points[:, 2] - center[2]) / radius_mm) ** 2
    return np.column_stack([square - 0.3, square**2 - 0.15, square**4 - 0.05])


@dataclass(frozen=True, eq=False)
class _ScannerErrors:
    """Where a scanner's files say that points are: matrix (3, 3), bow, 1/mm, and errors by incidence (3,)."""

    in_files: FloatArray
    bow_per_mm: float
    by_incidence_mm: FloatArray

    @classmethod
    def drawn(cls, options: TopologyScenario, seed: int, number: int) -> "_ScannerErrors":
        drawn = np.random.default_rng([seed, 20_269, number]).standard_normal(7) * options.scanners_err
        matrix = np.diag([1 + 0.005 * drawn[0], 1.0, 1 + 0.005 * drawn[1]])
        matrix[0, 2] = 0.01 * drawn[2]
        return cls(matrix * options.scanner_scale, 0.001 * drawn[3] / options.cell.window_x_mm, 0.02 * drawn[4:])

    @property
    def none(self) -> bool:
        """Whether files have columns' own x."""
        return bool((self.in_files == np.eye(3)).all())

    def told(self, seen: FloatArray) -> FloatArray:
        """Return what files say of points (N, 3); NaN where nothing was seen."""
        told = np.where(np.isnan(seen), np.nan, np.nan_to_num(seen) @ self.in_files.T)
        told[:, 2] += self.bow_per_mm * seen[:, 0] ** 2
        return told


def _side(world: TopologyWorld, stop: _Stop, scanner: str, balls: Sequence[str]) -> dict[str, int]:
    """Return on which side of the plane of light a capture's one ball plainly is, else nothing."""
    y = float(_center(world, stop, scanner, balls[0])[1])
    plain = len(balls) == 1 and abs(y) > 0.3 * world.radii_mm[balls[0]]
    return {"side": 1 if y > 0 else -1} if plain else {}


def _nearest(points: FloatArray, options: TcpScenario) -> FloatArray:
    """Return a whole profile (M, 3) with the point of each column nearest to the scanner; NaN where none."""
    x = columns(options)
    z = np.full(len(x), np.inf)
    place = np.round((points[:, 0] - x[0]) / options.pitch_mm).astype(int)
    inside = (place >= 0) & (place < len(x))
    np.minimum.at(z, place[inside], points[inside, 2])
    return np.column_stack([x, np.zeros_like(x), np.where(np.isfinite(z), z, np.nan)])


def _written(
    options: TopologyScenario, stop: _Stop, scanner: str, capture: str, points: FloatArray, err: _ScannerErrors
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return a capture's record and its file, in which points (N, 3) are off by the scanner's errors."""
    kind = options.cell.kinds[0]
    on_axis = any(ball.on not in ("base", "tool0") for ball in options.balls if ball.mount == stop.mount)
    file = f"captures/{capture}.{'csv' if kind == 'profile' else 'xyz'}"
    step = "turntable" if on_axis else "tcp"
    record: dict[str, Any] = {"id": capture, "step": step, "kind": kind, "files": [file]}
    seen = _nearest(points, options.cell) if kind == "profile" else points
    told = err.told(seen)
    content = profile_csv(told, 1.0, on_columns=err.none) if kind == "profile" else cloud_xyz(told, 1.0)
    record["pose"] = pose_numbers(stop.commanded)
    if scanner:
        record["scanner"] = scanner
    if on_axis and stop.mount is not None:
        record["mount"] = stop.mount
    return record | axes_read(options, stop.read, on_axis), {file: content}


def axes_read(options: TopologyScenario, read: Readings, on_axis: bool) -> dict[str, Any]:
    """Return a capture's fields that say where axes stood; the one table's only where it carries the object."""
    record: dict[str, Any] = {}
    for axis in options.axes:
        told = round(read[axis.name] * axis.unit, 6)
        if names_axes(options):
            record.setdefault("axes_mm" if axis.kind == "linear" else "axes_deg", {})[axis.name] = told
        elif on_axis:
            record["table_deg"] = told
    return record
