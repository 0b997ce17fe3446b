"""What the results of all stages share."""

from importlib import import_module
from typing import Final

from pydantic import Field

from calib_core.records.base import Record, Verdict
from calib_core.records.evidence import AnyBlock

_SHOWN: Final = "calib_core.stages.evidence"  # by name: the records know nothing of what shows them


class CaptureResidual(Record):
    """What one capture contributed to a solve, or why it did not."""

    capture: str
    used: bool
    reason: str | None = None


class Result(Record):
    """What every stage's result has, beside the name of its `stage`.

    `warnings` are doubts, one sentence a cause; `notes` say what else is worth knowing; `evidence` is the result
    told in blocks, as terminal, report and page show it.
    """

    method: str
    software: str
    inputs_sha256: str
    verdict: Verdict
    warnings: list[str] = Field(default_factory=list)
    notes: list[str] = Field(default_factory=list)
    evidence: list[AnyBlock] = Field(default_factory=list[AnyBlock])

    def __str__(self) -> str:
        return import_module(_SHOWN).text_of(self)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.verdict}; print it, or show it in a notebook>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return import_module(_SHOWN).html_of(self)


class VarianceComponents(Record):
    """Standard deviations of the point noise and of the robot's random pose errors."""

    point_sigma_mm: float | None
    position_sigma_mm: float
    orientation_sigma_rad: float
    orientation_sigma_deg: float
    estimated: list[str] = Field(default_factory=list)


class Undetermined(Record):
    """A direction of the answer that the motions do not fix."""

    direction: list[float]
    description: str
