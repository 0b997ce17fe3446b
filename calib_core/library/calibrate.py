"""One function a calibration: arrays or files in (see `inputs`), the result out."""

from __future__ import annotations  # so that help() shows the names of the types, not what they stand for

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from calib_core.archive.folder import read_bytes
from calib_core.frames import FloatArray
from calib_core.library.inputs import (
    Calibration,
    Captures,
    CellLike,
    Poses,
    Scan,
    Scans,
    kind_name_and_bytes,
    make_session,
    with_calibration,
)
from calib_core.library.opened import OpenSession
from calib_core.messages import message
from calib_core.records import Capture, Progress
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.hand_eye.record import HandEyeResult
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.recheck.record import RecheckResult
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult
from calib_core.stages.verify.record import VerifyResult

if TYPE_CHECKING:
    from calib_core.formats.format import Reading
    from calib_core.sphere.arc import ArcFit
    from calib_core.sphere.cloud import SphereFit


def calibrate_tcp(cell: CellLike, scans: Scans, poses: Poses, *, progress: Progress | None = None) -> TcpResult:
    """Return where the scanner is on the flange, with covariance, from captures of a sphere that stands still.

    Parameters
    ----------
    cell : Cell or mapping
        With `pose_convention` and, if known, `sphere_diameter_mm` and the robot's and the scanner's sigmas.
    scans : sequence
        One a capture: a file's path, N×2 points of a profile (x, z), N×3 of a cloud, the three numbers of a centre
        that the scanner reports itself, or a list of profiles (a sweep, whose pose is a list of poses); mm.
    poses : sequence or path
        One a scan: the controller's numbers in the cell's `pose_convention`, base_from_tool0 as 4×4 matrix (mm) or
        `RigidTransform`, or a pose of `read_poses`; or the path of a text with one pose a line.  Five or more, of
        which three are turned about different axes, determine the answer.
    progress : callable, optional
        Called with the fraction done and what is being done.

    Returns
    -------
    TcpResult
        With `mount_from_laser`, `covariance`, `verdict`, `residuals` and the other fields of results/tcp.json.

    Raises
    ------
    CalibrationError
        If the input is of no use, or what the solver says.
    """
    session = make_session(cell, {"tcp": Captures(scans, poses)})
    return cast("TcpResult", session.run("tcp", progress)["tcp"])


