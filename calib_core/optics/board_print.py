"""A calibration board to print in true scale, as SVG or PDF: what is black on it, and lines to measure it by."""

import json
from dataclasses import dataclass
from html import escape
from itertools import product
from math import ceil
from typing import Final

import numpy as np

from calib_core.errors import InputError
from calib_core.optics.board_charuco import markers_of
from calib_core.records import Board

PAPERS_MM: Final = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
"""Width and height of sheets."""
_MARGIN_MM, _TEXT_MM = 12.0, 3.0
_DOT: Final = {"circles": 0.3, "asymmetric-circles": 0.45}  # radius over pitch
_POINTS_PER_MM = 72 / 25.4
_ARC = 0.5522847498  # where a quarter circle's Bézier points stand


@dataclass(frozen=True)
class BoardSheet:
    """A board on a sheet of paper; all in mm, from the sheet's upper left corner.

    Attributes
    ----------
    size_mm : (width, height)
    rectangles : tuple of (left, top, width, height)
    dots : tuple of (x, y, radius)
    words : tuple of (x, y, text)
    """

    size_mm: tuple[float, float]
    rectangles: tuple[tuple[float, float, float, float], ...]
    dots: tuple[tuple[float, float, float], ...]
    words: tuple[tuple[float, float, str], ...]


def board_sheet(board: Board, paper: str | None = None) -> BoardSheet:
    """Return a board on a sheet, upright or lying: a named one, else the smallest that holds it.

    Raises
    ------
    InputError
        If the sheet is too small, or a ChArUco board lacks its markers' size or dictionary.
    """
    rectangles, dots, (width, height) = _pattern(board)
    room = width + 2 * _MARGIN_MM, height + 2 * _MARGIN_MM + 4 * _TEXT_MM
    named = [size for name, size in PAPERS_MM.items() if paper in (None, name)]
    sheets = [sheet for width_mm, height_mm in named for sheet in ((width_mm, height_mm), (height_mm, width_mm))]
    fitting = [size for size in sheets if size[0] >= room[0] and size[1] >= room[1]]
    if not fitting:
        need = "a sheet of at least {width:.0f} × {height:.0f} mm"
        to_do = "Take a larger sheet, fewer columns and rows, or a smaller pitch."
        raise InputError(need, "{paper}", to_do, "cell.board", width=room[0], height=room[1], paper=paper or "A0")
    size = fitting[0]
    left, top = (size[0] - width) / 2, (size[1] - height - 4 * _TEXT_MM) / 2
    below = top + height + 2 * _TEXT_MM
    length = 10.0 * max(int(min(width, 200.0) // 10), 1)
    scale = [
        (left, below, length, 0.3),
        (left, below - 1.5, 0.3, 3.3),
        (left + length - 0.3, below - 1.5, 0.3, 3.3),
    ]
    told = json.dumps(board.model_dump(mode="json", exclude_none=True, exclude_defaults=True))
    return BoardSheet(
        size,
        tuple((x + left, y + top, w, h) for x, y, w, h in rectangles) + tuple(scale),
        tuple((x + left, y + top, radius) for x, y, radius in dots),
        ((left, below + 2 * _TEXT_MM, f"|-| {length:g} mm   scancell {told}"),),
    )


def sheet_svg(sheet: BoardSheet) -> bytes:
    """Return a sheet as SVG, its units millimetres."""
    width, height = sheet.size_mm
    shapes = [
        f'<rect x="{x:.4f}" y="{y:.4f}" width="{w:.4f}" height="{h:.4f}"/>' for x, y, w, h in sheet.rectangles
    ]
    shapes += [f'<circle cx="{x:.4f}" cy="{y:.4f}" r="{radius:.4f}"/>' for x, y, radius in sheet.dots]
    font = f'font-family="Helvetica, Arial, sans-serif" font-size="{_TEXT_MM}"'
    shapes += [f'<text x="{x:.2f}" y="{y:.2f}" {font}>{escape(text)}</text>' for x, y, text in sheet.words]
    size = f'width="{width:g}mm" height="{height:g}mm" viewBox="0 0 {width:g} {height:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    return "\n".join([head, *shapes, "</svg>", ""]).encode()


def sheet_pdf(sheet: BoardSheet) -> bytes:
    """Return a sheet as PDF of one page, which asks viewers not to scale it."""
    width, height = (_POINTS_PER_MM * length for length in sheet.size_mm)
    drawn = [f"{_POINTS_PER_MM:.8f} 0 0 {-_POINTS_PER_MM:.8f} 0 {height:.4f} cm"]
    drawn += [f"{x:.4f} {y:.4f} {w:.4f} {h:.4f} re f" for x, y, w, h in sheet.rectangles]
    drawn += [_dot(*dot) for dot in sheet.dots]
    for x, y, text in sheet.words:
        safe = text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
        drawn.append(f"BT /F1 {_TEXT_MM} Tf 1 0 0 -1 {x:.2f} {y:.2f} Tm ({safe}) Tj ET")
    content = "\n".join(drawn).encode("latin-1", "replace")
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Contents 4 0 R "
        "/Resources << /Font << /F1 << /Type /Font /Subtype /Type1 /BaseFont /Helvetica >> >> >> >>".encode(),
        b"<< /Length %d >>\nstream\n%b\nendstream" % (len(content), content),
    ]
    whole, places = b"%PDF-1.4\n", list[int]()
    for number, body in enumerate(objects, start=1):
        places.append(len(whole))
        whole += b"%d 0 obj\n%b\nendobj\n" % (number, body)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    count = len(objects) + 1
    end = b"xref\n0 %d\n0000000000 65535 f \n%btrailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n"
    return whole + end % (count, table, count, len(whole))


def _dot(x: float, y: float, radius: float) -> str:
    arc, path = _ARC * radius, [f"{x + radius:.4f} {y:.4f} m"]
    for cos, sin in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        first = x + radius * cos - arc * sin, y + radius * sin + arc * cos
        second = x - radius * sin + arc * cos, y + radius * cos + arc * sin
        end = x - radius * sin, y + radius * cos
        path.append(" ".join(f"{value:.4f}" for value in (*first, *second, *end)) + " c")
    return " ".join(path) + " f"


def _pattern(board: Board) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]], tuple[float, float]]:
    """Return a board's black rectangles and dots, and its size, mm."""
    across, down = board.pitches_mm
    if board.kind in _DOT:
        from calib_core.optics.board import points_in_board_mm

        radius = _DOT[board.kind] * min(board.pitches_mm)
        places = points_in_board_mm(board)[:, :2] + radius
        dots = [(*place, radius) for place in places.tolist()]
        width, height = (places.max(axis=0) + radius).tolist()
        return [], dots, (width, height)
    is_plain = board.kind == "chessboard"
    columns, rows = board.columns + is_plain, board.rows + is_plain
    squares = product(range(columns), range(rows))
    black = [(c * across, r * down, across, down) for c, r in squares if (c + r) % 2 == 0]
    return black + ([] if is_plain else _markers(board)), [], (columns * across, rows * down)


