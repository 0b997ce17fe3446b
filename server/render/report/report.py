"""The report: a page to sign, then equipment and circumstances, then the evidence of every result."""

from base64 import b64encode
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from calib_core import __version__
from calib_core.archive.seals import SOLVED
from calib_core.cell.found import answering, placed_scanner
from calib_core.errors import CalibrationError
from calib_core.evidence.html import result_html
from calib_core.evidence.style import STYLE
from calib_core.evidence.text import verdict_words
from calib_core.exports.workpiece import covariance_in
from calib_core.findings.reading import as_read
from calib_core.findings.telling import block_in, told
from calib_core.formats.shared.images import decode_image
from calib_core.graph.registry import stages
from calib_core.messages import Catalogue
from calib_core.records import ReadFile, Session
from calib_core.records.evidence import AnyBlock
from calib_core.review.truth import truth_blocks
from calib_core.stages.evidence import stored_evidence, title_of
from server.render.report.circumstances import (
    cell_rows,
    certificate_rows,
    documentation_rows,
    environment_rows,
    equipment_rows,
)
from server.render.report.first_page import (
    Circumstances,
    Data,
    approval,
    identification,
    outcome,
    plain_text,
    report_number,
)
from server.render.report.scene_picture import scene_picture
from server.render.report.words import WORDS

_WIDEST_PX = 480

_COVARIANCES: Final = ("covariance", "turntable_covariance")
_SIGNED: Final = ("calibrated by", "checked by", "approved by")


def report_html(
    session: Session,
    results: Mapping[str, Data],
    stale: Collection[str] = (),
    truth: Data | None = None,
    circumstances: Circumstances | None = None,
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
    circumstances : Circumstances, optional
        When it was solved, who released it, in which language and on what paper it is printed.

    Raises
    ------
    InputError
        If a result's frame or covariance is none.
    """
    of_answer = results.get(answering(results) or "", {})
    date_signed = (of_answer.get("provenance") or SOLVED) == SOLVED
    about = replace(circumstances or Circumstances(), date_signed=date_signed)
    said = about.language
    order = [s.name for s in sorted(stages(), key=lambda s: not s.is_answer or not s.answers)]  # the answer first
    names = sorted(results, key=lambda name: order.index(name) if name in order else len(order))
    read: dict[str, dict[str, Any]] = {
        name: {**_read(session, results[name], said), "stale": name in stale} for name in names
    }
    blocks = {name: _evidence(session, data) for name, data in read.items()}
    if truth is not None:
        blocks = {name: [*some, *truth_blocks(session, read[name], truth)] for name, some in blocks.items()}
    why = {name: _reasons(results[name], read[name]) for name in names}
    blocks = {name: [_said(one, said, why[name]) for one in some] for name, some in blocks.items()}
    answer = outcome(session, read, blocks, about)
    number = report_number(session, results, about)
    environment = Environment(
        loader=PackageLoader("server.render.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.jinja").render(
        language={"zh": "zh-Hans"}.get(said.language, said.language),
        t={name: said.say(text) for name, text in WORDS.items()},
        name=session.name or said.say(WORDS["session"]),
        number=number,
        paper=about.paper,
        head=Markup(plain_text(f"{said.say(WORDS['title'])} {number}")),
        foot=Markup(plain_text(session.name or "")),
        page_words=[plain_text(part) for part in _around_places(said.say(WORDS["page"]))],
        style=Markup(STYLE),
        identification=identification(session, answer["stage"] if answer else None, about),
        answer=answer,
        approval=approval(about),
        signed=[said.say(WORDS[name]) for name in _SIGNED],
        equipment=equipment_rows(session, about),
        certificates=certificate_rows(session, about),
        environment=environment_rows(session, about),
        documentation=documentation_rows(session, about),
        picture=Markup(scene_picture(session, read, said)),
        cell=cell_rows(session.cell, about),
        stages=[
            {
                **read[name],
                "title": said.say(title_of(name, session.cell)),
                "word": verdict_words(read[name]["verdict"], said)[0],
                "body": Markup(result_html(read[name], blocks[name], said, address_of(about.read))),
            }
            for name in names
        ],
        simulated=truth is not None,
        software=f"scancell {__version__}",
    )


def _read(session: Session, result: Data, said: Catalogue) -> dict[str, Any]:
    """Return a result as it is read: in the language, with the cell's own severities where it has any."""
    severities = session.cell.findings
    if said.language == "en" and not severities:
        return dict(result)
    read = as_read(result, said.language, severities)
    kept = {"method": result.get("method"), **({} if severities else {"verdict": result["verdict"]})}
    texts = {name: value for name, value in read.items() if name != "method"}  # as a whole it would be read anew
    return {**told(texts, said), **kept}


def _reasons(stored: Data, read: Data) -> dict[str, str]:
    """Return why captures were left out, as the evidence has it, with what the language says."""
    pairs = zip(stored.get("residuals") or (), read.get("residuals") or (), strict=True)
    return {one["reason"]: said["reason"] for one, said in pairs if one.get("reason")}


def _said(block: AnyBlock, said: Catalogue, reasons: Mapping[str, str]) -> AnyBlock:
    if said.language == "en":
        return block
    data = block_in(block, said).to_json()
    for row in data.get("rows") or ():
        row["cells"] = [reasons.get(cell, cell) if isinstance(cell, str) else cell for cell in row["cells"]]
        row["reason"] = reasons.get(row.get("reason"), row.get("reason") or "")
    return type(block).model_validate(data)


def _around_places(text: str) -> list[str]:
    """Return what stands before, between and after the two places of a text, the page's number and their count."""
    before, _, rest = text.partition("{page}")
    between, _, after = rest.partition("{pages}")
    return [before, between, after]


def _evidence(session: Session, data: Data) -> list[AnyBlock]:
    for name in _COVARIANCES:
        if name in data and placed_scanner(data) is not None:
            covariance_in(data, name)
    return stored_evidence(session, data)


def address_of(read: ReadFile | None) -> Callable[[str], str]:
    """Return what gives a frame's picture as an address with all of it, "" where it cannot be read."""

    def address(name: str) -> str:
        if read is None:
            return ""
        try:
            image = decode_image(read(name), name)
        except CalibrationError:  # the report goes out without it
            return ""
        return f"data:image/jpeg;base64,{b64encode(_small_jpeg(image)).decode()}"

    return address


def _small_jpeg(image: NDArray[Any]) -> bytes:
    import cv2

    by = min(1.0, _WIDEST_PX / image.shape[1])
    small = cv2.resize(image, None, fx=by, fy=by, interpolation=cv2.INTER_AREA)
    shown = small[..., ::-1] if small.ndim == 3 else small
    shown = shown if image.dtype == np.uint8 else (shown // 256).astype(np.uint8)
    return cv2.imencode(".jpg", np.ascontiguousarray(shown))[1].tobytes()
