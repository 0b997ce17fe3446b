"""The arm's own errors as a result tells them, and what is to be said of them."""

import re
from collections.abc import Sequence
from typing import Final

from calib_core.chain.arm_model import ArmModel
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.evidence.numbers import quantity
from calib_core.findings import Finding
from calib_core.findings.codes import arm as codes
from calib_core.messages import message, templates
from calib_core.records import Capture, Cell
from calib_core.records.evidence import AnyBlock, Column, Row, Table
from calib_core.records.results import ArmModelFound, ArmTerms, FoundFrame

_TERMS: Final = templates(
    {
        "zero_deg": "Zero of joint {number}",
        "length_mm": "Length of link {number}",
        "offset_mm": "Offset of link {number}",
        "twist_deg": "Twist of link {number}",
        "tilt_deg": "Tilt of link {number}",
        "sag_deg": "Sag of joint {number}, arm stretched out",
        "deg_per_deg": "Joint {number} by turns of joint {other}",
    }
)
_DIGITS: Final = 5  # of information in units of what is believed: none below is any
_UNITS: Final = {"_deg_per_deg": "°/°", "_deg": "°", "_mm": "mm"}


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
        decided_by=model.decided_by,
        worth_it=model.worth_it,
        applied=model.applied,
        controller=controller,
        covariance=model.covariance.tolist() if model.applied else None,
        told=ArmTerms(
            names=[term.name for term in model.told.terms],
            believed=[term.sigma for term in model.told.terms],
            information=model.told.information.round(_DIGITS).tolist(),
            vector=model.told.vector.round(_DIGITS).tolist(),
        ),
    )


def arm_findings(cell: Cell, model: ArmModel | None, captures: Sequence[Capture]) -> list[Finding]:
    """Return what the arm's errors would bring, or why they are not applied to captures that should tell them."""
    if model is None:
        return _lacking(cell, captures)
    before, after = model.held_out_mm
    said = codes.ARM_APPLIED if model.applied else codes.ARM_WORTH_IT if model.worth_it else codes.ARM_NOT_BETTER
    silent = said is codes.ARM_NOT_BETTER and cell.robot.errors != "apply"
    return [] if silent else [said(before_mm=before, after_mm=after, decided_by=model.decided_by)]


def _lacking(cell: Cell, captures: Sequence[Capture]) -> list[Finding]:
    """Return what the cell or captures lack, where the arm's errors are to be applied."""
    if cell.robot.errors != "apply":
        return []
    untold = [one.id for one in captures if one.kind == "sweep" or not (one.joints_deg or one.joints_mm)]
    if cell.robot.arm is not None and not untold:
        return []
    lacks = "arm" if cell.robot.arm is None else "joints"
    known = len(captures) - len(untold)
    return [
        codes.ARM_WITHOUT_JOINTS(
            untold if lacks == "joints" else [], lacks=lacks, known=known, count=len(captures)
        )
    ]


def arm_table(model: ArmModelFound | None) -> list[AnyBlock]:
    """Return the arm's errors one by one, and what they bring at poses left out."""
    if model is None or not model.names:
        return []
    before_mm, after_mm = model.held_out_rms_mm
    code = codes.ARM_APPLIED if model.applied else codes.ARM_WORTH_IT if model.worth_it else codes.ARM_NOT_BETTER
    values = {"before_mm": before_mm, "after_mm": after_mm, "decided_by": model.decided_by}
    caption = code.as_message(code.text, values, [])
    found = zip(model.names, model.values, model.sigmas, strict=True)
    rows = [Row(cells=[term_label(name), quantity(value, _unit(name), sigma)]) for name, value, sigma in found]
    columns = [Column(label="Error", align="left"), Column(label="Found")]
    return [
        Table(id="arm", title="The arm's own errors", detail=True, caption=caption, columns=columns, rows=rows)
    ]


def _unit(name: str) -> str:
    return next(unit for ending, unit in _UNITS.items() if name.endswith(ending))


def term_label(name: str) -> str:
    """Return what one of `arms.errors.arm_terms` is, as users read it."""
    numbers = [int(n) for n in re.findall(r"\d+", name)]
    template = next(text for ending, text in _TERMS.items() if name.endswith(ending))
    return message(template, number=numbers[0], other=numbers[-1])
