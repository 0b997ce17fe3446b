"""What the library's functions are given: arrays or files in, a session in memory out.

Scans are given one a capture: a file's path, or an array: N×2 is a profile (x, z), N×3 a cloud, three numbers the
sphere's centre, all in millimetres in L; a list of profiles is a sweep, whose pose is a list too.  Frames are
paths, or H×W arrays of 8 or 16 bit.  Poses are the controller's numbers in the cell's `pose_convention`,
base_from_tool0 as 4×4 matrices (mm) or `RigidTransform`, poses of `read_poses`, or the path of a text with one
pose a line.
"""

from __future__ import annotations  # as in `calibrate`

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from calib_core.archive.folder import read_bytes
from calib_core.cell.found import ON_FLANGE, SCANNER_FRAMES
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.library.opened import OpenSession, in_memory
from calib_core.messages import message
from calib_core.records import Capture, Cell, Kind, Session, parse_cell
from calib_core.records.strict_fields import require_known_fields
from calib_core.robots.controller_file import FilePose
from calib_core.steps import steps_that_show

if TYPE_CHECKING:
    from calib_core.formats.format import Reading
    from calib_core.stages.chain.record import ChainResult
    from calib_core.stages.tcp.record import TcpResult

Scan: TypeAlias = "ArrayLike | PathLike[str] | str | Reading"
Scans: TypeAlias = "Iterable[Scan | Sequence[Scan]]"
Pose: TypeAlias = ArrayLike | RigidTransform | FilePose
Poses: TypeAlias = Iterable[Pose | Sequence[Pose]] | PathLike[str] | str
Calibration: TypeAlias = "TcpResult | ChainResult | RigidTransform | ArrayLike"
CellLike: TypeAlias = Cell | Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Captures:
    """Captures of one step: scans, and beside each its pose, the table's angle and the sphere's mount."""

    scans: Scans
    poses: Poses | None = None
    table_deg: Sequence[float] | None = None
    mounts: Sequence[str] | None = None


def make_session(cell: CellLike, steps: Mapping[str, Captures], name: str = "") -> OpenSession:
    """Return a session in memory.

    Parameters
    ----------
    cell : Cell or mapping
    steps : mapping
        By step, such as "tcp": its captures.
    name : str, optional

    Raises
    ------
    InputError
        If counts differ, or a pose or a scan is none.
    """
    known = _cell(cell)
    captures: list[Capture] = []
    files: dict[str, bytes] = {}
    for step, given in steps.items():
        for capture, content in _captures(known, step, given):
            captures.append(capture)
            files |= content
    return in_memory(Session(name=name, cell=known, captures=captures), files)


def with_calibration(cell: CellLike, calibration: Calibration) -> Cell:
    """Return a cell whose tool and, where the calibration has one, table are known.

    Raises
    ------
    InputError
        If it is neither a result nor a 4×4 matrix.
    """
    known = _cell(cell).known
    tool = calibration.matrix if isinstance(calibration, RigidTransform) else calibration
    name = next((n for n in SCANNER_FRAMES if getattr(calibration, n, None) is not None), ON_FLANGE)
    matrix = _array(getattr(calibration, name, tool))
    if matrix is None or matrix.shape != (4, 4):
        got = (
            repr(calibration)[:60]
            if matrix is None or not matrix.ndim
            else message("an array of shape {shape}", shape=matrix.shape)
        )
        to_do = message("Give a TcpResult, a ChainResult, or the scanner's matrix on the flange.")
        raise InputError("a calibration, or a 4×4 matrix", got, to_do)
    update: dict[str, Any] = {name: matrix.tolist()}
    if (table := getattr(calibration, "base_from_turntable", None)) is not None:
        update["base_from_turntable"] = table
    return _cell(cell).model_copy(update={"known": known.model_copy(update=update)})


def _cell(cell: CellLike) -> Cell:
    """Return a cell; one that is written here as a mapping may have no unknown field, those of files may."""
    if isinstance(cell, Cell):
        return cell
    known = parse_cell(cell)
    require_known_fields(known, "cell")
    return known


def _captures(cell: Cell, step: str, given: Captures) -> list[tuple[Capture, dict[str, bytes]]]:
    scans = _listed(given.scans, step)
    count = len(scans)
    poses = [None] * count if given.poses is None else _poses(cell, given.poses)
    angles = [None] * count if given.table_deg is None else _angles(given.table_deg, step)
    mounts = [None] * count if given.mounts is None else list(given.mounts)
    for found, need in (
        (poses, message("{count} poses, one a scan", count=count)),
        (angles, message("{count} angles, one a scan", count=count)),
        (mounts, message("{count} mounts, one a scan", count=count)),
    ):
        if len(found) != count:
            raise InputError(need, str(len(found)), message("Give one for each, in their order."), step)
    return [
        _capture(step, k, scan, {"pose": pose, "table_deg": angle, "mount": mount})
        for k, (scan, pose, angle, mount) in enumerate(zip(scans, poses, angles, mounts, strict=True))
    ]


def _listed(scans: Scans, step: str) -> list[Any]:
    """Return the scans as a list; one scan in place of a list is told as such."""
    is_profile = isinstance(scans, np.ndarray) and scans.ndim == 2 and scans.shape[1] == 2
    if is_profile or isinstance(scans, str | PathLike):
        raise InputError("a list of scans, one a pose", "one scan", "Put the scans in a list.", step)
    return list(scans)


