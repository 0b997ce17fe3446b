"""Whether a turntable can be trusted: the verdict, and every reason for doubt as a sentence."""

from collections.abc import Sequence

import numpy as np

from calib_core.chain.observations import TableObservation, named
from calib_core.chain.table_frame import TableCovariance
from calib_core.chain.table_reasons import remounted
from calib_core.chain.turntable import TurntableSolution
from calib_core.evidence.words import by_to_do
from calib_core.frames import FloatArray
from calib_core.records import Undetermined, Verdict
from calib_core.stages.tcp.verdict import is_beyond

_UNDETERMINED_RAD = np.deg2rad(0.5)
_UNDETERMINED_MM = 3.0
_WEAK_RAD = np.deg2rad(0.1)
_MOST_REJECTED = 1 / 3
_ONE_HEIGHT_MM = 20.0
_LARGE_ANGLE_RAD = np.deg2rad(0.05)
_HOPELESS_MM = 5.0


def turntable_verdict(
    table: TurntableSolution, observations: Sequence[TableObservation]
) -> tuple[Verdict, list[str]]:
    """Return the verdict on a turntable and its warnings: root causes first, and not what follows from them."""
    undetermined = [one.description for one in undetermined_of_table(table.covariance)]
    failures = [f"Not determined: {text}." for text in by_to_do(undetermined)]
    failures += _failures(table)
    doubts = [*_doubts_about_captures(table, observations), *_doubts_about_direction(table)]
    if failures:
        return "fail", failures + doubts
    warnings = [*doubts, *_doubts_about_axis(table), *_doubts_about_encoder(table)]
    return ("warn" if warnings else "pass"), warnings


def undetermined_of_table(covariance: TableCovariance) -> list[Undetermined]:
    """Return the directions in which the axis is not fixed: tilts beyond 0.5°, shifts beyond 3 mm."""
    found: list[Undetermined] = []
    values, vectors = np.linalg.eigh(covariance.axis_direction)
    for value, direction in zip(values, vectors.T, strict=True):
        if value > _UNDETERMINED_RAD**2:
            text = f"the axis may lean towards {_words(direction)} (±{_degrees(value)}): {_MORE}"
            found.append(Undetermined(direction=direction.tolist(), description=text))
    values, vectors = np.linalg.eigh(covariance.axis_point)
    for value, direction in zip(values, vectors.T, strict=True):
        if value > _UNDETERMINED_MM**2:
            shift = 2 * np.sqrt(value)
            text = f"the axis may lie further along {_words(direction)} (±{shift:.1f} mm): {_MORE}"
            found.append(Undetermined(direction=direction.tolist(), description=text))
    return found


_MORE = "capture the sphere all around, well off the axis and at two heights"


def _failures(table: TurntableSolution) -> list[str]:
    found: list[str] = []
    rejected = int(np.count_nonzero(~table.used))
    if rejected > _MOST_REJECTED * len(table.captures):
        found.append(
            f"{rejected} of {len(table.captures)} captures contradict the others "
            f"({named(table.captures, table.used)}). Check table angles, mountings and poses, then repeat these."
        )
    scatter = float(np.sqrt(np.mean(table.residuals.distance_mm[table.used] ** 2)))
    if scatter > _HOPELESS_MM:
        found.append(
            f"Table angles and scans do not fit together: the sphere is {scatter:.1f} mm off its circle. "
            "Check the angles, their unit, and that every capture has its own."
        )
    return found


