"""Rows of what speaks against using an answer."""

from typing import Any

import numpy as np

from calib_core.exports.answer import Answer
from calib_core.findings.codes.faults import FAULT_CODES
from calib_core.frames import RigidTransform
from tests.every_code.made import CELL, Case

MOMENT = ("drift", "overdue", "equipment-changed", "verify-undecided")


def answer(**fields: Any) -> Case:
    """Return what an answer says of itself."""
    tool = RigidTransform.of([0, 0, 0], [1, 2, 3], "tool0", "laser")
    results = {"tcp": {"verdict": "pass"}}
    return lambda: Answer(CELL.session, results, "tcp", tool, np.eye(6), **fields).findings


CASES: dict[str, tuple[Case, Case]] = {
    "answer-stale": (answer(stale=True), answer()),
    "answer-failed": (answer(verdict="fail"), answer(verdict="warn")),
    "answer-not-confirmed": (answer(decision="conditional-fail"), answer(decision="conditional-pass")),
    "answer-not-replayed": (answer(provenance=("solved", "imported")), answer(provenance=("solved", "replayed"))),
    "answer-altered": (answer(altered=True), answer()),
    "answer-differs": (answer(provenance=("differs",)), answer(provenance=("replayed",))),
    **{FAULT_CODES[name].name: (answer(of_moment=(name,)), answer()) for name in MOMENT},
}
