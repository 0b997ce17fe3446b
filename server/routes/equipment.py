"""The register of equipment: spheres, bars, plates, scanners, robots, tables with their certificates."""

from typing import Annotated, Any

from fastapi import File, Path, Response, UploadFile
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import TooLargeError
from calib_core.records.policy import Equipment
from calib_core.records.strict_fields import require_known_fields
from server.http.api_router import API, api_router
from server.http.created import created
from server.http.openapi import BYTES
from server.routes.dependencies import IdempotencyDep, StoreDep
from server.store.equipment import (
    add_equipment,
    certificate_of,
    change_equipment,
    equipment_data,
    equipment_row,
    list_equipment,
    remove_equipment,
)
from server.store.models import Data

router = api_router("equipment", f"{API}/equipment")

_LARGEST_BYTES = 20_000_000
_EXAMPLE: Data = {
    "kind": "sphere",
    "name": "K80-1",
    "serial": "S-4711",
    "certificate": {
        "number": "K-123",
        "laboratory": "Example Laboratory",
        "issued": "2026-03-01",
        "due": "2028-03-01",
    },
}
PieceId = Annotated[str, Path(description="A piece's `id`.", max_length=64, examples=["5f1c0a92e6b37d58"])]


class EquipmentRequest(Equipment):
    """A piece of equipment by its identification, with its certificate."""

    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})


class RegisteredEquipment(Equipment):
    """A piece in the register.

    `overdue`: its certificate was due before today; `altered`: it is not as this server signed it.
    """

    id: str
    created: str
    updated: str
    overdue: bool
    altered: bool


class EquipmentList(BaseModel):
    """All pieces, by kind."""

    items: list[RegisteredEquipment]


@router.get("", response_model=EquipmentList, response_model_exclude_unset=True)
def list_all(store: StoreDep) -> Response:
    """List the register of equipment."""
    with store.read() as db:
        return JSONResponse({"items": list_equipment(db)})


@router.post("", status_code=201, response_model=RegisteredEquipment)
def add(body: EquipmentRequest, idempotency: IdempotencyDep, store: StoreDep) -> Response:
    """Enter a piece of equipment; a session refers to it by `register_id` in `cell.equipment`."""
    require_known_fields(body, "request")

    def act(db: Transaction) -> Data:
        return equipment_data(add_equipment(db, body.to_json()))

    return created(idempotency.run(store, body.to_json(), 201, act)[0], "/api/v1/equipment/{id}")


@router.get("/{piece}", response_model=RegisteredEquipment)
def get(piece: PieceId, store: StoreDep) -> Response:
    """Return a piece of equipment."""
    with store.read() as db:
        return JSONResponse(equipment_data(equipment_row(db, piece)))


@router.put("/{piece}", response_model=RegisteredEquipment)
def change(piece: PieceId, body: EquipmentRequest, store: StoreDep) -> Response:
    """Replace what the register says of a piece; sessions keep what it said when they were stored."""
    require_known_fields(body, "request")
    with store.write() as db:
        row = equipment_row(db, piece)
        change_equipment(db, row, body.to_json())
        return JSONResponse(equipment_data(row))


@router.delete("/{piece}", status_code=204)
def remove(piece: PieceId, store: StoreDep) -> None:
    """Remove a piece from the register; sessions keep what it said."""
    with store.write() as db:
        remove_equipment(db, equipment_row(db, piece))


@router.put("/{piece}/certificate", response_model=RegisteredEquipment)
def set_certificate(
    piece: PieceId,
    store: StoreDep,
    file: Annotated[
        UploadFile,
        File(description="The certificate: a DCC's XML is read, anything else kept.", examples=["%PDF-1.7 …"]),
    ],
) -> Response:
    """Keep the file of a piece's certificate; number, laboratory and date are taken from a digital one (DCC)."""
    content = file.file.read(_LARGEST_BYTES + 1)
    if len(content) > _LARGEST_BYTES:
        need = "a file of at most {limit_mb:g} MB"
        raise TooLargeError(need, "more", "Give the certificate alone.", "file", limit_mb=_LARGEST_BYTES / 1e6)
    name = (file.filename or "certificate").replace("\\", "/").rpartition("/")[2][:200]
    with store.write() as db:
        row = equipment_row(db, piece)
        known: dict[str, Any] = row.record.get("certificate") or {}
        record = {**_read(content), **row.record, "certificate": {**known, **_certificate(content), "file": name}}
        row.certificate_file = content
        change_equipment(db, row, record)
        return JSONResponse(equipment_data(row))


def _told(content: bytes) -> Data:
    """Return what a digital certificate says of its item, nothing of other files."""
    from calib_core.captures.certificate import read_certificate

    if not content.lstrip().startswith(b"<"):
        return {}
    return read_certificate(content, of_sphere=False).equipment.to_json()


def _read(content: bytes) -> Data:
    return {name: value for name, value in _told(content).items() if name not in ("kind", "certificate") and value}


def _certificate(content: bytes) -> Data:
    return {name: value for name, value in (_told(content).get("certificate") or {}).items() if value}


@router.get(
    "/{piece}/certificate",
    response_class=Response,
    responses={200: {"description": "The file.", "content": {"application/octet-stream": {"schema": BYTES}}}},
)
def get_certificate(piece: PieceId, store: StoreDep) -> Response:
    """Return the file of a piece's certificate as it came."""
    with store.read() as db:
        content = certificate_of(equipment_row(db, piece))
    headers = {"Content-Disposition": "attachment", "X-Content-Type-Options": "nosniff"}
    return Response(content, media_type="application/octet-stream", headers=headers)
