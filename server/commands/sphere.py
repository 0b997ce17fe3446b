"""`scancell sphere`: the sphere in one cloud or profile."""

import argparse
import math
from pathlib import Path
from typing import Any

from server.console.command import OK, Command
from server.console.output import print_result, remark


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="profile: csv, npy; cloud: ply, pcd, xyz, npy")
    parser.add_argument("--diameter-mm", type=float, metavar="D", help="the sphere's diameter, where it is known")
    parser.add_argument("--unit", choices=("mm", "m"), help="the file's unit of length (default mm)")


def _run(options: argparse.Namespace) -> int:
    """Fit the file's sphere, or the circle of a profile, and print it."""
    from calib_core.archive.folder import read_bytes
    from calib_core.errors import InputError, MeasurementError
    from calib_core.formats.points import kind_of_file

    file, diameter_mm = options.file, options.diameter_mm
    if diameter_mm is not None and not (math.isfinite(diameter_mm) and diameter_mm > 0):
        raise InputError("a positive diameter in mm", f"{diameter_mm}", "Give it in mm.", "--diameter-mm")
    data = read_bytes(file, "Name the scanner's file.")
    scale = 1000.0 if options.unit == "m" else 1.0
    fit = _profile if kind_of_file(data, file.name) == "profile" else _cloud
    try:
        found = fit(data, str(file), diameter_mm, scale)
    except MeasurementError as error:
        raise error.at(str(file)) from None
    if options.unit is None and diameter_mm is None and found["radius_mm"] < 1:
        remark(options, f"warning: {file}: a radius below 1 mm looks like metres: add --unit m.")
    print_result(options, _text(found), found)
    return OK


def _profile(data: bytes, name: str, diameter_mm: float | None, scale: float) -> dict[str, Any]:
    from calib_core.formats.points import parse_profile
    from calib_core.sphere.arc import fit_arc

    arc = fit_arc(parse_profile(data, name) * scale, diameter_mm)
    x, z = arc.center_mm.tolist()
    found: dict[str, Any] = {"kind": "profile", "center_mm": [x, z], "radius_mm": arc.radius_mm}
    if diameter_mm is not None:
        y = math.sqrt(max(diameter_mm**2 / 4 - arc.radius_mm**2, 0.0))
        found["sphere_center_mm"] = [[x, y, z], [x, -y, z]]
    return found | {
        "rms_mm": arc.rms_mm,
        "point_sigma_mm": arc.point_sigma_mm,
        "points": len(arc.inliers),
        "inliers": int(arc.inliers.sum()),
        "extent_deg": math.degrees(arc.extent_rad),
        "covariance": arc.covariance.tolist(),
        "covariance_order": ["x_mm", "z_mm", "radius_mm"],
    }


def _cloud(data: bytes, name: str, diameter_mm: float | None, scale: float) -> dict[str, Any]:
    from calib_core.formats.points import parse_cloud
    from calib_core.sphere.cloud import fit_sphere

    fit = fit_sphere(parse_cloud(data, name) * scale, diameter_mm)
    return {
        "kind": "cloud",
        "center_mm": fit.center_mm.tolist(),
        "radius_mm": fit.radius_mm,
        "rms_mm": fit.rms_mm,
        "point_sigma_mm": fit.point_sigma_mm,
        "points": len(fit.inliers),
        "inliers": int(fit.inliers.sum()),
        "covariance": fit.covariance.tolist(),
        "covariance_order": ["x_mm", "y_mm", "z_mm", "radius_mm"][: len(fit.covariance)],
    }


def _text(found: dict[str, Any]) -> str:
    center = " ".join(f"{value:.4f}" for value in found["center_mm"])
    axes = "x z" if found["kind"] == "profile" else "x y z"
    sigmas = [math.sqrt(row[i]) for i, row in enumerate(found["covariance"])]
    lines = [
        f"centre {axes}  {center} mm  (standard deviations {' '.join(f'{s:.4f}' for s in sigmas)})",
        f"radius  {found['radius_mm']:.4f} mm",
        f"rms  {found['rms_mm']:.4f} mm over {found['inliers']} of {found['points']} points",
    ]
    for x, y, z in found.get("sphere_center_mm", []):
        lines.append(
            f"sphere's centre  {x:.4f} {y:.4f} {z:.4f} mm, if it lies on the {'+' if y >= 0 else '−'}y side"
        )
    return "\n".join(lines)


COMMAND = Command("sphere", "fit the sphere in one cloud or profile", "files", _arguments, _run)
