"""`scancell board`: a calibration board to print in true scale."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from server.console.command import OK, Command
from server.console.output import print_result

if TYPE_CHECKING:
    from calib_core.records import Board


def _arguments(parser: argparse.ArgumentParser) -> None:
    from calib_core.optics.board_print import PAPERS_MM
    from calib_core.records import Board

    kinds = get_args(Board.model_fields["kind"].annotation)
    parser.add_argument("out", type=Path, metavar="FILE", help="what to write: a name that ends in .pdf or .svg")
    parser.add_argument("--session", type=Path, metavar="SESSION", help="take cell.board of this session")
    parser.add_argument(
        "--kind", choices=kinds, default="chessboard", help="what is printed (default: chessboard)"
    )
    parser.add_argument(
        "--columns", type=int, default=9, help="inner corners, circles, or squares of ChArUco (default: 9)"
    )
    parser.add_argument("--rows", type=int, default=6, help="of them (default: 6)")
    parser.add_argument(
        "--pitch-mm", type=float, default=20.0, metavar="MM", help="from one to the next (default: 20)"
    )
    parser.add_argument(
        "--marker-mm", type=float, metavar="MM", help="a ChArUco marker's side (default: 0.7 of the pitch)"
    )
    parser.add_argument("--dictionary", metavar="NAME", help="of the markers (default: DICT_5X5_100)")
    parser.add_argument(
        "--paper", choices=PAPERS_MM, help="the sheet (default: the smallest that holds the board)"
    )


def _run(options: argparse.Namespace) -> int:
    """Write the board and say how to measure what was printed."""
    from calib_core.errors import InputError
    from calib_core.formats.shared.writing import write_pieces
    from calib_core.messages import message
    from calib_core.optics.board_print import board_sheet, measured_over, sheet_pdf, sheet_svg

    board = _board(options)
    writers = {".pdf": sheet_pdf, ".svg": sheet_svg}
    if options.out.suffix.lower() not in writers:
        to_do = "Name the file so."
        raise InputError("a file name that ends in .pdf or .svg", str(options.out), to_do, str(options.out))
    sheet = board_sheet(board, options.paper)
    write_pieces(options.out, [writers[options.out.suffix.lower()](sheet)])
    along_row, along_column = measured_over(board)
    told = board.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    width, height = sheet.size_mm
    lines = [
        message(
            "{file}: {width_mm:g} × {height_mm:g} mm. Print it at 100 %, not fitted to the page, and glue it "
            "flat.",
            file=str(options.out),
            width_mm=width,
            height_mm=height,
        ),
        message(
            "Then measure it: {along_row} pitches along a row are {row_mm:g} mm, {along_column} along a column "
            "{column_mm:g} mm.",
            along_row=along_row,
            row_mm=along_row * board.pitches_mm[0],
            along_column=along_column,
            column_mm=along_column * board.pitches_mm[1],
        ),
        message("Tell what you measure as pitch_mm and pitch_y_mm of cell.board, and how well as pitch_sigma_mm:"),
        f"  {json.dumps(told)}",
    ]
    measure = {"pitches_along_row": along_row, "pitches_along_column": along_column}
    print_result(options, "\n".join(lines), {"board": told, "paper_mm": [width, height], "measure": measure})
    return OK


def _board(options: argparse.Namespace) -> "Board":
    """Return the board that is told by a session, or by the options."""
    from calib_core.captures.boards import board_of
    from calib_core.records import Board
    from calib_core.records.parsing import parsed_record

    if options.session is not None:
        from calib_core.archive.archive import opened
        from calib_core.archive.folder import load_session

        with opened(options.session) as folder:
            session, _ = load_session(folder)
            return board_of(session.cell)
    told = {name: getattr(options, name) for name in ("kind", "columns", "rows", "pitch_mm")}
    if options.kind == "charuco":
        told["marker_mm"] = options.marker_mm or 0.7 * options.pitch_mm
        told["dictionary"] = options.dictionary or "DICT_5X5_100"
    return parsed_record(Board, told, "cell.board")


COMMAND = Command("board", "a calibration board to print in true scale", "files", _arguments, _run)
