"""One function a calibration: arrays or files in (see `inputs`), the result out."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, cast

from calib_core.archive.folder import read_bytes
from calib_core.frames import FloatArray
from calib_core.library.inputs import (
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
from calib_core.records import Capture
from calib_core.stages.camera.record import CameraResult
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.laser_plane.record import LaserPlaneResult
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.stage import Progress
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable.record import TurntableResult


def calibrate_tcp(cell: CellLike, scans: Scans, poses: Poses, *, progress: Progress | None = None) -> TcpResult:
    """Return where the scanner is on the flange, with covariance, from captures of a sphere that stands still.

    Parameters
    ----------
    cell : Cell or mapping
        With `pose_convention` and, if known, `sphere_diameter_mm` and the robot's and the scanner's sigmas.
    scans, poses
        One a capture; see `inputs`.  At least five orientations determine the answer.
    progress : callable, optional
        Called with the fraction done and what is being done.

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
    tool: Any,
    *,
    mounts: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> TurntableResult:
    """Return where the turntable is in base, from captures of a sphere that turns with it.

    Parameters
    ----------
    cell : Cell or mapping
    scans, poses
        One a capture; see `inputs`.
    table_deg : sequence of float
        The table's angle of each capture.
    tool : TcpResult, ChainResult or 4×4 array
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
    if len(camera_frames):
        steps["camera"] = Captures(camera_frames)
    return cast("LaserPlaneResult", make_session(cell, steps).run("laser-plane", progress)["laser-plane"])


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
        return getattr(self.result, name)

    def __str__(self) -> str:
        return str(self.result)

    def _repr_html_(self) -> str:
        return self.result._repr_html_()  # pyright: ignore[reportPrivateUsage]


def merge_scans(
    cell: CellLike,
    scans: Scans,
    poses: Poses,
    table_deg: Sequence[float] | None = None,
    calibration: Any = None,
    *,
    progress: Progress | None = None,
) -> Merged:
    """Return scans of a part as one cloud (and mesh, as `cell.merge` says).

    Parameters
    ----------
    cell : Cell or mapping
    scans, poses
        One a scan; see `inputs`.
    table_deg : sequence of float, optional
        The table's angle of each scan.
    calibration : ChainResult, TcpResult or 4×4 array, optional
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
    cell: CellLike, scans: Scans, poses: Poses, calibration: Any, *, progress: Progress | None = None
) -> Any:
    """Return what captures that no calibration has seen say of one: the result of the stage `verify`.

    Parameters and errors as of `merge_scans`.
    """
    session = make_session(with_calibration(cell, calibration), {"verify": Captures(scans, poses)})
    return session.run("verify", progress)["verify"]


def fit_sphere(scan: Scan, diameter_mm: float | None = None) -> Any:
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


def read_scan(path: PathLike[str] | str) -> Any:
    """Return a scanner's file as a `Reading`: its points, N×2 or N×3 in mm, and what was taken for what.

    Raises
    ------
    CalibrationError
        If no format claims the file, or it is damaged.
    """
    from calib_core.formats.points import read_file

    return read_file(read_bytes(Path(path), "Name the scanner's file."), str(path))


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
