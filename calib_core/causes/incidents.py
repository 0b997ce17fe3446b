"""What happened to the captures, as a finding with its remedy: a part left out, or two poses exchanged."""

from collections.abc import Sequence
from typing import cast

from calib_core.causes.readings import moved_poses
from calib_core.chain.incidents import Happened
from calib_core.findings import Finding
from calib_core.findings.codes import causes as codes
from calib_core.records import BeforeAfter, Capture, CauseKind, Changes, RootCause


def incident_finding(happened: Happened, captures: Sequence[Capture] = ()) -> Finding:
    """Return a cause with its remedy: the smaller part of the session left out, or two poses exchanged."""
    return happened.code(list(happened.captures), remedy=_remedy(happened, captures), **happened.values)


def _remedy(happened: Happened, captures: Sequence[Capture]) -> RootCause:
    since = happened.captures[0]
    given: dict[str, str] = {}
    if happened.code is codes.SWAPPED_POSES:
        one, other = happened.captures
        given = {one: other, other: one}
    shift = happened.values.get("shift_mm")
    evidence = [BeforeAfter(label="Moved by", unit="mm", before=shift, after=None)] if shift is not None else []
    return RootCause(
        id=f"{happened.kind}-{since}"[:64],
        kind=cast(CauseKind, happened.kind),
        evidence=evidence,
        captures=list(happened.captures),
        changes=_changes(given, happened, captures),
        poses_from=given,
    )


def _changes(given: dict[str, str], happened: Happened, captures: Sequence[Capture]) -> Changes | None:
    if not given:
        return _fewer(happened, captures)
    # Arrays that come without records have nothing to change.
    return moved_poses(given, (), captures) if given.keys() <= {capture.id for capture in captures} else None


def _fewer(happened: Happened, captures: Sequence[Capture]) -> Changes | None:
    used = [capture.id for capture in captures if not capture.excluded]
    after = [name for name in used if name in happened.captures]
    before = [name for name in used if name not in happened.captures]
    fewer = after if len(after) <= len(before) else before
    return Changes(captures={name: {"excluded": True} for name in fewer}) if fewer else None
