"""What carries scanner and ball in a cell, as its record says."""

from collections import Counter
from collections.abc import Iterable, Sequence

from calib_core.cell.layout import Carrier, KnownDistance
from calib_core.cell.walk import Carriers
from calib_core.records import Capture, Cell, Scanner, Sphere
from calib_core.steps import steps_that_show

_DISTANCE_SIGMA_MM = 0.01
"""Of a calibrated distance of which nothing is told."""


def scanner_mount(cell: Cell, scanner: str | None = None) -> Carrier:
    """Return what carries a scanner; without a name, the cell's only or first one."""
    scanners = cell.scanners or {}
    told = scanners[scanner] if scanner in scanners else next(iter(scanners.values()), None)
    if told is not None and "on" in told.model_fields_set:
        return told.on
    return "base" if cell.arrangement == "sphere-on-robot" else "tool0"


def scanner_names(cell: Cell) -> tuple[str, ...]:
    """Return the names of a cell's scanners; none where it names none."""
    return tuple(cell.scanners or ())


def other_end(mount: Carrier) -> Carrier:
    """Return what carries a ball of which nothing is told: the robot's other end, from its scanner."""
    return "tool0" if mount == "base" else "base"


def told_balls(cell: Cell, carrier: str) -> list[Sphere]:
    """Return what is told of the balls that a frame carries."""
    end = other_end(scanner_mount(cell))
    return [ball for ball in cell.spheres or [] if (ball.on or end) == carrier]


def balls_in_sight(cell: Cell, capture: Capture | None = None) -> list[Sphere]:
    """Return the told balls of which a capture, or any, may show one.

    The one that its mounting names; else those on what carries its ball, by its step; else any.
    """
    told = cell.spheres or []
    if capture is None:
        return told
    if named := [ball for ball in told if ball.name == capture.mount]:
        return named
    ends = [ball.on or other_end(scanner_mount(cell, capture.scanner)) for ball in told]
    on_table = capture.step in steps_that_show("sphere-on-table")
    carrier = carriers_of(cell, capture).ball
    here = [
        ball for ball, on in zip(told, ends, strict=True) if (rides_on_axis(on) if on_table else on == carrier)
    ]
    return here or told


def tells_diameter(cell: Cell) -> bool:
    """Return whether a cell tells the diameter of any ball."""
    return cell.sphere_diameter_mm is not None or any(ball.diameter_mm for ball in cell.spheres or [])


def diameters_by_name(cell: Cell) -> dict[str, float]:
    """Return the diameters of balls that have one of their own, by their names."""
    return {ball.name: ball.diameter_mm for ball in cell.spheres or [] if ball.diameter_mm is not None}


def with_diameter(cell: Cell, told_mm: float, diameter_mm: float) -> dict[str, object]:
    """Return the merge patch of a cell by which a ball that is told to have a diameter has another."""
    patch: dict[str, object] = {}
    if told_mm in diameters_by_name(cell).values():
        patch["spheres"] = [
            ball.model_dump(exclude_unset=True)
            | ({"diameter_mm": diameter_mm} if ball.diameter_mm == told_mm else {})
            for ball in cell.spheres or []
        ]
    if cell.sphere_diameter_mm == told_mm or not patch:
        patch["sphere_diameter_mm"] = diameter_mm
    return patch


def ball_name(carrier: str) -> str:
    """Return what a ball is called that nobody named, by what carries it."""
    return "sphere" if carrier == "base" else "sphere-on-flange"


def told_distances(cell: Cell) -> tuple[KnownDistance, ...]:
    """Return the told distances of balls."""
    told = cell.sphere_distances or []
    return tuple(KnownDistance(d.between[0], d.between[1], d.mm, d.sigma_mm or _DISTANCE_SIGMA_MM) for d in told)


def ball_on_flange(cell: Cell) -> bool:
    """Return whether the flange carries the ball of the TCP's captures, and the scanner stands still."""
    return other_end(scanner_mount(cell)) == "tool0"


def scanner_told(cell: Cell, capture: Capture) -> Scanner:
    """Return what is told of the scanner that took a capture."""
    return (cell.scanners or {}).get(capture.scanner or "", cell.scanner)


def scanner_name(cell: Cell, capture: Capture) -> str:
    """Return the name of the scanner that took a capture; empty where the cell has one."""
    return (capture.scanner or next(iter(cell.scanners or ()), "")) if len(cell.scanners or {}) > 1 else ""


def scanner_place(cell: Cell, capture: Capture) -> int:
    """Return how many scanners a cell lists before the one that took a capture."""
    name = scanner_name(cell, capture)
    return list(cell.scanners or ()).index(name) if name in (cell.scanners or ()) else 0


def rides_on_axis(carrier: str) -> bool:
    """Return whether what carries a ball is an axis, neither base nor the flange."""
    return carrier not in ("base", "tool0")


def rides_with_robot(carrier: str) -> bool:
    """Return whether what carries something is the flange."""
    return carrier == "tool0"


def carrier_of_all(mounts: Iterable[str]) -> str:
    """Return `base` where all of some scanners stand still, `tool0` where the flange carries one."""
    return "base" if {*mounts} == {"base"} else "tool0"


def carriers_read(cell: Cell) -> tuple[str, ...]:
    """Return the cell's fields that say that the flange holds a board before a camera; none where it does not."""
    return ("arrangement", "scanners") if ball_on_flange(cell) else ()


def of_one_scanner(captures: Sequence[Capture], least: int) -> list[Capture]:
    """Return the captures of one of several scanners, which have a mount each.

    The one that took fewest, of those that took at least so many as find their mount: it is the one in hand.
    """
    taken = Counter(capture.scanner for capture in captures)
    if len(taken) < 2:
        return list(captures)
    enough = [name for name in taken if taken[name] >= least]
    one = min(enough, key=taken.__getitem__) if enough else max(taken, key=taken.__getitem__)
    return [capture for capture in captures if capture.scanner == one]


def stands_still(cell: Cell, capture: Capture) -> bool:
    """Return whether the scanner that took a capture stands still, wherever the robot is."""
    return scanner_mount(cell, capture.scanner) == "base"


def stands_apart(cell: Cell, capture: Capture) -> bool:
    """Return whether neither scanner nor ball of a capture is on the robot: its pose does not matter then."""
    carriers = carriers_of(cell, capture)
    return capture.step in steps_that_show("sphere-on-table") and "tool0" not in (carriers.scanner, carriers.ball)


def carriers_of(cell: Cell, capture: Capture) -> Carriers:
    """Return what carries scanner and ball in a capture; a turntable stands in base."""
    mount = scanner_mount(cell, capture.scanner)
    return Carriers(mount, "base" if capture.step == "turntable" else other_end(mount))