def _angles(angles: Iterable[Any], step: str) -> list[float]:
    try:
        return [float(angle) for angle in angles]
    except (TypeError, ValueError) as error:
        need = message("the table's angle of each scan, a number in degrees")
        raise InputError(need, str(error), "Correct it.", step) from None


def _capture(step: str, index: int, scan: Any, fields: dict[str, Any]) -> tuple[Capture, dict[str, bytes]]:
    name = f"{step}-{index + 1:02d}"
    given = {key: value for key, value in fields.items() if value is not None}
    is_frame = step in steps_that_show("board")
    parts = list(scan) if isinstance(scan, list | tuple) and not _is_numbers(scan) else [scan]
    center = None if is_frame else _array(parts[0])
    if len(parts) == 1 and center is not None and center.shape == (3,):
        return Capture(id=name, step=step, kind="center", center_mm=center.tolist(), **given), {}
    files: dict[str, bytes] = {}
    kind: Kind = "frame"
    for k, part in enumerate(parts):
        found, ending, data = kind_name_and_bytes(part, f"{step}, scan {index + 1}", "frame" if is_frame else None)
        kind = found
        files[f"captures/{name}{f'-{k + 1}' if len(parts) > 1 else ''}{Path(ending).suffix}"] = data
    if len(parts) > 1 and not is_frame:
        kind = "sweep"
        if "pose" in given:
            given["poses"] = given.pop("pose")
    return Capture(id=name, step=step, kind=kind, files=list(files), **given), files


def kind_name_and_bytes(scan: Any, where: str, kind: Kind | None) -> tuple[Kind, str, bytes]:
    """Return what a scan is, a file's name for it, and the bytes."""
    from calib_core.formats.format import Reading
    from calib_core.formats.points import read_file

    if isinstance(scan, str | PathLike):
        path = Path(cast("str | PathLike[str]", scan))
        data = read_bytes(path, message("Name the scanner's file."))
        return kind or read_file(data, str(path)).kind, str(path), data
    if kind == "frame":
        return kind, "frame.png", _png(np.asarray(scan), where)
    array = _array(scan.points if isinstance(scan, Reading) else scan)
    if array is None or array.ndim != 2 or array.shape[1] not in (2, 3):
        got = (
            repr(scan)[:60]
            if array is None or not array.ndim
            else message("an array of shape {shape}", shape=array.shape)
        )
        raise InputError("points, N×2 (a profile) or N×3 (a cloud)", got, "Give them as rows of numbers.", where)
    data = BytesIO()
    np.save(data, array, allow_pickle=False)
    return ("profile" if array.shape[1] == 2 else "cloud"), "points.npy", data.getvalue()


def _png(frame: Any, where: str) -> bytes:
    import cv2

    if frame.ndim not in (2, 3) or frame.dtype not in (np.uint8, np.uint16):
        got = message("{dtype} of shape {frame}", dtype=frame.dtype, frame=frame.shape)
        raise InputError("a frame, H×W, of uint8 or uint16", got, "Convert it, or name its file.", where)
    done, data = cv2.imencode(".png", frame)
    if not done:
        to_do = "Name its file instead."
        raise InputError("a frame that PNG can hold", "shape {frame}", to_do, where, frame=frame.shape)
    return data.tobytes()


def _poses(cell: Cell, poses: Poses) -> list[Any]:
    if isinstance(poses, str | PathLike):
        return _poses_of_text(cell, Path(poses))
    return [_pose(cell, pose, f"pose {k + 1}") for k, pose in enumerate(poses)]


def _poses_of_text(cell: Cell, path: Path) -> list[Any]:
    from calib_core.robots import parse_pose_lines

    text = read_bytes(path, message("Name the file of the poses.")).decode("utf-8", "replace")
    lines = parse_pose_lines(cell.pose_convention, text)
    for line in lines:
        if line.problem:
            raise InputError("a pose a line", line.problem, "Correct it.", f"{path}: line {line.line}")
    return [line.numbers for line in lines]


def _pose(cell: Cell, pose: Any, where: str) -> list[Any]:
    from calib_core.poses.numbers import parse_pose, to_pose

    if isinstance(pose, FilePose):
        if pose.pose is None:
            raise InputError("a pose", "joints alone ({pose})", "Give its pose.", where, pose=pose.name)
        pose = parse_pose(pose.convention, pose.pose, where)
    if isinstance(pose, RigidTransform):
        return to_pose(cell.pose_convention, pose)
    if np.shape(pose) == (4, 4):
        return to_pose(cell.pose_convention, RigidTransform.from_rounded(pose, "base", "tool0"))
    array = _array(pose)
    if array is not None and array.ndim == 1:
        if not np.isfinite(array).all():
            raise InputError(
                "finite numbers", f"{array.tolist()}", "Read the pose from the controller again.", where
            )
        return array.tolist()
    if isinstance(pose, list | tuple | np.ndarray):  # of a sweep: one a profile
        return [_pose(cell, each, where) for each in cast("Sequence[Any]", pose)]
    raise InputError("numbers, or a 4×4 matrix", repr(pose)[:60], "Give base_from_tool0.", where)


def _array(value: Any) -> FloatArray | None:
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):  # a path, or arrays of different lengths
        return None


def _is_numbers(scan: Any) -> bool:
    """Return whether a list is one scan written as numbers rather than a list of scans."""
    array = _array(scan)
    return array is not None and array.ndim in (1, 2) and not any(isinstance(part, np.ndarray) for part in scan)
