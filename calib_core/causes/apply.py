"""Changes applied to a session, and the changes that undo them."""

from collections.abc import Mapping, Sequence
from typing import Any

from calib_core.causes.flange import brought_back
from calib_core.causes.readings import Reading, changes_of, moved_poses
from calib_core.causes.table import angles_of
from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.records import Capture, Changes, RootCause, Session, parse_session

_AGAIN = message("Solve it again: the session has changed since.")


def merge_patch(data: Any, changes: Any) -> Any:
    """Return data with changes merged in (RFC 7396): objects field by field, null removes, all else replaces."""
    if not isinstance(changes, Mapping):
        return changes
    merged = dict(data) if isinstance(data, Mapping) else {}
    for name, value in changes.items():
        if value is None:
            merged.pop(name, None)
        else:
            merged[name] = merge_patch(merged.get(name), value)
    return merged


def patch_back(before: Any, changes: Any) -> Any:
    """Return the merge patch that undoes changes of `before`: what they added is removed by null."""
    if not isinstance(changes, Mapping) or not isinstance(before, Mapping):
        return before
    return {name: patch_back(before[name], change) if name in before else None for name, change in changes.items()}


def applied(session: Session, changes: Changes) -> tuple[Session, Changes]:
    """Return the session with changes made, and the changes that undo them.

    Raises
    ------
    InputError
        If a capture is not there, or what comes out is no session.
    """
    record = session.to_json()
    captures = {capture["id"]: capture for capture in record.get("captures", [])}
    missing = [name for name in changes.captures if name not in captures]
    if missing:
        raise InputError("a capture of the session", ", ".join(repr(name) for name in missing), _AGAIN, "captures")
    undo = Changes(
        cell=patch_back(record["cell"], changes.cell),
        captures={name: patch_back(captures[name], change) for name, change in changes.captures.items()},
    )
    changed = {
        **record,
        "cell": merge_patch(record["cell"], changes.cell),
        "captures": [merge_patch(capture, changes.captures.get(name, {})) for name, capture in captures.items()],
    }
    return parse_session(changed, "session.json"), undo


def changes_for(session: Session, cause: RootCause) -> Changes:
    """Return all that applying a cause changes in a session: of captures of other stages too.

    Raises
    ------
    InputError
        If it has no remedy, or its captures are gone.
    """
    if cause.changes is None:
        need = "a root cause with a remedy"
        raise InputError(need, "'{cause}', which has none", cause.sentence, "cause", cause=cause.id)
    there = {capture.id for capture in session.captures}
    gone = sorted({*cause.changes.captures, *cause.poses_from.values()} - there)
    if gone:
        need = "the captures that the cause is about"
        raise InputError(need, "{gone} removed since", _AGAIN, "cause", gone=", ".join(gone))
    if cause.pose_reading is not None:
        return changes_of(Reading.recorded(cause.pose_reading), session.cell, session.captures)
    if cause.poses_from:
        lost = [name for name in cause.changes.captures if name not in cause.poses_from]
        return moved_poses(cause.poses_from, lost, session.captures)
    if cause.table_reading is not None:
        return angles_of(cause.table_reading, session.captures)
    if cause.flange_reading is not None:
        return brought_back(cause.flange_reading, session.cell, session.captures)
    if cause.point_settings:
        return settings_of(cause.point_settings, session.captures)
    return cause.changes


def settings_of(settings: Mapping[str, Any], captures: Sequence[Capture]) -> Changes:
    """Return what makes every file of points be read with these settings, beside those that it has."""
    files = [capture for capture in captures if capture.kind in ("profile", "cloud", "sweep")]
    return Changes(captures={capture.id: {"format_settings": dict(settings)} for capture in files})


def cause_named(causes: Sequence[RootCause], name: str) -> RootCause:
    """Return a cause by its id, its kind where only one has it, or its place, "1" being the best.

    Raises
    ------
    InputError
        If there is none.
    """
    found = [cause for cause in causes if cause.id == name] or [c for c in causes if c.kind == name]
    if not found and name.isascii() and name.isdigit() and 1 <= int(name) <= len(causes):
        found = [causes[int(name) - 1]]
    if not found:
        to_do = message("Solve the session to see them.")
        raise InputError.unknown(name, [cause.id for cause in causes] or [message("none")], "cause", to_do)
    return found[0]
