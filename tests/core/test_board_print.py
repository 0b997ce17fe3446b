"""Boards to print: what is drawn is the told board in true scale, in SVG and in PDF alike."""

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.optics.board import find_board
from calib_core.optics.board_print import BoardSheet, board_sheet, measured_over, sheet_pdf, sheet_svg
from server.cli import main
from tests.wrong_boards import RIGHT

PX_PER_MM = 6.0


@pytest.mark.parametrize("kind", RIGHT)
def test_the_printed_board_is_the_told_one_at_its_told_pitch(kind: str) -> None:
    sheet = board_sheet(RIGHT[kind])
    view = find_board(_picture(sheet), RIGHT[kind])
    onto_image, _ = cv2.findHomography(view.points_in_board_mm[:, :2], view.points_px)
    np.testing.assert_allclose(onto_image[:2, :2], PX_PER_MM * np.eye(2), atol=0.01)


@pytest.mark.parametrize("kind", ["circles", "asymmetric-circles"])
def test_letters_below_a_grid_of_circles_are_no_further_row_of_it(kind: str) -> None:
    sheet = board_sheet(RIGHT[kind])
    rows = sorted({y for _, y, _ in sheet.dots})
    next_to_last = [(x, radius) for x, y, radius in sheet.dots if y == rows[-2]]
    shifted = next_to_last if kind == "asymmetric-circles" else [(x, r) for x, y, r in sheet.dots if y == rows[-1]]
    below = tuple((x, 2 * rows[-1] - rows[-2], radius / 3) for x, radius in shifted)
    picture = _picture(replace(sheet, dots=sheet.dots + below))
    assert len(find_board(picture, RIGHT[kind]).points_px) == len(sheet.dots)


def _picture(sheet: BoardSheet) -> NDArray[np.uint8]:
    """Return a sheet as a scanner that sees it straight on has it."""
    picture = np.full([round(PX_PER_MM * length) for length in sheet.size_mm[::-1]], 235, np.uint8)
    for left, top, width, height in sheet.rectangles:
        corners = np.rint(PX_PER_MM * np.array([top, top + height, left, left + width])).astype(int)
        picture[corners[0] : corners[1], corners[2] : corners[3]] = 20
    for x, y, radius in sheet.dots:
        cv2.circle(picture, (round(PX_PER_MM * x), round(PX_PER_MM * y)), round(PX_PER_MM * radius), 20, -1)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.2), dtype=np.uint8)


def test_svg_and_pdf_draw_the_same_rectangles_on_the_same_sheet() -> None:
    sheet = board_sheet(RIGHT["charuco"], "A3")
    svg, pdf = sheet_svg(sheet).decode(), sheet_pdf(sheet).decode("latin-1")
    assert 'width="297mm" height="420mm"' in svg
    width, height = map(float, re.findall(r"MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)[0])
    assert (width, height) == pytest.approx((297 * 72 / 25.4, 420 * 72 / 25.4), abs=1e-3)
    drawn = [
        tuple(map(float, found)) for found in re.findall(r"^([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re f$", pdf, re.M)
    ]
    told = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"', svg)
    assert drawn == [tuple(map(float, found)) for found in told]
    assert len(drawn) == len(sheet.rectangles)
    assert "/PrintScaling /None" in pdf
    # The table of contents of a PDF holds where each object begins.
    places = [int(place) for place in re.findall(r"^(\d{10}) 00000 n ", pdf, re.M)]
    assert [pdf[place:].startswith(f"{k} 0 obj") for k, place in enumerate(places, 1)] == [True] * 4


def test_a_sheet_that_is_too_small_and_a_dictionary_of_too_few_markers_are_refused() -> None:
    with pytest.raises(InputError, match="a sheet of at least"):
        board_sheet(RIGHT["chessboard"].model_copy(update={"pitch_mm": 40.0}), "A4")
    with pytest.raises(InputError, match="markers that are smaller than their squares"):
        board_sheet(RIGHT["charuco"].model_copy(update={"marker_mm": RIGHT["charuco"].pitch_mm}))
    with pytest.raises(InputError, match="a dictionary of at least"):
        board_sheet(RIGHT["charuco"].model_copy(update={"columns": 15, "rows": 9, "dictionary": "DICT_4X4_50"}))


def test_what_is_to_be_measured_is_told_by_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "board.pdf"
    assert main(["board", str(out), "--kind", "charuco", "--columns", "8", "--rows", "6", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert out.read_bytes().startswith(b"%PDF")
    assert found["measure"] == {"pitches_along_row": 6, "pitches_along_column": 4}
    assert found["board"]["dictionary"] == "DICT_5X5_100"
    assert measured_over(RIGHT["asymmetric-circles"]) == (6, 10)
    assert main(["board", str(tmp_path / "board.png")]) == 2
