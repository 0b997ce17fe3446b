"""Evidence: a result reads the same in the terminal, in HTML and in JSON, in the same words."""

import html
import json
import re
import xml.etree.ElementTree as ET
from typing import Any
from unicodedata import east_asian_width

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from calib_core.archive.folder import load_session
from calib_core.archive.stored_results import stored_results
from calib_core.captures.contradictions import not_measured
from calib_core.errors import MeasurementError
from calib_core.evidence.html import blocks_html, result_html
from calib_core.evidence.numbers import limit_of, number_text, quantity, quantity_text, rms
from calib_core.evidence.svg import plot_svg
from calib_core.evidence.text import blocks_text, plain, result_text
from calib_core.evidence.words import captures_text
from calib_core.findings.catalogues import catalogue
from calib_core.records.evidence import (
    AnyBlock,
    Axis,
    Band,
    Column,
    Figure,
    Frame,
    FrameNumber,
    Note,
    Picture,
    Plot,
    Quantity,
    Row,
    Series,
    Table,
)
from calib_core.records.results import VarianceComponents
from calib_core.review.same_numbers import compare
from calib_core.stages.evidence import stored_evidence, title_of
from calib_core.stages.evidence_parts import BAND, _in_degrees, residual_plot
from calib_core.stages.tcp.record import TcpResidual

BLOCKS = TypeAdapter(list[AnyBlock])
IDENTITY = [[float(i == k) for k in range(4)] for i in range(4)]
EVERY_KIND: list[AnyBlock] = [
    Figure(
        label="Reach",
        quantity=quantity(1.25, "mm", 0.04),
        limit=quantity(2.0, "mm"),
        limit_label="allowed",
        remark="estimated",
        headline=True,
    ),
    Frame(
        title="Tool",
        name="tool0_from_laser",
        into="tool0",
        outof="laser",
        matrix=IDENTITY,
        convention="fanuc",
        units="fanuc, mm and deg",
        numbers=[FrameNumber(label="W", quantity=quantity(-179.9, "°", 0.02))],
    ),
    Table(
        title="Captures",
        caption="What each shows.",
        columns=[Column(label="Capture", align="left"), Column(label="RMS", unit="mm", decimals=3)],
        rows=[
            Row(cells=["p01", 0.0123]),
            Row(cells=["p02", 7.5], capture="p02", used=False, reason="the sphere was moved"),
        ],
    ),
    *(
        Plot(
            title=f"A plot, {shape}",
            shape=shape,
            caption=f"How it looks as {shape}.",
            x=Axis(label="Capture"),
            y=Axis(label="Distance", unit="σ"),
            series=[Series(label="one", y=[1.0, 2.0, None]), Series(label="two", y=[3.0, 1.0, 2.0])],
            band=Band(low=0.0, high=2.8, label="expected"),
        )
        for shape in ("captures", "line", "xy", "histogram", "grid", "section")
    ),
    Picture(title="Board", drawing="board", alt="A board under the scanner."),
    Note(title="Said", text="The table was still.", level="info"),
]
SAID = (
    "Reach", "1.250 ± 0.080 mm", "allowed 2.00 mm", "estimated", "tool0_from_laser as fanuc", "−179.900 ± 0.040°",
    "What each shows.", "RMS, mm", "0.012", "7.500", "the sphere was moved", "How it looks as captures.",
    "How it looks as grid.", "A board under the scanner.", "The table was still.", "Captures", "Board",
)  # fmt: skip


def words_of_html(text: str) -> str:
    return " ".join(plain(html.unescape(re.sub(r"<[^>]+>", " ", text))).split())


@pytest.mark.parametrize("said", SAID)
def test_each_kind_of_block_says_the_same_in_each_medium(said):
    wanted = plain(said)
    assert wanted in " ".join(blocks_text(EVERY_KIND).split())
    assert wanted in words_of_html(blocks_html(EVERY_KIND))


def test_blocks_survive_json_and_keep_their_kind():
    data = [json.loads(json.dumps(block.to_json())) for block in EVERY_KIND]
    assert BLOCKS.validate_python(data) == EVERY_KIND
    assert {block["kind"] for block in data} == {"figure", "frame", "table", "plot", "picture", "note"}


