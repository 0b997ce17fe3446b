"""`scancell simulate`: a session folder whose truth is known."""

from pathlib import Path

from calib_core.archive.folder import save_session, to_json_bytes
from calib_core.simulation import simulate as simulate_cell


def simulate(scenario: str, seed: int, out: Path) -> int:
    """Write the session folder of a simulated cell, with truth.json beside session.json."""
    simulated = simulate_cell(scenario, seed)
    save_session(out, simulated.session, {**simulated.files, "truth.json": to_json_bytes(simulated.truth)})
    print(f"{out}: {len(simulated.session.captures)} captures, scenario {scenario}, seed {seed}")
    return 0
