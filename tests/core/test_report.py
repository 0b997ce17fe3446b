"""The report: what it says is what the records say, and it needs nothing but itself."""

import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from calib_core.archive.folder import load_session, result_data
from calib_core.archive.stored_results import stored_results
from calib_core.errors import InputError
from calib_core.exports.export import tool_number_sigmas, tool_numbers
from calib_core.exports.workpiece import at_workpiece
from calib_core.frames import RigidTransform
from calib_core.records import Session, TcpResidual
from calib_core.robots import CONVENTIONS
from calib_core.simulation import simulate
from calib_core.stages.pipeline import run
from server.cli import main
from server.render.report.numbers import number, with_decimals_of
from server.render.report.plot import BAND, residual_plot
from server.render.report.report import report_html

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
def solved(solved_folder) -> tuple[Session, dict[str, dict[str, Any]]]:
    return load_session(solved_folder)[0], stored_results(solved_folder)


def test_it_says_what_the_records_say(solved):
    session, results = solved
    page = Page(report_html(session, results))
    tcp = results["tcp"]
    assert session.name in page.text
    assert tcp["inputs_sha256"] in page.text
    assert tcp["software"] in page.text
    assert tcp["method"] in page.text
    for warning in tcp["warnings"]:
        assert warning in page.text
    assert page.row("Sphere's diameter")[1] == "40.0000\u202fmm"
    assert page.row("Captures, tcp") == ["Captures, tcp", "14"]
    two = tcp["two_step"]
    label = "Scatter of the sphere's centres, RMS"
    assert page.row(label)[1:] == [number(r["center_scatter_rms_mm"], 3, "mm") for r in (tcp, two)]
    given = tcp["variance_components"]
    assert page.row("Robot, position, each axis")[1:] == [number(given["position_sigma_mm"], 4, "mm"), "given"]
    for row in tcp["residuals"]:
        shown = page.row(row["capture"])
        assert shown[1:3] == [str(row["points"]), number(row["surface_rms_mm"])]
        assert shown[-1] == ("yes" if row["used"] else "no")
        assert row["used"] or f"{row['capture']} : {row['reason']}" in page.text


@pytest.mark.parametrize("convention", sorted(set(CONVENTIONS) - {"matrix"}))
def test_the_tool_frame_is_in_the_controllers_convention_with_twice_its_sigma(solved, convention):
    session, results = solved
    other = session.model_copy(update={"cell": session.cell.model_copy(update={"pose_convention": convention})})
    page = Page(report_html(other, results))
    tool = RigidTransform.from_rounded(results["tcp"]["tool0_from_laser"], "tool0", "laser")
    sigmas = tool_number_sigmas(convention, tool, np.array(results["tcp"]["covariance"])[:6, :6])
    names = CONVENTIONS[convention].numbers.split()
    start = next(k for k, row in enumerate(page.rows) if row[:2] == ["Number", "Value"])
    shown = page.rows[start + 1 : start + 1 + len(names)]
    assert [row[0] for row in shown] == names
    for row, value, sigma in zip(shown, tool_numbers(convention, tool), sigmas, strict=True):
        stated, uncertainty = (float(text.replace("−", "-")) for text in row[1:])
        assert uncertainty == pytest.approx(2 * sigma, rel=0.06)  # two digits
        assert stated == pytest.approx(value, abs=0.06 * uncertainty)


def test_a_matrix_is_the_matrix(solved):
    session, results = solved
    other = session.model_copy(update={"cell": session.cell.model_copy(update={"pose_convention": "matrix"})})
    page = Page(report_html(other, results))
    first = results["tcp"]["tool0_from_laser"][0]
    assert page.row(number(first[0], 6)) == [*(number(v, 6) for v in first[:3]), number(first[3], 4)]


