"""What `scancell demo` prints of the merged scans, beside the part as it is."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from calib_core.archive.stored_clouds import CLOUD_FILE, MESH_FILE, read_stored_ply
from calib_core.cell.found import placed_table
from calib_core.frames import FloatArray, RigidTransform
from calib_core.fusion.deviation import mesh_deviations, sphere_deviations
from calib_core.simulation.part import build_part
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.merge.record import MergeResult

_ABOUT_THE_BALL_MM = 1.0


def merge_lines(
    result: MergeResult, chain: ChainResult, truth: Mapping[str, Any], made: Mapping[str, bytes]
) -> Iterator[str]:
    """Give the merge's figures: the ball on the part, the distance of cloud and mesh from the true part.

    Parameters
    ----------
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
    yield f"\nmerge: {result.scanned_points:,} points as one cloud and a mesh — verdict {result.verdict}"
    yield f"  {'':22}{'found':>24}{'truth':>12}{'error':>10}"
    for name, file in (("cloud", CLOUD_FILE), ("mesh", MESH_FILE)):
        if file not in made:
            continue
        found = read_stored_ply(made[file], file).points_mm.astype(float)
        points = into_truth.apply(frame.apply(found))
        if name == "cloud":
            yield from _ball(points, truth)
        off = mesh_deviations(points, part.points_mm, part.triangles)
        text = f"RMS {off.rms_mm:.3f} mm, 95 % within {off.largest_mm(0.95):.3f} mm"
        yield f"  {name + ', off the part':22}{text:>46}"
    if result.overlap_rms_mm is not None and result.expected_overlap_rms_mm is not None:
        text = f"{result.overlap_rms_mm:.3f} mm (expected {result.expected_overlap_rms_mm:.3f} mm)"
        yield f"  {'scans apart, RMS':22}{text:>46}"


def _ball(points_in_true_turntable: FloatArray, truth: Mapping[str, Any]) -> Iterator[str]:
    center, diameter = np.array(truth["ball_center_in_turntable_mm"]), truth["ball_diameter_mm"]
    away = np.linalg.norm(points_in_true_turntable - center, axis=1) - diameter / 2
    above = points_in_true_turntable[:, 2] > center[2] - 0.25 * diameter  # the post holds it from below
    ball = sphere_deviations(points_in_true_turntable[above & (np.abs(away) < _ABOUT_THE_BALL_MM)])
    assert ball.center_mm is not None
    assert ball.radius_mm is not None
    found = 2 * ball.radius_mm
    yield f"  {'ball, diameter, mm':22}{found:24.3f}{diameter:12.3f}{found - diameter:10.3f}"
    yield f"  {'ball in base, error':22}{f'{np.linalg.norm(ball.center_mm - center):.3f} mm':>46}"
