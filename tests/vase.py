"""Scans of a vase on a turntable: as arrays, and as the captures of a session whose tool and table are known."""

from typing import Any

import numpy as np


def view(side: int, seed: int = 0) -> np.ndarray:
    """A scan (side, side, 3) of a turned vase 200 mm high, seen from 400 mm: ±60° around it, noise 0.02 mm."""
    rng = np.random.default_rng(seed)
    around, height = np.meshgrid(
        np.deg2rad(np.linspace(-60, 60, side)), np.linspace(-100, 100, side), indexing="ij"
    )
    radius = 80 + 15 * np.sin(height / 25) + rng.normal(0, 0.02, around.shape)
    points = np.stack([height, radius * np.sin(around), 400 - radius * np.cos(around)], axis=-1)
    return points.astype(np.float32)


def poses(count: int) -> list[np.ndarray]:
    """turntable_from_laser as the table turns."""
    result = []
    for k in range(count):
        c, s = np.cos(2 * np.pi * k / count), np.sin(2 * np.pi * k / count)
        turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        result.append(turn @ np.array([[0, 0, -1.0, 400], [0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]]))
    return result


def vase_session(scans: int, side: int) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return the record of a session of so many scans of side × side points around the vase, and its files."""
    head = (
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {side}\nHEIGHT {side}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {side * side}\nDATA binary\n"
    ).encode()
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    for number in range(scans):
        name = f"captures/s{number:03d}.pcd"
        captures.append(
            {
                "id": f"s{number:03d}",
                "step": "scan",
                "kind": "cloud",
                "files": [name],
                "pose": np.eye(4).ravel().tolist(),
                "table_deg": -360.0 * number / scans,
            }
        )
        files[name] = head + view(side, number).tobytes()
    cell = {
        "pose_convention": "matrix",
        "scanner": {"kind": "cloud", "point_sigma_mm": 0.02},
        "merge": {"voxel_mm": 0.5, "mesh": "none"},
        "known": {"tool0_from_laser": poses(1)[0].tolist(), "base_from_turntable": np.eye(4).tolist()},
    }
    return {"format": "scancell-session/1", "name": "vase", "cell": cell, "captures": captures}, files
