"""Plates and bars of balls, told otherwise than they are, and a ball beside its reflection."""

from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.records import Session
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.simulation.topology_scenarios import TOPOLOGY_SCENARIOS

Simulated = tuple[Session, dict[str, bytes], dict[str, Any]]
_PLATE = TOPOLOGY_SCENARIOS["plate"]


def told_plate(names: str, balls: int = 3, **cell: Any) -> Simulated:
    """Return captures of balls of a plate whose cell tells of those of `names`."""
    session, files, truth = simulate_topology(replace(_PLATE, balls=_PLATE.balls[:balls]), "plate", 2)
    data = session.to_json()
    spheres = [{"name": name, "diameter_mm": 40.0, "on": "base"} for name in names]
    return Session.model_validate({**data, "cell": {**data["cell"], "spheres": spheres, **cell}}), files, truth


def reflected(*captures: int, beside_mm: float = 45.0) -> Simulated:
    """Return captures of one ball, some of which show its arc once more, beside it and 6 mm nearer."""
    session, files, truth = simulate_topology(replace(_PLATE, balls=_PLATE.balls[:1]), "ball", 1)
    for number in captures:
        name = session.captures[number - 1].files[0]
        files[name] = _twice(files[name], beside_mm)
    return session, files, truth


def _twice(profile: bytes, beside_mm: float) -> bytes:
    head, *rows = profile.decode().splitlines()
    x, z = np.array([[float(value or "nan") for value in row.split(",")] for row in rows]).T
    seen = np.isfinite(z)
    shift = -np.sign(x[seen].mean()) * round(beside_mm / (x[1] - x[0]))
    other = np.roll(z, int(shift)) - 6.0
    both = np.where(seen, z, other)
    lines = [f"{a:.4f},{b:.4f}" if np.isfinite(b) else f"{a:.4f}," for a, b in zip(x, both, strict=True)]
    return "\n".join([head, *lines, ""]).encode()
