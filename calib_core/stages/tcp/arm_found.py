"""The arm's own errors as a result tells them, and what is to be said of them."""

from calib_core.chain.arm_model import ArmModel
from calib_core.chain.tcp import TcpSolution
from calib_core.findings import Finding
from calib_core.findings.codes import arm as codes
from calib_core.records import Cell
from calib_core.records.results import ArmModelFound, FoundFrame


def arm_model_found(solution: TcpSolution) -> ArmModelFound | None:
    """Return the arm's errors as a record; None where joints are not known."""
    model, told = solution.arm, solution.as_told
    if model is None:
        return None
    controller = None
    if told is not None:
        mount = told.state.mount_from_laser
        covariance = told.covariance[:6, :6].tolist()
        controller = [FoundFrame(into=mount.into, outof="laser", matrix=mount.to_rows(), covariance=covariance)]
    return ArmModelFound(
        names=[term.name for term in model.terms],
        values=model.values.tolist(),
        sigmas=model.sigmas.tolist(),
        members=list(model.members),
        held_out_rms_mm=list(model.held_out_mm),
        worth_it=model.worth_it,
        applied=model.applied,
        controller=controller,
    )


def arm_findings(cell: Cell, model: ArmModel | None) -> list[Finding]:
    """Return what the arm's errors would bring, or why they are not applied."""
    if model is None:
        return []
    before, after = model.held_out_mm
    if model.applied:
        return [codes.ARM_APPLIED(before_mm=before, after_mm=after)]
    if model.worth_it:
        return [codes.ARM_WORTH_IT(before_mm=before, after_mm=after)]
    return [codes.ARM_NOT_BETTER(before_mm=before, after_mm=after)] if cell.robot.errors == "apply" else []
