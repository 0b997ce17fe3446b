"""The least error of a scanner on the flange by balls that stand together, several at a stop (Cramér–Rao)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from calib_core.simulation import TcpScenario
from calib_core.simulation.motion import FloatArray
from calib_core.simulation.sensor import arc_points


def plate_bound(truth: Mapping[str, Any], options: TcpScenario) -> tuple[float, float]:
    """Return the least RMS error, mm, of the scanner's place, and of its point where it sees balls on average.

    Nothing but the six of tool0_from_laser and the balls' places is unknown; a stop's pose errs for all its balls.
    """
    mount = np.array(truth["tool0_from_laser"])
    balls = {ball["name"]: (np.array(ball["center_mm"]), ball["diameter_mm"] / 2) for ball in truth["spheres"]}
    places = dict(zip(balls, np.eye(len(balls)), strict=True))
    information = np.zeros((6 + 3 * len(balls),) * 2)
    seen: list[FloatArray] = []
    for stop, names in truth["balls_seen"].items():
        actual = np.array(truth["base_from_tool0"][stop])
        way = actual @ mount
        rows: list[Any] = []
        spread: list[Any] = []
        for name in names:
            center, radius_mm = balls[name]
            seen.append(way[:3, :3].T @ (center - way[:3, 3]))
            points = arc_points(seen[-1], radius_mm, options)
            normals = (points - seen[-1]) / radius_mm @ way[:3, :3].T
            on_flange, by_shift = points @ mount[:3, :3].T + mount[:3, 3], normals @ actual[:3, :3]
            by_place = np.hstack([-own * normals for own in places[name]])
            rows.append(np.hstack([np.cross(points, normals @ way[:3, :3]), by_shift, by_place]))
            by_turn = np.cross(on_flange, by_shift) * options.orientation_sigma_rad
            spread.append(np.hstack([by_turn, normals * options.position_sigma_mm]))
        jacobian, errors = np.vstack(rows), np.vstack(spread)
        # Woodbury: (σ² I + S Sᵀ)⁻¹ without the large matrix.
        inner = np.linalg.inv(options.point_sigma_mm**2 * np.eye(6) + errors.T @ errors)
        shared = errors.T @ jacobian
        information += (jacobian.T @ jacobian - shared.T @ inner @ shared) / options.point_sigma_mm**2
    tool = np.linalg.inv(information)[:6, :6]
    by_turn = -np.cross(np.mean(seen, axis=0) * [1.0, 0.0, 1.0], np.eye(3), axisb=0, axisc=0)
    by_tool = np.hstack([mount[:3, :3] @ by_turn, np.eye(3)])
    return float(np.sqrt(np.trace(tool[3:, 3:]))), float(np.sqrt(np.trace(by_tool @ tool @ by_tool.T)))
