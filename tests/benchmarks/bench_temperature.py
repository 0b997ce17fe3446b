"""A steel ball in a workshop at 10 to 30 °C: the answer's error with its temperature told, and not told."""

import numpy as np
from harness import Row

from calib_core.frames import RigidTransform
from calib_core.records import Session, parse_session
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage

_EXPANSION_PER_K, _LEAST_C, _MOST_C = 11.5e-6, 10.0, 30.0
KINDS = ("at 20 °C", "told", "not told")


def told(session: Session, kind: str, ball_c: float) -> Session:
    """Return what is said of a session's sphere: its certificate holds at 20 °C, it was captured at `ball_c`."""
    record = session.to_json()
    sphere = {"kind": "sphere", "expansion_per_k": _EXPANSION_PER_K}
    record["cell"] |= {"equipment": [sphere], "sphere_diameter_sigma_mm": 0.002}
    if kind != "at 20 °C":
        record["cell"]["sphere_diameter_mm"] /= 1 + _EXPANSION_PER_K * (ball_c - 20.0)
    return parse_session(record | ({"environment": {"ball_c": ball_c}} if kind == "told" else {}), "session")


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes ten times as many sessions."""
    count = 300 if full else 30
    scales = {kind: np.zeros(count) for kind in KINDS}
    errors_mm = {kind: np.zeros(count) for kind in KINDS}
    within = dict.fromkeys(KINDS, 0)
    for seed in range(count):
        made = simulate("tcp", seed)
        true = RigidTransform.from_rounded(made.truth["tool0_from_laser"], "tool0", "laser")
        true_mm = made.session.cell.sphere_diameter_mm
        assert true_mm is not None
        ball_c = float(np.random.default_rng(seed).uniform(_LEAST_C, _MOST_C))
        for kind in KINDS:
            session = told(made.session, kind, ball_c)
            result = solve_stage(session, "tcp", made.files.__getitem__).to_json()
            notes = [one["values"] for one in result["findings"] if one["code"] == "length-at-temperature"]
            used_mm = notes[0]["length_mm"] if notes else session.cell.sphere_diameter_mm
            scales[kind][seed] = used_mm / true_mm - 1
            found = RigidTransform.from_rounded(result["tool0_from_laser"], "tool0", "laser")
            point, spread = (np.array(result["workpiece"][name]) for name in ("point_in_laser_mm", "covariance"))
            error = found.apply(point) - true.apply(point)
            errors_mm[kind][seed] = np.linalg.norm(error)
            within[kind] += float(error @ np.linalg.solve(spread, error)) < 7.815  # 95 % of three dimensions
    rows = [
        Row(
            f"error of scale over {count} sessions, {kind}",
            "as at 20 °C" if kind == "told" else "",
            f"RMS {1e6 * np.sqrt(np.mean(scales[kind] ** 2)):.1f} ppm of the diameter; tool's RMS error at the "
            f"workpiece {np.sqrt(np.mean(errors_mm[kind] ** 2)):.4f} mm",
            bool(np.max(np.abs(scales[kind])) < 1e-8) if kind == "told" else None,
        )
        for kind in KINDS
    ]
    rows += [
        Row(
            f"errors within the stated 95 %, {kind}",
            "≥ 90 %",
            f"{within[kind]} of {count}",
            within[kind] >= 0.9 * count - 1.5 * np.sqrt(0.05 * 0.95 * count),
        )
        for kind in KINDS
    ]
    return rows
