"""What is said of how far held-out captures scatter, and of a tool that moved."""

from collections.abc import Sequence

import numpy as np

from calib_core.findings.codes import verify as codes
from calib_core.records.findings import Finding
from calib_core.stages.verify.held_out import HeldOut
from calib_core.stages.verify.record import Decision, VerifyCheck

_DOUBTFUL_CHANCE, _MOVED_CHANCE = 0.01, 0.005
_FAILING_FACTOR = 3.0  # of the scatter over the expected one


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
