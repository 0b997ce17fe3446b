"""What `scancell demo` prints of the merged scans, beside the part as it is."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from calib_core.archive.stored_clouds import CLOUD_FILE, MESH_FILE, read_stored_ply
from calib_core.cell.found import placed_table
from calib_core.frames import FloatArray, RigidTransform
from calib_core.fusion.deviation import mesh_deviations, sphere_deviations
from calib_core.messages import message
from calib_core.simulation.part import build_part
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.merge.record import MergeResult
from server.commands.demo.sheet import Sheet

_ABOUT_THE_BALL_MM = 1.0


def add_merge(
    sheet: Sheet, result: MergeResult, chain: ChainResult, truth: Mapping[str, Any], made: Mapping[str, bytes]
) -> None:
    """Add the merge's figures: the ball on the part, the distance of cloud and mesh from the true part.

    Parameters
    ----------
    sheet : Sheet
    result : MergeResult
    chain : ChainResult
        The calibration that the scans were merged with.
    truth : mapping
        The simulator's.
    made : mapping
        The stored files by name.
    """
    part = build_part()
    into_truth = RigidTransform.from_rounded(truth["base_from_turntable"], "base", "turntable").inverse()
    frame = placed_table(chain.model_dump())
    sheet.title(
        result.stage,
        result.verdict,
        message("{points:,} points as one cloud and a mesh", points=result.scanned_points),
    )
    sheet.heads(message("found"))
    files = {CLOUD_FILE: message("cloud, off the part"), MESH_FILE: message("mesh, off the part")}
    for file, label in files.items():
        if file not in made:
            continue
        found = read_stored_ply(made[file], file).points_mm.astype(float)
        points = into_truth.apply(frame.apply(found))
        if file == CLOUD_FILE:
            _add_ball(sheet, points, truth)
        off = mesh_deviations(points, part.points_mm, part.triangles)
        within = message(
            "RMS {rms_mm:.3f} mm, 95 % within {within_mm:.3f} mm",
            rms_mm=off.rms_mm,
            within_mm=off.largest_mm(0.95),
        )
        sheet.line(label, within)
    if result.overlap_rms_mm is not None and result.expected_overlap_rms_mm is not None:
        rms, expected = f"{result.overlap_rms_mm:.3f} mm", f"{result.expected_overlap_rms_mm:.3f} mm"
        sheet.line(
            message("scans apart, RMS"),
            message("{found} (expected about {expected})", found=rms, expected=expected),
        )


def _add_ball(sheet: Sheet, points_in_true_turntable: FloatArray, truth: Mapping[str, Any]) -> None:
    center, diameter = np.array(truth["ball_center_in_turntable_mm"]), truth["ball_diameter_mm"]
    away = np.linalg.norm(points_in_true_turntable - center, axis=1) - diameter / 2
    above = points_in_true_turntable[:, 2] > center[2] - 0.25 * diameter  # the post holds it from below
    ball = sphere_deviations(points_in_true_turntable[above & (np.abs(away) < _ABOUT_THE_BALL_MM)])
    assert ball.center_mm is not None
    assert ball.radius_mm is not None
    found = 2 * ball.radius_mm
    sheet.numbers(message("ball, diameter, mm"), f"{found:.3f}", found, diameter)
    sheet.line(message("ball on the part, error"), f"{np.linalg.norm(ball.center_mm - center):.3f} mm")
