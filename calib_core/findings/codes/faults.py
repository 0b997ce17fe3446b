"""What speaks against using an answer, as `answer.faults` and `allow` name it: `FAULT_CODES`."""

from collections.abc import Mapping
from typing import Final

from calib_core.findings.code import Code

ANSWER_STALE = Code(
    "answer-stale",
    "error",
    text="The answer's inputs have changed since it was solved.",
    to_do="Solve the session again.",
    meaning="Captures or the cell were changed: the answer is that of another state.",
    decided="The key of what it was solved from is not that of today. `allow=stale` exports it, marked.",
    usual_causes="A capture that was added, excluded or corrected after solving.",
    fixed=True,
)

ANSWER_FAILED = Code(
    "answer-failed",
    "error",
    text="The answer has the verdict 'fail'.",
    to_do="Mend what its result names, and solve again.",
    meaning="The answer's own result says that it must not be used.",
    decided="A finding of its result is an error. `allow=fail` exports it, marked.",
    usual_causes="See the errors of its result.",
    fixed=True,
)

ANSWER_NOT_CONFIRMED = Code(
    "answer-not-confirmed",
    "error",
    text="The answer's latest verification failed its limits.",
    to_do="Look at the verification, calibrate again, and verify again.",
    meaning="Captures that had no part in the answer contradict it.",
    decided="The decision of the latest verification is `fail` or `conditional-fail`.",
    usual_causes="A scanner that was moved after the calibration.",
    fixed=True,
)

ANSWER_NOT_REPLAYED = Code(
    "answer-not-replayed",
    "error",
    text="The answer was imported, and not solved anew here.",
    to_do="Wait for its replay, replay the session, or solve it again.",
    meaning="What another installation found is not known to follow from the captures.",
    decided="The result's provenance is `imported`.",
    usual_causes="An archive or folder that was imported a moment ago.",
    fixed=True,
)

ANSWER_DIFFERS = Code(
    "answer-differs",
    "error",
    text="The answer was imported, and solving it anew here gives other numbers.",
    to_do="Look at how far they differ, and solve the session.",
    meaning="The imported result does not follow from its captures.",
    decided="With the same revision of the method a number is more than a thousandth of its sigma off.",
    usual_causes="A result that was altered, files that are not those it was solved from.",
    fixed=True,
)

ANSWER_ALTERED = Code(
    "answer-altered",
    "error",
    text="Stored records that this answer rests on were changed or removed in the database itself, or their "
    "signatures are not trusted here.",
    to_do="`scancell doctor` names them; put them right, trust their key (`scancell trust add`), or have them signed as "
    "they stand (`--accept`).",
    meaning="The server signs what it stores, and numbers what was decided: a signature is broken, or a number missing.",
    decided="A session, a capture, a policy or an entry of the signed log is not as it was stored here.",
    usual_causes="A hand in the database; a store that was moved or restored without its key; a copy of its file that was "
    "put back without `scancell restore`.",
    fixed=True,
)

CELL_DRIFTED = Code(
    "cell-drifted",
    "warning",
    text="The cell's answers changed by more than their uncertainty.",
    to_do="Look at the cell's drift, and acknowledge it.",
    meaning="Something in the cell changed between two calibrations.",
    decided="Two answers in a row differ by more than both uncertainties allow, and nobody acknowledged it.",
    usual_causes="A collision, a scanner or table that was mounted anew.",
    fixed=True,
)

ANSWER_OVERDUE = Code(
    "answer-overdue",
    "warning",
    text="The answer is older than the cell's policy allows.",
    to_do="Calibrate or verify the cell again.",
    meaning="The policy of the cell says how often it is calibrated or verified.",
    decided="More days have passed than `interval_days`.",
    usual_causes="A calibration that was forgotten.",
    fixed=True,
)

EQUIPMENT_CHANGED = Code(
    "equipment-changed",
    "warning",
    text="The answer is of other equipment than the answer in force.",
    to_do="Check the serial numbers, and acknowledge the change.",
    meaning="A scanner, sphere or robot with another serial number needs a calibration of its own.",
    decided="A serial number of cell.equipment is another one.",
    usual_causes="A scanner that was replaced, a typing error.",
    fixed=True,
)

VERIFICATION_MISSING = Code(
    "verification-missing",
    "warning",
    text="The cell's policy needs a verification that decides, and there is none of this answer.",
    to_do="Take captures for the verification until it decides.",
    meaning="The policy of the cell asks for a verification before a release.",
    decided="There is no verification, or it decided nothing.",
    usual_causes="Too few captures of the verification, or limits that were not set.",
    fixed=True,
)

FAULT_CODES: Final[Mapping[str, Code]] = {
    "stale": ANSWER_STALE,
    "fail": ANSWER_FAILED,
    "verify-fail": ANSWER_NOT_CONFIRMED,
    "not-replayed": ANSWER_NOT_REPLAYED,
    "differs": ANSWER_DIFFERS,
    "altered": ANSWER_ALTERED,
    "drift": CELL_DRIFTED,
    "overdue": ANSWER_OVERDUE,
    "equipment-changed": EQUIPMENT_CHANGED,
    "verify-undecided": VERIFICATION_MISSING,
}
"""The codes of the faults, by the names that `answer.faults` and `allow` have."""
