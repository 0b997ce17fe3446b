"""The report's content: what the template shows, computed from the session's records alone."""

import math
from collections.abc import Collection, Mapping
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from pydantic import ValidationError

from calib_core import __version__
from calib_core.frames import RigidTransform
from calib_core.records import Cell, ChainResult, Session, TcpResult
from calib_core.robots import CONVENTIONS
from server.render.report.numbers import COVERAGE, frame_rows, number, pose_covariance
from server.render.report.plot import residual_plot
from server.render.report.turntable import table_section
from server.render.report.workpiece import workpiece_rows

_MEANING: Final = {
    "pass": "Accepted: the captures agree with each other and determine the answer.",
    "warn": "Usable with care: read the warnings below before you rely on it.",
    "fail": "Not accepted: do not use these numbers; the warnings below say what to mend.",
}
_STAGES: Final = {
    "camera": "Camera",
    "laser-plane": "Laser plane",
    "tcp": "Scanner on the flange (TCP)",
    "turntable": "Turntable",
    "chain": "Whole chain",
    "verify": "Verification",
    "merge": "Merge",
}

Data = Mapping[str, Any]


def report_html(session: Session, results: Mapping[str, Data], stale: Collection[str] = ()) -> str:
    """Return a session's report as one HTML page that needs no other file, no script and no address.

    Parameters
    ----------
    session : Session
    results : mapping
        The stages' results by stage, as JSON data.
    stale : collection of str
        The stages whose result is older than the captures.

    Raises
    ------
    InputError
        If a result's frame or covariance is none.
    """
    stages = [_stage(session, name, results[name], name in stale) for name in _STAGES if name in results]
    verdicts = [stage["verdict"] for stage in stages]
    worst = next((v for v in ("fail", "warn", "pass") if v in verdicts), None)
    environment = Environment(
        loader=PackageLoader("server.render.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["number"] = number
    return environment.get_template("report.html.jinja").render(
        session=session,
        name=session.name or "Session",
        worst=worst,
        cell=_cell_rows(session.cell),
        captures=_capture_counts(session),
        stages=stages,
        coverage=COVERAGE,
        software=f"scancell {__version__}",
    )


def _stage(session: Session, name: str, result: Data, stale: bool) -> dict[str, Any]:
    stage: dict[str, Any] = {
        "name": name,
        "title": _STAGES[name],
        "verdict": result["verdict"],
        "meaning": _MEANING[result["verdict"]],
        "method": result["method"],
        "software": result["software"],
        "inputs_sha256": result["inputs_sha256"],
        "warnings": result.get("warnings") or [],
        "stale": stale,
        "rows": result.get("residuals") or [],
        "figures": _plain_figures(result),
    }
    stage["tcp"] = _tcp(session, result)
    stage["table"] = table_section(session.cell.pose_convention, result)
    stage["workpiece"] = workpiece_rows(session, result) if stage["tcp"] or stage["table"] else []
    return stage


def _tcp(session: Session, data: Data) -> dict[str, Any] | None:
    """Return what is said of a tool frame, None of a result that is not one (of another version)."""
    record = {"tcp": TcpResult, "chain": ChainResult}.get(data["stage"])
    try:
        result = record.model_validate(data) if record else None
    except ValidationError:
        return None
    if not isinstance(result, TcpResult | ChainResult):
        return None
    tool = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser")
    covariance = pose_covariance(result.covariance, f"results/{result.stage}.json: covariance")
    parts = result.variance_components
    return {
        "convention": CONVENTIONS[session.cell.pose_convention],
        "frame": frame_rows(session.cell.pose_convention, tool, covariance),
        "matrix": [[number(v, 6 if k < 3 else 4) for k, v in enumerate(row)] for row in result.tool0_from_laser],
        "says": _says(covariance),
        "sphere": [number(v) for v in result.sphere_center_in_base_mm],
        "components": [
            ("Noise of one point", number(parts.point_sigma_mm, 4, "mm"), _origin(parts.estimated, "point")),
            (
                "Robot, position, each axis",
                number(parts.position_sigma_mm, 4, "mm"),
                _origin(parts.estimated, "pos"),
            ),
            (
                "Robot, orientation, each axis",
                number(parts.orientation_sigma_deg, 4, "°"),
                _origin(parts.estimated, "orient"),
            ),
        ],
        "compared": _compared(result),
        "two_step_reason": result.two_step.reason,
        "apart": _apart(tool, result),
        "undetermined": [direction.description for direction in result.undetermined],
        "plot": residual_plot(result.residuals),
        "residuals": [_residual_row(row.model_dump()) for row in result.residuals],
        "used": sum(row.used for row in result.residuals),
    }


def _says(covariance: Any) -> str:
    """Return what the covariance means where the scanner measures."""
    angle_rad = math.sqrt(max(float(np.linalg.eigvalsh(covariance[:3, :3])[-1]), 0.0))
    shift_mm = math.sqrt(max(float(np.linalg.eigvalsh(covariance[3:, 3:])[-1]), 0.0))
    return (
        f"With about 95 % confidence (k = {COVERAGE:g}) the scanner's origin is known to "
        f"{number(COVERAGE * shift_mm, 2, 'mm')} and its orientation to "
        f"{number(math.degrees(COVERAGE * angle_rad), 3, '°')}, in the worst direction. The two are correlated: "
        "what they mean together where the scanner measures stands below, at the workpiece. The robot's own error "
        "at each pose comes on top."
    )


def _origin(estimated: list[str], begin: str) -> str:
    return "estimated from the data" if any(name.startswith(begin) for name in estimated) else "given"


def _compared(result: TcpResult | ChainResult) -> list[tuple[str, str, str]]:
    two = result.two_step
    return [
        (
            "Scatter of the sphere's centres, RMS",
            number(result.center_scatter_rms_mm, 3, "mm"),
            number(two.center_scatter_rms_mm, 3, "mm"),
        ),
        (
            "Points on the sphere's surface, RMS",
            number(result.surface_rms_mm, 3, "mm"),
            number(two.surface_rms_mm, 3, "mm"),
        ),
        (
            "The same, each capture left out in turn",
            number(result.leave_one_out_surface_rms_mm, 3, "mm"),
            number(two.leave_one_out_surface_rms_mm, 3, "mm"),
        ),
    ]


def _apart(tool: RigidTransform, result: TcpResult | ChainResult) -> str:
    if result.two_step.tool0_from_laser is None:
        return ""
    difference = tool.difference(RigidTransform.from_rounded(result.two_step.tool0_from_laser, "tool0", "laser"))
    angle_deg = math.degrees(float(np.linalg.norm(difference[:3])))
    shift = number(float(np.linalg.norm(difference[3:])), 3, "mm")
    return f"The two answers differ by {number(angle_deg, 3, '°')} and {shift}."


def _residual_row(row: Data) -> dict[str, Any]:
    return {
        "capture": row["capture"],
        "used": row["used"],
        "reason": row["reason"] or "",
        "figures": [
            str(row["points"]),
            number(row["surface_rms_mm"]),
            number(row.get("leave_one_out_rms_mm")),
            number(row["center_distance_mm"]),
            number(row["mahalanobis"], 2),
            number(row.get("zone"), 2),
        ],
    }


def _plain_figures(result: Data) -> list[tuple[str, str]]:
    """Return the single numbers of any stage's result, by name with unit."""
    figures: list[tuple[str, str]] = []
    for name, value in result.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            words, unit = _label(name)
            figures.append((words, number(float(value), 0 if isinstance(value, int) else 4, unit)))
    return figures


def _label(name: str) -> tuple[str, str]:
    for ending, unit in (("_mm", "mm"), ("_deg", "°"), ("_rad", "rad"), ("_px", "px"), ("_s", "s")):
        if name.endswith(ending):
            return name.removesuffix(ending).replace("_", " "), unit
    return name.replace("_", " "), ""


def _cell_rows(cell: Cell) -> list[tuple[str, str]]:
    sphere = number(cell.sphere_diameter_mm, 4, "mm")
    if cell.sphere_diameter_sigma_mm is not None:
        sphere += f" ± {number(COVERAGE * cell.sphere_diameter_sigma_mm, 4, 'mm')}"
    rows = [
        ("Sphere's diameter", sphere),
        ("Poses as", f"{cell.pose_convention}: {CONVENTIONS[cell.pose_convention].numbers}"),
        ("Robot", cell.robot.brand),
        ("Scanner", cell.scanner.kind),
        ("Scanner's z axis", cell.scanner.z_axis),
        ("Noise of one point, given", _given(cell.scanner.point_sigma_mm, "mm")),
        ("Robot's position, given", _given(cell.robot.position_sigma_mm, "mm")),
        ("Robot's orientation, given", _given(cell.robot.orientation_sigma_deg, "°")),
        ("Turntable's angle, given", _given(cell.turntable.angle_sigma_deg, "°")),
        ("Board", f"{cell.board.kind}, {cell.board.columns} × {cell.board.rows}" if cell.board else None),
    ]
    return [(label, value) for label, value in rows if value is not None]


def _given(sigma: float | None, unit: str) -> str | None:
    return None if sigma is None else f"{number(sigma, 4, unit)} standard deviation"


def _capture_counts(session: Session) -> list[tuple[str, int, int]]:
    """Return each step's name, its captures, and how many of them are excluded."""
    steps = dict.fromkeys(capture.step for capture in session.captures)
    counted = {step: [c for c in session.captures if c.step == step] for step in steps}
    return [(step, len(of_step), sum(c.excluded for c in of_step)) for step, of_step in counted.items()]