def calibrate_turntable(
    cell: CellLike,
    scans: Scans,
    poses: Poses,
    table_deg: Sequence[float],
    tool: Calibration,
    *,
    mounts: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> TurntableResult:
    """Return where the turntable is in base, from captures of a sphere that turns with it.

    Parameters
    ----------
    cell : Cell or mapping
    scans, poses
        One a capture, as of `calibrate_tcp`.
    table_deg : sequence of float
        The table's angle of each capture.
    tool : TcpResult, ChainResult, RigidTransform or 4×4 array
        The scanner on the flange.
    mounts : sequence of str, optional
        The name of the place on the table where the sphere was, where there are several.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    known = with_calibration(cell, tool)
    session = make_session(known, {"turntable": Captures(scans, poses, table_deg, mounts)})
    return cast("TurntableResult", session.run("turntable", progress)["turntable"])


def calibrate_chain(
    cell: CellLike, tcp: Captures, turntable: Captures, *, progress: Progress | None = None
) -> ChainResult:
    """Return tool and table from all captures together: the best answer, as each helps the other.

    Parameters
    ----------
    cell : Cell or mapping
    tcp : Captures
        Of the sphere that stands still.
    turntable : Captures
        Of the sphere on the table, with `table_deg`.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    session = make_session(cell, {"tcp": tcp, "turntable": turntable})
    return cast("ChainResult", session.run("chain", progress)["chain"])


def calibrate_camera(cell: CellLike, frames: Scans, *, progress: Progress | None = None) -> CameraResult:
    """Return the camera of the scanner, from frames of the board in `cell.board`.

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    session = make_session(cell, {"camera": Captures(frames)})
    return cast("CameraResult", session.run("camera", progress)["camera"])


def calibrate_laser_plane(
    cell: CellLike, frames: Scans, *, camera_frames: Scans = (), progress: Progress | None = None
) -> LaserPlaneResult:
    """Return the plane of light in the camera.

    Parameters
    ----------
    cell : Cell or mapping
        With the `board`, and the camera in `known.camera` where it is known.
    frames : sequence
        One a board's pose: a frame with the stripe on the lit board, or a pair (board lit, stripe).
    camera_frames : sequence, optional
        Further frames of the board, for the camera alone.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    steps: dict[str, Captures] = {"laser-plane": Captures(frames)}
    if further := list(camera_frames):
        steps["camera"] = Captures(further)
    return cast("LaserPlaneResult", make_session(cell, steps).run("laser-plane", progress)["laser-plane"])


def calibrate_hand_eye(
    cell: CellLike,
    frames: Scans,
    poses: Poses,
    calibration: Calibration | None = None,
    *,
    progress: Progress | None = None,
) -> HandEyeResult:
    """Return where the camera is on the flange, by frames of a board that stands still: a second opinion.

    Parameters
    ----------
    cell : Cell or mapping
        With the `board`, which is `fixed`, and the camera in `known.camera` where it is known.
    frames, poses
        One a board's frame, as of `calibrate_camera` and `calibrate_tcp`.
    calibration : TcpResult, ChainResult, RigidTransform or 4×4 array, optional
        The sphere's answer, to compare with where the cell knows the plane of light.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    known = cell if calibration is None else with_calibration(cell, calibration)
    session = make_session(known, {"camera": Captures(frames, poses)})
    return cast("HandEyeResult", session.run("hand-eye", progress)["hand-eye"])


class Merged:
    """Merged scans: the result's fields as attributes, the cloud, and the files as they are stored.

    Attributes
    ----------
    result : MergeResult
    points_mm : array
        N×3, in the frame that the result names.
    files : mapping
        The cloud and, where there is one, the mesh, as PLY.
    """

    def __init__(self, result: MergeResult, points_mm: FloatArray, files: Mapping[str, bytes]) -> None:
        self.result, self.points_mm, self.files = result, points_mm, files

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # a copy asks for such names before it has a result
            raise AttributeError(name)
        return getattr(self.result, name)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *type(self.result).model_fields]

    def __str__(self) -> str:
        return str(self.result)

    def _repr_html_(self) -> str:
        return self.result._repr_html_()  # pyright: ignore[reportPrivateUsage]


def merge_scans(
    cell: CellLike,
    scans: Scans,
    poses: Poses,
    table_deg: Sequence[float] | None = None,
    calibration: Calibration | None = None,
    *,
    progress: Progress | None = None,
) -> Merged:
    """Return scans of a part as one cloud (and mesh, as `cell.merge` says).

    Parameters
    ----------
    cell : Cell or mapping
    scans, poses
        One a scan, as of `calibrate_tcp`.
    table_deg : sequence of float, optional
        The table's angle of each scan.
    calibration : ChainResult, TcpResult, RigidTransform or 4×4 array, optional
        The scanner on the flange and, with a table, where it is; left out: what `cell.known` has.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    known = cell if calibration is None else with_calibration(cell, calibration)
    results = make_session(known, {"scan": Captures(scans, poses, table_deg)}).run("merge", progress)
    return Merged(results["merge"], results.points_mm, results.files)


def verify(
    cell: CellLike,
    scans: Scans,
    poses: Poses,
    calibration: Calibration,
    *,
    mounts: Sequence[str] | None = None,
    plate: Captures | None = None,
    progress: Progress | None = None,
) -> VerifyResult:
    """Return what captures that no calibration has seen say of one.

    Parameters
    ----------
    cell : Cell or mapping
        With the limits in `verification`, if any.
    scans, poses
        Of a sphere that stands still, one a capture, as of `calibrate_tcp`.
    calibration : TcpResult, ChainResult, RigidTransform or 4×4 array
    mounts : sequence of str, optional
        Which sphere of a ball bar each scan shows.
    plate : Captures, optional
        Of a flat plate, for its flatness.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`.
    """
    steps = {"verify": Captures(scans, poses, mounts=mounts)}
    if plate is not None:
        steps["plate"] = plate
    session = make_session(with_calibration(cell, calibration), steps)
    return cast("VerifyResult", session.run("verify", progress)["verify"])


def recheck_tcp(
    cell: CellLike, tcp: Captures, repeated: Captures, *, progress: Progress | None = None
) -> RecheckResult:
    """Return whether a calibration still holds, from some of its poses captured again, the sphere in its place.

    Parameters
    ----------
    cell : Cell or mapping
    tcp : Captures
        Those of the calibration.
    repeated : Captures
        Now, at three or more of the same poses.
    progress : callable, optional

    Raises
    ------
    CalibrationError
        As `calibrate_tcp`, or if no pose is repeated.
    """
    session = make_session(cell, {"tcp": tcp, "recheck": repeated})
    return cast("RecheckResult", session.run("recheck", progress)["recheck"])


def fit_sphere(scan: Scan, diameter_mm: float | None = None) -> ArcFit | SphereFit:
    """Return the sphere in a cloud (`SphereFit`), or the circle in a profile (`ArcFit`), with covariance.

    Raises
    ------
    CalibrationError
        If there is none, or the file cannot be read.
    """
    from calib_core.formats.points import parse_cloud, parse_profile
    from calib_core.sphere.arc import fit_arc
    from calib_core.sphere.cloud import fit_sphere as fit_cloud

    kind, name, data = kind_name_and_bytes(scan, "the scan", None)
    if kind == "profile":
        return fit_arc(parse_profile(data, name), diameter_mm)
    return fit_cloud(parse_cloud(data, name), diameter_mm)


def read_scan(path: PathLike[str] | str) -> Reading:
    """Return a scanner's file as a `Reading`: its points, N×2 or N×3 in mm, and what was taken for what.

    Raises
    ------
    CalibrationError
        If no format claims the file, or it is damaged.
    """
    from calib_core.formats.points import read_file

    return read_file(read_bytes(Path(path), message("Name the scanner's file.")), str(path))


def scan_points(session: OpenSession, capture: Capture) -> FloatArray:
    """Return the points of a capture of kind `profile` or `cloud`, N×2 or N×3 in mm, blanks left out.

    Raises
    ------
    CalibrationError
        If its file is damaged or has no points.
    """
    from calib_core.formats.points import known_points, read_file

    (name,) = capture.files
    return known_points(read_file(session.read(name), name), name)
