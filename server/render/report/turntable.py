"""What a report says of a turntable: axis and frame, mountings, and how well the sphere keeps to its circles."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from calib_core.frames import RigidTransform
from calib_core.records import ChainResult, TurntableResidual, TurntableResult
from server.render.report.numbers import COVERAGE, frame_rows, number, pose_covariance
from server.render.report.plot import residual_plot


def table_section(convention: str, data: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what is said of the turntable in a stage's result, None where there is none in it."""
    record = {"turntable": TurntableResult, "chain": ChainResult}.get(data["stage"])
    try:
        result = record.model_validate(data) if record else None
    except ValidationError:
        return None
    if not isinstance(result, TurntableResult | ChainResult):
        return None
    covariance = result.turntable_covariance if isinstance(result, ChainResult) else result.covariance
    # The numbers of a pose are the same whatever its frames are called.
    frame = RigidTransform.from_rounded(result.base_from_turntable, "tool0", "laser")
    return {
        "frame": frame_rows(
            convention, frame, pose_covariance(covariance, f"results/{result.stage}.json: covariance")
        ),
        "facts": _facts(result),
        "mounts": [
            (
                mount.mount,
                str(mount.captures),
                number(mount.radius_mm, 3, "mm"),
                ", ".join(number(v) for v in mount.center_in_turntable_mm),
            )
            for mount in result.mounts
        ],
        "plot": residual_plot(result.residuals) if isinstance(result, TurntableResult) else "",
        "rows": [_row(r) for r in result.residuals if isinstance(r, TurntableResidual) and not _is_still(r)],
    }


def _is_still(row: TurntableResidual) -> bool:
    return row.table_deg is None


def _facts(result: TurntableResult | ChainResult) -> list[tuple[str, str]]:
    scale = result.encoder_scale
    return [
        ("Axis, direction in base", ", ".join(number(v, 6) for v in result.axis_direction_in_base)),
        ("Axis, direction known to", f"± {number(COVERAGE * result.axis_direction_sigma_deg, 4, '°')}"),
        ("Axis, a point on it in base, mm", ", ".join(number(v) for v in result.axis_point_in_base_mm)),
        ("Axis, place known to", f"± {number(COVERAGE * result.axis_point_sigma_mm, 3, 'mm')}"),
        ("Angles count about the axis", "right-handed" if result.direction == 1 else "left-handed"),
        ("Angle's random error", f"{number(result.angle_sigma_deg, 4, '°')} standard deviation"),
        (
            "Encoder's scale error",
            f"{number(1e6 * scale.error, 1)} ± {number(COVERAGE * 1e6 * scale.sigma, 1)} · 10⁻⁶, "
            + ("accounted for" if scale.applied else "not accounted for"),
        ),
        ("Sphere off its circle, across, RMS", number(result.radial_rms_mm, 3, "mm")),
        ("Sphere off its circle, along the axis, RMS", number(result.axial_rms_mm, 3, "mm")),
        ("Sphere off its circle, around, RMS", number(result.angle_rms_deg, 4, "°")),
    ]


def _row(row: TurntableResidual) -> dict[str, Any]:
    return {
        "capture": row.capture,
        "used": row.used,
        "reason": row.reason or "",
        "figures": [
            row.mount or "–",
            number(row.table_deg, 2),
            number(row.radial_mm),
            number(row.tangential_mm),
            number(row.axial_mm),
            number(row.mahalanobis, 2),
        ],
    }
