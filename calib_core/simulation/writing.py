"""The session record and the files of a simulated cell, as a real one would have written them."""

from functools import lru_cache

import numpy as np

from calib_core.records import Session
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.profile_cell import Shot, World, pose_numbers

_ENDING = {"profile": "csv", "cloud": "xyz"}


def session_record(world: World, name: str) -> Session:
    """Return the session record, poses in the convention `abb` (x y z in mm, q1 q2 q3 q4)."""
    options = world.options
    scanner: dict[str, object] = {"kind": options.kinds[0]} if len(options.kinds) == 1 else {}
    cell: dict[str, object] = {"pose_convention": "abb", "sphere_diameter_mm": options.sphere_diameter_mm}
    if options.sphere_diameter_sigma_mm:
        cell["sphere_diameter_sigma_mm"] = options.sphere_diameter_sigma_mm
    if options.sigmas == "given":
        scanner["point_sigma_mm"] = options.point_sigma_mm
        cell["robot"] = {
            "position_sigma_mm": options.position_sigma_mm,
            "orientation_sigma_deg": float(np.rad2deg(options.orientation_sigma_rad)),
        }
    cell["scanner"] = scanner
    if options.ball_on_flange:
        cell["arrangement"] = "sphere-on-robot"
    captures = [shot_record(shot, world) for shot in world.shots]
    return Session.model_validate(
        {"format": "scancell-session/1", "name": name, "cell": cell, "captures": captures}
    )


def session_files(world: World) -> dict[str, bytes]:
    """Return the bytes of every capture's file."""
    return {name: content for shot in world.shots for name, content in shot_files(shot, world).items()}


def shot_files(shot: Shot, world: World) -> dict[str, bytes]:
    """Return the bytes of one capture's file by its name; of a centre, which has none, nothing."""
    if shot.kind == "center":
        return {}
    scale = 0.001 if world.options.length_unit == "m" else 1.0
    write = profile_csv if shot.kind == "profile" else cloud_xyz
    return {_file(shot): write(shot.measured_points_mm, scale)}


def _file(shot: Shot) -> str:
    return f"captures/{shot.name}.{_ENDING[shot.kind]}"


def shot_record(shot: Shot, world: World) -> dict[str, object]:
    """Return one capture as the session's record has it."""
    scale = 0.001 if world.options.length_unit == "m" else 1.0
    data: dict[str, object] = {"id": shot.name, "step": "tcp", "kind": shot.kind}
    if shot.kind == "center":
        data["center_mm"] = (np.round(shot.measured_points_mm[0], 4) * scale).tolist()
    else:
        data["files"] = [_file(shot)]
    if shot.table is not None:
        data |= {"step": "turntable", "table_deg": shot.table.reported_angle, "mount": shot.table.reported_mount}
    return data | {"pose": pose_numbers(shot.reported)}


def profile_csv(points_mm: FloatArray, scale: float, on_columns: bool = True) -> bytes:
    """Return a profile (N, 3) in L as CSV, its lengths multiplied by `scale`; of columns x has one decimal."""
    digits = 4 if scale == 1.0 else 7
    z = points_mm[:, 2] * scale
    hit = np.flatnonzero(np.isfinite(z))
    lines = list(_blank_rows(tuple((points_mm[:, 0] * scale).tolist()), digits - 3 if on_columns else digits))
    for k, value in zip(hit.tolist(), z[hit].tolist(), strict=True):
        lines[k] += f"{value:.{digits}f}"
    return ("x_mm,z_mm\n" + "\n".join(lines) + "\n").encode()


@lru_cache(maxsize=8)
def _blank_rows(x: tuple[float, ...], digits: int) -> tuple[str, ...]:
    """Return the rows of columns that saw nothing: every profile of a sensor has the same x."""
    return tuple(f"{value:.{digits}f}," for value in x)


def cloud_xyz(points_mm: FloatArray, scale: float) -> bytes:
    """Return a cloud (N, 3) in L as text, its lengths multiplied by `scale`."""
    digits = 4 if scale == 1.0 else 7
    lines = [" ".join(f"{v:.{digits}f}" for v in row) for row in (points_mm * scale).tolist()]
    return ("\n".join(lines) + "\n").encode()
