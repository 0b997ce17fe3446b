"""The evidence of a result: made when its stage is solved, and where a stored one has none yet."""

from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from calib_core.archive.stored_results import result_record
from calib_core.cell.found import SCANNER_FRAMES, axis_of_table
from calib_core.cell.titles import SCANNER_IN_BASE, axis_title, step_title
from calib_core.evidence.numbers import fixed, quantity
from calib_core.graph.registry import STAGES
from calib_core.messages import ENGLISH, Catalogue
from calib_core.records import CaptureResidual, Cell, Result, Session
from calib_core.records.evidence import AnyBlock, Figure
from calib_core.stages.evidence_parts import label_of, left_out

_BLOCKS = TypeAdapter(list[AnyBlock])


def with_evidence(session: Session, result: Result) -> Result:
    """Return a result that tells itself, and the pose convention that it was solved with."""
    convention = session.cell.pose_convention
    return result.model_copy(update={"pose_convention": convention, "evidence": made_evidence(session, result)})


def made_evidence(session: Session, result: Result) -> list[AnyBlock]:
    """Return the blocks that a result's stage makes of it; raises InputError where its numbers are none."""
    stage = getattr(result, "stage", "")
    blocks = STAGES.get(stage).evidence(session, result) if stage in STAGES.names() else None
    return plain_evidence(result.model_dump(mode="json")) if blocks is None else blocks


def title_of(stage: str, cell: Cell | None = None) -> str:
    """Return what a stage's result is called, by what the cell is made of where that is told."""
    own = None if cell is None else step_title(cell, stage)
    return own or (STAGES.get(stage).title if stage in STAGES.names() else stage)


def title_of_result(stage: str, result: Mapping[str, Any]) -> str:
    """Return what a result is called, JSON data: by what it found, for the cell is not at hand."""
    if stage == "tcp" and [result.get(name) is not None for name in SCANNER_FRAMES] == [False, True]:
        return SCANNER_IN_BASE
    return axis_title(*axis_of_table(result)) if stage == "turntable" else title_of(stage)


def text_of(result: Result, said: Catalogue = ENGLISH) -> str:
    """Return a result whose texts are in a language already as text, as `print` and the terminal show it."""
    from calib_core.evidence.text import result_text

    data = _told(result)
    return result_text(said.say(data["title"]), data, result.evidence, said)


def html_of(result: Result) -> str:
    """Return a result as HTML, as a notebook shows it."""
    from calib_core.evidence.html import result_html
    from calib_core.evidence.style import STYLE

    data = _told(result)
    body = f"<h2>{data['title']}</h2>{result_html(data, result.evidence)}"
    return f'<div class="scancell notebook"><style>{STYLE}</style>{body}</div>'


def _told(result: Result) -> dict[str, Any]:
    shown = result.model_dump(include={"verdict", "warnings", "notes"})
    stage = getattr(result, "stage", "")
    found = result.model_dump(by_alias=True, include={*SCANNER_FRAMES, "frames", "spheres", "axes"})
    return {"stage": stage, "title": title_of_result(stage, found), **shown}


def stored_evidence(session: Session, data: Mapping[str, Any]) -> list[AnyBlock]:
    """Return the evidence of a result given as JSON data; one without, as 0.1.0 wrote it, is told anew.

    Raises
    ------
    InputError
        If a frame or a covariance of the result is none.
    """
    try:
        if data.get("evidence"):
            return _BLOCKS.validate_python(data["evidence"])
        record = result_record(str(data.get("stage")))
        return made_evidence(session, record.model_validate(data))
    except ValidationError:
        return plain_evidence(data)  # of another version: its single numbers are told as they are


def plain_evidence(data: Mapping[str, Any]) -> list[AnyBlock]:
    """Return the single numbers of any result by name, and which captures are not used."""
    figures: list[AnyBlock] = []
    for name, value in data.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            label, unit = label_of(name)
            shown = fixed(value, 0, unit) if isinstance(value, int) else quantity(value, unit)
            figures.append(Figure(label=label, quantity=shown))
    rows = [CaptureResidual.model_validate(row) for row in data.get("residuals") or []]
    return [*figures, *left_out(rows)]