def _doubts_about_captures(table: TurntableSolution, observations: Sequence[TableObservation]) -> list[str]:
    moved = table.tool_move.sentence if table.tool_move else None
    found = [sentence for sentence in (moved, remounted(observations, table)) if sentence]
    if 0 < np.count_nonzero(~table.used) <= _MOST_REJECTED * len(table.captures):
        found.append(
            f"Left out because they contradict the others: {named(table.captures, table.used)}; see their reasons."
        )
    if table.excess > 1:
        found.append(
            f"The captures scatter {np.sqrt(table.excess):.1f} times more than the given sigmas explain (wobble, "
            "play or a robot less exact than stated); the stated uncertainty is enlarged by that."
        )
    if scatters_by_table(table) and table.excess <= 1:
        found.append(
            f"The captures scatter by {table.sigmas.largest_position_mm:.2f} mm where the robot's sigma says "
            f"{table.options.position_sigma_mm:.2f} mm (wobble, play or a robot less exact than stated); the "
            "stated uncertainty holds it."
        )
    return found


def scatters_by_table(table: TurntableSolution) -> bool:
    """Return whether captures of the table scatter more than is told of the robot, and than the arm explains."""
    told_mm = table.options.position_sigma_mm
    return told_mm is not None and is_beyond(table.sigmas.largest_position_mm, max(told_mm, table.by_arm_mm))


def _doubts_about_axis(table: TurntableSolution) -> list[str]:
    found: list[str] = []
    values, vectors = np.linalg.eigh(table.covariance.axis_direction)
    weakest = f"weakest towards {_words(vectors[:, -1])} (±{_degrees(values[-1])})"
    if table.options.angles_unknown:
        sense = "" if table.options.direction else "; give turntable.direction before scanning by table angles"
        found.append(
            "The table's angles were not read: the axis rests on the shape of the circles alone, in direction "
            f"{weakest}, in place known to {2 * np.sqrt(np.trace(table.covariance.axis_point)):.2f} mm. The sense "
            f"of turning, angle zero and the encoder stay unknown{sense}."
        )
    heights = table.frame.mounts_mm[:, 2]
    if np.ptp(heights) < _ONE_HEIGHT_MM:
        found.append(
            f"One height only: the axis's direction rests on the plane of one circle, {weakest}. Mount the sphere "
            "100 mm or more higher and capture it all around again."
        )
    elif values[-1] > _WEAK_RAD**2:
        found.append(f"The axis's direction is weakly determined, {weakest}. Add angles all around, and heights.")
    return found


def _doubts_about_direction(table: TurntableSolution) -> list[str]:
    if table.options.direction in (None, table.frame.direction):
        return []
    return [
        f"The table turns the other way round than turntable.direction = {table.options.direction} says: its "
        f"angles count {'right' if table.frame.direction > 0 else 'left'}-handed about the axis that points up. "
        f"The answer has direction {table.frame.direction}; correct the cell."
    ]


def _doubts_about_encoder(table: TurntableSolution) -> list[str]:
    found = [table.pattern.sentence] if table.pattern is not None else []
    scale = table.encoder
    if scale.significant and not table.options.encoder_scale:
        done = (
            "The answer accounts for it"
            if scale.applied
            else "The answer does not account for it, as turntable.encoder is 'exact'"
        )
        found.append(
            f"The table turns by {100 * scale.error:+.3f} ± {200 * scale.sigma:.3f} % more than its angles say. "
            f"{done}; check the encoder and the gear."
        )
    if (
        table.pattern is None
        and table.options.angle_sigma_rad is None
        and table.sigmas.angle_rad > _LARGE_ANGLE_RAD
    ):
        found.append(
            f"The table's angles scatter by {np.rad2deg(table.sigmas.angle_rad):.3f}°: check the encoder and the "
            "table's brake."
        )
    return found


def _degrees(variance: float) -> str:
    return f"{np.rad2deg(2 * np.sqrt(variance)):.3f}°"


def _words(direction: FloatArray) -> str:
    signed = direction * np.sign(direction[np.argmax(np.abs(direction))])
    largest = int(np.argmax(np.abs(signed)))
    if signed[largest] > np.cos(np.deg2rad(15)):
        return f"base's {'xyz'[largest]}"
    return f"({signed[0]:.2f}, {signed[1]:.2f}, {signed[2]:.2f}) in base"
