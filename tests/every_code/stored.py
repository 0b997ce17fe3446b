"""Rows of what results of before 0.2 say in sentences."""

from calib_core.findings.bridge import findings_in
from tests.every_code.made import Case


def result(**fields: object) -> Case:
    """Return the findings of a result that was stored without any."""
    return lambda: findings_in({"stage": "tcp", "verdict": "pass", **fields})


CASES: dict[str, tuple[Case, Case]] = {
    "stored-error": (
        result(verdict="fail", warnings=["Poses do not fit."]),
        result(verdict="warn", warnings=["Poses do not fit."]),
    ),
    "stored-warning": (
        result(verdict="warn", warnings=["One capture lies off."]),
        result(verdict="pass", notes=["One capture lies off."]),
    ),
    "stored-note": (
        result(notes=["The arm repeats well."]),
        result(verdict="warn", warnings=["The arm repeats well."]),
    ),
}
