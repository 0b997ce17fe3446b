"""The verification's decision: figures held against limits that were set before, with a guard band.

Four answers, as in ISO 14253-1 and ILAC-G8 with the guard band w = U (k = 2): pass up to the limit less w,
conditional pass up to the limit, conditional fail up to the limit plus w, fail beyond.  Where U is above the
limit, or too few captures count, nothing is decided.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, get_args

import numpy as np

from calib_core.evidence.numbers import decimals_of_uncertainty
from calib_core.findings import Code
from calib_core.findings.codes import verify as codes
from calib_core.frames import FloatArray, skew
from calib_core.messages import message
from calib_core.records.findings import Finding
from calib_core.stages.verify.held_out import Asked, HeldOut
from calib_core.stages.verify.record import Decision, VerifyCheck
from calib_core.stages.verify.tool import Tool

_DOUBTFUL_CHANCE, _MOVED_CHANCE = 0.01, 0.005
_FAILING_FACTOR = 3.0  # of the scatter over the expected one

_ORDER: tuple[Decision, ...] = get_args(Decision)
_BEYOND = _ORDER[-1]
_SAID: dict[Decision, Code] = {
    code.name.removeprefix("verify-"): code  # pyright: ignore[reportAssignmentType]
    for code in (codes.VERIFY_CONDITIONAL_PASS, codes.VERIFY_CONDITIONAL_FAIL, codes.VERIFY_FAIL)
}
LEAST_DECIDING = 4
"""Fewer captures leave nothing over from which to tell how far they scatter about the tool's stated error."""
_QUARTER = 0.25
_BAND = 0.95  # the share of the points that the band of a form holds


@dataclass(frozen=True)
class Estimate:
    """A figure and its expanded uncertainty (k = 2), mm."""

    value_mm: float
    uncertainty_mm: float


def decided(value_mm: float, uncertainty_mm: float, limit_mm: float) -> Decision:
    """Return the answer of the decision rule."""
    value = abs(value_mm)
    if not uncertainty_mm <= limit_mm:
        return "undecided"
    if value <= limit_mm - uncertainty_mm:
        return "pass"
    if value <= limit_mm:
        return "conditional-pass"
    return "conditional-fail" if value <= limit_mm + uncertainty_mm else _BEYOND


TITLES: Final = {
    "tool": message("Tool's error at the sphere"),
    "form": message("Probing form"),
    "form_95": message("Probing form, 95 %"),
    "size": message("Probing size"),
    "spacing": message("Sphere spacing"),
    "flatness": message("Flatness"),
    "flatness_95": message("Flatness, 95 %"),
}
"""The figures of a verification by their names."""


def checked(name: str, estimate: Estimate, limit_mm: float | None, count: int = LEAST_DECIDING) -> VerifyCheck:
    """Return a figure of `count` captures held against its limit, None where none was set."""
    decision: Decision | None = None
    title, reason = TITLES[name], ""
    if limit_mm is not None:
        enough = count >= LEAST_DECIDING
        decision = decided(estimate.value_mm, estimate.uncertainty_mm, limit_mm) if enough else "undecided"
        reason = message(
            "{title}: {value_mm:.{digits}f} ± {uncertainty_mm:.{digits}f} mm, limit {limit_mm:g} mm",
            title=title,
            value_mm=estimate.value_mm,
            uncertainty_mm=estimate.uncertainty_mm,
            limit_mm=limit_mm,
            digits=decimals_of_uncertainty(estimate.uncertainty_mm),
        )
        if decision not in ("pass", _BEYOND) and not (enough and estimate.uncertainty_mm <= _QUARTER * limit_mm):
            reason = message(
                "{told}; its uncertainty is more than a quarter of the limit: take more captures, turned further.",
                told=reason,
            )
        else:
            reason = message("{text}.", text=reason)
    return VerifyCheck(
        name=name,
        title=str(title),
        value_mm=estimate.value_mm,
        uncertainty_mm=estimate.uncertainty_mm,
        limit_mm=limit_mm,
        decision=decision,
        reason=reason,
    )


def overall(checks: Sequence[VerifyCheck], unchecked: int = 0) -> Decision | None:
    """Return the worst decision; `unchecked` limits could not be looked at. None where no limit was set."""
    judged: list[Decision] = [check.decision for check in checks if check.decision is not None]
    if unchecked:
        judged.append("undecided")
    return max(judged, key=_ORDER.index, default=None)


def decision_findings(checks: Sequence[VerifyCheck], count: int) -> list[Finding]:
    """Return what is said of each figure that did not pass its limit, `count` captures having been of use."""
    findings: list[Finding] = []
    for check in checks:
        if check.decision is None or check.decision == "pass":
            continue
        figures: dict[str, Any] = {
            "title": TITLES[check.name],
            "value_mm": check.value_mm,
            "uncertainty_mm": check.uncertainty_mm,
            "limit_mm": check.limit_mm or 0.0,
            "digits": decimals_of_uncertainty(check.uncertainty_mm),
        }
        if check.decision != "undecided":
            findings.append(_SAID[check.decision](**figures))
        else:
            why = "captures" if count < LEAST_DECIDING else "uncertainty"
            findings.append(codes.VERIFY_UNDECIDED(**figures, count=count, why=why))
    return findings


