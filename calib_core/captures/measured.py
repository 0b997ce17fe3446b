"""What was measured in a capture, made of what was noticed in it."""

from collections.abc import Iterable
from typing import Any

from calib_core.errors import CalibrationError
from calib_core.findings import Finding, measured_judgement
from calib_core.findings.codes.quality import NOT_SEEN
from calib_core.records import Capture, Measured


def not_seen(capture: Capture, error: CalibrationError, **more: Any) -> Measured:
    """Return why a capture does not show what it is to show, and what to do."""
    found = NOT_SEEN([capture.id], need=error.need, got=error.got, to_do=error.to_do)
    return measured_of(capture, [found], **more)


def measured_of(capture: Capture, findings: Iterable[Finding], **figures: Any) -> Measured:
    """Return what was measured in a capture: what was noticed, and the figures by the fields of `Measured`."""
    return Measured(capture=capture.id, kind=capture.kind, **measured_judgement(findings), **figures)
