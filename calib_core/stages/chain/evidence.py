"""What the whole chain's result says of itself: tool and table from all captures together."""

from calib_core.records import Session
from calib_core.records.evidence import AnyBlock
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.evidence_parts import (
    captures_used,
    left_out,
    provenance,
    residual_plot,
    residual_table,
    workpiece_headline,
    workpiece_places,
    workpiece_table,
)
from calib_core.stages.tcp.arm_found import arm_table
from calib_core.stages.tcp.evidence import COLUMNS as TCP_COLUMNS
from calib_core.stages.tcp.evidence import scanner_table, sphere_figures, tool_frames, tool_sigmas
from calib_core.stages.tcp.pose_repeatability import repeatability_table
from calib_core.stages.tcp.record import TcpResidual
from calib_core.stages.topology_found import axes_table, carrier_name
from calib_core.stages.turntable.evidence import COLUMNS as TABLE_COLUMNS
from calib_core.stages.turntable.evidence import (
    axis_figures,
    axis_sigmas,
    circles,
    mountings,
    table_frame,
    table_noise,
    table_rows,
    wobble,
)
from calib_core.stages.two_step_blocks import two_step_blocks


def evidence(session: Session, result: ChainResult) -> list[AnyBlock]:
    """Return the whole chain told in blocks, the answer first."""
    places = workpiece_places(session, result)
    still = [row for row in result.residuals if isinstance(row, TcpResidual)]
    return [
        *workpiece_headline(places),
        *tool_sigmas(result),
        *axis_sigmas(result),
        captures_used(result),
        *tool_frames(session, result),
        table_frame(session, result, result.turntable_covariance),
        *axis_figures(result),
        *axes_table(result, shown_already=1),
        *mountings(result),
        *workpiece_table(places, carrier_name(result)),
        *residual_plot(result.residuals),
        *wobble(result.residuals),
        *two_step_blocks(result),
        *circles(result),
        table_noise(result),
        *scanner_table(result),
        *arm_table(result.arm_model),
        *repeatability_table(session, result),
        *sphere_figures(result),
        *left_out(result.residuals),
        *residual_table(still, TCP_COLUMNS, "Each capture of the still sphere"),
        *residual_table(table_rows(result), TABLE_COLUMNS, "Each capture on the table"),
        *provenance(result),
    ]