@pytest.mark.parametrize(
    "block",
    [
        {"kind": "poem", "text": "x"},
        {"kind": "note"},
        {"kind": "table", "columns": [{"label": "a"}], "rows": [{"cells": [1, 2]}]},
        {"kind": "figure", "label": "x", "quantity": {"value": float("nan")}},
        {
            "kind": "plot", "shape": "xy", "caption": "", "x": {"label": ""}, "y": {"label": ""},
            "series": [{"y": [1, 2], "captures": ["p01"]}],
        },
    ],
)  # fmt: skip
def test_blocks_that_are_none_are_refused(block):
    with pytest.raises(ValidationError):
        BLOCKS.validate_python([block])


def assert_same_everywhere(session: Any, result: dict[str, Any]) -> None:
    """Hold every number and sentence of a result's evidence against terminal and HTML."""
    blocks = stored_evidence(session, result)
    assert blocks
    assert blocks == stored_evidence(session, {**result, "evidence": []})  # as 0.1.0 stored it
    text = " ".join(result_text(title_of(result["stage"]), result, blocks).split())
    detailed = " ".join(blocks_text(blocks, detail=True).split())
    page = words_of_html(result_html(result, blocks))
    said = [*result["warnings"], *result["notes"]]
    for block in blocks:
        said += [said_by for said_by in (block.title,) if said_by]
        match block:
            case Figure(quantity=Quantity() as shown):
                said += [block.label, quantity_text(shown)]
            case Figure() | Note():
                said.append(block.text or "")
            case Frame():
                said += [quantity_text(number.quantity) for number in block.numbers]
            case Table():
                said += [quantity_text(c) for row in block.rows for c in row.cells if isinstance(c, Quantity)]
                said += [block.caption, *(c for row in block.rows for c in row.cells if isinstance(c, str))]
            case Plot():
                said.append(block.caption)
                assert not block.title or html.escape(block.title) in plot_svg(block)
            case _:
                pass
    for sentence in said:
        wanted = " ".join(plain(sentence).split())
        assert wanted in page, sentence
        assert wanted in text or wanted in detailed, sentence


def test_the_tcp_reads_the_same_everywhere(solved_folder):
    session, results = load_session(solved_folder)[0], stored_results(solved_folder)
    assert_same_everywhere(session, results["tcp"])


@pytest.mark.parametrize("stage", ["turntable", "chain"])
def test_table_and_chain_read_the_same_everywhere(turntable_results, stage):
    session, results = turntable_results
    assert_same_everywhere(session, results[stage])


def test_the_headline_is_the_uncertainty_at_the_workpiece(turntable_results):
    session, results = turntable_results
    first = stored_evidence(session, results["chain"])[0]
    assert isinstance(first, Figure)
    assert first.headline
    assert first.label == "At the workpiece"


@pytest.mark.parametrize("stage", ["tcp", "turntable", "chain"])
def test_what_failed_states_no_uncertainty_of_its_frames(turntable_results, stage):
    session, results = turntable_results
    blocks = stored_evidence(session, {**results[stage], "verdict": "fail", "evidence": []})
    end = next(k for k, block in enumerate(blocks) if block.title)
    assert not [block.label for block in blocks[:end] if isinstance(block, Figure) and block.quantity]
    frames = [block for block in blocks if isinstance(block, Frame)]
    assert frames
    assert all(frame.covariance is None for frame in frames)
    assert not any(number.quantity.uncertainty for frame in frames for number in frame.numbers)
    if stage != "turntable":
        assert not any(
            "uncertainty" in str(block.to_json()) for block in blocks if "two steps" in (block.title or "")
        )
        assert not {"scanner", "drift"} & {block.id for block in blocks}


