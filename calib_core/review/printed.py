"""Whether a report prints what the results beside it say, in whatever language it is written."""

import html
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, get_args

from calib_core.cell.found import SCANNER_FRAMES
from calib_core.errors import InputError
from calib_core.evidence.numbers import limit_of, number_text, quantity, quantity_text
from calib_core.evidence.text import cell_text, figure_text, verdict_words
from calib_core.findings.catalogues import LANGUAGES, catalogue
from calib_core.records import ResultsData, Session
from calib_core.records.base import Verdict
from calib_core.records.decided_before import DECISIONS
from calib_core.records.evidence import AnyBlock, Figure, Frame, Plot, Series, Table
from calib_core.stages.evidence import stored_evidence

_Results = ResultsData
_NUMBER: Final = re.compile(r"−?\d[\d\u202f]*(?:\.\d+)?")
_GERMAN: Final = re.compile('<html lang="de">')
_VERDICT: Final = re.compile(r'<(?:strong|span) class="verdict (\w+)">([^<]*)<')
_ROW: Final = re.compile(r'<td class="(pass|warn|fail)">([^<]*)</td>')
_DECIDED: Final = re.compile(r'<(?:span|td) class="decided ([\w-]*)">([^<]*)<')
_DECIDED_BEFORE: Final = re.compile(rf"<strong>({'|'.join(DECISIONS)})</strong>")  # as earlier versions print it
_SECTION: Final = re.compile(r'(?=<(?:strong|span) class="verdict )')
_DRAWING: Final = re.compile(r"<svg.*?</svg>", re.DOTALL)
_HEAD: Final = re.compile(r"<h1>(.*?)</h1>", re.DOTALL)
_FIRST: Final = re.compile(r'<p class="answer">.*?</p>', re.DOTALL)
_CHECKS: Final = re.compile(r'<table class="checks">.*?</table>', re.DOTALL)
_COLUMNS: Final = re.compile(r"<thead>.*?</thead>", re.DOTALL)  # words: "k = 2" is no figure
_MATRIX_DECIMALS: Final = (6, 6, 6, 4)


def misprinted(
    content: bytes, session: Session, results: _Results, answer: Mapping[str, Any] | None
) -> Iterator[str]:
    """Give what a report prints otherwise than the results say, each by its name.

    Parameters
    ----------
    content : bytes
        The report, an HTML page.
    session : Session
    results : mapping
        The results beside it, as JSON data.
    answer : mapping or None
        The answer that they give, as JSON data.
    """
    page = content.decode(errors="replace")
    if _GERMAN.search(page[:300]):
        page = re.sub(r"(?<=\d),(?=\d)", ".", page)
    sections = [_NUMBER.findall(_text(part)) for part in _SECTION.split(_DRAWING.sub(" ", page))]
    if session.name and (head := _HEAD.search(page)) and _text(head[1]) != " ".join(session.name.split()):
        yield "session"
    if not session.cell.findings:  # a cell that judges otherwise has verdicts of its own
        yield from _verdicts(page, results, answer)
    yield from _decisions(page, results.get("verify", {}))
    known: set[str] = set()
    for stage, result in results.items():
        try:
            blocks = stored_evidence(session, result) if result.get("evidence") else []
        except InputError:
            blocks = []
        numbers = [number for block in blocks for number in _numbers(block)]
        known |= {*numbers, *_labels(blocks)}
        is_printed = any(_follow(numbers, section) for section in sections)
        if not is_printed or str(result.get("inputs_sha256", "")) not in page:
            yield f"results.{stage}"
    known |= {number for check in results.get("verify", {}).get("checks") or [] for number in _of_check(check)}
    first = " ".join(part for pattern in (_FIRST, _CHECKS) for part in pattern.findall(page))
    if known and not known.issuperset(_NUMBER.findall(_text(_COLUMNS.sub(" ", first)))):
        yield "figures"
    yield from _frames(page, answer or {})


def _text(page: str) -> str:
    return re.sub(r"[ \n\t]+", " ", html.unescape(re.sub(r"<[^>]*>", " ", page))).strip()


def _follow(numbers: Sequence[str], section: Sequence[str]) -> bool:
    """Return whether numbers stand in a section in their order; further ones may stand between them."""
    here = iter(section)
    return all(number in here for number in numbers)


