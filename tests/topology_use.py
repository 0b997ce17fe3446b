"""A cell of any topology put to use: solved, planned, exported, drawn and archived; what became of it."""

from contextlib import suppress
from pathlib import Path

import numpy as np

import calib_core as cc
from calib_core.library.opened import in_memory
from calib_core.simulation import TopologyScenario
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.guide import guide
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.scene_model import scene_facts
from server.scenes.stored import scene_input
from tests.topology_errors import distances

_CHI2_95 = {2: 5.99, 6: 12.59}
_EXPORTS = ("json", "urdf", "abb")


def put_to_use(scenario: TopologyScenario, seed: int, folder: Path) -> str:
    """Return `solved`, by what it is named that it is not, or how it is wrong; whatever it is, nothing breaks."""
    session, files, truth = simulate_topology(scenario, "drawn", seed)
    opened = in_memory(session, files)
    opened.check()
    try:
        results = opened.run()
    except cc.CalibrationError:
        return "named by an error"
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
        return "named by findings"
    # The 95 % of a χ² grow with the square of how many standard deviations are allowed.
    three = {many: 9.0 * limit / 4 for many, limit in _CHI2_95.items()}
    known = [one for one in last.frames if np.isfinite(np.array(one.matrix, dtype=float)).all()]
    found = distances(last.model_copy(update={"frames": known}), truth)
    far = [name for name, squared, many, _ in found if squared > three[many]]
    return f"wrong, with no word of it: {', '.join(far)}" if far else "solved"