def test_a_verification_reads_the_same_everywhere(solved_folder):
    seen = {"capture": "v01", "used": True, "center_distance_mm": 0.05, "mahalanobis": 1.2}
    result = {
        "stage": "verify", "method": "m", "software": "s", "inputs_sha256": "0" * 64, "verdict": "pass",
        "warnings": [], "notes": ["The arm came to rest."], "verified": "tcp", "tool0_from_laser": IDENTITY,
        "sphere_center_in_base_mm": [1.0, 2.0, 3.0], "sphere_center_covariance": [[1.0] * 3] * 3,
        "surface_rms_mm": 0.02, "held_out_scatter_rms_mm": 0.061, "expected_scatter_rms_mm": 0.055,
        "chi_squared": 21.5, "degrees_of_freedom": 27, "chance": 0.76,
        "residuals": [seen, {"capture": "v02", "used": False, "reason": "the sphere was not in view"}],
    }  # fmt: skip
    assert_same_everywhere(load_session(solved_folder)[0], result)


def test_words_are_no_difference_to_a_replay(solved_folder):
    stored = stored_results(solved_folder)["tcp"]
    retold = {**stored, "evidence": [], "notes": ["told"], "warnings": ["told otherwise"]}
    assert compare(stored, retold).equal


@pytest.mark.parametrize(
    ("value", "sigma", "shown"),
    [
        (140.3217, 0.0406, "140.322 ± 0.081"),
        (140.3217, 0.63, "140.3 ± 1.3"),
        (-0.6701234, 0.0008, "−0.6701 ± 0.0016"),
        (-0.000123, 0.00000225, "−0.0001230 ± 0.0000045"),
        (1234.5, 125.0, "1234 ± 250"),
        (None, 0.04, "± 0.080"),
        (1.5, None, "1.50"),
        (0.0432, None, "0.0432"),
        (1.5, float("nan"), "1.50"),
        (float("inf"), None, "–"),
        (12345.6, None, "12\u202f346"),
        (1.23456, 0.03, "1.235 ± 0.060"),
    ],
)
def test_digits_follow_the_uncertainty(value, sigma, shown):
    assert quantity_text(quantity(value, "", sigma)) == shown


@pytest.mark.parametrize(
    ("limit", "value", "sigma", "shown"),
    [
        (0.8, 1.004, 0.01, "0.800"),
        (0.8, 1.0, 0.2, "0.80"),
        (0.125, 1.0, 0.2, "0.125"),
        (50, 2.1, None, "50.00"),
    ],
)
def test_a_limit_has_the_digits_of_what_it_is_held_against(limit, value, sigma, shown):
    assert quantity_text(limit_of(limit, quantity(value, "", sigma))) == shown


def test_no_number_is_minus_zero():
    assert (number_text(-0.0001, 3), number_text(0.0, 1), number_text(-0.0006, 3)) == ("0.000", "0.0", "−0.001")


def test_captures_are_named_as_runs():
    order = [f"f{k:02d}" for k in range(1, 31)]
    assert captures_text(order[12:24], order) == "f13–f24"
    assert captures_text(["f07", "f03", "f09"], order) == "f03, f07 and f09"
    assert captures_text(["f03", "f04"], order) == "f03 and f04"
    assert captures_text(["x"]) == "x"
    assert catalogue("de").say(captures_text(["f07", "f03", "f09"], order)) == "f03, f07 und f09"
    assert captures_text(order[::2], order).endswith("f23 and 3 more")


def test_captures_that_fail_for_one_need_are_one_finding():
    failed = {f"f{k:02d}": MeasurementError("20 points", f"{k}", "Move closer.") for k in range(13, 25)}
    (few, other) = not_measured({**failed, "f02": MeasurementError("a frame", "a black frame", "Light it.")})
    assert (few.captures, other.captures) == (list(failed), ["f02"])
    assert "f13–f24 are not used: need 20 points, got 13 (so in f13; the others alike)." in few.text


def plot_of(rows: list[TcpResidual]) -> Plot:
    (plot,) = residual_plot(rows)
    assert isinstance(plot, Plot)
    return plot