def test_it_needs_nothing_from_outside_and_runs_nothing(solved):
    html = report_html(*solved)
    page = Page(html)
    assert page.tags.isdisjoint({"script", "link", "img", "iframe", "object", "embed", "base", "form"})
    assert not re.search(r"https?:|url\(|@import|javascript:", html)
    assert not [name for name, _ in page.attributes if name in ("src", "href", "action") or name.startswith("on")]
    for needed in ("prefers-color-scheme: dark", "@media print", 'lang="en"', 'charset="utf-8"'):
        assert needed in html


def test_words_from_outside_are_words(solved):
    session, results = solved
    evil = "<script>alert(1)</script>\"'><img src=x onerror=y>"
    result = {**results["tcp"], "warnings": [evil], "method": evil, "software": evil}
    result["residuals"] = [{**row, "reason": evil} for row in result["residuals"]]
    cell = session.cell.model_copy(update={"robot": session.cell.robot.model_copy(update={"brand": evil})})
    page = Page(report_html(session.model_copy(update={"name": evil, "cell": cell}), {"tcp": result}))
    assert page.tags.isdisjoint({"script", "img"})
    assert page.text.count("<script>alert(1)</script>") >= 5


@pytest.mark.parametrize("verdict", ["pass", "warn", "fail"])
def test_the_verdict_and_what_it_means(solved, verdict):
    session, results = solved
    text = Page(report_html(session, {"tcp": {**results["tcp"], "verdict": verdict}})).text
    assert f"verdict {verdict}" in text
    assert {"pass": "Accepted", "warn": "with care", "fail": "do not use"}[verdict] in text


def test_stale_unsolved_and_undetermined(solved):
    session, results = solved
    assert "Out of date" not in report_html(session, results)
    assert "Out of date" in report_html(session, results, ["tcp"])
    assert "Nothing is solved yet" in report_html(session, {})
    open_direction = {"direction": [0, 0, 0, 0, 1, 0], "description": "no rotation about y yet"}
    text = Page(report_html(session, {"tcp": {**results["tcp"], "undetermined": [open_direction]}})).text
    assert "The captures do not determine: no rotation about y yet" in text


def test_no_two_step_answer_is_told_with_its_reason(solved):
    session, results = solved
    two = {"reason": "no pure translations among the captures"}
    page = Page(report_html(session, {"tcp": {**results["tcp"], "two_step": two}}))
    assert "No two-step answer: no pure translations" in page.text
    assert page.row("Scatter of the sphere's centres, RMS")[2] == "–"


def test_other_stages_show_their_figures(solved):
    result = {"stage": "camera", "method": "m", "software": "s", "inputs_sha256": "0" * 64, "verdict": "pass"}
    result |= {
        "reprojection_rms_px": 0.1642,
        "residuals": [{"capture": "b01", "used": False, "reason": "blurred"}],
    }
    page = Page(report_html(solved[0], {"camera": result}))
    assert page.row("reprojection rms") == ["reprojection rms", "0.1642\u202fpx"]
    assert page.row("b01") == ["b01", "no: blurred"]


def test_turntable_and_chain_are_reported_with_axis_and_mountings():
    simulated = simulate("turntable", 3)
    results = {k: result_data(r) for k, r in run(simulated.session, simulated.files.__getitem__).items()}
    page = Page(report_html(simulated.session, results))
    for stage in ("turntable", "chain"):
        axis = ", ".join(number(v, 6) for v in results[stage]["axis_direction_in_base"])
        assert ["Axis, direction in base", axis] in page.rows
        sigma = number(2 * results[stage]["axis_direction_sigma_deg"], 4, "°")
        assert ["Axis, direction known to", f"± {sigma}"] in page.rows
        assert results[stage]["inputs_sha256"] in page.text
        for mount in results[stage]["mounts"]:
            assert any(row[:3] == [mount["mount"], "8", number(mount["radius_mm"], 3, "mm")] for row in page.rows)
    for known in at_workpiece(simulated.session, results["chain"]):
        worst = number(2 * known.worst_sigma_mm, 3)
        assert any(row[-1] == worst and known.where in row[0] for row in page.rows), known
    assert sum(row[:1] == ["t05"] for row in page.rows) == 3  # by the table's stage, and twice by the chain's
    assert page.tags.isdisjoint({"script", "img"})


