"""Whether a TCP can be trusted: the verdict, and every reason for doubt as a sentence."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from calib_core.chain.held import ScannerError
from calib_core.chain.model import Sigmas
from calib_core.chain.observations import SphereObservation, named
from calib_core.chain.repeated import repeats
from calib_core.chain.tcp import TcpSolution
from calib_core.evidence.words import by_to_do
from calib_core.records import Result, Verdict
from calib_core.stages.tcp.record import NOT_CHECKED

Judged = TypeVar("Judged", bound=Result)
_HOPELESS_SCATTER_MM = 5.0
_HOPELESS_SIGMA_MM = 2.5  # inverted poses leave 2.9 mm and more; arms that are only untrue stay below 1 mm
_LARGE_SIGMA_MM = 1.0
_MOST_REJECTED = 1 / 3
_CHI2_6_RARE = 22.5  # 99.9 %
_LIGHT = 0.5
_RIVAL_NEAR = 1.5
_CLEAR_LOG_ODDS = 5.0  # 150 : 1
_LEAST_LAG_MM = 0.05
_MUCH_MORE = 1.5
_LEAST_SCATTER_MM = 0.02
_FEW_SPARE = 9  # of five captures six are left: the estimated scatter then may be small by chance alone


def tcp_verdict(solution: TcpSolution) -> tuple[Verdict, list[str]]:
    """Return the verdict on a solution and its warnings: root causes first, and not what follows from them."""
    misfit = _misfit(solution)
    if misfit:
        return "fail", [*misfit, *_doubts_about_captures(solution)]
    failures = _failures(solution)
    if failures:
        return "fail", [*failures, *_doubts_about_captures(solution), *_doubts_about_noise(solution)]
    warnings = _doubts(solution)
    return ("warn" if warnings else "pass"), warnings


def _misfit(solution: TcpSolution) -> list[str]:
    scatter = solution.joint.center_scatter_rms_mm
    if scatter <= _HOPELESS_SCATTER_MM and solution.sigmas.position_mm <= _HOPELESS_SIGMA_MM:
        return []
    return [
        f"Poses and scans do not fit together: the sphere's centre scatters by {scatter:.1f} mm in base. "
        "Check the pose convention, the units, and that every capture has its own pose."
    ]


def _failures(solution: TcpSolution) -> list[str]:
    found = [f"Not determined: {text}." for text in by_to_do([d.description for d in solution.undetermined])]
    rejected = [name for name, used in zip(solution.captures, solution.used, strict=True) if not used]
    if len(rejected) > _MOST_REJECTED * len(solution.captures):
        found.append(
            f"{len(rejected)} of {len(solution.captures)} captures contradict the others "
            f"({named(solution.captures, solution.used)}). "
            "Check that the sphere stands firmly and that the poses belong to the captures, then repeat these."
        )
    return found


def _doubts(solution: TcpSolution) -> list[str]:
    return [*_doubts_about_captures(solution), *_doubts_about_motion(solution), *_doubts_about_noise(solution)]


def _doubts_about_captures(solution: TcpSolution) -> list[str]:
    found = [cause.sentence for cause in solution.causes]
    explained = {name for cause in solution.causes for name in cause.captures}
    rejected = [name for name, used in zip(solution.captures, solution.used, strict=True) if not used]
    if 0 < len(rejected) <= _MOST_REJECTED * len(solution.captures) and not set(rejected) <= explained:
        found.append(
            f"Left out because they contradict the others: {named(solution.captures, solution.used)}; "
            "see their reasons."
        )
    if _sides_are_open(solution):
        found.append(
            "Which side of the plane of light the sphere is on is hardly decided. Add captures with the plane "
            "well off the sphere's middle, or tell each capture's side."
        )
    return found


def _sides_are_open(solution: TcpSolution) -> bool:
    if solution.sides_log_odds is not None:
        return solution.sides_log_odds < _CLEAR_LOG_ODDS
    rival = solution.rival_scatter_mm
    return rival is not None and rival < _RIVAL_NEAR * solution.start_scatter_mm


def _doubts_about_motion(solution: TcpSolution) -> list[str]:
    undetermined = [d.direction for d in solution.undetermined]
    weak = [
        d.description
        for d in solution.weak
        if not any(abs(float(d.direction @ known)) > 0.9 for known in undetermined)
    ]
    found = [f"Weakly determined: {text}." for text in by_to_do(weak)]
    spare = 3 * int(solution.used.sum()) - 9
    if spare < _FEW_SPARE:
        found.append(
            f"Only {int(solution.used.sum())} captures are used, {spare} measured values more than unknowns: "
            "errors can hide. Add a few orientations."
        )
    return found + doubts_about_two_steps(solution)


def doubts_about_two_steps(solution: TcpSolution) -> list[str]:
    """Return a sentence where the joint answer and the paper's two steps contradict each other."""
    if solution.two_step is None or solution.two_step_covariance is None:
        return []
    if solution.held.errors:
        return []  # of arm or scanner: they move the two steps otherwise, and are said, with what to do
    difference = solution.joint.tool0_from_laser.difference(solution.two_step.tool0_from_laser)
    distance = float(difference @ np.linalg.solve(solution.two_step_covariance, difference))
    if distance <= _CHI2_6_RARE:
        return []
    return [
        "The joint answer and the paper's two steps differ by more than their uncertainty "
        f"({np.linalg.norm(difference[3:]):.2f} mm, {np.rad2deg(np.linalg.norm(difference[:3])):.2f}°): "
        "the pure translations may not have kept their orientation."
    ]


