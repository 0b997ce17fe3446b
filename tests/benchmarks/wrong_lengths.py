"""Sessions whose lengths or table angles are wrong in the ways in which users get them wrong."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from calib_core.records import Session, parse_session

SCALES = ((1.05, 1.0), (0.8, 1.0), (2.0, 1.0), (1.0, 1.2), (1.0, 0.5), (1.1, 1.1), (0.5, 0.5))
"""By what x and z of all profiles are multiplied."""


def scaled_file(data: bytes, x: float, z: float) -> bytes:
    """Return a profile of columns x_mm,z_mm with its numbers multiplied."""
    head, *lines = data.decode().splitlines()
    rows = [head]
    for line in lines:
        cells = line.split(",")
        if cells[0].strip() and cells[1].strip():
            cells[:2] = f"{float(cells[0]) * x:.6f}", f"{float(cells[1]) * z:.6f}"
        rows.append(",".join(cells))
    return ("\n".join(rows) + "\n").encode()


def scaled_files(files: Mapping[str, bytes], x: float, z: float) -> dict[str, bytes]:
    """Return all files with the profiles' numbers multiplied."""
    return {name: scaled_file(data, x, z) if name.endswith(".csv") else data for name, data in files.items()}


def changed(session: Session, change: Callable[[dict[str, Any]], None]) -> Session:
    """Return the session with its record changed."""
    data = session.to_json()
    change(data)
    return parse_session(data)


def _times(factor: float) -> Callable[[list[float]], list[float]]:
    return lambda angles: [factor * one for one in angles]


def _lost(at: int, step_deg: float) -> Callable[[list[float]], list[float]]:
    return lambda angles: [one - step_deg * (k >= at) for k, one in enumerate(angles)]


ANGLES: dict[str, Callable[[list[float]], list[float]]] = {
    "in radians": _times(np.pi / 180),
    "in radians, the other way": _times(-np.pi / 180),
    "in gon": _times(10 / 9),
    "in turns": _times(1 / 360),
    "steps of 30 for 45": _times(2 / 3),
    "10 % too large": _times(1.1),
    "numbered steps": lambda angles: [float(round(one / 45)) for one in angles],
    "a step of 45 lost": _lost(4, 45.0),
    "10 lost at the second height": _lost(11, 10.0),
}
"""What was told of the table's angles, from the right ones, one after the other."""


def told_angles(session: Session, wrong: Callable[[list[float]], list[float]]) -> Session:
    """Return the session with the table's angles told wrongly."""

    def change(data: dict[str, Any]) -> None:
        turned = [capture for capture in data["captures"] if capture.get("table_deg") is not None]
        for capture, angle in zip(turned, wrong([c["table_deg"] for c in turned]), strict=True):
            capture["table_deg"] = angle

    return changed(session, change)
