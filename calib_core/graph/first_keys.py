"""The hash of a stage's inputs as version 0.1.0 made it, so that its results are still known to be fresh."""

import hashlib
import json
from collections.abc import Callable

from calib_core.graph.registry import STAGES
from calib_core.graph.stage import Stage
from calib_core.records import Session
from calib_core.steps import steps_that_show

_LATER = {
    "taken", "clock", "excluded_because", "included_because", "added_because", "changed_because", "environment"
}  # fmt: skip


def inputs_sha256_of_0_1_0(session: Session, stage: Stage, digest: Callable[[str], str]) -> str:
    """Return the hash over the whole cell and the whole captures of a stage and of those it rests on.

    It is kept for the results of that version alone: nothing new is ever marked with it.
    """
    steps = {*stage.steps}
    boards = steps_that_show("board")
    if not stage.needs_every_step:
        before = [STAGES.get(name) for name in stage.after]
        steps |= {
            other.step.name
            for other in before
            if other.step and other.step.name not in boards and not other.is_brought(session)
        }
    captures = [capture for capture in session.captures if capture.step in steps]
    if stage.after and any(capture.kind in ("frame", "sweep") for capture in captures):
        steps |= {*boards}
        captures = [capture for capture in session.captures if capture.step in steps]
    names = [name for capture in captures if not capture.excluded for name in capture.files]
    inputs = {
        "stage": stage.name,
        "cell": session.cell.model_dump(mode="json", exclude_defaults=True, exclude={"findings"}),
        "captures": [
            capture.model_dump(mode="json", exclude_defaults=True, exclude=_LATER) for capture in captures
        ],
        "files": {name: digest(name) for name in names},
    }
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()
