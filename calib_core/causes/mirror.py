"""Centres of the sphere whose frame is left-handed: no turn of the scanner brings them together, a mirror does."""

from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.causes.search import MUCH_CLOSER
from calib_core.chain.observations import Observations, SphereSize
from calib_core.chain.start import centers_of, find_start
from calib_core.findings import Finding
from calib_core.findings.codes import causes as codes
from calib_core.records import BeforeAfter, Capture, Changes, RootCause, Session

_LEAST_CAPTURES = 7
_AXIS = "y"
"""With a turn of the scanner, each axis mirrors as well; across the stripe, programs count either way."""


def mirror_causes(session: Session, observations: Observations, sphere: SphereSize) -> list[Finding]:
    """Return that clouds or centres of the still sphere are mirrored, where they fit far better so."""
    if len(observations) < _LEAST_CAPTURES or any(o.kind == "profile" for o in observations):
        return []
    centers = centers_of(observations, sphere)
    mirrored = replace(centers, measured=centers.measured * np.array([1.0, -1.0, 1.0]))
    before_mm, after_mm = (find_start(one).scatter_mm for one in (centers, mirrored))
    if after_mm > MUCH_CLOSER * before_mm:
        return []
    evidence = BeforeAfter(label="Scatter of the sphere's centre", unit="mm", before=before_mm, after=after_mm)
    remedy = RootCause(
        id="points-mirrored",
        kind="scaled-profile",
        evidence=[evidence],
        changes=Changes(captures={c.id: turned_round(c, _AXIS) for c in session.captures if _has_points(c)}),
    )
    found: dict[str, Any] = {"axis": _AXIS, "before_mm": before_mm, "after_mm": after_mm}
    return [codes.POINTS_MIRRORED(remedy=remedy, of="sphere", **found)]


def turned_round(capture: Capture, axis: str) -> dict[str, object]:
    """Return the change of a capture by which an axis of its points counts the other way."""
    if capture.center_mm is not None:
        return {"center_mm": [-v if a == axis else v for a, v in zip("xyz", capture.center_mm, strict=True)]}
    name = f"{axis}_scale"
    return {"format_settings": {name: -float((capture.format_settings or {}).get(name, 1.0))}}


def _has_points(capture: Capture) -> bool:
    return capture.kind in ("cloud", "center")