def _doubts_about_noise(solution: TcpSolution) -> list[str]:
    found: list[str] = []
    if solution.excess > 1:
        found.append(
            f"The captures scatter {np.sqrt(solution.excess):.1f} times more than the given sigmas explain: "
            f"{_contradicted(solution)}"
        )
    measured, given = solution.measured_point_sigma_mm, solution.options.point_sigma_mm
    if measured and given and not 0.5 < measured / given < 2:
        found.append(
            f"The points scatter by {measured:.3f} mm about their arcs, but scanner.point_sigma_mm says "
            f"{given:.3f} mm."
        )
    if solution.sigmas.position_mm > _LARGE_SIGMA_MM:
        found.append(
            f"The poses scatter by {solution.sigmas.position_mm:.2f} mm: more than a sound arm. "
            "Check its mastering, its tool and the sphere's stand."
        )
    found.extend(_about(error, solution) for error in solution.held.errors)
    return found


def _contradicted(solution: TcpSolution) -> str:
    if solution.options.position_sigma_mm is None and solution.options.orientation_sigma_rad is None:
        return "the stated uncertainty is enlarged accordingly."
    return "the robot's were estimated instead. Leave them out, or check the arm."


def _about(error: ScannerError, solution: TcpSolution) -> str:
    if error.name == "arm_scale":
        return (
            f"The robot's poses seem too long by {-100 * error.error:.2f} ± {200 * error.sigma:.2f} %, or the "
            "scanner's lengths too short by as much: the captures hardly tell which. Check the arm's calibration, "
            "the scanner's own and the sphere's diameter."
        )
    if error.name == "bow":
        return (
            "The scanner's z seems bent over its width: it hides in the TCP. Check the scanner's own calibration."
        )
    what = "x leans with z (shear)" if error.name == "shear" else f"{error.name[-1]} scale seems wrong"
    done = (
        "It is taken out of the points for the TCP"
        if solution.held.applied
        else "The TCP is that of the files as they are (cell.scanner.errors: apply takes it out)"
    )
    return (
        f"The scanner's {what} by {100 * error.error:+.1f} ± {200 * error.sigma:.1f} %. {done}; check the "
        "scanner's own calibration and the sphere's diameter."
    )


def tcp_notes(solution: TcpSolution) -> list[str]:
    """Return what is worth knowing of a solution beside its doubts: what was assumed, and what was not checked."""
    found: list[str] = []
    if any(solution.points):
        found.append(
            f"Sphere diameter {solution.sphere.diameter_mm:g} ± {2 * solution.sphere.sigma_mm:g} mm (95 %), as "
            "told or, where only the diameter was told, as for its class (cell.sphere_class)."
        )
    light = [
        f"{name} ({weight:.0%})"
        for name, used, weight in zip(solution.captures, solution.used, solution.weights, strict=True)
        if used and weight < _LIGHT
    ]
    if light:
        found.append(f"Counted less because they lie off: {', '.join(light)}.")
    found += beyond_told_sigma(solution.sigmas, solution.options.position_sigma_mm)
    found.append(
        f"{NOT_CHECKED}, and errors of the arm that all captures share. "
        "Approach some poses from another side and let the arm come to rest to show them."
    )
    return found


def beyond_told_sigma(sigmas: Sigmas, told_mm: float | None) -> list[str]:
    """Return a sentence where poses are less true than the sigma that was told of them.

    No reason for doubt: makers tell how well an arm repeats, and what it errs beyond that, alike where poses are
    alike, is estimated whatever is told.  Arms that repeat to some hundredths of a millimetre are true to tenths.

    Parameters
    ----------
    sigmas : Sigmas
        As found.
    told_mm : float or None
        Of a pose's position.
    """
    found_mm = sigmas.largest_position_mm
    if told_mm is None or not is_beyond(found_mm, told_mm):
        return []
    return [
        f"The captures agree to {found_mm:.2f} mm where the robot's sigma says {told_mm:.2f} mm: an arm repeats "
        "better than it is true. The stated uncertainty holds it."
    ]


def is_beyond(scatter_mm: float, expected_mm: float) -> bool:
    """Return whether a scatter is clearly larger than what was expected."""
    return scatter_mm > _MUCH_MORE * max(expected_mm, _LEAST_SCATTER_MM)


def with_repeats(result: Judged, observations: Sequence[SphereObservation], sigmas: Sigmas) -> Judged:
    """Return a result with what captures of a pose that was taken twice say of lag and play, if there are any.

    Parameters
    ----------
    result : TcpResult or ChainResult
    observations : the captures of the still sphere, in the order in which they were taken
    sigmas : Sigmas
        A pose's own scatter counts twice in a difference.
    """
    found = repeats(observations)
    if not found:
        return result
    largest = max(found, key=lambda one: one.shift_mm)
    usual_mm = 3 * np.sqrt(2) * sigmas.position_mm
    names = f"{largest.first} and {largest.again}"
    if largest.is_shift and largest.shift_mm > max(usual_mm, _LEAST_LAG_MM):
        warning = (
            f"{names} are one pose, reached twice, but see the sphere {largest.shift_mm:.2f} mm apart: the arm "
            "lags or has play, or the sphere moved. By as much the TCP may be off in the direction of approach: "
            "let the arm come to rest before each capture."
        )
        verdict = "warn" if result.verdict == "pass" else result.verdict
        return result.model_copy(update={"verdict": verdict, "warnings": [*result.warnings, warning]})
    checked = (
        f"Poses taken again after the arm had been elsewhere differ by {largest.shift_mm:.3f} mm at most "
        f"({names}): where they were reached from another side, a lag is no larger. Not checked: errors of the "
        "arm that all captures share."
    )
    notes = [checked if note.startswith(NOT_CHECKED) else note for note in result.notes]
    return result.model_copy(update={"notes": notes})
