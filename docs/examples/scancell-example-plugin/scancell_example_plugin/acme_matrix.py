"""The tool as sixteen numbers in a line, as an invented controller wants it."""

from pydantic import Field

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export, Settings


class AcmeSettings(Settings):
    """How many digits the controller takes."""

    digits: int = Field(default=6, ge=3, le=12, description="Digits behind the point.")


def write(answer: Answer, settings: AcmeSettings) -> str:
    """Return tool0_from_laser, row by row, translation in mm."""
    numbers = answer.tool0_from_laser.matrix.ravel()
    return " ".join(f"{number:.{settings.digits}f}" for number in numbers) + "\n"


EXPORT = Export("acme-matrix", "ACME: the tool as a matrix", "text/plain", ".acm", write, AcmeSettings)
