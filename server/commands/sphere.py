"""`scancell sphere`: the sphere in one cloud or profile."""

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib_core.messages import message
from server.console.command import OK, Command
from server.console.output import print_result, remark

if TYPE_CHECKING:
    from calib_core.frames import FloatArray
    from calib_core.sphere.arc import ArcFit
    from calib_core.sphere.cloud import SphereFit


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="a profile or cloud: CSV, PLY, E57 … (docs/formats.md)"
    )
    parser.add_argument("--diameter-mm", type=float, metavar="D", help="the sphere's diameter, where it is known")
    parser.add_argument(
        "--unit", choices=("mm", "m", "um", "cm", "in"), help="the file's unit (default: its own, mm)"
    )
    parser.add_argument("--format", metavar="NAME", help="the file's format, where it is not recognised")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a setting of the format, such as z_scale_mm=0.001",
    )


def _run(options: argparse.Namespace) -> int:
    """Fit the file's sphere, or the circle of a profile, and print it."""
    from calib_core.archive.folder import read_bytes
    from calib_core.errors import InputError, MeasurementError
    from calib_core.formats.points import FORMATS, known_points, read_file
    from calib_core.proof import WORDS, is_experimental

    file, diameter_mm = options.file, options.diameter_mm
    if diameter_mm is not None and not (math.isfinite(diameter_mm) and diameter_mm > 0):
        raise InputError("a positive diameter in mm", f"{diameter_mm}", "Give it in mm.", "--diameter-mm")
    data = read_bytes(file, message("Name the scanner's file."))
    reading = read_file(data, str(file), format_name=options.format, settings=_settings(options))
    points = known_points(reading, str(file))
    proof = FORMATS.get(reading.format).proof
    if is_experimental(proof):
        remark(options, message("Its reader is {proof}.", proof=WORDS[proof]))
    for doubt in reading.doubts:
        remark(options, message("Warning: {file}: {doubt}", file=str(file), doubt=doubt))
    try:
        found = _profile(points, diameter_mm) if reading.kind == "profile" else _cloud(points, diameter_mm)
    except MeasurementError as error:
        raise error.at(str(file)) from None
    found |= {"read": reading.to_json(rows=0)}
    print_result(options, _text(found), found)
    return OK


def _settings(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings as told: values are JSON where they can be, else text."""
    told: dict[str, Any] = {"unit": options.unit} if options.unit else {}
    for pair in options.set:
        name, _, value = pair.partition("=")
        try:
            told[name] = json.loads(value)
        except ValueError:
            told[name] = value
    return told


def _profile(points: "FloatArray", diameter_mm: float | None) -> dict[str, Any]:
    from calib_core.sphere.arc import fit_arc

    arc = fit_arc(points, diameter_mm)
    x, z = arc.center_mm.tolist()
    found: dict[str, Any] = {"kind": "profile", "center_mm": [x, z], "radius_mm": arc.radius_mm}
    if diameter_mm is not None:
        y = math.sqrt(max(diameter_mm**2 / 4 - arc.radius_mm**2, 0.0))
        found["sphere_center_mm"] = [[x, y, z], [x, -y, z]]
    extent = {"extent_deg": math.degrees(arc.extent_rad)}
    return found | _quality(arc) | extent | {"covariance_order": ["x_mm", "z_mm", "radius_mm"]}


def _cloud(points: "FloatArray", diameter_mm: float | None) -> dict[str, Any]:
    from calib_core.sphere.cloud import fit_sphere

    fit = fit_sphere(points, diameter_mm)
    order = ["x_mm", "y_mm", "z_mm", "radius_mm"][: len(fit.covariance)]
    found = {"kind": "cloud", "center_mm": fit.center_mm.tolist(), "radius_mm": fit.radius_mm}
    return found | _quality(fit) | {"covariance_order": order}


def _quality(fit: "ArcFit | SphereFit") -> dict[str, Any]:
    return {
        "rms_mm": fit.rms_mm,
        "point_sigma_mm": fit.point_sigma_mm,
        "points": len(fit.inliers),
        "inliers": int(fit.inliers.sum()),
        "covariance": fit.covariance.tolist(),
    }


def _text(found: dict[str, Any]) -> str:
    center = " ".join(f"{value:.4f}" for value in found["center_mm"])
    axes = "x z" if found["kind"] == "profile" else "x y z"
    sigmas = [math.sqrt(row[i]) for i, row in enumerate(found["covariance"])]
    centre = message(
        "centre {axes}  {center} mm  (standard deviations {sigmas})",
        axes=axes,
        center=center,
        sigmas=" ".join(f"{s:.4f}" for s in sigmas),
    )
    lines = [
        message("read  {sentence}", sentence=found["read"]["sentence"]),
        *(f"      {note}" for note in found["read"]["notes"]),
        centre,
        message("radius  {radius_mm:.4f} mm", radius_mm=found["radius_mm"]),
        message(
            "rms  {rms_mm:.4f} mm over {inliers} of {points} points",
            rms_mm=found["rms_mm"],
            inliers=found["inliers"],
            points=found["points"],
        ),
    ]
    lines += [
        message(
            "sphere's centre  {center} mm, if it lies on the {sign}y side",
            center=" ".join(f"{value:.4f}" for value in center_mm),
            sign="+" if center_mm[1] >= 0 else "−",
        )
        for center_mm in found.get("sphere_center_mm", [])
    ]
    return "\n".join(lines)


COMMAND = Command("sphere", "fit the sphere in one cloud or profile", "files", _arguments, _run)