@pytest.mark.parametrize("covariance", [[], [[1.0]], [[-1.0] * 6] * 6, [[1e300] * 6] * 6, [[1.0] * 6] * 5 + [[]]])
def test_a_covariance_that_is_none_is_told(solved, covariance):
    session, results = solved
    with pytest.raises(InputError, match=r"results/tcp.json: covariance: need a covariance"):
        report_html(session, {"tcp": {**results["tcp"], "covariance": covariance}})


def test_no_number_is_minus_zero():
    assert (number(-0.0001, 3), number(0.0, 1), number(-0.0006, 3)) == ("0.000", "0.0", "−0.001")


def circle_heights(svg: str) -> dict[str, float]:
    root = ET.fromstring(svg)
    return {str(c.findtext("title")).split(":")[0]: float(c.attrib["cy"]) for c in root.iter("circle")}


def test_the_plot_has_one_dot_a_capture_at_its_height_and_crosses_the_rejected():
    values = {"p01": 0.0, "p02": BAND, "p03": 1.4}
    rows = [TcpResidual(capture=name, used=True, mahalanobis=value) for name, value in values.items()]
    rows += [TcpResidual(capture="p04", used=False, mahalanobis=700.0), TcpResidual(capture="p05", used=False)]
    svg = str(residual_plot(rows))
    root = ET.fromstring(svg)
    heights = circle_heights(svg)
    band = next(e for e in root.iter("rect") if e.attrib["class"] == "band").attrib
    assert heights["p02"] == pytest.approx(float(band["y"]), abs=0.11)
    assert heights["p01"] == pytest.approx(float(band["y"]) + float(band["height"]), abs=0.11)
    between = heights["p01"] + (heights["p02"] - heights["p01"]) * 1.4 / BAND
    assert heights["p03"] == pytest.approx(between, abs=0.11)
    (cross,) = [e for e in root.iter("path") if e.attrib["class"] == "rejected"]
    assert float(cross.attrib["d"].split()[1].split("l")[0]) + 5 == pytest.approx(14, abs=0.1)  # the upper edge


def test_the_plot_of_many_captures_stays_legible():
    rows = [TcpResidual(capture=f"capture-{k:04d}", used=True, mahalanobis=1.0) for k in range(500)]
    root = ET.fromstring(str(residual_plot(rows)))
    assert len(list(root.iter("circle"))) == 500
    assert len([t for t in root.iter("text") if (t.text or "").startswith("capture-")]) <= 42
    assert str(residual_plot([TcpResidual(capture="p01", used=False)])) == ""


@pytest.mark.parametrize(
    ("value", "uncertainty", "shown"),
    [
        (140.3217, 0.0812, ("140.322", "0.081")),
        (-0.6701234, 0.0016, ("−0.6701", "0.0016")),
        (1234.5, 250.0, ("1234", "250")),
        (1.5, 0.0, ("1.5000", "–")),
        (1.5, float("nan"), ("1.5000", "–")),
    ],
)
def test_digits_follow_the_uncertainty(value, uncertainty, shown):
    assert with_decimals_of(value, uncertainty) == shown


def test_the_command_writes_the_page(solved_folder, tmp_path, capsys):
    file = tmp_path / "r.html"
    assert main(["report", str(solved_folder), "--out", str(file)]) == 0
    assert capsys.readouterr().out == f"{file}\n"
    session, results = load_session(solved_folder)[0], stored_results(solved_folder)
    assert file.read_text(encoding="utf-8") == report_html(session, results)
    assert main(["report", str(tmp_path / "none"), "--out", str(file)]) == 2


def test_a_pdf_is_refused_and_nothing_is_written_under_its_name(solved_folder, tmp_path, capsys):
    assert main(["report", str(solved_folder), "--out", str(tmp_path / "r.PDF")]) == 2
    assert "a browser prints it as PDF" in capsys.readouterr().err
    assert list(tmp_path.glob("*.PDF")) == []