def _of_check(check: Mapping[str, Any]) -> list[str]:
    """Return the numbers that the first page has of one of a verification's checks."""
    measured = quantity(check["value_mm"], "mm", (check.get("uncertainty_mm") or 0.0) / 2 or None)
    limit_mm = check.get("limit_mm") or 0.0
    limits = f"{quantity_text(limit_of(limit_mm, measured))} {limit_mm:g}"  # as earlier versions print it, too
    return _NUMBER.findall(f"{check['title']} {quantity_text(measured)} {limits}")


def _numbers(block: AnyBlock) -> list[str]:
    """Return the numbers of a block in the order in which they are printed; those within words are left out."""
    texts: list[str] = []
    match block:
        case Figure():
            texts = [quantity_text(shown) for shown in (block.quantity if not block.text else None, block.limit)]
        case Frame():
            texts = [quantity_text(number.quantity) for number in block.numbers]
            texts += [
                number_text(x, decimals)
                for row in block.matrix
                for x, decimals in zip(row, _MATRIX_DECIMALS, strict=True)
            ]
        case Table():
            cells = [cell for row in block.rows for cell in zip(row.cells, block.columns, strict=True)]
            texts = [cell_text(cell, column) for cell, column in cells if not isinstance(cell, str)]
        case Plot():
            texts = [number_text(value, 3) for series in block.series for value in _points(series)]
            texts = [] if block.shape == "section" else texts
        case _:
            pass
    return [number for text in texts for number in _NUMBER.findall(text)]


def _points(series: Series) -> Iterator[float]:
    """Give the numbers of a plot's points, those that have a value."""
    for k, y in enumerate(series.y):
        if y is not None:
            yield from (series.x[k], y) if series.x and not series.captures else (y,)


def _labels(blocks: Sequence[AnyBlock]) -> set[str]:
    """Return the numbers within the words of figures."""
    figures = [block for block in blocks if isinstance(block, Figure)]
    return {number for one in figures for number in _NUMBER.findall(f"{one.label} {figure_text(one)}")}


def _verdicts(page: str, results: _Results, answer: Mapping[str, Any] | None) -> Iterator[str]:
    """Give "verdict" where those of the answer and of each result are not what is printed, by mark and word."""
    words = {
        verdict: {verdict, *(verdict_words(verdict, catalogue(name))[0].lower() for name in LANGUAGES)}
        for verdict in get_args(Verdict)
    }
    of_results = Counter(str(result.get("verdict")) for result in results.values())
    marks, every_word = _VERDICT.findall(page), set[str]().union(*words.values())
    rows = [row for row in _ROW.findall(page) if row[1].lower() in every_word]
    is_right = (
        (not marks or answer is None or marks[0][0] == answer["verdict"])
        and (not marks or Counter(mark for mark, _ in marks[1:]) == of_results)
        and (not rows or of_results <= Counter(mark for mark, _ in rows))
        and all(word.lower() in words.get(mark, ()) for mark, word in [*marks, *rows])
    )
    if not is_right:
        yield "verdict"


def _decisions(page: str, verify: Mapping[str, Any]) -> Iterator[str]:
    """Give "decision" where that of the verification, or of one of its limits, is not what is printed."""
    decided = str(verify.get("decision") or "")
    expected = [decided, *(str(check.get("decision") or "") for check in verify.get("checks") or [])]
    marks = _DECIDED.findall(page)
    of_mark = {
        name: {name, *(catalogue(language).say(text) for language in LANGUAGES)}
        for name, text in DECISIONS.items()
    }
    is_right = (
        (not marks or [mark for mark, _ in marks] == expected[0 if decided else 1 :])
        and all(html.unescape(word) in of_mark.get(mark, {"–"}) for mark, word in marks)
        and {*_DECIDED_BEFORE.findall(page)} <= {decided}
    )
    if not is_right:
        yield "decision"


def _frames(page: str, answer: Mapping[str, Any]) -> Iterator[str]:
    """Give the frames whose position is printed nowhere."""
    text = _text(page).replace("\N{MINUS SIGN}", "-")
    for name in (*SCANNER_FRAMES, "base_from_turntable"):
        if answer.get(name) and not _prints(text, answer[name]["numbers"][:3]):
            yield name


def _prints(text: str, numbers: list[float]) -> bool:
    """Return whether three numbers stand in a text one soon after the other, with equally many decimals."""
    for decimals in range(7):
        shown = [rf"(?<![\d.]){re.escape(f'{number:.{decimals}f}')}(?!\.?\d)" for number in numbers]
        if re.search(r"[\s\S]{0,200}?".join(shown), text):
            return True
    return False