def _markers(board: Board) -> list[tuple[float, ...]]:
    """Return the black runs of a ChArUco board's markers: the white squares are numbered row by row."""
    import cv2

    marker_mm, words = markers_of(board)
    white = [(c, r) for r in range(board.rows) for c in range(board.columns) if (c + r) % 2]
    if len(white) > len(words.bytesList):
        need = "a dictionary of at least {count} markers"
        to_do = "Name a larger one, or take fewer columns and rows."
        raise InputError(need, "{dictionary}", to_do, "cell.board", count=len(white), dictionary=board.dictionary)
    cells = int(words.markerSize) + 2
    cell_mm = marker_mm / cells
    found: list[tuple[float, ...]] = []
    for number, (column, row) in enumerate(white):
        left, top = (
            (k + 0.5) * pitch - marker_mm / 2 for k, pitch in zip((column, row), board.pitches_mm, strict=True)
        )
        dark = np.asarray(cv2.aruco.generateImageMarker(words, number, cells)) == 0
        for line, along in enumerate(dark):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], along, [0]]).astype(int)))
            for first, last in edges.reshape(-1, 2).tolist():
                found.append((left + first * cell_mm, top + line * cell_mm, (last - first) * cell_mm, cell_mm))
    return found


def measured_over(board: Board) -> tuple[int, int]:
    """Return over how many pitches along a row, and along a column, a printed board is measured."""
    columns, rows = board.columns - (board.kind == "charuco"), board.rows - (board.kind == "charuco")
    along_row = columns - 1 if board.kind != "asymmetric-circles" else 2 * (columns - 1)
    return max(along_row, 1), max(2 * ceil((rows - 2) / 2) if board.kind == "asymmetric-circles" else rows - 1, 1)
