"""What `scancell run` prints of a merge."""

from math import hypot

from calib_core.records import MergeResult


def merge_summary(result: MergeResult) -> str:
    """Return the merge's figures as lines of text."""
    used = sum(row.used for row in result.residuals)
    size = " × ".join(f"{high - low:.1f}" for low, high in zip(result.low_mm, result.high_mm, strict=True))
    lines = [
        f"merge: {result.verdict}",
        f"  {used} of {len(result.residuals)} captures, {result.scanned_points:,} points into {result.points:,} "
        f"voxels of {result.voxel_mm:g} mm, {size} mm in the {result.frame}'s frame",
    ]
    if result.overlap_rms_mm is not None and result.expected_overlap_rms_mm is not None:
        lines.append(
            f"  scans lie {result.overlap_rms_mm:.4f} mm apart before any registration (RMS; "
            f"{result.expected_overlap_rms_mm:.4f} mm expected)"
        )
    if result.self_calibration is not None:
        moved = hypot(*result.self_calibration.shift[3:6])
        lines.append(
            f"  the overlap determines {result.self_calibration.directions} directions of tool and table better "
            f"than the captures did; the tool moved by {moved:.3f} mm"
        )
    if result.registered_overlap_rms_mm is not None:
        lines.append(
            f"  after registration {result.registered_overlap_rms_mm:.4f} mm; it moved the scans by "
            f"{result.registration_shift_rms_mm:.4f} mm (RMS)"
        )
    if result.surface_sigma_mm is not None:
        lines.append(f"  the merged surface is known to {result.surface_sigma_mm:.4f} mm (standard deviation)")
    if result.triangles:
        lines.append(f"  mesh of {result.triangles:,} triangles")
    return "\n".join([*lines, *(f"  ! {warning}" for warning in result.warnings)])
