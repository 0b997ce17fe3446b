"""A cell of any topology put to use: solved, planned, merged, exported, drawn and archived; what became of it."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import calib_core as cc
from calib_core.graph.stage_input import Kept
from calib_core.library.opened import in_memory
from calib_core.records import Session
from calib_core.simulation import TopologyScenario
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.guide import guide
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import solve_stage
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.scene_model import scene_facts
from server.scenes.stored import scene_input
from tests.topology_errors import distances

_CHI2_95 = {2: 5.99, 6: 12.59}
_EVERY = 5
_PATCH = "".join(f"{x} {y} 190\n" for x in range(-20, 21) for y in range(-20, 21)).encode()
_EXPORTS = ("json", "urdf", "abb")


def put_to_use(scenario: TopologyScenario, seed: int, folder: Path) -> str:
    """Return `solved`, by what codes it is named, or how it is wrong; whatever it is, nothing breaks."""
    session, files, truth = simulate_topology(scenario, "drawn", seed)
    opened = in_memory(session, files)
    opened.check()
    try:
        results = opened.run()
    except cc.CalibrationError as error:
        return f"named by an error of {error.where}"
    guide(opened.record, [], results)
    for name in _EXPORTS:
        with suppress(cc.CalibrationError):  # said in a sentence, as that a position is open
            opened.export(name, allow=["fail", "stale", "not-replayed"])
    data = {stage: result.to_json() for stage, result in results.items()}
    facts = scene_facts(scene_input(opened.record, opened.read, [], data))
    assert draw(facts, look_at(facts))
    assert opened.pack(folder / f"{seed}.zip").stat().st_size > 0
    last = results["chain" if "chain" in results else "tcp"]
    if last.verdict == "fail":
        return f"named by {', '.join(sorted({one.code for one in last.findings if one.severity == 'error'}))}"
    assert merge_of_patches(session, files, results).points > 0
    # The 95 % of a χ² grow with the square of how many standard deviations are allowed.
    three = {many: 9.0 * limit / 4 for many, limit in _CHI2_95.items()}
    known = [one for one in last.frames if np.isfinite(np.array(one.matrix, dtype=float)).all()]
    found = distances(last.model_copy(update={"frames": known}), truth)
    far = [name for name, squared, many, _ in found if squared > three[many]]
    return f"wrong, with no word of it: {', '.join(far)}" if far else "solved"


def merge_of_patches(session: Session, files: Mapping[str, bytes], results: Mapping[str, Any]) -> MergeResult:
    """Return the merge of a flat patch that each scanner sees before itself at some of its captures."""
    own = sorted(session.captures, key=lambda one: one.scanner or "")
    scan = {"step": "scan", "kind": "cloud", "files": ["captures/patch.xyz"], "mount": None, "side": None}
    scans = [one.model_copy(update={**scan, "id": f"scan-{one.id}"}) for one in own[::_EVERY]]
    of_part = session.model_copy(update={"captures": [*session.captures, *scans]})
    read = {**files, "captures/patch.xyz": _PATCH}.__getitem__
    merged = solve_stage(of_part, "merge", read, kept=Kept(results=dict(results)))
    assert isinstance(merged, MergeResult)
    return merged
