"""Calibration of laser scanning cells: pure functions from records and arrays to frozen results.

    import calib_core as cc

    cell = cc.Cell(pose_convention="fanuc", sphere_diameter_mm=80.0)
    result = cc.calibrate_tcp(cell, profiles, poses)

The packages follow the paper: `optics` (camera and laser plane), `sphere` (its centre in a scan), `chain`
(TCP, turntable, everything together), `fusion` (the merged cloud).  Lengths are millimetres and angles radians
unless a name says otherwise.  What is listed here is imported when it is first used: see docs/library.md.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calib_core.errors import CalibrationError
    from calib_core.frames import RigidTransform
    from calib_core.library.archives import pack, replay, unpack, verify_archive
    from calib_core.library.calibrate import (
        Merged,
        calibrate_camera,
        calibrate_chain,
        calibrate_hand_eye,
        calibrate_laser_plane,
        calibrate_tcp,
        calibrate_turntable,
        fit_sphere,
        merge_scans,
        read_scan,
        recheck_tcp,
        scan_points,
        verify,
    )
    from calib_core.library.inputs import Captures, make_session
    from calib_core.library.machines import read_poses
    from calib_core.library.opened import OpenSession, load, simulate
    from calib_core.poses.numbers import parse_pose, to_pose
    from calib_core.records import Board, Capture, Cell, Known, Robot, Scanner, Session, Turntable

__version__ = "0.1.0"

__all__ = [
    "Board", "CalibrationError", "Capture", "Captures", "Cell", "Known", "Merged", "OpenSession",
    "RigidTransform", "Robot", "Scanner", "Session", "Turntable", "calibrate_camera", "calibrate_chain",
    "calibrate_hand_eye", "calibrate_laser_plane", "calibrate_tcp", "calibrate_turntable", "fit_sphere",
    "load", "make_session", "merge_scans", "pack", "parse_pose", "read_poses", "read_scan", "recheck_tcp",
    "replay", "scan_points", "simulate", "to_pose", "unpack", "verify", "verify_archive"
]  # fmt: skip

_RECORDS = ("Board", "Capture", "Cell", "Known", "Robot", "Scanner", "Session", "Turntable")
_HOMES = {
    **dict.fromkeys(_RECORDS, "records"),
    "CalibrationError": "errors",
    "RigidTransform": "frames",
    "Captures": "library.inputs",
    "OpenSession": "library.opened",
    "load": "library.opened",
    "make_session": "library.inputs",
    "pack": "library.archives",
    "parse_pose": "robots",
    "read_poses": "library.machines",
    "replay": "library.archives",
    "simulate": "library.opened",
    "to_pose": "robots",
    "unpack": "library.archives",
    "verify_archive": "library.archives",
}


def __getattr__(name: str) -> Any:
    """Return what is listed here, imported when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module 'calib_core' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(f"calib_core.{_HOMES.get(name, 'library.calibrate')}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
