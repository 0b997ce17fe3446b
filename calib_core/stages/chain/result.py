"""The whole chain's solution as the record that is stored, sent and archived."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib_core.chain.observations import TableObservations
from calib_core.chain.whole import ChainSolution
from calib_core.findings import Code, Finding, judgement
from calib_core.findings.codes import turntable as codes
from calib_core.frames import FloatArray
from calib_core.records import Result
from calib_core.records.results import ArmErrorsFound, OpticsShift, ScannerFound
from calib_core.stages.axes_found import axes_found
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.tcp.record import TcpResult, ToolResult
from calib_core.stages.tcp.result import by_pose, tcp_result
from calib_core.stages.turntable.result import table_fields, table_rows, variance_components

METHOD = (
    "joint maximum likelihood over all points of both kinds of captures, errors of poses and angles integrated out"
)
_CHI2_6_RARE, _CHI2_5_RARE = 22.5, 20.5  # 99.9 %


def chain_result(
    solution: ChainSolution,
    observations: TableObservations,
    software: str,
    inputs_sha256: str,
    findings: Sequence[Finding],
) -> ChainResult:
    """Return a solution as a record, with what was noticed; `observations` are those of the table."""
    table = solution.turntable
    tcp = tcp_result(solution.tcp, software, inputs_sha256, findings)
    on_table = {o.sphere.capture for o in observations}
    return ChainResult(
        stage="chain",
        method=METHOD,
        software=software,
        inputs_sha256=inputs_sha256,
        **judgement(findings),
        turntable_covariance=table.covariance.pose.tolist(),
        cross_covariance=solution.cross_covariance.tolist(),
        residuals=[
            *(row for row in tcp.residuals if row.capture not in on_table),
            *table_rows(observations, table, findings),
        ],
        frames=tcp.frames,
        axes=axes_found(table.state, table.unknowns_covariance),
        **{
            name: getattr(tcp, name)
            for name in ToolResult.model_fields.keys() - Result.model_fields.keys() - {"axes"}
        }
        | {
            "variance_components": variance_components(table),
            **_scanners(solution, tcp),
            "optics": _optics(solution, tcp),
            "arm_errors": _arm_errors(solution, tcp),
        },
        **table_fields(observations, table),
    )


def _scanners(solution: ChainSolution, tcp: TcpResult) -> dict[str, Any]:
    """Return what was found of each scanner, that of the first with what it does to the table."""
    first = tcp.errors_of_scanner and _with_table(tcp.errors_of_scanner, solution)
    if not isinstance(tcp.scanner, str):
        return {"scanner": first}
    return {"scanner": tcp.scanner, "scanner_errors": {**(tcp.scanner_errors or {}), tcp.scanner: first}}


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
    of_table: dict[str, Any] = {
        "table_with_lengths": arm.with_lengths.tolist(),
        "table_with_poses": by_pose(arm.with_poses),
    }
    own = solution.tcp.arm
    if own is not None and own.applied:
        of_table["table_with_terms"] = (arm.with_terms * [term.sigma for term in own.terms]).tolist()
    return tcp.arm_errors.model_copy(update=of_table)


def _optics(solution: ChainSolution, tcp: TcpResult) -> list[OpticsShift]:
    """Return what camera and plane of light do to the tool, with what they do to the table."""
    table = solution.turntable.state.walk.layout.axis_and_places(solution.turntable.state.walk.layout.table)
    moves = [solution.turntable.covariance.pose_by_unknowns @ e.step[table] for e in solution.tcp.beside.optics]
    pairs = zip(tcp.optics, moves, strict=True)
    return [shift.model_copy(update={"turntable": move.tolist()}) for shift, move in pairs]


def disagreements(solution: ChainSolution) -> list[Finding]:
    """Return where one kind of captures alone gives another answer than both."""
    found: list[Finding] = []
    if solution.tcp_distance > _CHI2_6_RARE:
        found.append(_differs(codes.CHAIN_TOOL_DIFFERS, solution.tcp_difference))
    if solution.turntable_distance > _CHI2_5_RARE:
        found.append(_differs(codes.CHAIN_TABLE_DIFFERS, solution.turntable_difference))
    return found


def _differs(code: Code, difference: FloatArray) -> Finding:
    return code(
        shift_mm=float(np.linalg.norm(difference[3:])), turn_deg=float(np.rad2deg(np.linalg.norm(difference[:3])))
    )
