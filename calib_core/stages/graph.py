"""The paper's calibrations in their order: which captures each stage takes, and what a result rests on."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

from calib_core.errors import InputError
from calib_core.records import Capture, Known, Session, Stage, Step
from calib_core.stages.stage import ReadFile

_OF_FRAMES: tuple[Step, ...] = ("camera", "laser-plane")  # what raw frames of later stages rest on


@dataclass(frozen=True)
class StageEntry:
    """One stage: the steps whose captures it takes, and what it gives that a user may bring.

    `tool_from` and `table_from` are the steps that its tool and its table come from, where the user brings none;
    with `every_step` it is solved only where there are captures of all its steps.
    """

    steps: tuple[Step, ...]
    known: Callable[[Known], object | None]
    tool_from: tuple[Step, ...] = ()
    table_from: tuple[Step, ...] = ()
    every_step: bool = False


STAGES: dict[Stage, StageEntry] = {
    "camera": StageEntry(("camera", "laser-plane"), lambda known: known.camera),
    "laser-plane": StageEntry(("laser-plane",), lambda known: known.laser_plane),
    "tcp": StageEntry(("tcp",), lambda known: known.tool0_from_laser),
    "turntable": StageEntry(("turntable",), lambda known: known.base_from_turntable, tool_from=("tcp",)),
    "chain": StageEntry(
        ("tcp", "turntable"),
        lambda known: known.tool0_from_laser or known.base_from_turntable,
        every_step=True,
    ),
    "merge": StageEntry(("scan",), lambda _known: None, tool_from=("tcp",), table_from=("turntable",)),
}


def stage_captures(session: Session, stage: str) -> list[Capture]:
    """Return the captures that a stage takes, the excluded ones too."""
    steps = stage_entry(stage).steps
    return [capture for capture in session.captures if capture.step in steps]


def inputs_sha256(session: Session, stage: str, read: ReadFile, digest: Callable[[str], str] | None = None) -> str:
    """Return the hash of all that a stage's result depends on: cell, captures, and their files' contents.

    A stored result is stale where this differs from the one it carries.  Where a store knows the SHA-256 of its
    files, `digest` gives it by a file's name, and nothing is read.
    """
    digest = digest or (lambda name: hashlib.sha256(read(name)).hexdigest())
    captures = _captures_it_rests_on(session, stage)
    names = [name for capture in captures if not capture.excluded for name in capture.files]
    inputs = {
        "stage": stage,
        "cell": session.cell.model_dump(mode="json", exclude_defaults=True),
        "captures": [capture.model_dump(mode="json", exclude_defaults=True) for capture in captures],
        "files": {name: digest(name) for name in names},
    }
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _captures_it_rests_on(session: Session, stage: str) -> list[Capture]:
    """Return a stage's captures, and those that tell how its raw frames become points."""
    entry = stage_entry(stage)
    steps: set[Step] = {*entry.steps}
    if entry.tool_from and session.cell.known.tool0_from_laser is None:
        steps |= {*entry.tool_from}
    if entry.table_from and session.cell.known.base_from_turntable is None:
        steps |= {*entry.table_from}
    captures = [capture for capture in session.captures if capture.step in steps]
    if stage != "camera" and any(capture.kind in ("frame", "sweep") for capture in captures):
        steps |= {*_OF_FRAMES}
        return [capture for capture in session.captures if capture.step in steps]
    return captures


def stage_entry(stage: str) -> StageEntry:
    """Return the entry of a stage by its name; raises InputError where there is no such stage."""
    for name, entry in STAGES.items():
        if name == stage:
            return entry
    got = f"'{stage}', which a later version will solve" if stage in get_args(Stage) else f"'{stage}'"
    raise InputError("a stage among all, " + ", ".join(STAGES), got, "Name one of these.", "stage")