def test_the_plot_has_one_dot_a_capture_at_its_height_and_crosses_the_rejected():
    values = {"p01": 0.0, "p02": BAND, "p03": 1.4}
    rows = [TcpResidual(capture=name, used=True, mahalanobis=value) for name, value in values.items()]
    rows += [TcpResidual(capture="p04", used=False, mahalanobis=700.0), TcpResidual(capture="p05", used=False)]
    root = ET.fromstring(plot_svg(plot_of(rows)))
    heights = {str(c.findtext("title")).split(":")[0]: float(c.attrib["cy"]) for c in root.iter("circle")}
    band = next(e for e in root.iter("rect") if e.attrib["class"] == "band").attrib
    assert heights["p02"] == pytest.approx(float(band["y"]), abs=0.11)
    assert heights["p01"] == pytest.approx(float(band["y"]) + float(band["height"]), abs=0.11)
    between = heights["p01"] + (heights["p02"] - heights["p01"]) * 1.4 / BAND
    assert heights["p03"] == pytest.approx(between, abs=0.11)
    (cross,) = [e for e in root.iter("path") if e.attrib["class"] == "rejected"]
    assert float(cross.attrib["d"].split()[1].split("l")[0]) + 5 == pytest.approx(14, abs=0.1)  # the upper edge


def test_the_plot_of_many_captures_stays_legible():
    rows = [TcpResidual(capture=f"capture-{k:04d}", used=True, mahalanobis=1.0) for k in range(500)]
    root = ET.fromstring(plot_svg(plot_of(rows)))
    assert len(list(root.iter("circle"))) == 500
    assert len([t for t in root.iter("text") if (t.text or "").startswith("capture-")]) <= 42
    assert residual_plot([TcpResidual(capture="p01", used=False)]) == []


def test_a_section_is_drawn_to_one_scale():
    axis = Axis(label="what", unit="mm")
    outline = Series(x=[0.0, 40.0, 40.0, 10.0, 10.0], y=[0.0, 0.0, None, 0.0, 90.0])
    plot = Plot(shape="section", caption="how", x=axis, y=axis, series=[outline, Series(x=[20.0], y=[30.0])])
    drawn, dots = (path.attrib["d"] for path in ET.fromstring(plot_svg(plot)).iter("path"))
    places = np.array([list(map(float, place.split())) for place in re.findall(r"[\d.]+ [\d.]+", drawn)])
    assert drawn.count("M") == 2
    per_mm = (places[1] - places[0])[0] / 40.0
    assert places[2] - places[3] == pytest.approx([0.0, 90.0 * per_mm], abs=0.2)
    assert float(dots[1:].split()[0]) == pytest.approx(places[0][0] + 20 * per_mm, abs=0.2)


def test_a_map_over_the_image_has_square_cells_with_their_numbers_and_none_where_nothing_is_known() -> None:
    axis = Axis(label="Distance", unit="px")
    rows = [Series(y=[0.07, 0.0512, None]), Series(y=[0.01, 0.0, 0.02])]
    drawn = plot_svg(Plot(title="Map", shape="grid", caption="", x=axis, y=axis, series=rows))
    assert re.findall(r">([^<>]+)</text>", drawn) == ["0.070", "0.051", "0.010", "0.000", "0.020"]
    sides = set(re.findall(r'<rect [^>]*width="([\d.]+)" height="([\d.]+)"', drawn))
    assert [width == height for width, height in sides] == [True]


@pytest.mark.parametrize("values", [[0.0], [1e-12, 2e-12], [-5.0, 3.0], [1e9, 1e9], [4.0, 4.0, 4.0]])
@pytest.mark.parametrize("shape", ["captures", "line", "xy", "histogram", "grid"])
def test_a_plot_of_any_numbers_is_drawn_within_its_frame(values, shape):
    axis = Axis(label="what")
    plot = Plot(shape=shape, caption="how", x=axis, y=axis, series=[Series(y=values)])
    root = ET.fromstring(plot_svg(plot))
    assert root.find("title") is not None
    assert root.findtext("desc") == "how"
    for mark in root.iter("circle"):
        assert 0 <= float(mark.attrib["cx"]) <= 760
        assert 0 <= float(mark.attrib["cy"]) <= 240


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0750, "0.075"), (0.0432, "0.043"), (0.1251, "0.125"), (43.3, "43")]
)
def test_a_root_mean_square_shows_what_it_is_known_to(value: float, shown: str) -> None:
    assert quantity_text(rms(value, "mm")) == f"{shown}\u202fmm"


