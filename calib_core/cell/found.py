"""Where a result, or what is known of a cell, says that scanner and ball are."""

from collections.abc import Iterable, Mapping
from typing import Any, Final, Literal

import numpy as np

from calib_core.cell.axes import TABLE, frame_of
from calib_core.cell.carriers import (
    other_end,
    rides_on_axis,
    scanner_mount,
    scanner_name,
    scanner_told,
    stands_still,
)
from calib_core.cell.layout import Carrier
from calib_core.cell.walk import Carriers
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Cell, ResultsData
from calib_core.records.base import Matrix4, OpenMatrix4, Record, Rows, Vector3
from calib_core.records.results import FoundFrame
from calib_core.records.topology import FoundAxis, KnownFrame
from calib_core.steps import stage_names, table_stages, tool_stages

_MOUNTS: Final[tuple[Carrier, ...]] = ("tool0", "base")
ON_FLANGE: Final = "tool0_from_laser"
"""The field of records that has a scanner on the flange."""
SCANNER_FRAMES: Final = (ON_FLANGE, "base_from_laser")
"""The fields of records that have a scanner's pose; one of both is told."""
_LEAST_POSES: Final = 5
_BY_BOARD: Final[Mapping[Carrier, str]] = {mount: f"{mount}_from_laser_by_board" for mount in _MOUNTS}
"""The same as a board has it, whose covariance is `laser_covariance`."""


class UpToShift(Record):
    """Scanner and table up to one shift of both, by a machine that did not turn enough to tell more.

    A machine that moved along one line alone leaves a rotation about its `travel` open, too.

    The scanner's place along `directions`, in the frame of what carries it, is not determined.  Here it is as if
    one component for each of them were zero: all that scanner and table are used for together does not depend on
    it.  Where nothing ties both to base (`own_base`), base is the scanner's own frame here, z towards the scanner.
    The other fields are those of the result by the same names, with numbers in place of null.
    """

    directions: list[Vector3]
    travel: Vector3 | None = None
    own_base: Literal[True] | None = None
    tool0_from_laser: Matrix4 | None = None
    base_from_laser: Matrix4 | None = None
    base_from_turntable: Matrix4 | None = None
    covariance: Rows
    turntable_covariance: Rows | None = None
    cross_covariance: Rows | None = None
    axes: list[FoundAxis] | None = None
    frames: list[FoundFrame] | None = None


class ScannerPlaced(Record):
    """Where the scanner is on what carries it: on the flange, or in base where it stands still.

    Components that are not determined are null, and `up_to_shift` then has what is known all the same.
    """

    tool0_from_laser: OpenMatrix4 | None = None
    base_from_laser: OpenMatrix4 | None = None
    up_to_shift: UpToShift | None = None

    @property
    def placed_scanner(self) -> RigidTransform | None:
        """The scanner's pose on what carries it, where it has one."""
        return placed_scanner(self.model_dump(include={*SCANNER_FRAMES, "up_to_shift"}))

    @property
    def mount_from_laser(self) -> RigidTransform:
        """The scanner's pose on what carries it; raises InputError where it has none."""
        return scanner_frame(self.model_dump(include={*SCANNER_FRAMES, "up_to_shift"}))


def covariance_of_several(cell: Cell, result: Mapping[str, Any]) -> FloatArray | None:
    """Return the scanner's covariance (6, 6) by a result of several scanners or still balls, or with the robot on
    axes; None of others.
    """
    scanners = [frame for frame in result.get("frames") or () if frame["outof"] == "laser"]
    still = [ball for ball in result.get("spheres") or () if ball["in"] == "base"]
    on_axes = any(axis.carries == "robot" for axis in cell.axes or ())
    rows = result.get("covariance") if len(scanners) > 1 or len(still) > 1 or on_axes else None
    return None if rows is None else np.array(rows, dtype=float)[:6, :6]


def placed_scanner(result: Mapping[str, Any]) -> RigidTransform | None:
    """Return the scanner's pose on what carries it, of a result as JSON data; None where it has none."""
    told = as_used(result)
    for mount in _MOUNTS:
        if (rows := told.get(f"{mount}_from_laser")) is not None:
            return RigidTransform.from_rounded(rows, mount, "laser")
    return None


