"""The whole chain's solution as the record that is stored, sent and archived."""

from collections.abc import Sequence

import numpy as np

from calib_core.chain.observations import TableObservation
from calib_core.chain.table_judging import TABLE_COLUMN
from calib_core.chain.whole import ChainSolution
from calib_core.frames import FloatArray
from calib_core.records import Result, Verdict
from calib_core.records.results import ArmErrorsFound, OpticsShift, ScannerFound
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResult, ToolResult
from calib_core.stages.tcp.result import by_pose, tcp_result
from calib_core.stages.tcp.verdict import beyond_told_sigma, doubts_about_two_steps
from calib_core.stages.turntable.result import table_fields, table_rows, variance_components
from calib_core.stages.turntable.verdict import scatters_by_table, turntable_verdict

METHOD = (
    "joint maximum likelihood over all points of both kinds of captures, errors of poses and angles integrated out"
)
_CHI2_6_RARE, _CHI2_5_RARE = 22.5, 20.5  # 99.9 %
_ORDER: tuple[Verdict, ...] = ("pass", "warn", "fail")


def chain_result(
    solution: ChainSolution, observations: Sequence[TableObservation], software: str, inputs_sha256: str
) -> ChainResult:
    """Return a solution as a record, with its verdict; `observations` are those of the table."""
    table = solution.turntable
    tcp = tcp_result(solution.tcp, software, inputs_sha256)
    table_verdict, table_warnings = turntable_verdict(table, observations)
    doubts, of_tcp = _disagreements(solution), tcp.warnings
    if table.tool_move and table.tool_move.sentence:  # the rest follows from it
        doubts = [table.tool_move.sentence]
        of_tcp = [one for one in of_tcp if one not in doubts_about_two_steps(solution.tcp)]
    verdicts: list[Verdict] = [tcp.verdict, table_verdict, "warn" if doubts else "pass"]
    return ChainResult(
        stage="chain",
        method=METHOD,
        software=software,
        inputs_sha256=inputs_sha256,
        verdict=max(verdicts, key=_ORDER.index),
        warnings=list(dict.fromkeys([*doubts, *of_tcp, *table_warnings])),
        notes=_notes(solution, tcp),
        turntable_covariance=table.covariance.pose.tolist(),
        cross_covariance=solution.cross_covariance.tolist(),
        residuals=[*tcp.residuals, *table_rows(observations, table)],
        **{name: getattr(tcp, name) for name in ToolResult.model_fields.keys() - Result.model_fields.keys()}
        | {
            "variance_components": variance_components(table),
            "scanner": tcp.scanner and _with_table(tcp.scanner, solution),
            "optics": _optics(solution, tcp),
            "arm_errors": _arm_errors(solution, tcp),
        },
        **table_fields(observations, table),
    )


def _notes(solution: ChainSolution, tcp: TcpResult) -> list[str]:
    """Return the tool's notes, but for what the table is doubted for."""
    table, told_mm = solution.turntable, solution.turntable.options.position_sigma_mm
    said = beyond_told_sigma(table.sigmas, told_mm) if scatters_by_table(table) else []
    return [note for note in tcp.notes if note not in said]


def _with_table(scanner: ScannerFound, solution: ChainSolution) -> ScannerFound:
    """Return what was found of the scanner, with what it does to the table."""
    left = scanner.left_in_files
    if left is not None and solution.left_of_table is not None:
        left = left.model_copy(update={"turntable": solution.left_of_table.tolist()})
    of_table = {"covariance_with_table": solution.scanner_with_table.tolist(), "left_in_files": left}
    return scanner.model_copy(update=of_table)


def _arm_errors(solution: ChainSolution, tcp: TcpResult) -> ArmErrorsFound | None:
    """Return how the tool errs together with the arm, with the table's share."""
    arm = solution.arm_with_table
    if tcp.arm_errors is None or arm is None:
        return None
    of_table = {"table_with_lengths": arm.with_lengths.tolist(), "table_with_poses": by_pose(arm.with_poses)}
    return tcp.arm_errors.model_copy(update=of_table)


def _optics(solution: ChainSolution, tcp: TcpResult) -> list[OpticsShift]:
    """Return what camera and plane of light do to the tool, with what they do to the table."""
    table = slice(TABLE_COLUMN, TABLE_COLUMN + solution.turntable.covariance.pose_by_unknowns.shape[1])
    moves = [solution.turntable.covariance.pose_by_unknowns @ e.step[table] for e in solution.tcp.optics]
    pairs = zip(tcp.optics, moves, strict=True)
    return [shift.model_copy(update={"turntable": move.tolist()}) for shift, move in pairs]


def _disagreements(solution: ChainSolution) -> list[str]:
    found: list[str] = []
    if solution.tcp_distance > _CHI2_6_RARE:
        found.append(
            f"The tcp stage alone gives a tool that differs {_words(solution.tcp_difference)}, more than its "
            "uncertainty allows: the captures of the table contradict those of the still sphere. Check that "
            "sphere, scanner mounting and robot are the same in both."
        )
    if solution.turntable_distance > _CHI2_5_RARE:
        found.append(
            f"The turntable stage alone gives a frame that differs {_words(solution.turntable_difference)}, more "
            "than its uncertainty allows: check the table's wobble, its angles, and that the scanner sits firmly."
        )
    return found


def _words(difference: FloatArray) -> str:
    return f"by {np.linalg.norm(difference[3:]):.3f} mm and {np.rad2deg(np.linalg.norm(difference[:3])):.3f}°"