def test_the_dots_of_captures_fill_the_width_of_their_plot() -> None:
    rows = [TcpResidual(capture=f"p{k}", used=True, mahalanobis=1.0) for k in range(8)]
    root = ET.fromstring(plot_svg(plot_of(rows)))
    width = float(root.attrib["viewBox"].split()[2])
    places = sorted(float(c.attrib["cx"]) for c in root.iter("circle"))
    assert places[0] < 0.2 * width < 0.8 * width < places[-1] < width
    assert np.diff(places) == pytest.approx(np.full(7, places[1] - places[0]), abs=0.3)


def test_how_well_the_nominal_lies_is_said_with_its_place_and_its_turn() -> None:
    from calib_core.stages.merge.evidence import _laid
    from calib_core.stages.merge.record import Alignment

    lies = [[float(k == j) for j in range(4)] for k in range(4)]
    covariance = np.diag([1e-6, 4e-6, 4e-6, 0.0004, 0.0004, 0.0001]).tolist()
    laid = Alignment(
        method="best-fit", rms_mm=0.05, base_from_reference=lies, cloud_from_reference=lies, covariance=covariance,
        reference_sha256="0" * 64,
    )  # fmt: skip
    said = {str(one.label): one.quantity for one in _laid(laid, True) if isinstance(one, Figure) and one.quantity}
    place, turn = (next(q for label, q in said.items() if word in label) for word in ("Place", "Turn"))
    assert (place.uncertainty, place.unit) == (pytest.approx(2 * 0.03), "mm")
    assert (turn.uncertainty, turn.unit) == (pytest.approx(2 * np.rad2deg(0.003)), "°")
    assert len(_laid(laid, False)) == 2


def test_lines_of_a_terminal_break_between_chinese_characters_and_keep_numbers_with_their_signs() -> None:
    text = "仅由本标定造成的点位偏差（k = 2）：扫描仪沿其各轴，其余沿转台各轴。色带包含 95 % 的合格采集。"
    lines = blocks_text([Note(level="info", text=text * 3)], said=catalogue("zh")).splitlines()
    columns = [sum(2 if east_asian_width(one) in "WF" else 1 for one in line) for line in lines]
    assert max(columns) <= 100
    assert min(columns[:-1]) > 94, "a line is filled before the next one begins"
    assert not [line for line in lines if line.strip()[0] in "）：，。；%="]
    assert "".join(line.strip() for line in lines).count("k = 2") == 3


def test_german_has_decimal_commas_where_nothing_is_typed_in() -> None:
    said = catalogue("de")
    frame = Frame(
        name="tool0_from_laser",
        into="tool0",
        outof="laser",
        convention="abb",
        numbers=[FrameNumber(label="x", quantity=quantity(36.26, "mm", 0.13))],
        matrix=np.eye(4).tolist(),
    )
    columns = [Column(label="Name", own=True, align="left"), Column(label="Radius", unit="mm", decimals=3)]
    table = Table(caption="± bei k = 2, 0.25 mm", columns=columns, rows=[Row(cells=["1.5", 90.025])])
    place = Figure(label="Ort", text="(981.98, −306.21, 340.50) mm")
    blocks = [place, frame, table, Note(level="info", text="scancell 0.1.0 liest „1.5“ und 0.12 bis 0.5 mm.")]
    for words in (blocks_text(blocks, said=said), html.unescape(blocks_html(blocks, said))):
        assert "(981,98; " in words, words
        assert "90,025" in words
        assert "0,25" in words
        assert "scancell 0.1.0 liest „1.5“ und 0,12 bis 0,5" in words
        assert "36.26 ± 0.26" in words
        assert "1.5" in words.replace("„1.5“", ""), "a name of somebody's own keeps its point"
    assert "36,26" not in blocks_text(blocks, said=catalogue("zh")) + blocks_html(blocks)


def test_the_noise_is_told_by_its_standard_deviations_alone_in_degrees() -> None:
    told = {"point_sigma_mm": 0.02, "position_sigma_mm": 0.05, "orientation_sigma_rad": 2e-4}
    parts = VarianceComponents(**told, orientation_sigma_deg=0.0, reach_mm=90.0, reach_rad=0.2)
    assert _in_degrees(parts) == {
        "point_sigma_mm": 0.02, "position_sigma_mm": 0.05, "orientation_sigma_deg": np.rad2deg(2e-4)
    }  # fmt: skip
