"""What to do next and what it is worth: budget at the part, planned poses, a cell before it stands, its board."""

from typing import Annotated, Any, Literal

from fastapi import Query, Response
from pydantic import Field

from calib_core.errors import InputError
from calib_core.guidance.cell_plan import CellPlan, CellToPlan
from calib_core.guidance.part_budget import BudgetAtPart
from calib_core.guidance.pose_list import PoseList
from calib_core.records import Board
from calib_core.records.base import PlannedStep
from calib_core.records.described import DescribedCell
from calib_core.records.strict_fields import require_known_fields
from calib_core.stages.recheck.guide import RecheckPlan
from server.http.api_router import api_router
from server.http.openapi import BYTES
from server.page_questions import cell_plan, planned
from server.routes.dependencies import LoadedSession, PageProcessDep, SessionId, StoreDep
from server.store.session_texts import load_texts
from server.store.sessions import load_session

router = api_router("guidance")

_FILE: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The program's file, named as the controller takes it.",
        "content": {"application/octet-stream": {"schema": BYTES}},
    }
}

Millimetres = Annotated[float | None, Query(ge=-1e5, le=1e5, allow_inf_nan=False, examples=[25.0])]


class PlannedCell(CellToPlan):
    """A cell that does not stand yet, as `POST /plan` takes it."""

    model_config = {  # noqa: RUF012
        "json_schema_extra": {
            "examples": [{"scanner": {"near_mm": 130, "far_mm": 230, "near_width_mm": 60}, "wanted_mm": 0.2}]
        }
    }
    most_captures: Annotated[int, Field(ge=5, le=40)] = 20


class BoardToPrint(Board):
    """A board as `GET /board` takes it: as `cell.board`, and what it is printed on."""

    paper: Annotated[Literal["A4", "A3", "A2", "A1", "A0"] | None, Field(description="Else the smallest.")] = None
    form: Literal["pdf", "svg"] = "pdf"


@router.get("/sessions/{session_id}/budget", response_model=BudgetAtPart)
def get_budget(
    stored: LoadedSession,
    x_mm: Millimetres = None,
    y_mm: Millimetres = None,
    z_mm: Millimetres = None,
    field: bool = False,
) -> BudgetAtPart:
    """Return the error budget of the answer at a point of the workpiece, in T or without a table in L.

    Left out, the point is the cell's, or where the sphere stood. `field` adds points all over the table.
    """
    from calib_core.guidance.part_budget import budget_at

    given = [x_mm, y_mm, z_mm]
    if any(value is None for value in given) and any(value is not None for value in given):
        raise InputError("x_mm, y_mm and z_mm together, or none", "some", "Give all three.", "x_mm")
    point = None if x_mm is None else [value or 0.0 for value in given]
    return budget_at(stored.session, stored.results_with_stale(), point, field)


@router.get("/sessions/{session_id}/planned", response_model=PoseList)
def get_planned(
    session_id: SessionId,
    store: StoreDep,
    pages: PageProcessDep,
    captures: Annotated[int, Query(ge=1, le=30, examples=[10])] = 10,
    step: PlannedStep = "tcp",
) -> PoseList:
    """Return the poses that together leave least uncertainty at the workpiece, and what each gains.

    Those of `turntable` come with the table's angle and the sphere's height, those of `verify` keep away from the
    calibration's.
    """
    with store.read() as db:
        texts = load_texts(db, session_id)
    return pages.ask(planned, texts, captures, step)


@router.get("/sessions/{session_id}/planned/program", response_class=Response, responses=_FILE)
def get_planned_program(
    session_id: SessionId,
    store: StoreDep,
    pages: PageProcessDep,
    brand: Annotated[str, Query(max_length=40, examples=["kuka"], description="A robot brand.")],
    captures: Annotated[int, Query(ge=1, le=30, examples=[10])] = 10,
    step: PlannedStep = "tcp",
) -> Response:
    """Return a planned set as a program of a brand: by the flange, slowly, each move started by the operator.

    Refused (409) while the tool is not known to ± 10 mm: approaches could touch.
    """
    from calib_core.exports.planned_program import planned_program

    with store.read() as db:
        texts = load_texts(db, session_id)
        stored = load_session(db, store.blobs, session_id)
    program = planned_program(stored.session, pages.ask(planned, texts, captures, step), brand)
    headers = {"Content-Disposition": f'attachment; filename="{program.name}"'}
    headers |= {} if program.proof is None else {"Scancell-Proof": program.proof}
    return Response(program.content, media_type=program.media_type, headers=headers)


@router.get("/sessions/{session_id}/recheck", response_model=RecheckPlan)
def get_recheck(stored: LoadedSession) -> RecheckPlan:
    """Return the three poses to capture again with step `recheck`, the sphere still in its place.

    `POST …/solve/recheck` then says whether the calibration still holds.
    """
    from calib_core.stages.recheck.guide import recheck_plan

    return recheck_plan(stored.session, stored.results)


@router.post("/plan", response_model=CellPlan)
def post_plan(cell: PlannedCell, pages: PageProcessDep) -> CellPlan:
    """Return what a cell will reach before anything is bought: sphere, captures, place. Stores nothing."""
    require_known_fields(cell, "request", DescribedCell.model_fields)
    return pages.ask(cell_plan, CellToPlan.model_validate(cell.model_dump(exclude_unset=True)))


@router.get("/board", response_class=Response, responses=_FILE)
def get_board(told: Annotated[BoardToPrint, Query()]) -> Response:
    """Return a calibration board to print in true scale; measure the print, and tell the pitches as measured."""
    from calib_core.optics.board_print import board_sheet, sheet_pdf, sheet_svg

    board = Board.model_validate(told.model_dump(include=set(Board.model_fields)))
    sheet = board_sheet(board, told.paper)
    content, media_type = (
        (sheet_pdf(sheet), "application/pdf") if told.form == "pdf" else (sheet_svg(sheet), "image/svg+xml")
    )
    headers = {"Content-Disposition": f'attachment; filename="board.{told.form}"'}
    return Response(content, media_type=media_type, headers=headers)
