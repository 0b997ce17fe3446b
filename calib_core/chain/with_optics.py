"""Answers with what camera and plane of light, which gave their points, are not known to."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib_core.chain.held import Held
from calib_core.chain.moved import OpticsError, at_point_by, spread_of
from calib_core.chain.table_frame import frame_covariance
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.whole import ChainSolution


def with_optics(solution: TcpSolution, errors: Sequence[OpticsError]) -> TcpSolution:
    """Return a tool whose covariances have errors of camera and plane of light."""
    view, (held, more) = solution.in_view, (_wider(solution.held, errors), at_point_by(solution.held, errors))
    return replace(
        solution,
        covariance=held.covariance[:9, :9],
        held=held,
        in_view=replace(view, at_point=view.at_point + more, at_workpiece=view.at_workpiece + more),
        beside=replace(solution.beside, optics=tuple(errors)),
    )


def chain_with_optics(solution: ChainSolution, errors: Sequence[OpticsError]) -> ChainSolution:
    """Return a whole chain whose covariances have errors of camera and plane of light."""
    tcp, table = with_optics(solution.tcp, errors), solution.turntable
    size = table.state.walk.layout.axis_and_places(table.state.walk.layout.table)
    covariance = tcp.held.covariance
    frame = frame_covariance(table.state.table, covariance[np.ix_(size, size)], table.options.direction)
    by_unknowns = frame.pose_by_unknowns
    return replace(
        solution,
        tcp=tcp,
        turntable=replace(table, covariance=frame),
        cross_covariance=covariance[:6, size] @ by_unknowns.T,
        scanner_with_table=by_unknowns @ covariance[np.ix_(size, tcp.held.tool_and_scanner[6:])],
    )


def _wider(held: Held, errors: Sequence[OpticsError]) -> Held:
    return replace(held, covariance=held.covariance + spread_of(errors, len(held.covariance)))