def tool_error(asked: Asked, tool: Tool) -> Estimate:
    """Return by how much the tool is off where the scanner saw the sphere, as its captures alone tell it.

    Parameters
    ----------
    asked : Asked
        The tool that the captures ask for, each weighed by its own noise and the robot's; where they scatter more
        than that, the uncertainty grows with them.
    tool : Tool
        That is verified.
    """
    freedom = max(3 * len(asked.points) - 9, 1)
    growth = max(1.0, asked.squared / freedom)
    point = asked.points.mean(axis=0)
    off = asked.mount_from_laser.apply(point) - tool.mount_from_laser.apply(point)
    moved = np.hstack([skew(point), -asked.mount_from_laser.rotation.T])
    spread = moved @ asked.covariance[3:, 3:] @ moved.T * growth
    return Estimate(float(np.linalg.norm(off)), 2 * float(np.sqrt(np.linalg.eigvalsh(spread)[-1])))


def probing(
    points_in_base: Sequence[FloatArray], diameter_mm: float, diameter_sigma_mm: float
) -> dict[str, Estimate]:
    """Return probing form, its 95 % band and size of all captures' points together, with their uncertainties.

    Parameters
    ----------
    points_in_base : a list of (N, 3), one a capture
    diameter_mm, diameter_sigma_mm : float
        As calibrated.

    Notes
    -----
    2634-style, as VDI/VDE 2634-3 words it: form is r_max − r_min about the sphere of free radius, or the smallest
    band that holds 95 % of the points; size is the fitted diameter minus the calibrated one.  Captures err as a
    whole, so the uncertainty comes from leaving out each in turn (jackknife).
    """
    whole, sigmas = jackknifed(lambda points: _figures(points, diameter_mm), points_in_base)
    sigmas[2] = np.hypot(sigmas[2], diameter_sigma_mm)
    names = ("form", "form_95", "size")
    return {n: Estimate(float(v), 2 * float(s)) for n, v, s in zip(names, whole, sigmas, strict=True)}


def jackknifed(
    figures: Callable[[FloatArray], tuple[float, ...]], parts: Sequence[FloatArray]
) -> tuple[tuple[float, ...], FloatArray]:
    """Return the figures of all parts' points together, and their standard deviations by leaving out each part."""
    without = [figures(np.concatenate([*parts[:k], *parts[k + 1 :]])) for k in range(len(parts))]
    return figures(np.concatenate(parts)), np.sqrt((len(parts) - 1) * np.var(without, axis=0))


def range_and_band(values: FloatArray) -> tuple[float, float]:
    """Return the range of values (N,) and the width of the narrowest band that holds 95 % of them."""
    ordered = np.sort(values)
    inside = max(int(np.ceil(_BAND * len(ordered))), 1)
    band = (ordered[inside - 1 :] - ordered[: len(ordered) - inside + 1]).min()
    return float(ordered[-1] - ordered[0]), float(band)


def _figures(points: FloatArray, diameter_mm: float) -> tuple[float, float, float]:
    middle = points.mean(axis=0)
    local = points - middle
    solution = np.linalg.lstsq(
        np.column_stack([2 * local, np.ones(len(local))]), (local**2).sum(axis=1), rcond=None
    )
    center = np.asarray(solution[0][:3], dtype=float)
    radius = diameter_mm / 2
    for _ in range(15):
        off = local - center
        length = np.linalg.norm(off, axis=1)
        slopes = np.column_stack([-off / length[:, None], -np.ones(len(off))])
        step = np.asarray(np.linalg.lstsq(slopes, radius - length, rcond=None)[0], dtype=float)
        center, radius = center + step[:3], radius + float(step[3])
        if np.abs(step).max() < 1e-9:
            break
    return *range_and_band(np.linalg.norm(local - center, axis=1)), 2 * radius - diameter_mm


def moved_findings(found: HeldOut, checks: Sequence[VerifyCheck]) -> list[Finding]:
    """Return whether another tool explains captures beyond chance; where it has a limit, that decides."""
    off = next(check for check in checks if check.name == "tool")
    if off.decision is not None or found.moved_chance >= _MOVED_CHANCE:
        return []
    return [codes.TOOL_MOVED(off_mm=off.value_mm, uncertainty_mm=off.uncertainty_mm)]


def scatter_findings(
    found: HeldOut, knows_uncertainty: bool, decision: Decision | None, moved: Sequence[Finding] = ()
) -> list[Finding]:
    """Return what is said of the scatter; where limits were set, these decide.

    A scatter that a tool which moved explains is not said beside it, unless it fails.
    """
    if not knows_uncertainty:
        return [codes.TOOL_WITHOUT_UNCERTAINTY()] if decision is None else []
    if found.chance >= _DOUBTFUL_CHANCE:
        return []
    factor = float(np.sqrt(found.chi_squared / found.degrees_of_freedom))
    fails = factor > _FAILING_FACTOR and decision is None
    if (
        not fails
        and any(one.code == codes.TOOL_MOVED.name for one in moved)
        and found.rest_chance >= _DOUBTFUL_CHANCE
    ):
        return []
    code = codes.SCATTER_FAILS if fails else codes.SCATTER_LARGE
    return [code(factor=factor, scatter_mm=found.scatter_rms_mm, expected_mm=found.expected_scatter_rms_mm)]
