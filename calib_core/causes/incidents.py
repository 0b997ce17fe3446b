"""Incidents that one cause explains, as root causes with their remedy."""

from collections.abc import Sequence

from calib_core.causes.readings import moved_poses
from calib_core.chain.incidents import Happened
from calib_core.records import BeforeAfter, Capture, Changes, RootCause


def incident_record(incident: Happened, captures: Sequence[Capture]) -> RootCause:
    """Return an incident with its remedy: the smaller part of the session left out, or two poses exchanged."""
    if incident.kind == "swapped-poses":
        one, other = incident.captures
        given = {one: other, other: one}
        return RootCause(
            id=f"swapped-poses-{one}"[:64],
            kind=incident.kind,
            title=f"Poses of {one} and {other} are swapped",
            sentence=incident.sentence,
            captures=list(incident.captures),
            changes=moved_poses(given, (), captures),
            poses_from=given,
        )
    used = [capture.id for capture in captures if not capture.excluded]
    after = [name for name in used if name in incident.captures]
    before = [name for name in used if name not in incident.captures]
    fewer = after if len(after) <= len(before) else before
    since = incident.captures[0]
    return RootCause(
        id=f"{incident.kind}-{since}"[:64],
        kind=incident.kind,
        title=f"The sphere moved before {since}"
        if incident.kind == "moved-sphere"
        else f"The scanner moved on the flange before {since}",
        sentence=incident.sentence,
        evidence=[BeforeAfter(label="Moved by", unit="mm", before=incident.distance_mm, after=None)],
        captures=list(incident.captures),
        changes=Changes(captures={name: {"excluded": True} for name in fewer}) if fewer else None,
    )