def of_scanner(result: Mapping[str, Any], cell: Cell) -> Mapping[str, Any]:
    """Return a result of several scanners, JSON data, as if it were of the one that a cell has."""
    name, mount = next(iter(cell.scanners or ()), None), scanner_mount(cell)
    frames, balls = result.get("frames") or (), result.get("spheres") or ()
    frame = next((f for f in frames if (f["outof"], f.get("scanner")) == ("laser", name)), None)
    ball = next((b["center_mm"] for b in balls if b["in"] == other_end(mount)), None)
    if name is None or frame is None or result.get("up_to_shift"):
        return result
    own = {f"{mount}_from_laser": frame["matrix"], f"sphere_center_in_{other_end(mount)}_mm": ball}
    return {**result, **dict.fromkeys(SCANNER_FRAMES), **own, "covariance": frame["covariance"]}


def as_used(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a result as JSON data with numbers for what is open, as scanner and table are used together."""
    told = result.get("up_to_shift")
    return {**result, **{name: value for name, value in told.items() if value is not None}} if told else result


def turns_little(result: Mapping[str, Any]) -> bool:
    """Return whether a result, JSON data, is of a machine that turned too little to tell where its scanner is."""
    told = result.get("up_to_shift")
    return bool(told) and not told.get("own_base")


def placed_table(result: Mapping[str, Any]) -> RigidTransform:
    """Return the table's frame in base, of a result as JSON data, beside the scanner's."""
    return RigidTransform.from_rounded(as_used(result)["base_from_turntable"], "base", "turntable")


def scanner_frame(result: Mapping[str, Any]) -> RigidTransform:
    """Return what `placed_scanner` does; raises InputError where there is none."""
    if (found := placed_scanner(result)) is not None:
        return found
    raise InputError("{frames:or}", "neither", "Solve the stage 'tcp' again.", "tcp", frames=list(SCANNER_FRAMES))


def answering(results: Mapping[str, Record | Mapping[str, Any]]) -> str | None:
    """Return the stage whose result is the answer: the best with the scanner by a sphere.

    Where there is none: a table's that its scanner alone knows, or a board's that tells the scanner.
    """
    placed = next((stage for stage in tool_stages() if stage in results), None)
    return placed or next((stage for stage in stage_names() if stage in results and _alone(results[stage])), None)


def _alone(result: Record | Mapping[str, Any]) -> bool:
    told = result if isinstance(result, Mapping) else vars(result)
    return _own_base(result) or any(told.get(name) is not None for name in _BY_BOARD.values())


def _own_base(result: Record | Mapping[str, Any]) -> bool:
    if isinstance(result, Record):
        told: UpToShift | None = getattr(result, "up_to_shift", None)
        return told is not None and bool(told.own_base)
    return bool((result.get("up_to_shift") or {}).get("own_base"))


def table_seen(result: Mapping[str, Any]) -> FoundFrame | None:
    """Return where a table is that is known to its scanner alone, of a result as JSON data; None of others."""
    if not _own_base(result):
        return None
    seen = (one for one in result["frames"] if one["outof"] == "turntable" and one["into"].startswith("laser"))
    return FoundFrame.model_validate(next(seen))


def axis_of_table(result: Mapping[str, Any]) -> tuple[str, str]:
    """Return name and kind of the axis that `base_from_turntable` is of; `table` where the cell names none."""
    others = {frame["outof"] for frame in result.get("frames") or ()}
    riding = [ball["in"] for ball in result.get("spheres") or () if rides_on_axis(ball["in"])]
    own = (name for name in riding if name not in others and name != frame_of(TABLE))
    name, kinds = next(own, TABLE), {axis["name"]: axis["kind"] for axis in result.get("axes") or ()}
    return name, kinds.get(name, "rotary")


def turntable_name(cell: Cell, results: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Return the name of the axis whose frame is `turntable`, as results, JSON data, or a cell of one have it."""
    solved = (results[stage] for stage in (*tool_stages(), *table_stages()) if stage in results)
    if (found := next((result for result in solved if result.get("axes")), None)) is not None:
        return axis_of_table(found)[0]
    carried = [axis.name for axis in cell.axes or () if axis.carries == "object"]
    return carried[0] if len(carried) == 1 else None


def scanner_answered(result: Mapping[str, Any]) -> tuple[RigidTransform, FloatArray]:
    """Return the scanner's pose with its covariance as an answer, JSON data, has them, by a sphere or a board."""
    for mount, name in _BY_BOARD.items():
        if (rows := result.get(name)) is not None:
            covariance = np.array(result["laser_covariance"], dtype=float)
            return RigidTransform.from_rounded(rows, mount, "laser"), covariance
    return scanner_frame(result), np.array(result["covariance"], dtype=float)


def told_by(mount_from_laser: RigidTransform) -> dict[str, Any]:
    """Return a scanner's pose by the name of its field in records."""
    return {f"{mount_from_laser.into}_from_laser": mount_from_laser.to_rows()}


def mounts_of(frames: Iterable[FoundFrame | KnownFrame]) -> dict[str, tuple[RigidTransform, FloatArray]]:
    """Return scanners' poses among frames by the scanners' names; what is not told of them counts as exact."""
    told = [one for one in frames if one.outof == "laser" and one.scanner]
    return {
        one.scanner or "": (
            RigidTransform.from_rounded(one.matrix, mount, "laser"),
            np.zeros((6, 6)) if one.covariance is None else np.array(one.covariance, dtype=float),
        )
        for one in told
        for mount in _MOUNTS
        if one.into == mount and np.isfinite(np.array(one.matrix, dtype=float)).all()
    }


def known_scanner(cell: Cell) -> RigidTransform | None:
    """Return where the scanner is known to be on what carries it, None where it is to be found."""
    mount = scanner_mount(cell)
    rows = getattr(cell.known, f"{mount}_from_laser")
    return None if rows is None else RigidTransform.from_rounded(rows, mount, "laser")


def own_base(cell: Cell, captures: Iterable[Capture]) -> RigidTransform | None:
    """Return base_from_laser of a scanner that stands before a table and that nothing ties to the robot's base.

    Base is then taken as the scanner's own frame, z towards the scanner, so that tables seen from above point up.
    None where any scanner that saw the table is on the flange, is known, or took captures of step tcp.
    """
    some = [one for one in captures if not one.excluded]
    before = {scanner_name(cell, one): one for one in some if one.step == "turntable"}
    tied = {scanner_name(cell, one) for one in some if one.step == "tcp"} | {*mounts_of(cell.known.frames or [])}
    still = all(stands_still(cell, one) for one in before.values())
    if not before or not still or tied & before.keys() or known_scanner(cell) is not None:
        return None
    toward = scanner_told(cell, next(iter(before.values()))).z_axis == "toward"
    turn = [0.0 if toward else np.pi, 0.0, 0.0]
    return RigidTransform.of(turn, [0.0, 0.0, 0.0], "base", "laser")


def told_by_axes(cell: Cell, captures: Iterable[Capture]) -> bool:
    """Return whether balls on axes alone tell where scanners are: the flange took one to them, to several poses.

    Nothing that is known and no capture of step tcp tells it then.
    """
    some = [one for one in captures if not one.excluded]
    if known_scanner(cell) is not None or any(one.step == "tcp" for one in some):
        return False
    seen = [one for one in some if one.step == "turntable" and not stands_still(cell, one)]
    poses = {tuple(one.pose or next(iter(one.poses or ()), ())) for one in seen}
    return len(poses) >= _LEAST_POSES and cell.turntable.angles != "unknown"


def no_scanner(need: str) -> InputError:
    """Return what to say where neither captures nor the cell tell where the scanner is."""
    return InputError(
        need,
        "neither captures with step 'tcp' nor cell.known.tool0_from_laser",
        "Capture the still sphere from several robot poses first, that on the table while it rests will do; or "
        "give tool0_from_laser with the cell.",
        "captures",
    )


def carriers_found(result: Mapping[str, Any]) -> Carriers:
    """Return what carries scanner and ball, by a result as JSON data."""
    return Carriers("base", "tool0") if result.get("base_from_laser") is not None else Carriers("tool0", "base")


def on_flange(mount_from_laser: RigidTransform) -> bool:
    """Return whether a scanner's pose is that of one on the flange."""
    return mount_from_laser.into == "tool0"


def ball_at(cell: Cell, results: ResultsData, on: str, at_mm: FloatArray) -> str:
    """Return the name of the ball at a place where sizes differ, and a capture tells which it shows; else none."""
    if len({ball.diameter_mm for ball in cell.spheres or []}) < 2:
        return ""
    balls = next((own for stage in tool_stages() if (own := (results.get(stage) or {}).get("spheres"))), [])
    told = {ball.name for ball in cell.spheres or []}
    off_mm: dict[str, float] = {
        ball["name"]: float(np.linalg.norm(np.array(ball["center_mm"], dtype=float) - at_mm))
        for ball in balls
        if ball["in"] == on and ball["name"] in told and None not in ball["center_mm"]
    }
    return min(off_mm, key=off_mm.__getitem__, default="")
