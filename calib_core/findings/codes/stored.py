"""What results say that have no findings of their own: those of releases before 0.2."""

from calib_core.findings.code import Code

_MEANING = (
    "The result was stored by a release that knew no findings, and says this as a sentence. Solve the stage again "
    "to get its findings."
)

SAID_BEFORE = Code(
    "stored-error",
    "error",
    text="{sentence}",
    meaning=_MEANING,
    decided="The stored result has the verdict `fail`, and this is its first sentence.",
    usual_causes="A result of a release before 0.2.",
    fixed=True,
)

SAID_WARNING = Code(
    "stored-warning",
    "warning",
    text="{sentence}",
    meaning=_MEANING,
    decided="The stored result has it among its warnings.",
    usual_causes="A result of a release before 0.2.",
    fixed=True,
)

SAID_NOTE = Code(
    "stored-note",
    "note",
    text="{sentence}",
    meaning=_MEANING,
    decided="The stored result has it among its notes.",
    usual_causes="A result of a release before 0.2.",
    fixed=True,
)
