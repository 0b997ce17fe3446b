"""What pages ask the process that works for them: functions that take a session as texts, and run there."""

import json
from collections import OrderedDict
from hashlib import blake2b
from typing import TYPE_CHECKING, Any, Final

from calib_core.messages import remember_parts, with_parts
from calib_core.records import Measured, Session, parse_session
from server.store.process_data import SessionTexts, with_stale

if TYPE_CHECKING:
    from calib_core.guidance.cell_plan import CellPlan, CellToPlan
    from calib_core.guidance.pose_list import PoseList
    from calib_core.records.base import PlannedStep

_MOST_SEEN: Final = 5000
_NOT_READ: Final = {"preview": [], "preview_on_sphere": []}
_seen: OrderedDict[bytes, Measured] = OrderedDict()  # by their texts' hashes; what was asked for last is last


def guide_text(texts: SessionTexts) -> str:
    """Return a session's guide as JSON text."""
    from calib_core.stages.guide import guide

    found = with_parts(guide(*_read(texts)).to_json())
    return json.dumps(found, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def planned(texts: SessionTexts, captures: int, step: "PlannedStep") -> "PoseList":
    """Return so many poses for a step that together leave least uncertainty."""
    from calib_core.guidance.pose_list import planned_poses

    return planned_poses(*_read(texts), captures, step)


def cell_plan(cell: "CellToPlan") -> "CellPlan":
    """Return what a cell will reach before it stands."""
    from calib_core.guidance.cell_plan import plan_cell

    return plan_cell(cell)


def seen_in(text: str) -> Measured:
    """Return what was seen in a capture, kept from one question to the next.

    It comes without the points that are drawn of a profile, most of the record: nobody who guides reads them.  The
    guide reads what those of a frame cover; frames are few in a session, and are read again.
    """
    key = blake2b(text.encode(), digest_size=16).digest()
    known = _seen.pop(key, None)
    if known is None:
        known = Measured.model_validate_json(text)
        remember_parts(known.model_extra)
        if known.image_size is not None:
            return known
        known = known.model_copy(update=_NOT_READ)
    _seen[key] = known
    while len(_seen) > _MOST_SEEN:
        _seen.popitem(last=False)
    return known


def _read(texts: SessionTexts) -> tuple[Session, list[Measured], dict[str, Any]]:
    """Return the session, what was seen in its captures, and its results with whether they are stale."""
    record = {**json.loads(texts.record), "captures": [json.loads(text) for text in texts.captures]}
    session = parse_session(record, texts.id)
    results = {stage: json.loads(text) for stage, text in texts.results.items()}
    remember_parts(results)
    return session, [seen_in(text) for text in texts.measured], with_stale(session, results, texts.digests)
