"""The report: what it says is what the records say, and it needs nothing but itself."""

import json
import re
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.archive.dates import solved_when
from calib_core.archive.folder import load_session
from calib_core.archive.stored_results import stored_results
from calib_core.errors import InputError
from calib_core.evidence.numbers import number_text, quantity, quantity_text
from calib_core.evidence.svg import plot_svg
from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.exports.workpiece import at_workpiece
from calib_core.findings.catalogues import catalogue
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.records.evidence import Axis, Plot, Series
from calib_core.review.printed import misprinted
from calib_core.robots import CONVENTIONS
from server.cli import main
from server.render.pdf import pdf_of
from server.render.report.first_page import Circumstances
from server.render.report.report import report_html
from tests.verified import solved as verified
from tests.verified import verified_session

Solved = tuple[Session, dict[str, dict[str, Any]]]
VOID = {"meta", "link", "br", "hr", "img", "input"}


class Page(HTMLParser):
    """The page's text, its tables, and whether its elements close as they open."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.words: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.tags: set[str] = set()
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes += attrs

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.words.append(data)
        if self.rows and any(tag in ("th", "td") for tag in self.open):
            self.rows[-1][-1] += data

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def row(self, label: str) -> list[str]:
        return next(row for row in self.rows if row and row[0] == label)


@pytest.fixture
def solved(solved_folder: Path) -> Solved:
    return load_session(solved_folder)[0], stored_results(solved_folder)


def as_of_0_1_0(result: dict[str, Any]) -> dict[str, Any]:
    """Return a result as it was stored before there was evidence."""
    return {name: value for name, value in result.items() if name not in ("evidence", "notes")}


def test_it_says_what_the_records_say(solved: Solved) -> None:
    session, results = solved
    page = Page(report_html(session, results))
    tcp = results["tcp"]
    assert session.name in page.text
    assert tcp["inputs_sha256"] in page.text
    assert tcp["software"] in page.text
    dated = report_html(session, results, circumstances=Circumstances(solved="2026-11-03T07:16:34.521Z"))
    assert Page(dated).row("Solved") == ["Solved", "2026-11-03 07:16 UTC"]
    assert tcp["method"] in page.text
    for warning in tcp["warnings"]:
        assert warning in page.text
    assert page.row("Sphere's diameter")[1].startswith("40.0")
    assert page.row("Captures") == ["Captures", "TCP 14"]
    two = tcp["two_step"]
    label = "Scatter of the sphere's centres, RMS"
    shown = [quantity_text(quantity(r["center_scatter_rms_mm"], "mm")) for r in (tcp, two)]
    assert page.row(label)[1:3] == shown
    given = quantity_text(quantity(tcp["variance_components"]["position_sigma_mm"], "mm"))
    assert page.row("Robot's position, each axis")[1:] == [given, "given"]
    for row in tcp["residuals"]:
        shown = next(r for r in page.rows if len(r) > 5 and r[0] == row["capture"])
        assert shown[1] == str(row["points"])
        assert row["used"] or shown[-1] == f"no: {row['reason']}"


def test_the_first_page_is_to_be_signed(solved: Solved) -> None:
    session, results = solved
    html = report_html(session, results)
    first = Page(html[html.index("<section") : html.index("<main>")])
    worst = next(place for place in at_workpiece(session, results["tcp"]) if place.of == "tool").worst_sigma_mm
    assert (
        f"At the workpiece {quantity_text(quantity(None, 'mm', worst))}".split()
        == (first.text[first.text.index("At the workpiece") :].split()[: 3 + 2 + 1])
    )
    assert results["tcp"]["inputs_sha256"] in first.text
    for role in ("Calibrated by", "Checked by", "Approved by"):
        assert first.row(role) == [role, "", "", ""]


def test_the_first_page_says_what_its_plus_minus_is(solved: Solved, turntable_results: Solved) -> None:
    session, results = turntable_results
    for of_stage in (results, {"turntable": results["turntable"]}):  # without a tool it is no answer
        html = report_html(session, of_stage)
        first = Page(html[html.index("<section") : html.index("<main>")]).text
        assert first.index("±") < first.index("Expanded uncertainty of the calibration (k = 2")
    plain = [block for block in solved[1]["tcp"]["evidence"] if not block.get("headline")]
    html = report_html(solved[0], {"tcp": {**solved[1]["tcp"], "evidence": plain}})
    assert "Expanded uncertainty of the calibration" not in html


def test_words_over_a_verification_s_figures_are_no_figures_that_results_must_tell() -> None:
    made = verified_session(5, 1.0)
    results = verified(made)
    page = report_html(made.session, results)
    heads = re.findall("<thead>.*?</thead>", page[: page.index("<main>")], re.DOTALL)
    assert "k = 2" in heads[0]
    told = page.replace(heads[0], heads[0].replace("2", "98765"))
    assert list(misprinted(told.encode(), made.session, results, None)) == []
    assert "0.40\u202fmm</td>" in page[: page.index("<main>")]  # with its figure's digits, as in the evidence
    earlier = page.replace("0.40\u202fmm</td>", "0.4 mm</td>", 1)
    assert list(misprinted(earlier.encode(), made.session, results, None)) == []
    wrong = page.replace("0.40\u202fmm</td>", "0.50\u202fmm</td>", 1)
    assert wrong != page
    assert list(misprinted(wrong.encode(), made.session, results, None)) == ["figures"]


@pytest.mark.parametrize(
    ("language", "order"), [("en", "Order number"), ("de", "Auftragsnummer"), ("zh", "订单号")]
)
def test_lines_that_are_often_told_are_said_in_the_language(solved: Solved, language: str, order: str) -> None:
    session = solved[0].model_copy(update={"documentation": {"order_number": "4711", "bay_door": "north"}})
    page = Page(report_html(session, {}, circumstances=Circumstances(language=catalogue(language))))
    assert page.row(order) == [order, "4711"]
    assert page.row("Bay door") == ["Bay door", "north"]  # as it was told


def test_a_report_that_replaces_another_says_so_and_why(solved: Solved) -> None:
    documented = {"report_number": "C-12a", "replaces": "C-12", "replaces_because": "wrong serial number"}
    session, results = solved
    assert "replaces report" not in report_html(session, results)
    page = report_html(session.model_copy(update={"documentation": documented}), results)
    assert "This report replaces report C-12. Reason: wrong serial number" in page


def test_where_two_series_meet_the_first_lies_on_top() -> None:
    axis, points = Axis(label="Offset", unit="mm"), [3.0, 1.0, 0.0]
    both = [Series(label="captures", y=points, captures=["p1", "p2", "p3"]), Series(label="drift", y=points)]
    drawn = plot_svg(Plot(shape="xy", caption="", x=axis, y=axis, series=both))
    assert drawn.rindex("mark s1") < drawn.index("mark s0")


def test_before_the_evidence_the_cell_is_shown_from_two_sides(solved: Solved, turntable_results: Solved) -> None:
    session, results = solved
    html = report_html(session, results)
    seen = [capture for capture in session.captures if capture.step == "tcp"]
    assert html.count('<svg class="scene"') == 1
    picture = html[html.index('<svg class="scene"') :]
    picture = picture[: picture.index("</svg>")]
    assert picture.count("<circle") == 2 * (len(seen) + 1)  # each capture and the sphere
    assert " mm</text>" in picture
    assert html.index('<svg class="scene"') < html.index("<main>")
    assert '<svg class="scene"' in report_html(*turntable_results)
    assert '<svg class="scene"' not in report_html(session, {})


@pytest.mark.parametrize("convention", sorted(set(CONVENTIONS) - {"matrix"}))
def test_the_tool_frame_is_in_the_controllers_convention_with_twice_its_sigma(
    solved: Solved, convention: str
) -> None:
    session, results = solved
    other = session.model_copy(update={"cell": session.cell.model_copy(update={"pose_convention": convention})})
    page = Page(report_html(other, {"tcp": as_of_0_1_0(results["tcp"])}))
    tool = RigidTransform.from_rounded(results["tcp"]["tool0_from_laser"], "tool0", "laser")
    sigmas = tool_number_sigmas(convention, tool, np.array(results["tcp"]["covariance"])[:6, :6])
    names = CONVENTIONS[convention].numbers.split()
    start = next(k for k in range(len(page.rows)) if [r[0] for r in page.rows[k : k + len(names)]] == names)
    for row, value, sigma in zip(page.rows[start:], tool_numbers(convention, tool), sigmas, strict=False):
        stated, uncertainty = map(float, re.findall(r"[-\d.]+", row[1].replace("−", "-").replace("\u202f", "")))
        assert uncertainty == pytest.approx(2 * sigma, rel=0.06)  # two digits
        assert stated == pytest.approx(value, abs=0.06 * uncertainty)


def test_a_matrix_is_the_matrix(solved: Solved) -> None:
    session, results = solved
    other = session.model_copy(update={"cell": session.cell.model_copy(update={"pose_convention": "matrix"})})
    page = Page(report_html(other, {"tcp": as_of_0_1_0(results["tcp"])}))
    *turn, shift = results["tcp"]["tool0_from_laser"][0]
    assert page.row(number_text(turn[0], 6)) == [*(number_text(v, 6) for v in turn), number_text(shift, 4)]


def test_it_needs_nothing_from_outside_and_runs_nothing(solved: Solved) -> None:
    html = report_html(*solved)
    page = Page(html)
    assert page.tags.isdisjoint({"script", "link", "img", "iframe", "object", "embed", "base", "form"})
    assert not re.search(r"https?:|url\(|@import|javascript:", html)
    assert not [name for name, _ in page.attributes if name in ("src", "href", "action") or name.startswith("on")]
    for needed in ("prefers-color-scheme: dark", "@media print", 'lang="en"', 'charset="utf-8"'):
        assert needed in html


@pytest.mark.parametrize("form", [dict, as_of_0_1_0])
def test_words_from_outside_are_words(solved: Solved, form: Any) -> None:
    session, results = solved
    evil = "<script>alert(1)</script>\"'><img src=x onerror=y>"
    result = json.loads(json.dumps(form(results["tcp"])))
    result |= {"warnings": [evil], "notes": [evil], "method": evil, "software": evil}
    result["residuals"] = [{**row, "used": False, "reason": evil} for row in result["residuals"]]
    for block in result.get("evidence", []):
        block |= {"title": evil} if block["title"] else {}
        block |= {
            name: evil for name in ("label", "text", "caption", "name", "units", "formula") if block.get(name)
        }
    cell = session.cell.model_copy(update={"robot": session.cell.robot.model_copy(update={"brand": evil})})
    page = Page(report_html(session.model_copy(update={"name": evil, "cell": cell}), {"tcp": result}))
    assert page.tags.isdisjoint({"script", "img"})
    assert page.text.count("<script>alert(1)</script>") >= 5


@pytest.mark.parametrize("verdict", ["pass", "warn", "fail"])
def test_the_verdict_and_what_it_means(solved: Solved, verdict: str) -> None:
    session, results = solved
    text = Page(report_html(session, {"tcp": {**results["tcp"], "verdict": verdict}})).text
    assert f"Verdict of the calibration {verdict.upper()}" in text
    meaning = {"pass": "agree with each other", "warn": "Usable with care", "fail": "Do not use"}[verdict]
    assert meaning in text


def test_stale_and_unsolved(solved: Solved) -> None:
    session, results = solved
    assert "Out of date" not in report_html(session, results)
    assert "Out of date" in report_html(session, results, ["tcp"])
    assert "Nothing is solved yet" in report_html(session, {})


def test_no_two_step_answer_is_told_with_its_reason(solved: Solved) -> None:
    session, results = solved
    two = {"reason": "no pure translations among the captures"}
    page = Page(report_html(session, {"tcp": {**as_of_0_1_0(results["tcp"]), "two_step": two}}))
    assert "No two-step answer: no pure translations among the captures." in page.text


def test_at_most_three_warnings_are_in_sight(solved: Solved) -> None:
    session, results = solved
    html = report_html(session, {"tcp": {**results["tcp"], "warnings": [f"doubt {k}." for k in range(5)]}})
    folded = html[html.index("Further warnings") :]
    folded = folded[: folded.index("</details>")]
    assert [f"doubt {k}." in folded for k in range(5)] == [False] * 3 + [True] * 2


def test_a_result_of_another_version_shows_its_figures(solved: Solved) -> None:
    result = {"stage": "camera", "method": "m", "software": "s", "inputs_sha256": "0" * 64, "verdict": "pass"}
    result |= {
        "reprojection_rms_px": 0.1642,
        "residuals": [{"capture": "b01", "used": False, "reason": "blurred"}],
    }
    page = Page(report_html(solved[0], {"camera": result}))
    assert page.row("Reprojection rms") == ["Reprojection rms", "0.164\u202fpx"]
    assert page.row("b01") == ["b01", "blurred"]


def test_turntable_and_chain_are_reported_with_axis_and_mountings(turntable_results: Solved) -> None:
    session, results = turntable_results
    page = Page(report_html(session, results))
    for stage in ("turntable", "chain"):
        sigma = quantity_text(quantity(None, "°", results[stage]["axis_direction_sigma_deg"]))
        assert ["Axis, direction", sigma] in page.rows
        assert results[stage]["inputs_sha256"] in page.text
        for mount in results[stage]["mounts"]:
            shown = [mount["mount"], "8", number_text(mount["radius_mm"], 3)]
            assert any(row[:3] == shown for row in page.rows)
    for known in at_workpiece(session, results["chain"]):
        worst = quantity_text(quantity(None, "", known.worst_sigma_mm))
        assert any(row[-1] == worst and known.where in row[0] for row in page.rows), known
    assert page.tags.isdisjoint({"script", "img"})


@pytest.mark.parametrize("covariance", [[], [[1.0]], [[-1.0] * 6] * 6, [[1e300] * 6] * 6, [[1.0] * 6] * 5 + [[]]])
def test_a_covariance_that_is_none_is_told(solved: Solved, covariance: Any) -> None:
    session, results = solved
    with pytest.raises(InputError, match=r"results/tcp.json: covariance: need a covariance"):
        report_html(session, {"tcp": {**results["tcp"], "covariance": covariance}})


def test_the_command_writes_the_page(
    solved_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "r.html"
    assert main(["report", str(solved_folder), "--out", str(file)]) == 0
    assert capsys.readouterr().out == f"{file}\n"
    session, results = load_session(solved_folder)[0], stored_results(solved_folder)
    truth = json.loads((solved_folder / "truth.json").read_text(encoding="utf-8"))
    about = Circumstances(solved=solved_when(solved_folder, results, unpacked=False))
    assert file.read_text(encoding="utf-8") == report_html(session, results, (), truth, about)
    assert main(["report", str(tmp_path / "none"), "--out", str(file)]) == 2


@pytest.mark.thorough
def test_the_report_is_printed_as_pdf_by_a_browser_that_is_there(
    solved_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "r.PDF"
    assert main(["report", str(solved_folder), "--out", str(target)]) == 0
    printed = target.read_bytes()
    assert printed.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) >= 2
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("server.render.pdf._PLACES", ())
    assert main(["report", str(solved_folder), "--out", str(tmp_path / "none.pdf")]) == 2
    assert "Chromium, Chrome or Edge" in capsys.readouterr().err
    assert not (tmp_path / "none.pdf").exists()


def test_a_pdf_whose_characters_no_font_has_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = "<html><head></head><body>{}</body></html>"
    (tmp_path / "fonts.conf").write_text("<fontconfig></fontconfig>")
    monkeypatch.setenv("FONTCONFIG_FILE", str(tmp_path / "fonts.conf"))
    with pytest.raises(InputError, match=r"a font with Chinese characters.*fonts-noto-cjk. Print the page"):
        pdf_of(page.format("转台"), "r.pdf", instead="Print the page.")
    assert pdf_of(page.format("table"), "r.pdf").startswith(b"%PDF-")


def test_a_browser_that_does_not_end_is_ended_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "chromium").write_text(f"#!/bin/sh\nsleep 60 &\necho $! > {tmp_path / 'pid'}\nwait\n")
    (tmp_path / "chromium").chmod(0o700)
    monkeypatch.setattr("server.render.pdf.browser", lambda: str(tmp_path / "chromium"))
    with pytest.raises(InputError, match=r"not done within 0.5 s"):
        pdf_of("<p>", "here", longest_s=0.5)
    state = Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}/stat")
    until = time.monotonic() + 10
    while state.exists() and state.read_text().rpartition(")")[2].split()[0] not in "ZX":
        assert time.monotonic() < until


def test_captures_are_drawn_over_the_whole_width() -> None:
    count = 12
    series = Series(label="captures", y=[1.0] * count, captures=[f"p{k}" for k in range(count)])
    drawn = plot_svg(
        Plot(shape="captures", caption="", x=Axis(label=""), y=Axis(label="", unit="mm"), series=[series])
    )
    width = float(re.search(r'viewBox="0 0 ([\d.]+)', drawn)[1])  # type: ignore[index]
    marks = sorted({float(x) for x in re.findall(r'class="mark[^>]*?c?x="([\d.]+)"', drawn)})
    assert len(marks) == count
    assert marks[-1] - marks[0] > 0.7 * width
