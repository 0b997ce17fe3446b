"""The report: a page to sign, then the evidence of every result, from the session's records alone."""

import re
from collections.abc import Collection, Mapping
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from calib_core import __version__
from calib_core.errors import ConflictError
from calib_core.evidence.html import STALE, result_html
from calib_core.evidence.numbers import number_text, quantity, quantity_text, with_unit
from calib_core.evidence.style import STYLE
from calib_core.evidence.text import VERDICTS, figure_text
from calib_core.exports.answer import answer_of
from calib_core.exports.workpiece import covariance_in
from calib_core.graph.registry import stages
from calib_core.records import Cell, Session
from calib_core.records.evidence import AnyBlock, Figure
from calib_core.records.policy import Equipment
from calib_core.review.truth import truth_blocks
from calib_core.robots import CONVENTIONS
from calib_core.stages.evidence import stored_evidence, title_of
from server.render.report.scene_picture import scene_picture

_NOT_PLAIN = re.compile(r"[^\w .,:()#+-]")  # what would have to be escaped in a style sheet
_SIGNED_BY: Final = ("Calibrated by", "Checked by", "Released by")
_COVARIANCES: Final = ("covariance", "turntable_covariance")

Data = Mapping[str, Any]


def report_html(
    session: Session,
    results: Mapping[str, Data],
    stale: Collection[str] = (),
    truth: Data | None = None,
    solved: str = "",
) -> str:
    """Return a session's report as one HTML page that needs no other file, no script and no address.

    Parameters
    ----------
    session : Session
    results : mapping
        The stages' results by stage, as JSON data.
    stale : collection of str
        The stages whose result is older than the captures.
    truth : mapping, optional
        Of a simulated cell, as its `truth.json` has it.
    solved : str
        When the answer was solved (ISO 8601, UTC), where that is known.

    Raises
    ------
    InputError
        If a result's frame or covariance is none.
    """
    order = [s.name for s in sorted(stages(), key=lambda s: not s.is_answer or not s.answers)]  # the answer first
    names = sorted(results, key=lambda name: order.index(name) if name in order else len(order))
    told = {name: {**results[name], "stale": name in stale} for name in names}
    blocks = {name: _evidence(session, data) for name, data in told.items()}
    if truth is not None:
        blocks = {name: [*some, *truth_blocks(session, told[name], truth)] for name, some in blocks.items()}
    environment = Environment(
        loader=PackageLoader("server.render.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template("report.html.jinja").render(
        name=session.name or "Session",
        footer=Markup(_NOT_PLAIN.sub(" ", session.name or "Session")),
        style=Markup(STYLE),
        answer=_answer(session, told, blocks, solved),
        picture=Markup(scene_picture(session, told)),
        cell=_cell_rows(session.cell),
        captures=_capture_counts(session),
        told=_told(session, results),
        stages=[
            {
                **told[name],
                "title": title_of(name),
                "body": Markup(result_html(told[name], blocks[name])),
            }
            for name in names
        ],
        stale=STALE,
        simulated=truth is not None,
        signed_by=_SIGNED_BY,
        software=f"scancell {__version__}",
    )


def _evidence(session: Session, data: Data) -> list[AnyBlock]:
    for name in _COVARIANCES:
        if name in data and data.get("tool0_from_laser") is not None:
            covariance_in(data, name)
    return stored_evidence(session, data)


def _answer(
    session: Session, results: Mapping[str, Data], blocks: Mapping[str, list[AnyBlock]], solved: str
) -> Data | None:
    """Return what stands on the first page: the answer with its uncertainty, and what was decided."""
    try:
        answer = answer_of(session, results)
    except ConflictError:
        return None
    headline = next((b for b in blocks[answer.stage] if isinstance(b, Figure) and b.headline), None)
    decision = results.get("verify", {}).get("decision")
    return {
        "title": title_of(answer.stage),
        "solved": _when(solved),
        "verdict": answer.verdict,
        "meaning": VERDICTS[answer.verdict].partition(". ")[2],
        "label": headline.label if headline else "",
        "value": figure_text(headline) if headline else "",
        "stale": any(result["stale"] for result in results.values()),
        "decision": decision or "",
        "limits_changed": results.get("verify", {}).get("limits_changed") or [],
    }


def _when(moment: str) -> str:
    """Return a moment (ISO 8601, UTC) as people write it, "" where it is not known."""
    return f"{moment[:16].replace('T', ' ')} UTC" if moment else ""


def _cell_rows(cell: Cell) -> list[tuple[str, str]]:
    sigma = cell.sphere_diameter_sigma_mm
    rows = [
        ("Cell", cell.id),
        ("Sphere's diameter", quantity_text(quantity(cell.sphere_diameter_mm, "mm", sigma or None))),
        ("Poses as", f"{cell.pose_convention}: {CONVENTIONS[cell.pose_convention].numbers}"),
        ("Robot", cell.robot.brand),
        ("Scanner", cell.scanner.kind),
        ("Scanner's z axis", cell.scanner.z_axis),
        ("Noise of one point, given", _given(cell.scanner.point_sigma_mm, "mm")),
        ("Robot's position, given", _given(cell.robot.position_sigma_mm, "mm")),
        ("Robot's orientation, given", _given(cell.robot.orientation_sigma_deg, "°")),
        ("Turntable's angle, given", _given(cell.turntable.angle_sigma_deg, "°")),
        ("Board", f"{cell.board.kind}, {cell.board.columns} × {cell.board.rows}" if cell.board else None),
    ]
    return [(label, value) for label, value in rows if value is not None]


def _told(session: Session, results: Mapping[str, Data]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return what was told of circumstances and equipment, and the figures that a verification decided on."""
    told = session.documentation or {}
    air = session.environment.to_json() if session.environment else {}
    checks: list[Data] = results.get("verify", {}).get("checks") or []
    parts = {
        "Documentation": [(name.replace("_", " ").capitalize(), text) for name, text in told.items()],
        "Environment": [
            (f"{name.removesuffix('_c').capitalize()}", f"{value:g} °C") for name, value in air.items()
        ],
        "Equipment": [(one.kind.capitalize(), _piece(one)) for one in session.cell.equipment or []],
        "Decision": [(str(check["title"]), _held(check)) for check in checks if check.get("limit_mm") is not None],
    }
    return [(title, rows) for title, rows in parts.items() if rows]


def _held(check: Data) -> str:
    decision = str(check.get("decision")).replace("-", " ")
    figure = f"{check['value_mm']:.3f} ± {check['uncertainty_mm']:.3f} mm"
    return f"{figure}, limit {check['limit_mm']:g} mm: {decision} (ISO 14253-1, guard band U, k = 2)"


def _piece(one: Equipment) -> str:
    """Return a piece of equipment with what its certificate says, in one line."""
    certificate = one.certificate
    parts = [one.name, one.model, f"serial number {one.serial}" if one.serial else None]
    if certificate is not None:
        parts += [
            f"certificate {certificate.number}" if certificate.number else None,
            certificate.laboratory,
            f"issued {certificate.issued}" if certificate.issued else None,
            f"due {certificate.due}" if certificate.due else None,
        ]
    return ", ".join(part for part in parts if part)


def _given(sigma: float | None, unit: str) -> str | None:
    return None if sigma is None else f"{with_unit(number_text(sigma, 4), unit)} standard deviation"


def _capture_counts(session: Session) -> list[tuple[str, int, int]]:
    """Return each step's name, its captures, and how many of them are excluded."""
    steps = dict.fromkeys(capture.step for capture in session.captures)
    counted = {step: [c for c in session.captures if c.step == step] for step in steps}
    return [(step, len(of_step), sum(c.excluded for c in of_step)) for step, of_step in counted.items()]
